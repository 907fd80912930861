//! From a path or bytes to JSON and buffers: the .glb container, `data:` URIs, percent-encoded relative paths.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use serde_json::Value;

use super::error::{ContentError, Fault, ImportError};

const GLB_MAGIC: &[u8; 4] = b"glTF";
const CHUNK_JSON: u32 = 0x4E4F_534A;
const CHUNK_BIN: u32 = 0x004E_4942;

/// The two parts of a glTF file.
pub(super) struct Container<'a> {
    pub(super) json: Value,
    /// The binary chunk of a .glb.
    pub(super) bin: Option<&'a [u8]>,
}

impl<'a> Container<'a> {
    /// Splits a .glb or takes the whole as JSON.
    pub(super) fn parse(file: &Path, bytes: &'a [u8]) -> Result<Self, ImportError> {
        let not_gltf = |cause: String| ImportError::NotGltf { file: file.to_owned(), cause };
        let (json, bin) = if bytes.starts_with(GLB_MAGIC) { split_glb(file, bytes)? } else { (bytes, None) };
        if json.is_empty() {
            return Err(not_gltf("it is empty".to_owned()));
        }
        // A byte-order mark is not allowed, but some editors write one.
        let json = json.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(json);
        let json: Value = serde_json::from_slice(json).map_err(|e| not_gltf(format!("JSON: {e}")))?;
        let version = json.get("asset").and_then(|a| a.get("version")).and_then(Value::as_str);
        match version {
            Some(v) if v == "2" || v.starts_with("2.") => Ok(Self { json, bin }),
            Some(v) => Err(not_gltf(format!("its version is '{}'", super::error::one_line(v)))),
            None => Err(not_gltf("it has no asset.version".to_owned())),
        }
    }
}

fn split_glb<'a>(file: &Path, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>), ImportError> {
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let truncated = |needed: usize| {
        let cause = ContentError::Truncated {
            needed: needed as u64,
            container: "the file".to_owned(),
            available: bytes.len() as u64,
        };
        Fault::new("binary container", cause).in_file(file)
    };
    let version = word(4).ok_or_else(|| truncated(12))?;
    if version != 2 {
        let cause = format!("the binary container has version {version}");
        return Err(ImportError::NotGltf { file: file.to_owned(), cause });
    }
    let total = word(8).ok_or_else(|| truncated(12))? as usize;
    if total > bytes.len() {
        return Err(truncated(total));
    }
    let (mut json, mut bin, mut at) = (None, None, 12);
    while at + 8 <= total {
        let (length, kind) = (word(at).unwrap_or(0) as usize, word(at + 4).unwrap_or(0));
        let end = at + 8 + length;
        let data = bytes.get(at + 8..end).ok_or_else(|| truncated(end))?;
        match kind {
            CHUNK_JSON if json.is_none() => json = Some(data),
            CHUNK_BIN if bin.is_none() => bin = Some(data),
            _ => {}
        }
        at = end;
    }
    let json = json.ok_or_else(|| ImportError::NotGltf {
        file: file.to_owned(),
        cause: "the binary container has no JSON chunk".to_owned(),
    })?;
    Ok((json, bin))
}

/// Where a file's companions are.
pub(super) struct Folder {
    /// `None` for bytes in memory, which have no companions.
    pub(super) path: Option<PathBuf>,
}

impl Folder {
    /// The file that a relative URI means; `None` for all others.
    pub(super) fn companion(&self, uri: &str) -> Option<PathBuf> {
        let name = percent_decoded(uri);
        let folder =
            self.path.as_ref().filter(|_| !uri.starts_with("data:") && is_relative(uri) && is_relative(&name))?;
        let decoded = folder.join(name);
        // Writers that forgot to percent-encode a '%' mean the literal name.
        let literal = folder.join(uri);
        Some(if !decoded.exists() && literal.exists() { literal } else { decoded })
    }

    /// What a URI refers to; of a file at most so many bytes.
    pub(super) fn read(&self, uri: &str, most_bytes: u64) -> Result<Vec<u8>, String> {
        if let Some(data) = uri.strip_prefix("data:") {
            return decode_data_uri(data);
        }
        match self.companion(uri) {
            Some(path) => read_file(&path, most_bytes),
            None if self.path.is_none() => Err("a scene in memory has no companion files".to_owned()),
            None => Err("only files are read that are named relative to the scene's".to_owned()),
        }
    }
}

