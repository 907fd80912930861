//! Shapes for the kernels: hierarchies, triangles and vertices of the meshes, apart from where instances are placed.
//!
//! A mesh that is placed once, or is small, becomes part of one *static* mesh in world space. Two-level hierarchies over
//! the interleaved, building-sized meshes of real scenes cost 2 to 4 times the traversal (docs/ARCHITECTURE.md).
//! Meshes that are placed often, and instances that were moved, keep a hierarchy of their own, and the upper level places them.

use std::{collections::HashMap, sync::Arc};

use glam::Vec3;
use rayon::prelude::*;

use super::vertices;
use crate::{
    bvh::{Blas, HierarchyKind, Node, rebased},
    kernels::layout::{self, codes},
    scene::{AlphaMode, ContentHash, Instance, Mesh, Scene},
};

/// A mesh placed more than once still joins the static mesh while its copies have at most this many triangles together.
const LARGEST_COPIED: usize = 1 << 15;

/// Hierarchies by content, kept between scene versions.
pub(super) type BlasCache = HashMap<ContentHash, Arc<Blas>>;

/// Which instances join the static mesh. All indices are into the scene's instances, in ascending order.
pub(super) struct Split {
    /// Visible, of the static mesh.
    pub fixed: Vec<u32>,
    /// With a hierarchy of their mesh; some may be hidden.
    pub placed: Vec<u32>,
    /// Meshes of those.
    meshes: Vec<u32>,
}

/// A run of the scene that has one hierarchy: the static mesh, or a mesh that is placed often.
struct Piece {
    hash: ContentHash,
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    vertices: Vec<layout::Vertex>,
    /// Per triangle: its number in the mesh that it came from, and [`codes::TRIANGLE_ALPHA`] where a hit needs a test.
    numbers: Vec<u32>,
}

/// A hierarchy among the others.
#[derive(Debug)]
pub(super) struct PlacedBlas {
    /// Its root in the buffer of nodes.
    pub root: u32,
    pub blas: Arc<Blas>,
    triangles: std::ops::Range<u32>,
}

/// Shapes in the kernels' layout.
#[derive(Debug)]
pub(super) struct Shapes {
    pub nodes: Vec<Node>,
    /// Nine coordinates a triangle, in leaf order.
    pub positions: Vec<[f32; 9]>,
    /// Per triangle: its three vertices, and its number in its mesh with [`codes::TRIANGLE_ALPHA`].
    pub triangles: Vec<[u32; 4]>,
    pub vertices: Vec<layout::Vertex>,
    /// Of each placed mesh in ascending order, then of the static mesh if there is one; so their roots ascend too.
    pub pieces: Vec<PlacedBlas>,
}

impl Split {
    /// Of a scene whose `loose` instances are kept apart.
    pub(super) fn of(scene: &Scene, loose: &std::collections::BTreeSet<u32>) -> Self {
        let mut uses = vec![0usize; scene.meshes.len()];
        for instance in scene.instances.iter().filter(|i| i.visible) {
            uses[instance.mesh as usize] += 1;
        }
        let is_fixed = |i: &u32| {
            let mesh = scene.instances[*i as usize].mesh as usize;
            !loose.contains(i) && (uses[mesh] <= 1 || uses[mesh] * scene.meshes[mesh].triangles.len() <= LARGEST_COPIED)
        };
        let used = |i: &u32| scene.instances[*i as usize].visible || loose.contains(i);
        let (fixed, placed): (Vec<u32>, Vec<u32>) = (0..scene.instances.len() as u32).filter(used).partition(is_fixed);
        let mut meshes: Vec<u32> = placed.iter().map(|&i| scene.instances[i as usize].mesh).collect();
        meshes.sort_unstable();
        meshes.dedup();
        Self { fixed, placed, meshes }
    }

    /// Entries of the instance table before the static mesh's parts.
    pub(super) fn first_part(&self) -> u32 {
        (self.placed.len() + usize::from(!self.fixed.is_empty())) as u32
    }

