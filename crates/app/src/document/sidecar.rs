//! Saved edits: a small JSON file beside the scene, `SCENE.fovea.json`.
//!
//! A sidecar, not a new glTF: a written glTF would lose what this program does not read (extensions, animation, custom
//! properties), and the next export of the scene's own program would overwrite it. The sidecar outlives both, since parts
//! are found by name. An environment image in the sidecar's folder or below is named from there, so that the folder can be moved;
//! any other from the root. Lengths are metres, angles degrees, colours linear Rec. 709.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use glam::{Quat, Vec3};
use serde_json::{Map, Value as Json, json};
use tracer::scene::Backdrop;

use super::edits::{Edits, EnvironmentEdit, LightEdit, Move, NodeEdit};
use super::parameters::{MaterialParameter, Value};
use super::tree::PartName;
use super::{Document, Names};
use crate::config;
use crate::output::{OutputError, write_atomically};
use crate::session::Source;

/// What the file says it is.
const FORMAT: &str = "fovea-edits";
/// Raised when old programs would misread the file.
const VERSION: u64 = 1;
/// A backdrop that is the environment.
const ENVIRONMENT: &str = "environment";

/// How the names of such files end.
pub const ENDING: &str = ".fovea.json";

/// Where edits of the built-in scene are kept: in the working folder.
const BUILT_IN: &str = "built-in";

/// Where the edits of a scene are kept.
pub fn beside(source: &Source) -> PathBuf {
    match source {
        Source::BuiltIn => path_for(Path::new(BUILT_IN)),
        Source::File(path) => path_for(path),
    }
}

/// Where the edits of a scene in a file are kept.
pub fn path_for(scene: &Path) -> PathBuf {
    let mut name = scene.as_os_str().to_owned();
    name.push(ENDING);
    PathBuf::from(name)
}

/// What edits that could not be saved in time are called in their file's name.
const RECOVERED: &str = "recovered";

/// A file for edits of a window that ends, beside the one that they are saved to: `SCENE.fovea.recovered.json`, or the next that is
/// free.
pub fn free_rescue(sidecar: &Path) -> Option<PathBuf> {
    config::names_beside(sidecar, RECOVERED).find(|path| !path.exists())
}

/// The last of those files, while nothing has been saved since.
pub fn recovered(sidecar: &Path) -> Option<PathBuf> {
    let last = config::names_beside(sidecar, RECOVERED).take_while(|path| path.exists()).last()?;
    let written = |path: &Path| path.metadata().and_then(|metadata| metadata.modified()).ok();
    (written(sidecar) < written(&last)).then_some(last)
}

impl Document {
    /// Saves the edits; without any, a file of earlier ones is overwritten by an empty list.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn save_edits(&mut self, path: &Path) -> Result<(), OutputError> {
        self.copy_edits(path)?;
        self.set_saved();
        Ok(())
    }

    /// Writes the edits to a file that is not read with the scene: they count as unsaved as before.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn copy_edits(&self, path: &Path) -> Result<(), OutputError> {
        let text = serde_json::to_string_pretty(&self.to_json(path)).expect("keys are strings");
        write_atomically(path, |writer| writeln!(writer, "{text}").map_err(|error| error.to_string()))
    }

    /// The edits as one JSON object, as a file of this path holds them.
    pub fn to_json(&self, path: &Path) -> Json {
        let edits = self.edits();
        json!({
            "format": FORMAT,
            "version": VERSION,
            "nodes": list_json(&edits.nodes, &self.names.nodes, &edits.absent.nodes, node_json),
            "materials": list_json(&edits.materials, &self.names.materials, &edits.absent.materials, material_json),
            "lights": list_json(&edits.lights, &self.names.lights, &edits.absent.lights, light_json),
            "environment": environment_json(&edits.environment, &folder_of(path)),
        })
    }

    /// Takes the edits of a file; what names no part of this scene waits for it and is named.
    ///
    /// # Errors
    /// One line, when the file cannot be read or is no file of edits.
    pub fn load_edits(&mut self, path: &Path) -> Result<Vec<String>, String> {
        let edits = self.read_edits(path)?;
        let absent = edits.absent.parts();
        self.take_saved(edits);
        Ok(absent)
    }

    /// The same in place of the present edits, as one step to undo; they count as unsaved.
    ///
    /// # Errors
    /// As of [`Document::load_edits`].
    pub fn open_edits(&mut self, path: &Path) -> Result<Vec<String>, String> {
        let edits = self.read_edits(path)?;
        let absent = edits.absent.parts();
        self.replace(edits);
        Ok(absent)
    }

    fn read_edits(&self, path: &Path) -> Result<Edits, String> {
        let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        parse(&text, &self.names, &folder_of(path)).map_err(|reason| format!("{}: {reason}", path.display()))
    }
}

