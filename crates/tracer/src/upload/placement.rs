//! Where instances are placed: the upper level of the hierarchy and the instance table.

use glam::{Affine3A, Mat3A};

use super::geometry::{Shapes, Split};
use crate::{
    bvh::{HierarchyKind, Node, Tlas, TlasEntry, rebased},
    kernels::layout::{self, codes},
    scene::{Instance, Scene},
};

/// Instances in the kernels' layout.
pub(super) struct Placement {
    /// Of the upper level; they stand behind the shapes' nodes, from `root` on.
    pub nodes: Vec<Node>,
    /// Entries of the upper level in leaf order, room for the hidden ones, then the parts of the static mesh.
    pub instances: Vec<layout::Instance>,
    /// Scene instance of each entry; `None` for the static mesh as a whole and for hidden ones.
    pub sources: Vec<Option<u32>>,
    /// Node that traversal starts at: of the upper level, or of the only hierarchy when nothing is placed.
    pub root: u32,
    /// Nothing is placed: there is one level only.
    pub is_single_level: bool,
    /// Entries that the traversal stack needs.
    pub stack_size: u32,
}

impl Placement {
    pub(super) fn of(scene: &Scene, split: &Split, kind: HierarchyKind, shapes: &Shapes, upper_root: u32) -> Self {
        let visible = split.placed.iter().copied().filter(|&i| scene.instances[i as usize].visible);
        let mut roots = Vec::new();
        let mut entries = Vec::new();
        for source in visible {
            let instance = &scene.instances[source as usize];
            let Some(piece) = split.piece_of(instance.mesh).and_then(|piece| shapes.pieces.get(piece)) else {
                continue;
            };
            roots.push(piece.root);
            let world_from_mesh = instance.world_from_mesh;
            entries.push(TlasEntry { world_from_mesh, blas: piece.blas.clone(), source: Some(source) });
        }
        if let (false, Some(piece)) = (split.fixed.is_empty(), shapes.pieces.last()) {
            roots.push(piece.root);
            entries.push(TlasEntry { world_from_mesh: Affine3A::IDENTITY, blas: piece.blas.clone(), source: None });
        }
        let tlas = Tlas::build(kind, &entries);
        let deepest = shapes.pieces.iter().map(|piece| piece.blas.depth).max().unwrap_or(1);
        let is_single_level = split.placed.is_empty() && !split.fixed.is_empty();
        let mut placement = Self {
            nodes: Vec::new(),
            instances: Vec::with_capacity(split.first_part() as usize + split.fixed.len()),
            sources: Vec::new(),
            root: 0,
            is_single_level,
            stack_size: deepest.next_multiple_of(4),
        };
        for &order in &tlas.order {
            let entry = &entries[order as usize];
            let instance = entry.source.map(|source| &scene.instances[source as usize]);
            placement.push(instance, &entry.world_from_mesh, roots[order as usize], entry.source);
        }
        while placement.instances.len() < split.first_part() as usize {
            placement.push(None, &Affine3A::IDENTITY, codes::NONE, None);
        }
        for &source in &split.fixed {
            let instance = &scene.instances[source as usize];
            placement.push(Some(instance), &Affine3A::IDENTITY, codes::NONE, Some(source));
        }
        if !is_single_level {
            placement.root = upper_root;
            placement.nodes = rebased(kind, &tlas.nodes, placement.root, 0).collect();
            // Each level leaves at most one group behind, and entering a mesh leaves two.
            placement.stack_size = (tlas.depth + deepest + 2).next_multiple_of(4);
        }
        placement
    }

    fn push(&mut self, instance: Option<&Instance>, world_from_mesh: &Affine3A, root_node: u32, source: Option<u32>) {
        self.instances.push(encode_instance(instance, world_from_mesh, root_node));
        self.sources.push(source);
    }
}

/// To an eighth of its own size at most: the root is a constant of the kernels, and a shape more or less must not compile others.
pub(super) fn rounded_up(nodes: u32) -> u32 {
    nodes.next_multiple_of((nodes / 16).next_power_of_two())
}

fn encode_instance(instance: Option<&Instance>, world_from_mesh: &Affine3A, root_node: u32) -> layout::Instance {
    let mirrored = world_from_mesh.matrix3.determinant() < 0.0;
    let flag = |set: bool, bit: u32| if set { bit } else { 0 };
    layout::Instance {
        world_from_mesh: rows(world_from_mesh),
        mesh_from_world: rows(&world_from_mesh.inverse()),
        root_node,
        material: instance.map_or(codes::NONE, |i| i.material),
        first_light: codes::NONE,
        flags: flag(mirrored, codes::INSTANCE_MIRRORED) | flag(instance.is_none(), codes::INSTANCE_STATIC),
    }
}

fn rows(m: &Affine3A) -> [[f32; 4]; 3] {
    let t = m.translation;
    let r: Mat3A = m.matrix3.transpose();
    [r.x_axis.extend(t.x).to_array(), r.y_axis.extend(t.y).to_array(), r.z_axis.extend(t.z).to_array()]
}