    /// What the shapes depend on. The places of the placed ones do not count.
    pub(super) fn shapes_hash(&self, scene: &Scene) -> ContentHash {
        let mut bytes = self.first_part().to_le_bytes().to_vec();
        for &i in &self.fixed {
            let instance = &scene.instances[i as usize];
            bytes.extend(scene.meshes[instance.mesh as usize].hash.0.to_le_bytes());
            bytes.extend(bytemuck::cast_slice(&instance.world_from_mesh.to_cols_array()));
            bytes.push(u8::from(passes_light(scene, instance)));
        }
        bytes.extend(b"placed");
        let passing = meshes_passing_light(scene);
        for &mesh in &self.meshes {
            bytes.extend(scene.meshes[mesh as usize].hash.0.to_le_bytes());
            bytes.push(u8::from(passing[mesh as usize]));
        }
        ContentHash::of(&[&bytes])
    }

    /// Index of the piece of a mesh that is placed.
    pub(super) fn piece_of(&self, mesh: u32) -> Option<usize> {
        self.meshes.binary_search(&mesh).ok()
    }
}

impl Shapes {
    pub(super) fn build(scene: &Scene, split: &Split, kind: HierarchyKind, cache: &mut BlasCache) -> Self {
        let passing = meshes_passing_light(scene);
        let own = split.meshes.par_iter().map(|&m| own_piece(&scene.meshes[m as usize], passing[m as usize]));
        let mut pieces: Vec<Piece> = own.collect();
        if !split.fixed.is_empty() {
            pieces.push(static_piece(scene, &split.fixed, split.first_part()));
        }
        let blas = build_hierarchies(&pieces, kind, cache);
        let mut shapes = Self {
            nodes: Vec::with_capacity(blas.iter().map(|b| b.nodes.len()).sum()),
            positions: Vec::with_capacity(blas.iter().map(|b| b.triangle_order.len()).sum()),
            triangles: Vec::with_capacity(blas.iter().map(|b| b.triangle_order.len()).sum()),
            vertices: Vec::with_capacity(pieces.iter().map(|p| p.vertices.len()).sum()),
            pieces: Vec::with_capacity(pieces.len()),
        };
        for (piece, blas) in pieces.iter().zip(blas) {
            shapes.push_piece(piece, blas);
        }
        shapes
    }

    /// Number in its mesh and slot of every triangle of the piece whose root node this is.
    pub(super) fn slots_below(&self, root: u32) -> impl Iterator<Item = (u32, u32)> + '_ {
        let piece = self.pieces.binary_search_by_key(&root, |piece| piece.root);
        let range = piece.map_or(0..0, |piece| self.pieces[piece].triangles.clone());
        range.map(|slot| (self.triangles[slot as usize][3] & !codes::TRIANGLE_ALPHA, slot))
    }

    /// Appends a piece in the leaf order of its hierarchy.
    fn push_piece(&mut self, piece: &Piece, blas: Arc<Blas>) {
        let root = self.nodes.len() as u32;
        let first_vertex = self.vertices.len() as u32;
        self.nodes.extend(rebased(blas.kind, &blas.nodes, root, self.triangles.len() as u32));
        for &t in &blas.triangle_order {
            let corners = piece.triangles[t as usize];
            let mut flat = [0.0; 9];
            for (out, &v) in flat.chunks_exact_mut(3).zip(&corners) {
                out.copy_from_slice(&piece.positions[v as usize].to_array());
            }
            self.positions.push(flat);
            let [a, b, c] = corners.map(|v| v + first_vertex);
            self.triangles.push([a, b, c, piece.numbers[t as usize]]);
        }
        self.vertices.extend_from_slice(&piece.vertices);
        let end = self.triangles.len() as u32;
        let triangles = end - blas.triangle_order.len() as u32..end;
        self.pieces.push(PlacedBlas { root, blas, triangles });
    }
}

