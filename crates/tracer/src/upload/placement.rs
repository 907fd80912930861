//! Where instances are placed: the upper level of the hierarchy and the instance table.

use glam::{Affine3A, Mat3A};

use super::geometry::{Shapes, Split, meshes_passing_light, placed_hash};
use crate::{
    bvh::{HierarchyKind, Node, Tlas, TlasEntry, rebased},
    kernels::layout::{self, codes},
    scene::{Instance, Scene},
};

/// Instances in the kernels' layout.
pub(super) struct Placement {
    /// Of the upper level; they stand behind the shapes' nodes.
    pub nodes: Vec<Node>,
    /// The parts of the static mesh, then the entries of the upper level in leaf order.
    pub instances: Vec<layout::Instance>,
    /// Scene instance of each entry; `None` for the static mesh as a whole and for what has left it.
    pub sources: Vec<Option<u32>>,
    /// Nothing is placed: there is one level only.
    pub is_single_level: bool,
    /// Entries that the traversal stack needs.
    pub stack_size: u32,
}

impl Placement {
    pub(super) fn of(scene: &Scene, split: &Split, kind: HierarchyKind, shapes: &Shapes) -> Self {
        let passing = meshes_passing_light(scene);
        let visible = split.placed.iter().copied().filter(|&i| scene.instances[i as usize].visible);
        let mut roots = Vec::new();
        let mut entries = Vec::new();
        for source in visible {
            let instance = &scene.instances[source as usize];
            let Some(piece) = shapes.placed(placed_hash(scene, instance.mesh, &passing)) else { continue };
            roots.push(piece.root);
            let world_from_mesh = instance.world_from_mesh;
            entries.push(TlasEntry { world_from_mesh, blas: piece.blas.clone(), source: Some(source) });
        }
        if let (false, Some(piece)) = (split.fixed.is_empty(), &shapes.static_mesh) {
            roots.push(piece.root);
            entries.push(TlasEntry { world_from_mesh: Affine3A::IDENTITY, blas: piece.blas.clone(), source: None });
        }
        let tlas = Tlas::build(kind, &entries);
        let is_single_level = split.placed.is_empty() && !split.fixed.is_empty();
        // Each level leaves at most one group behind, and entering a mesh leaves two.
        let groups = if is_single_level { shapes.depth() } else { tlas.depth + shapes.depth() + 2 };
        let mut placement = Self {
            nodes: Vec::new(),
            instances: Vec::with_capacity(shapes.parts.len() + entries.len()),
            sources: Vec::new(),
            is_single_level,
            stack_size: groups.next_multiple_of(4),
        };
        for part in &shapes.parts {
            let source = (!part.is_gone).then_some(part.source);
            let instance = source.map(|source| &scene.instances[source as usize]);
            placement.push(instance, &Affine3A::IDENTITY, codes::NONE, source);
        }
        if is_single_level {
            return placement;
        }
        placement.nodes = rebased(kind, &tlas.nodes, shapes.node_count, shapes.parts.len() as u32).collect();
        for &order in &tlas.order {
            let entry = &entries[order as usize];
            let instance = entry.source.map(|source| &scene.instances[source as usize]);
            placement.push(instance, &entry.world_from_mesh, roots[order as usize], entry.source);
        }
        placement
    }

    fn push(&mut self, instance: Option<&Instance>, world_from_mesh: &Affine3A, root_node: u32, source: Option<u32>) {
        self.instances.push(encode_instance(instance, world_from_mesh, root_node));
        self.sources.push(source);
    }
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
