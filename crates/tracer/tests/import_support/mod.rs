//! A small builder of glTF files in memory for the import tests.

use serde_json::{Value, json};
use tracer::import::{ImportError, ImportOptions, ImportReport, load_glb_bytes};
use tracer::scene::Scene;

pub(crate) type Loaded = Result<(Scene, ImportReport), ImportError>;

/// A document under construction; tests edit `json` at will.
#[derive(Clone)]
pub(crate) struct File {
    pub(crate) json: Value,
    pub(crate) bin: Vec<u8>,
}

pub(crate) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

impl File {
    pub(crate) fn empty() -> Self {
        let json = json!({
            "accessors": [], "asset": {"version": "2.0"}, "bufferViews": [], "buffers": [], "materials": [],
            "meshes": [], "nodes": [], "scene": 0, "scenes": [{"nodes": []}],
        });
        Self { json, bin: Vec::new() }
    }

    /// One right triangle in the xy plane facing +Z, by one node: accessor 0 = positions, 1 = indices (u16).
    pub(crate) fn triangle() -> Self {
        let mut file = Self::empty();
        let positions = file.accessor(&floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0.]), 5126, "VEC3", 3);
        let indices = file.accessor(&[0, 0, 1, 0, 2, 0], 5123, "SCALAR", 3);
        file.mesh(json!({"attributes": {"POSITION": positions}, "indices": indices}));
        file.node(json!({"mesh": 0}));
        file
    }

    pub(crate) fn push(&mut self, key: &str, value: Value) -> usize {
        if !self.json[key].is_array() {
            self.json[key] = json!([]);
        }
        let list = self.json[key].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    pub(crate) fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "type": kind, "count": count}))
    }

    pub(crate) fn mesh(&mut self, primitive: Value) -> usize {
        self.push("meshes", Value::from_iter([("name", json!("m")), ("primitives", Value::Array(vec![primitive]))]))
    }

    /// Adds a root node.
    pub(crate) fn node(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(index));
        index
    }

    /// Adds a material and gives it to the first primitive.
    pub(crate) fn material(&mut self, material: Value) -> usize {
        let index = self.push("materials", material);
        self.json["meshes"][0]["primitives"][0]["material"] = json!(index);
        index
    }

    /// Adds a PNG of the given size and colour with its texture; returns the texture.
    pub(crate) fn texture(&mut self, width: u32, height: u32, color: [u8; 4]) -> usize {
        let view = self.view(&png(width, height, color));
        let image = self.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
        self.push("textures", json!({"source": image}))
    }

    /// Gives the triangle texture coordinates.
    pub(crate) fn with_uvs(mut self) -> Self {
        let uvs = self.accessor(&floats(&[0., 1., 1., 1., 0., 0.]), 5126, "VEC2", 3);
        self.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uvs);
        self
    }

    pub(crate) fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        if !self.bin.is_empty() && json["buffers"].as_array().is_some_and(Vec::is_empty) {
            json["buffers"] = json!([{"byteLength": self.bin.len()}]);
        }
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut glb = b"glTF".to_vec();
        let total = 28 + text.len() + bin.len();
        for word in [2, total as u32, text.len() as u32, 0x4E4F_534A] {
            glb.extend(word.to_le_bytes());
        }
        glb.extend(text);
        glb.extend((bin.len() as u32).to_le_bytes());
        glb.extend(0x004E_4942u32.to_le_bytes());
        glb.extend(bin);
        glb
    }

    pub(crate) fn load_with(&self, options: &ImportOptions) -> Loaded {
        load_glb_bytes("test.glb", &self.glb(), options)
    }

    pub(crate) fn load(&self) -> Loaded {
        self.load_with(&ImportOptions::default())
    }

    pub(crate) fn scene(&self) -> Scene {
        self.load().unwrap().0
    }

    /// The message of the import's error, checked to be one line that names the file.
    pub(crate) fn error(&self) -> String {
        one_line_error(self.load())
    }
}

pub(crate) fn one_line_error(loaded: Loaded) -> String {
    let message = loaded.map(|(scene, _)| scene.name).expect_err("the file is broken").to_string();
    assert!(message.starts_with("test.glb: "), "{message}");
    assert!(!message.contains('\n'), "{message}");
    message
}

pub(crate) fn png(width: u32, height: u32, color: [u8; 4]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image::RgbaImage::from_pixel(width, height, image::Rgba(color));
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}
