//! Two-level bounding volume hierarchy by obvhs: one per mesh, one over the instances.

use std::sync::Arc;

use glam::{Affine3A, Vec3, Vec3A};
use obvhs::{
    Boundable, BvhBuildParams,
    aabb::Aabb,
    bvh2::builder::build_bvh2,
    cwbvh::{CwBvh, builder::build_cwbvh, node::CwBvhNode},
    triangle::Triangle,
};

use crate::gpu::Gpu;

mod binary;

/// Metres. Boxes end here: from areas of larger ones, which overflow in f32, no hierarchy can be built. What reaches beyond is hit
/// only within, if at all.
pub const LARGEST_COORDINATE: f32 = 1e15;

/// A node as the kernels read it, of either kind of hierarchy: a CWBVH's, or a pair of children.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Node([u32; 20]);

const _: () = assert!(size_of::<CwBvhNode>() == size_of::<Node>());

/// How many children a node has. Rays meet the same in both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum HierarchyKind {
    /// Eight, compressed (CWBVH, Ylitie et al. 2017): few loads, much arithmetic for each.
    #[default]
    Wide,
    /// Two, as they are: for adapters on which arithmetic on packed bytes is slow.
    Binary,
}

impl HierarchyKind {
    /// What measured faster on adapters of this kind (docs/ARCHITECTURE.md).
    pub fn preferred_on(gpu: &Gpu) -> Self {
        if gpu.info().name.contains("SwiftShader") { Self::Binary } else { Self::Wide }
    }

    /// Builds over primitives: nodes, leaf order, bounds and levels.
    fn build<T: Boundable>(self, primitives: &[T]) -> Built {
        let mut build_time = std::time::Duration::default();
        match self {
            Self::Wide => {
                let bvh = build_cwbvh(primitives, build_params(), &mut build_time);
                let nodes = bytemuck::cast_slice(&bvh.nodes).to_vec();
                Built { nodes, depth: depth(&bvh), bounds: bvh.total_aabb, order: bvh.primitive_indices }
            }
            Self::Binary => binary::encode(build_bvh2(primitives, build_params(), &mut build_time)),
        }
    }
}

/// A hierarchy in the kernels' layout.
struct Built {
    nodes: Vec<Node>,
    order: Vec<u32>,
    bounds: Aabb,
    depth: u32,
}

/// The hierarchy of one mesh: its nodes, and its triangles in the order of the leaves.
#[derive(Debug)]
pub struct Blas {
    /// What its nodes are.
    pub kind: HierarchyKind,
    /// Indices of children and primitives count from zero.
    pub nodes: Vec<Node>,
    /// Leaf order to index of the triangle it was built from.
    pub triangle_order: Vec<u32>,
    /// Bounds in mesh space.
    pub bounds: Aabb,
    /// Levels of nodes, at least 1.
    pub depth: u32,
}

/// The hierarchy over the visible instances.
#[derive(Debug)]
pub struct Tlas {
    /// Indices of children and primitives count from zero.
    pub nodes: Vec<Node>,
    /// Leaf order to index of the entry it was built from.
    pub order: Vec<u32>,
    /// Levels of nodes, at least 1.
    pub depth: u32,
}

/// A hierarchy placed in the world.
#[derive(Clone, Debug)]
pub struct TlasEntry {
    /// Placement.
    pub world_from_mesh: Affine3A,
    /// What is placed.
    pub blas: Arc<Blas>,
    /// The scene's instance; `None` for the static mesh.
    pub source: Option<u32>,
}

impl Blas {
    /// Builds the hierarchy of an indexed triangle list. Triangles are not split, so each appears once.
    pub fn build(kind: HierarchyKind, positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let triangles: Vec<Triangle> = triangles
            .iter()
            .map(|corners| {
                let [v0, v1, v2] = corners.map(|i| within_limit(Vec3A::from(positions[i as usize])));
                Triangle { v0, v1, v2 }
            })
            .collect();
        let Built { nodes, order, bounds, depth } = kind.build(&triangles);
        Self { kind, nodes, triangle_order: order, bounds, depth }
    }
}

impl Tlas {
    /// Builds the hierarchy over placed ones.
    pub fn build(kind: HierarchyKind, entries: &[TlasEntry]) -> Self {
        if entries.is_empty() {
            return Self { nodes: vec![Node::default()], order: Vec::new(), depth: 1 };
        }
        let bounds: Vec<Aabb> =
            entries.iter().map(|entry| transformed_bounds(&entry.blas.bounds, &entry.world_from_mesh)).collect();
        let Built { nodes, order, depth, .. } = kind.build(&bounds);
        Self { nodes, order, depth }
    }
}

/// Bounds of a transformed box, widened by the rounding of the transform in f32.
pub fn transformed_bounds(bounds: &Aabb, world_from_mesh: &Affine3A) -> Aabb {
    let centre = (bounds.min + bounds.max) * 0.5;
    let half = (bounds.max - bounds.min) * 0.5;
    let m = world_from_mesh.matrix3;
    let new_half = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
    let new_centre = world_from_mesh.transform_point3a(centre);
    let slack = (new_centre.abs() + new_half + world_from_mesh.translation.abs()) * 1e-6;
    Aabb::new(within_limit(new_centre - new_half - slack), within_limit(new_centre + new_half + slack))
}

fn within_limit(point: Vec3A) -> Vec3A {
    point.clamp(Vec3A::splat(-LARGEST_COORDINATE), Vec3A::splat(LARGEST_COORDINATE))
}

/// Good traversal for a moderate build time; no spatial splits, because lights refer to triangles by leaf order.
const fn build_params() -> BvhBuildParams {
    BvhBuildParams { pre_split: false, max_prims_per_leaf: 3, ..BvhBuildParams::medium_build() }
}

fn depth(bvh: &CwBvh) -> u32 {
    let mut deepest = 1;
    let mut pending = vec![(0, 1)];
    while let Some((index, level)) = pending.pop() {
        let Some(node) = bvh.nodes.get(index as usize) else { continue };
        deepest = deepest.max(level);
        let children = node.imask.count_ones();
        pending.extend((0..children).map(|child| (node.child_base_idx + child, level + 1)));
    }
    deepest
}

/// Shifts a hierarchy's indices so that it can stand among others in one buffer.
pub fn rebased(kind: HierarchyKind, nodes: &[Node], node_base: u32, primitive_base: u32) -> impl Iterator<Item = Node> {
    nodes.iter().map(move |node| match kind {
        HierarchyKind::Wide => {
            let node: CwBvhNode = bytemuck::cast(*node);
            bytemuck::cast(CwBvhNode {
                child_base_idx: node.child_base_idx + node_base,
                primitive_base_idx: node.primitive_base_idx + primitive_base,
                ..node
            })
        }
        HierarchyKind::Binary => binary::rebased(*node, node_base, primitive_base),
    })
}
