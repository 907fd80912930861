//! Edits as values: what differs from the file, part by part. Nothing here refers to a version of the scene but by index.

use std::collections::BTreeMap;
use std::path::PathBuf;

use glam::{Quat, Vec3};
use tracer::scene::Backdrop;

use super::parameters::{MaterialParameter, Value};
use super::tree::PartName;

/// How a node is moved, turned and scaled against its place in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Metres along the world's axes.
    pub translation: Vec3,
    /// About the node's origin, in the world's axes; unit.
    pub rotation: Quat,
    /// Along the node's own axes; no component is 0.
    pub scale: Vec3,
}

impl Default for Move {
    fn default() -> Self {
        Self { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE }
    }
}

/// What is different about a node.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NodeEdit {
    /// Its place.
    pub moved: Move,
    /// Hidden or shown with all that hangs on it; `None`: as in the file.
    pub hidden: Option<bool>,
}

/// What is different about a light; `None`: as in the file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LightEdit {
    /// Linear colour times intensity: candela, or lux for a directional light.
    pub intensity: Option<Vec3>,
    /// Radians: the full angle that a directional light subtends, or the outer cone of a spot.
    pub angle: Option<f32>,
    /// Metres along the world's axes.
    pub translation: Vec3,
}

/// What is different about the environment; `None`: as in the file or on the command line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EnvironmentEdit {
    /// An equirectangular image.
    pub image: Option<PathBuf>,
    /// The same radiance from everywhere, where there is no image.
    pub radiance: Option<Vec3>,
    /// Degrees to the right, of an image.
    pub rotation_deg: Option<f32>,
    /// Multiplies an image's radiance.
    pub intensity: Option<f32>,
    /// What the camera sees of it.
    pub backdrop: Option<Backdrop>,
}

/// Edits of parts that the file lacks at present, by name. They are saved with the others and wait for their parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Absent {
    /// Of nodes.
    pub nodes: BTreeMap<PartName, NodeEdit>,
    /// Of materials.
    pub materials: BTreeMap<PartName, BTreeMap<MaterialParameter, Value>>,
    /// Of lights.
    pub lights: BTreeMap<PartName, LightEdit>,
}

impl Absent {
    /// The parts, in words.
    pub fn parts(&self) -> Vec<String> {
        let nodes = self.nodes.keys().map(|name| name.part("object"));
        let materials = self.materials.keys().map(|name| name.part("material"));
        let lights = self.lights.keys().map(|name| name.part("light"));
        nodes.chain(materials).chain(lights).collect()
    }
}

/// All that differs from the file. Parts are named by their index in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Edits {
    /// By glTF node.
    pub nodes: BTreeMap<u32, NodeEdit>,
    /// By place in the scene's materials.
    pub materials: BTreeMap<u32, BTreeMap<MaterialParameter, Value>>,
    /// By place in the scene's lights.
    pub lights: BTreeMap<u32, LightEdit>,
    /// The environment.
    pub environment: EnvironmentEdit,
    /// What is not in the file at present.
    pub absent: Absent,
}

/// One change that a person makes.
#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    /// Puts a node elsewhere.
    Move(u32, Move),
    /// Hides or shows a node with all that hangs on it.
    Hide(u32, bool),
    /// Shows all that the edits hide.
    ShowAll,
    /// Sets a material's parameter.
    Material(u32, MaterialParameter, Value),
    /// Sets a light.
    Light(u32, LightEdit),
    /// Sets the environment.
    Environment(EnvironmentEdit),
    /// Makes a part as it is in the file again.
    Reset(Part),
}

/// A part of a scene that can be chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Part {
    /// A glTF node.
    Node(u32),
    /// A material.
    Material(u32),
    /// A light.
    Light(u32),
    /// The environment.
    Environment,
}

/// What an edit sets: edits of one target in one gesture are one step to undo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// A node's place.
    Move(u32),
    /// Visibility.
    Hide(Option<u32>),
    /// One parameter of a material.
    Material(u32, MaterialParameter),
    /// A light.
    Light(u32),
    /// The environment.
    Environment,
    /// All of a part.
    Reset(Part),
}

impl Edit {
    /// What is set.
    pub fn target(&self) -> Target {
        match self {
            Self::Move(node, _) => Target::Move(*node),
            Self::Hide(node, _) => Target::Hide(Some(*node)),
            Self::ShowAll => Target::Hide(None),
            Self::Material(material, parameter, _) => Target::Material(*material, *parameter),
            Self::Light(light, _) => Target::Light(*light),
            Self::Environment(_) => Target::Environment,
            Self::Reset(part) => Target::Reset(*part),
        }
    }
}

impl Edits {
    /// Whether nothing differs from the file.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Carries out one change. What is set back to the file's own state leaves no trace.
    pub fn make(&mut self, edit: &Edit) {
        match edit {
            Edit::Move(node, moved) => self.nodes.entry(*node).or_default().moved = *moved,
            Edit::Hide(node, hidden) => self.nodes.entry(*node).or_default().hidden = Some(*hidden),
            Edit::ShowAll => {
                for edit in self.nodes.values_mut() {
                    edit.hidden = edit.hidden.filter(|hidden| !hidden);
                }
            }
            Edit::Material(material, parameter, value) => {
                self.materials.entry(*material).or_default().insert(*parameter, *value);
            }
            Edit::Light(light, edit) => {
                self.lights.insert(*light, *edit);
            }
            Edit::Environment(edit) => self.environment = edit.clone(),
            Edit::Reset(Part::Node(node)) => {
                self.nodes.remove(node);
            }
            Edit::Reset(Part::Material(material)) => {
                self.materials.remove(material);
            }
            Edit::Reset(Part::Light(light)) => {
                self.lights.remove(light);
            }
            Edit::Reset(Part::Environment) => self.environment = EnvironmentEdit::default(),
        }
        self.forget_what_is_usual();
    }

    /// Leaves to the file whether a node is shown.
    pub fn show_as_in_file(&mut self, node: u32) {
        if let Some(edit) = self.nodes.get_mut(&node) {
            edit.hidden = None;
        }
        self.forget_what_is_usual();
    }

    fn forget_what_is_usual(&mut self) {
        self.nodes.retain(|_, edit| *edit != NodeEdit::default());
        self.lights.retain(|_, edit| *edit != LightEdit::default());
    }
}