/// Whether a URI or name leads on from a folder: it has neither a scheme with an authority nor a root or drive.
fn is_relative(uri: &str) -> bool {
    let has_root = |part: Component<'_>| matches!(part, Component::Prefix(_) | Component::RootDir);
    !uri.contains("://") && !Path::new(uri).components().any(has_root)
}

/// What a file begins with. Pipes and devices, which may never end, are refused before they are opened.
fn read_file(path: &Path, most_bytes: u64) -> Result<Vec<u8>, String> {
    let about = path.metadata().map_err(|e| e.to_string())?;
    if !about.is_file() {
        return Err("it is no regular file".to_owned());
    }
    let length = usize::try_from(about.len().min(most_bytes)).map_err(|e| e.to_string())?;
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(length).map_err(|e| e.to_string())?;
    File::open(path).and_then(|file| file.take(most_bytes).read_to_end(&mut bytes)).map_err(|e| e.to_string())?;
    Ok(bytes)
}

/// What follows `data:`.
fn decode_data_uri(data: &str) -> Result<Vec<u8>, String> {
    let (header, body) = data.split_once(',').ok_or("the data URI has no comma")?;
    if header.ends_with(";base64") {
        decode_base64(body).ok_or_else(|| "the data URI is not valid base64".to_owned())
    } else {
        Ok(percent_bytes(body).into_owned())
    }
}

/// RFC 4648 base64, standard or URL alphabet, padding optional, white space ignored.
fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0u32, 0u32);
    for c in text.bytes() {
        let digit = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b'=' => break,
            b' ' | b'\t' | b'\r' | b'\n' => continue,
            _ => return None,
        };
        bits = bits << 6 | u32::from(digit);
        held += 6;
        if held >= 8 {
            held -= 8;
            bytes.push((bits >> held & 0xFF) as u8);
        }
    }
    Some(bytes)
}

fn percent_bytes(text: &str) -> Cow<'_, [u8]> {
    if !text.contains('%') {
        return Cow::Borrowed(text.as_bytes());
    }
    let source = text.as_bytes();
    let hex = |at: usize| source.get(at).and_then(|&c| char::from(c).to_digit(16));
    let (mut bytes, mut at) = (Vec::with_capacity(source.len()), 0);
    while at < source.len() {
        match (source[at], hex(at + 1), hex(at + 2)) {
            (b'%', Some(high), Some(low)) => {
                bytes.push((high << 4 | low) as u8);
                at += 3;
            }
            (byte, ..) => {
                bytes.push(byte);
                at += 1;
            }
        }
    }
    Cow::Owned(bytes)
}

fn percent_decoded(uri: &str) -> String {
    String::from_utf8(percent_bytes(uri).into_owned()).unwrap_or_else(|_| uri.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_matches_the_vectors_of_rfc_4648() {
        for (text, expected) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg", "foob"), ("Zm9v\nYmFy", "foobar")]
        {
            assert_eq!(decode_base64(text).as_deref(), Some(expected.as_bytes()), "{text:?}");
        }
        assert_eq!(decode_base64("Zm9*"), None);
    }

    #[test]
    fn percent_decoding_handles_utf8_and_stray_signs() {
        assert_eq!(percent_decoded("a%20b%C3%A9.png"), "a bé.png");
        assert_eq!(percent_decoded("100%"), "100%");
        assert_eq!(percent_decoded("%zz%FF"), "%zz%FF");
    }

    #[test]
    fn companions_are_named_relative_to_the_scene() {
        let folder = Folder { path: Some("scene".into()) };
        for uri in ["a.bin", "../textures/a%20b.png", "./a.png", "wall:1.png"] {
            assert_eq!(folder.companion(uri), Some(Path::new("scene").join(percent_decoded(uri))), "{uri}");
        }
        for uri in ["/etc/hosts", "%2Fetc/hosts", "file:///etc/hosts", "https://host/a.png", "data:,a"] {
            assert_eq!(folder.companion(uri), None, "{uri}");
        }
    }
}
