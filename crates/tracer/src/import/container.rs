//! From a path or bytes to JSON and buffers: the .glb container, `data:` URIs, percent-encoded relative paths.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

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
    /// The file that a relative URI means; `None` for `data:` URIs.
    pub(super) fn companion(&self, uri: &str) -> Option<PathBuf> {
        let folder = self.path.as_ref().filter(|_| !uri.starts_with("data:"))?;
        let decoded = folder.join(percent_decoded(uri));
        // Writers that forgot to percent-encode a '%' mean the literal name.
        let literal = folder.join(uri);
        Some(if !decoded.exists() && literal.exists() { literal } else { decoded })
    }

    /// What a URI refers to.
    pub(super) fn read(&self, uri: &str) -> Result<Vec<u8>, String> {
        if let Some(data) = uri.strip_prefix("data:") {
            return decode_data_uri(data);
        }
        match self.companion(uri) {
            Some(path) => std::fs::read(&path).map_err(|e| e.to_string()),
            None => Err("a scene in memory has no companion files".to_owned()),
        }
    }
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
}
