//! Edits of one version of a file on another: parts are the same when they have the same name.

use std::collections::BTreeMap;

use super::Names;
use super::edits::{Edits, Part};
use super::tree::{PartName, places};

/// Where the parts of one version are in another.
pub(super) struct Places {
    nodes: Vec<Option<u32>>,
    materials: Vec<Option<u32>>,
    lights: Vec<Option<u32>>,
}

impl Places {
    pub(super) fn new(from: &Names, to: &Names) -> Self {
        Self {
            nodes: places(&from.nodes, &to.nodes),
            materials: places(&from.materials, &to.materials),
            lights: places(&from.lights, &to.lights),
        }
    }

    pub(super) fn node(&self, node: u32) -> Option<u32> {
        self.nodes.get(node as usize).copied().flatten()
    }

    pub(super) fn part(&self, part: Part) -> Option<Part> {
        match part {
            Part::Node(node) => self.node(node).map(Part::Node),
            Part::Material(material) => self.materials.get(material as usize).copied().flatten().map(Part::Material),
            Part::Light(light) => self.lights.get(light as usize).copied().flatten().map(Part::Light),
            Part::Environment => Some(part),
        }
    }

    pub(super) fn of_edits(&self, edits: &Edits) -> Edits {
        Edits {
            nodes: moved(&edits.nodes, &self.nodes),
            materials: moved(&edits.materials, &self.materials),
            lights: moved(&edits.lights, &self.lights),
            environment: edits.environment.clone(),
        }
    }

    /// The edited parts that are gone.
    pub(super) fn missing(&self, edits: &Edits, names: &Names) -> Vec<String> {
        let nodes = gone(edits.nodes.keys(), &self.nodes, &names.nodes, "object");
        let materials = gone(edits.materials.keys(), &self.materials, &names.materials, "material");
        let lights = gone(edits.lights.keys(), &self.lights, &names.lights, "light");
        nodes.chain(materials).chain(lights).collect()
    }
}

fn moved<T: Clone>(edits: &BTreeMap<u32, T>, places: &[Option<u32>]) -> BTreeMap<u32, T> {
    let place = |index: &u32| places.get(*index as usize).copied().flatten();
    edits.iter().filter_map(|(index, edit)| Some((place(index)?, edit.clone()))).collect()
}

fn gone<'a>(
    edited: impl Iterator<Item = &'a u32>,
    places: &'a [Option<u32>],
    names: &'a [PartName],
    kind: &'static str,
) -> impl Iterator<Item = String> {
    let missing = edited.filter(|index| places.get(**index as usize).copied().flatten().is_none());
    missing.filter_map(|index| names.get(*index as usize)).map(move |name| format!("{kind} '{}'", name.name))
}
