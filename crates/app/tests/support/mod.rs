//! What the tests of the program have in common: a folder, a small scene, and running it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// A folder of its own for a test, with a glTF scene of one square; removed when dropped.
pub struct Folder(PathBuf);

impl Folder {
    /// A new one, named after the test.
    pub fn new(test: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("fovea-cli-{test}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        let corners: [[f32; 3]; 4] = [[-1.0, -1.0, -2.0], [1.0, -1.0, -2.0], [1.0, 1.0, -2.0], [-1.0, 1.0, -2.0]];
        let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        bytes.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
        std::fs::write(folder.join("a square.bin"), bytes).unwrap();
        std::fs::write(folder.join("square.gltf"), SQUARE).unwrap();
        Self(folder)
    }

    /// A file in it.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// What is in it, in order.
    pub fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).unwrap();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What a failed test leaves in the folder for temporary files harms nothing.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A square of 2 m, 2 m before a camera that stands at the origin.
pub const SQUARE: &str = r#"{
    "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0, 1] }],
    "nodes": [{ "mesh": 0 }, { "camera": 0, "name": "eye" }],
    "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }],
    "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
    "buffers": [{ "uri": "a%20square.bin", "byteLength": 60 }],
    "bufferViews": [{ "buffer": 0, "byteLength": 48 }, { "buffer": 0, "byteOffset": 48, "byteLength": 12 }],
    "accessors": [
        { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, -2], "max": [1, 1, -2] },
        { "bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR" }
    ]
}"#;

/// Runs the program.
pub fn fovea(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fovea")).args(arguments).output().unwrap()
}

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// One line on standard error that has all of `parts`, nothing on standard output, exit status 2.
pub fn refuses(arguments: &[&str], parts: &[&str]) {
    let output = fovea(arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    let lines: Vec<&str> = message.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert_eq!(lines.len(), 1, "{arguments:?}: {message}");
    assert!(message.trim_end().ends_with(lines[0]), "nothing follows the error: {message}");
    for part in parts {
        assert!(lines[0].contains(part), "{arguments:?}: {message}");
    }
    assert!(output.stdout.is_empty(), "{arguments:?}");
}

/// What the program prints.
pub fn json(arguments: &[&str]) -> Value {
    let output = fovea(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}