fn list_json<T>(
    edits: &BTreeMap<u32, T>,
    names: &[PartName],
    absent: &BTreeMap<PartName, T>,
    json: impl Fn(&T) -> Map<String, Json>,
) -> Json {
    let name = |index: u32| {
        let unnamed = || PartName { name: String::new(), occurrence: index };
        names.get(index as usize).cloned().unwrap_or_else(unnamed)
    };
    let present = edits.iter().map(|(index, edit)| (name(*index), edit));
    let all = present.chain(absent.iter().map(|(name, edit)| (name.clone(), edit)));
    let named = all.map(|(PartName { name, occurrence }, edit)| {
        let mut object = Map::new();
        object.insert("name".into(), json!(name));
        object.insert("occurrence".into(), json!(occurrence));
        object.extend(json(edit));
        Json::Object(object)
    });
    Json::Array(named.collect())
}

fn node_json(edit: &NodeEdit) -> Map<String, Json> {
    let mut object = Map::new();
    let Move { translation, rotation, scale } = edit.moved;
    if edit.moved != Move::default() {
        object.insert("translation_m".into(), json!(translation.to_array()));
        object.insert("rotation_xyzw".into(), json!(rotation.to_array()));
        object.insert("scale".into(), json!(scale.to_array()));
    }
    if let Some(hidden) = edit.hidden {
        object.insert("hidden".into(), json!(hidden));
    }
    object
}

fn material_json(values: &BTreeMap<MaterialParameter, Value>) -> Map<String, Json> {
    values.iter().map(|(parameter, value)| (parameter.key().to_owned(), value_json(*value))).collect()
}

fn value_json(value: Value) -> Json {
    match value {
        Value::Number(x) => json!(x),
        Value::Color(color) => json!(color.to_array()),
    }
}

fn light_json(edit: &LightEdit) -> Map<String, Json> {
    let mut object = Map::new();
    if let Some(intensity) = edit.intensity {
        object.insert("intensity".into(), json!(intensity.to_array()));
    }
    if let Some(angle) = edit.angle {
        object.insert("angle_deg".into(), json!(angle.to_degrees()));
    }
    if edit.translation != Vec3::ZERO {
        object.insert("translation_m".into(), json!(edit.translation.to_array()));
    }
    object
}

/// The folder of a file, from the root.
fn folder_of(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    absolute.parent().map(Path::to_owned).unwrap_or_default()
}

/// A file as it is named in a file of this folder: with `/` everywhere where it lies there or below.
fn name_from(folder: &Path, file: &Path) -> String {
    // The same folder may be named in several ways; a file that is a link stays where the link is.
    let place = |folder: &Path| folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let below = place(&folder_of(file)).strip_prefix(place(folder)).ok().map(Path::to_owned);
    let Some((below, name)) = below.zip(file.file_name()) else { return file.to_string_lossy().into_owned() };
    let below = below.join(name);
    let parts: Vec<_> = below.iter().map(|part| part.to_string_lossy()).collect();
    parts.join("/")
}

fn environment_json(edit: &EnvironmentEdit, folder: &Path) -> Json {
    let mut object = Map::new();
    if let Some(image) = &edit.image {
        object.insert("image".into(), json!(name_from(folder, image)));
    }
    if let Some(radiance) = edit.radiance {
        object.insert("radiance".into(), json!(radiance.to_array()));
    }
    if let Some(rotation) = edit.rotation_deg {
        object.insert("rotation_deg".into(), json!(rotation));
    }
    if let Some(intensity) = edit.intensity {
        object.insert("intensity".into(), json!(intensity));
    }
    match edit.backdrop {
        Some(Backdrop::Environment) => object.insert("backdrop".into(), json!(ENVIRONMENT)),
        Some(Backdrop::Color(color)) => object.insert("backdrop".into(), json!(color.to_array())),
        None => None,
    };
    Json::Object(object)
}