/// The pieces' hierarchies; builds those that are new on all cores and forgets unused ones.
fn build_hierarchies(pieces: &[Piece], kind: HierarchyKind, cache: &mut BlasCache) -> Vec<Arc<Blas>> {
    let known = &*cache;
    let build = |p: &Piece| Arc::new(Blas::build(kind, &p.positions, &p.triangles));
    let blas: Vec<Arc<Blas>> =
        pieces.par_iter().map(|p| known.get(&p.hash).cloned().unwrap_or_else(|| build(p))).collect();
    *cache = pieces.iter().zip(&blas).map(|(piece, blas)| (piece.hash, blas.clone())).collect();
    blas
}

fn own_piece(mesh: &Mesh, passes_light: bool) -> Piece {
    Piece {
        hash: mesh.hash,
        positions: mesh.positions.clone(),
        triangles: mesh.triangles.clone(),
        vertices: vertices::encode(mesh, None, codes::NONE).collect(),
        numbers: numbers(mesh, passes_light),
    }
}

fn numbers(mesh: &Mesh, passes_light: bool) -> Vec<u32> {
    let flag = if passes_light { codes::TRIANGLE_ALPHA } else { 0 };
    (0..mesh.triangles.len() as u32).map(|number| number | flag).collect()
}

/// For each mesh, whether some instance of it passes light.
fn meshes_passing_light(scene: &Scene) -> Vec<bool> {
    let mut passing = vec![false; scene.meshes.len()];
    for instance in scene.instances.iter().filter(|i| passes_light(scene, i)) {
        passing[instance.mesh as usize] = true;
    }
    passing
}

fn passes_light(scene: &Scene, instance: &Instance) -> bool {
    let material = &scene.materials[instance.material as usize];
    material.alpha_mode != AlphaMode::Opaque || material.is_clear_sheet()
}

/// All fixed instances in world space; their entries in the instance table follow the `first_part` others.
fn static_piece(scene: &Scene, fixed: &[u32], first_part: u32) -> Piece {
    let parts: Vec<Piece> = fixed
        .par_iter()
        .enumerate()
        .map(|(part, &source)| {
            let instance = &scene.instances[source as usize];
            let mesh = &scene.meshes[instance.mesh as usize];
            let mirrored = instance.world_from_mesh.matrix3.determinant() < 0.0;
            let matrix = instance.world_from_mesh.to_cols_array();
            Piece {
                hash: mesh.hash.mix(bytemuck::cast_slice(&matrix)),
                positions: mesh.positions.iter().map(|&p| instance.world_from_mesh.transform_point3(p)).collect(),
                // A mirror reverses the winding; in world space the order of corners says the same.
                triangles: mesh
                    .triangles
                    .iter()
                    .map(|&[a, b, c]| if mirrored { [a, c, b] } else { [a, b, c] })
                    .collect(),
                vertices: vertices::encode(mesh, Some(&instance.world_from_mesh), first_part + part as u32).collect(),
                numbers: numbers(mesh, passes_light(scene, instance)),
            }
        })
        .collect();
    let mut whole = Piece {
        hash: ContentHash::of(&[b"static"]),
        positions: Vec::with_capacity(parts.iter().map(|p| p.positions.len()).sum()),
        triangles: Vec::with_capacity(parts.iter().map(|p| p.triangles.len()).sum()),
        vertices: Vec::with_capacity(parts.iter().map(|p| p.vertices.len()).sum()),
        numbers: Vec::with_capacity(parts.iter().map(|p| p.numbers.len()).sum()),
    };
    for part in parts {
        let base = whole.positions.len() as u32;
        whole.hash = whole.hash.mix(&part.hash.0.to_le_bytes());
        whole.positions.extend_from_slice(&part.positions);
        whole.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + base)));
        whole.vertices.extend_from_slice(&part.vertices);
        whole.numbers.extend_from_slice(&part.numbers);
    }
    whole
}
