//! Edits of one version of a file on another: parts are the same when they have the same name.

use std::collections::{BTreeMap, HashMap};

use super::Names;
use super::edits::{Absent, Edits, Part};
use super::tree::PartName;

/// Where the parts of one version are in another.
pub(super) struct Places<'a> {
    nodes: List<'a>,
    materials: List<'a>,
    lights: List<'a>,
}

impl<'a> Places<'a> {
    pub(super) fn new(from: &'a Names, to: &'a Names) -> Self {
        Self {
            nodes: List::new(&from.nodes, &to.nodes),
            materials: List::new(&from.materials, &to.materials),
            lights: List::new(&from.lights, &to.lights),
        }
    }

    pub(super) fn node(&self, node: u32) -> Option<u32> {
        self.nodes.place(node)
    }

    pub(super) fn part(&self, part: Part) -> Option<Part> {
        match part {
            Part::Node(node) => self.node(node).map(Part::Node),
            Part::Material(material) => self.materials.place(material).map(Part::Material),
            Part::Light(light) => self.lights.place(light).map(Part::Light),
            Part::Environment => Some(part),
        }
    }

    /// The same edits: those of parts that are gone wait, and those of parts that are back do not wait any more.
    pub(super) fn of_edits(&self, edits: &Edits) -> Edits {
        let (nodes, absent_nodes) = self.nodes.moved(&edits.nodes, &edits.absent.nodes);
        let (materials, absent_materials) = self.materials.moved(&edits.materials, &edits.absent.materials);
        let (lights, absent_lights) = self.lights.moved(&edits.lights, &edits.absent.lights);
        let absent = Absent { nodes: absent_nodes, materials: absent_materials, lights: absent_lights };
        Edits { nodes, materials, lights, environment: edits.environment.clone(), absent }
    }

    /// The edited parts that are gone.
    pub(super) fn missing(&self, edits: &Edits) -> Vec<String> {
        let nodes = self.nodes.gone(edits.nodes.keys()).map(|name| name.part("object"));
        let materials = self.materials.gone(edits.materials.keys()).map(|name| name.part("material"));
        let lights = self.lights.gone(edits.lights.keys()).map(|name| name.part("light"));
        nodes.chain(materials).chain(lights).collect()
    }
}

/// The same for parts of one kind.
struct List<'a> {
    from: &'a [PartName],
    to: HashMap<&'a PartName, u32>,
}

impl<'a> List<'a> {
    fn new(from: &'a [PartName], to: &'a [PartName]) -> Self {
        Self { from, to: to.iter().zip(0..).collect() }
    }

    fn place(&self, index: u32) -> Option<u32> {
        self.to.get(self.from.get(index as usize)?).copied()
    }

    fn moved<T: Clone>(
        &self,
        edits: &BTreeMap<u32, T>,
        absent: &BTreeMap<PartName, T>,
    ) -> (BTreeMap<u32, T>, BTreeMap<PartName, T>) {
        let (mut here, mut gone) = (BTreeMap::new(), BTreeMap::new());
        let present = edits.iter().filter_map(|(index, edit)| Some((self.from.get(*index as usize)?, edit)));
        for (name, edit) in absent.iter().chain(present) {
            match self.to.get(name) {
                Some(place) => {
                    here.insert(*place, edit.clone());
                }
                None => {
                    gone.insert(name.clone(), edit.clone());
                }
            }
        }
        (here, gone)
    }

    fn gone<'b>(&'b self, edited: impl Iterator<Item = &'b u32> + 'b) -> impl Iterator<Item = &'a PartName> + 'b {
        edited.filter_map(|index| self.from.get(*index as usize)).filter(|name| !self.to.contains_key(name))
    }
}