/// Whether a file holds edits, whatever it is called.
pub fn is_edits(path: &Path) -> bool {
    let json = std::fs::read(path).ok().and_then(|bytes| serde_json::from_slice::<Json>(&bytes).ok());
    json.is_some_and(|json| json["format"] == FORMAT)
}

/// Edits for the parts of these names, from a file of this folder.
fn parse(text: &str, names: &Names, folder: &Path) -> Result<Edits, String> {
    let json: Json = serde_json::from_str(text).map_err(|error| format!("no file of edits: {error}"))?;
    if json["format"] != FORMAT {
        return Err(format!("no file of edits: its format is not \"{FORMAT}\""));
    }
    if json["version"] != VERSION {
        return Err(format!("edits of version {}; this program reads version {VERSION}", json["version"]));
    }
    let mut edits = Edits::default();
    (edits.nodes, edits.absent.nodes) = list(&json["nodes"], &names.nodes, node_edit);
    (edits.materials, edits.absent.materials) = list(&json["materials"], &names.materials, material_edit);
    (edits.lights, edits.absent.lights) = list(&json["lights"], &names.lights, light_edit);
    let environment = &json["environment"];
    edits.environment = EnvironmentEdit {
        image: environment["image"].as_str().map(|name| folder.join(name)),
        radiance: vector(&environment["radiance"]),
        rotation_deg: number(&environment["rotation_deg"]),
        intensity: number(&environment["intensity"]),
        backdrop: match &environment["backdrop"] {
            Json::String(name) if name == ENVIRONMENT => Some(Backdrop::Environment),
            color => vector(color).map(Backdrop::Color),
        },
    };
    Ok(edits)
}

fn node_edit(entry: &Json) -> NodeEdit {
    let usual = Move::default();
    let rotation = entry["rotation_xyzw"].as_array().filter(|values| values.len() == 4).and_then(|values| {
        let [x, y, z, w] = [0, 1, 2, 3].map(|index| number(&values[index]));
        Some(Quat::from_xyzw(x?, y?, z?, w?))
    });
    let moved = Move {
        translation: vector(&entry["translation_m"]).unwrap_or(usual.translation),
        rotation: rotation.unwrap_or(usual.rotation),
        scale: vector(&entry["scale"]).unwrap_or(usual.scale),
    };
    NodeEdit { moved: moved.sane(), hidden: entry["hidden"].as_bool() }
}

fn material_edit(entry: &Json) -> BTreeMap<MaterialParameter, Value> {
    let values = MaterialParameter::ALL.into_iter().filter_map(|parameter| {
        let value = &entry[parameter.key()];
        let value = vector(value).map(Value::Color).or_else(|| number(value).map(Value::Number))?;
        Some((parameter, value))
    });
    values.collect()
}

fn light_edit(entry: &Json) -> LightEdit {
    LightEdit {
        intensity: vector(&entry["intensity"]),
        angle: number(&entry["angle_deg"]).map(f32::to_radians),
        translation: vector(&entry["translation_m"]).unwrap_or_default(),
    }
}

/// The edits of a list by the places of the parts that they name, and by name where there are none.
fn list<T>(list: &Json, names: &[PartName], edit: impl Fn(&Json) -> T) -> (BTreeMap<u32, T>, BTreeMap<PartName, T>) {
    let (mut present, mut absent) = (BTreeMap::new(), BTreeMap::new());
    for entry in list.as_array().into_iter().flatten().filter(|entry| entry.is_object()) {
        let name = entry["name"].as_str().unwrap_or_default().to_owned();
        let occurrence = entry["occurrence"].as_u64().unwrap_or(0);
        let name = PartName { name, occurrence: u32::try_from(occurrence).unwrap_or(u32::MAX) };
        match names.iter().zip(0..).find(|(part, _)| **part == name) {
            Some((_, index)) => {
                present.insert(index, edit(entry));
            }
            None => {
                absent.insert(name, edit(entry));
            }
        }
    }
    (present, absent)
}

fn number(value: &Json) -> Option<f32> {
    value.as_f64().map(|x| x as f32).filter(|x| x.is_finite())
}

fn vector(value: &Json) -> Option<Vec3> {
    let values = value.as_array().filter(|values| values.len() == 3)?;
    Some(Vec3::new(number(&values[0])?, number(&values[1])?, number(&values[2])?))
}
