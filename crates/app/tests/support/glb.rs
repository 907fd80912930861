//! Other versions of a `.glb` file, as an exporter would write them.

use serde_json::Value;

/// A file's bytes with another JSON part.
pub fn with_json(bytes: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut document: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    change(&mut document);
    let mut json = serde_json::to_vec(&document).unwrap();
    json.resize(json.len().next_multiple_of(4), b' ');
    let rest = &bytes[20 + length..];
    let total = 20 + json.len() + rest.len();
    let mut whole = [b"glTF".as_slice(), &2_u32.to_le_bytes(), &(total as u32).to_le_bytes()].concat();
    whole.extend((json.len() as u32).to_le_bytes());
    whole.extend(b"JSON");
    whole.extend(json);
    whole.extend(rest);
    whole
}

/// The material of this name.
pub fn material<'a>(document: &'a mut Value, name: &str) -> &'a mut Value {
    let materials = document["materials"].as_array_mut().unwrap();
    materials.iter_mut().find(|material| material["name"] == name).unwrap()
}
