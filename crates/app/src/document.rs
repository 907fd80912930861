//! The scene as it is worked on: the file's version, edits on top of it, and their history.
//!
//! A document makes immutable [`Scene`] versions and never changes one. Edits are values ([`Edits`]); undo puts earlier
//! ones back. When the file changes on disk, the edits are put onto the new version wherever a part of the same name is
//! still there; those of other parts wait until theirs are back.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Affine3A;
use tracer::import::SceneNode;
use tracer::scene::{EnvironmentImage, Scene};

use crate::session::Loaded;
use edits::{Edit, Edits, Part, Target};
use tree::{PartName, Tree};

pub mod apply;
pub mod edits;
pub mod parameters;
mod reapply;
pub mod sidecar;
pub mod tree;

/// Most steps that can be undone; the oldest go first.
const MOST_STEPS: usize = 500;

/// Whether an edit is one of many that a drag or slider makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gesture {
    /// Complete in itself.
    Once,
    /// Goes on: further edits of the same target are the same step, until [`Document::end_gesture`].
    GoesOn,
}

/// The names of a file's parts.
#[derive(Clone, Debug, Default)]
struct Names {
    nodes: Vec<PartName>,
    materials: Vec<PartName>,
    lights: Vec<PartName>,
}

impl Names {
    fn of(scene: &Scene, nodes: &[SceneNode]) -> Self {
        Self {
            nodes: tree::part_names(nodes.iter().map(|node| node.name.as_str())),
            materials: tree::part_names(scene.materials.iter().map(|material| material.name.as_str())),
            lights: tree::part_names(scene.lights.iter().map(|light| light.name.as_str())),
        }
    }
}

/// A scene with edits.
#[derive(Clone, Debug)]
pub struct Document {
    file: Arc<Scene>,
    nodes: Vec<SceneNode>,
    tree: Tree,
    names: Names,
    edits: Edits,
    /// Earlier and later edits, the nearest last.
    undo: Vec<Edits>,
    redo: Vec<Edits>,
    gesture: Option<Target>,
    saved: Edits,
    solo: Option<u32>,
    /// The image that the edits name, once it is read; an image takes up to 1.5 GiB, so no other is kept.
    environment: Option<(PathBuf, Arc<EnvironmentImage>)>,
    version: Arc<Scene>,
}

impl Document {
    /// A file's scene without edits.
    pub fn new(loaded: &Loaded) -> Self {
        let file = Arc::clone(&loaded.scene);
        let tree = Tree::new(&loaded.nodes, &file);
        let nodes = tree::with_pivots(&loaded.nodes, &tree, &file);
        Self {
            tree,
            names: Names::of(&file, &nodes),
            version: Arc::clone(&file),
            file,
            nodes,
            edits: Edits::default(),
            undo: Vec::new(),
            redo: Vec::new(),
            gesture: None,
            saved: Edits::default(),
            solo: None,
            environment: None,
        }
    }

    /// The version that is to be shown.
    pub fn version(&self) -> &Arc<Scene> {
        &self.version
    }

    /// The file's own version.
    pub fn file(&self) -> &Arc<Scene> {
        &self.file
    }

    /// The file's nodes. The origin of each is the point about which it turns and is scaled: its own, or the middle of what
    /// hangs on it where its own lies outside of that, as in files whose objects have no places of their own.
    pub fn nodes(&self) -> &[SceneNode] {
        &self.nodes
    }

    /// What hangs on what.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// What differs from the file.
    pub fn edits(&self) -> &Edits {
        &self.edits
    }

    /// Whether there are edits that have not been saved.
    pub fn is_unsaved(&self) -> bool {
        self.edits != self.saved
    }

    /// The node that alone is shown, with all that hangs on it.
    pub fn solo(&self) -> Option<u32> {
        self.solo
    }

    /// Shows one node alone, or all again. Not an edit: it is neither undone nor saved.
    pub fn set_solo(&mut self, node: Option<u32>) {
        self.solo = node;
        self.remake();
    }

    /// Whether a node is shown.
    pub fn is_visible(&self, node: u32) -> bool {
        let in_file = self.tree.is_shown_in_file(node);
        apply::is_visible(node, in_file, &self.tree, &self.edits, self.solo)
    }

    /// What takes a point of the file's world to where it is now, for what hangs on a node.
    pub fn world_from_file(&self, node: u32) -> Affine3A {
        apply::world_from_file(node, &self.nodes, &self.tree, &self.edits)
    }

    /// The same for what a node hangs on.
    pub fn world_from_file_above(&self, node: u32) -> Affine3A {
        self.tree.parent(node).map_or(Affine3A::IDENTITY, |parent| self.world_from_file(parent))
    }

