//! The scene's nodes as a tree: what hangs on what, and what a name means in another version of the file.

use std::collections::HashMap;

use glam::Vec3;
use tracer::import::SceneNode;
use tracer::scene::Scene;

/// Children and parents of the nodes that place something.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    /// Nodes without a parent, in the file's order.
    pub roots: Vec<u32>,
    /// By node.
    children: Vec<Vec<u32>>,
    parents: Vec<Option<u32>>,
    /// The file shows something of what hangs on the node.
    shown: Vec<bool>,
}

impl Tree {
    /// The tree of all nodes that place triangles, or on which such a node hangs.
    pub fn new(nodes: &[SceneNode], scene: &Scene) -> Self {
        let mut kept = vec![false; nodes.len()];
        for instance in &scene.instances {
            let mut next = Some(instance.node);
            while let Some(node) = next {
                match kept.get_mut(node as usize) {
                    Some(kept) if !*kept => *kept = true,
                    _ => break,
                }
                next = nodes[node as usize].parent;
            }
        }
        let mut tree = Self {
            roots: Vec::new(),
            children: vec![Vec::new(); nodes.len()],
            parents: nodes.iter().map(|node| node.parent).collect(),
            shown: Vec::new(),
        };
        for (index, node) in (0u32..).zip(nodes).filter(|(index, _)| kept[*index as usize]) {
            match node.parent.and_then(|parent| tree.children.get_mut(parent as usize)) {
                Some(siblings) => siblings.push(index),
                None => tree.roots.push(index),
            }
        }
        let mut shown = vec![false; nodes.len()];
        for instance in scene.instances.iter().filter(|instance| instance.visible) {
            for node in tree.line(instance.node) {
                match shown.get_mut(node as usize) {
                    Some(shown) if !*shown => *shown = true,
                    _ => break,
                }
            }
        }
        tree.shown = shown;
        tree
    }

    /// Whether the file shows a node: anything of what hangs on it.
    pub fn is_shown_in_file(&self, node: u32) -> bool {
        self.shown.get(node as usize).copied().unwrap_or(true)
    }

    /// What hangs on a node.
    pub fn children(&self, node: u32) -> &[u32] {
        self.children.get(node as usize).map_or(&[], Vec::as_slice)
    }

    /// What a node hangs on.
    pub fn parent(&self, node: u32) -> Option<u32> {
        self.parents.get(node as usize).copied().flatten()
    }

    /// A node and all that it hangs on, from itself up.
    pub fn line(&self, node: u32) -> impl Iterator<Item = u32> + '_ {
        std::iter::successors(Some(node), |node| self.parent(*node))
    }

    /// A node and all that hangs on it.
    pub fn below(&self, node: u32) -> Vec<u32> {
        let mut below = vec![node];
        let mut next = 0;
        while let Some(&node) = below.get(next) {
            below.extend(self.children(node));
            next += 1;
        }
        below
    }
}

/// The nodes with their origins moved to where one takes hold of them: see [`Document::nodes`](super::Document::nodes).
pub(super) fn with_pivots(nodes: &[SceneNode], tree: &Tree, scene: &Scene) -> Vec<SceneNode> {
    let boxes: Vec<(Vec3, Vec3)> = scene
        .meshes
        .iter()
        .map(|mesh| mesh.positions.iter().fold((Vec3::MAX, Vec3::MIN), |(low, high), &p| (low.min(p), high.max(p))))
        .collect();
    let mut bounds = vec![(Vec3::MAX, Vec3::MIN); nodes.len()];
    for instance in &scene.instances {
        let Some(&(low, high)) = boxes.get(instance.mesh as usize).filter(|(low, high)| low.x <= high.x) else {
            continue;
        };
        for corner in 0..8_u32 {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
            let point = instance.world_from_mesh.transform_point3(Vec3::new(pick(0), pick(1), pick(2)));
            for node in tree.line(instance.node) {
                if let Some((low, high)) = bounds.get_mut(node as usize) {
                    (*low, *high) = (low.min(point), high.max(point));
                }
            }
        }
    }
    let pivoted = nodes.iter().zip(bounds).map(|(node, (low, high))| {
        let origin = Vec3::from(node.world_from_node.translation);
        let inside = origin.cmpge(low).all() && origin.cmple(high).all();
        let mut node = node.clone();
        if !inside && low.x <= high.x {
            node.world_from_node.translation = ((low + high) * 0.5).into();
        }
        node
    });
    pivoted.collect()
}

/// What a part is called: its name, and which of those that share it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PartName {
    /// May be empty.
    pub name: String,
    /// 0 for the first of that name.
    pub occurrence: u32,
}

impl PartName {
    /// What it is, and its name: on one line, whatever the file says.
    pub fn part(&self, kind: &str) -> String {
        format!("{kind} '{}'", self.name.replace(['\n', '\r'], " "))
    }
}

/// The names of a list of parts, in order.
pub fn part_names<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<PartName> {
    let mut counts: HashMap<&str, u32> = HashMap::new();
    names
        .into_iter()
        .map(|name| {
            let count = counts.entry(name).or_default();
            *count += 1;
            PartName { name: name.to_owned(), occurrence: *count - 1 }
        })
        .collect()
}