    /// Makes an edit.
    pub fn edit(&mut self, edit: &Edit, gesture: Gesture) {
        let mut edits = self.edits.clone();
        match edit {
            // A group that is shown as in the file again does not show what the file hides of it.
            Edit::Hide(node, hidden) if apply::is_usually_visible(*node, &self.tree, &edits) != *hidden => {
                edits.show_as_in_file(*node);
            }
            _ => edits.make(edit),
        }
        // A gesture begins with its first change, not with a pointer that has not moved yet.
        if edits == self.edits {
            return;
        }
        let goes_on = self.gesture == Some(edit.target());
        self.gesture = (gesture == Gesture::GoesOn).then_some(edit.target());
        self.change(edits, goes_on);
    }

    /// Puts other edits in the place of all, as one step.
    pub fn replace(&mut self, edits: Edits) {
        self.end_gesture();
        if edits != self.edits {
            self.change(edits, false);
        }
    }

    fn change(&mut self, edits: Edits, goes_on: bool) {
        let before = std::mem::replace(&mut self.edits, edits);
        if !goes_on {
            if self.undo.len() == MOST_STEPS {
                self.undo.remove(0);
            }
            self.undo.push(before);
        }
        self.redo.clear();
        self.remake();
    }

    /// The next edit is a step of its own.
    pub fn end_gesture(&mut self) {
        self.gesture = None;
    }

    /// Whether there is a step to undo.
    pub fn can_undo(&self) -> bool {
        !self.undo.is_empty()
    }

    /// Whether there is a step to make again.
    pub fn can_redo(&self) -> bool {
        !self.redo.is_empty()
    }

    /// Takes the last step back.
    pub fn undo(&mut self) {
        if let Some(edits) = self.undo.pop() {
            self.redo.push(std::mem::replace(&mut self.edits, edits));
            self.end_gesture();
            self.remake();
        }
    }

    /// Makes the last step that was undone again.
    pub fn redo(&mut self) {
        if let Some(edits) = self.redo.pop() {
            self.undo.push(std::mem::replace(&mut self.edits, edits));
            self.end_gesture();
            self.remake();
        }
    }

    /// Takes edits from a file as they are, without a step to undo.
    pub fn take_saved(&mut self, edits: Edits) {
        self.saved.clone_from(&edits);
        self.edits = edits;
        self.remake();
    }

    /// Says that the edits are saved as they are.
    pub fn set_saved(&mut self) {
        self.saved.clone_from(&self.edits);
    }

    /// Takes an environment's image, or a newer version of it. One that the edits do not name is not kept.
    pub fn add_environment(&mut self, path: PathBuf, image: Arc<EnvironmentImage>) {
        self.environment = Some((path, image));
        self.remake();
    }

    /// The environment image that the edits name and that is not there: it was not read yet, or is read again, as one that is
    /// named again by undo.
    pub fn wanted_environment(&self) -> Option<&Path> {
        let path = self.edits.environment.image.as_deref()?;
        self.environment.is_none().then_some(path)
    }

    /// Goes on from a newer version of the file. What is selected is named by its new index, if it is still there; edits
    /// of parts that are gone wait for them, and the parts are named.
    pub fn follow_file(&mut self, loaded: &Loaded, selected: Option<Part>) -> (Option<Part>, Vec<String>) {
        let names = Names::of(&loaded.scene, &loaded.nodes);
        let places = reapply::Places::new(&self.names, &names);
        let gone = places.missing(&self.edits);
        for edits in self.undo.iter_mut().chain(&mut self.redo).chain([&mut self.edits, &mut self.saved]) {
            *edits = places.of_edits(edits);
        }
        self.solo = self.solo.and_then(|node| places.node(node));
        let selected = selected.and_then(|part| places.part(part));
        self.file = Arc::new((*loaded.scene).clone().sharing_parts_of(&self.file));
        self.tree = Tree::new(&loaded.nodes, &self.file);
        self.nodes = tree::with_pivots(&loaded.nodes, &self.tree, &self.file);
        self.names = names;
        self.end_gesture();
        self.remake();
        (selected, gone)
    }

    fn remake(&mut self) {
        let named = self.edits.environment.image.as_ref();
        self.environment.take_if(|(path, _)| Some(&*path) != named);
        let unchanged = self.edits.is_empty() && self.solo.is_none();
        self.version = if unchanged {
            Arc::clone(&self.file)
        } else {
            let image = self.environment.as_ref().map(|(_, image)| image);
            let made = apply::apply(&self.file, &self.nodes, &self.tree, &self.edits, self.solo, image);
            Arc::new(made.sharing_parts_of(&self.version))
        };
    }
}

#[cfg(test)]
mod tests;
