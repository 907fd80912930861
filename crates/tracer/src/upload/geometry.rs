//! Geometry for the kernels: hierarchies, triangles, vertices and instances.
//!
//! A mesh that is placed once, or is small, becomes part of one *static* mesh in world space. Two-level hierarchies over
//! the interleaved, building-sized meshes of real scenes cost 2 to 4 times the traversal (docs/reports/traversal.md).
//! Meshes that are placed often keep a hierarchy of their own, and the upper level places them.

use std::{collections::HashMap, sync::Arc};

use glam::{Affine3A, Mat3A, Vec3};
use obvhs::cwbvh::node::CwBvhNode;
use rayon::prelude::*;

use super::vertices;
use crate::{
    bvh::{Blas, Tlas, TlasEntry, rebased},
    kernels::layout::{self, codes},
    scene::{AlphaMode, ContentHash, Instance, Mesh, Scene},
};

/// A mesh placed more than once still joins the static mesh while its copies have at most this many triangles together.
const LARGEST_COPIED: usize = 1 << 15;

/// Hierarchies by content, kept between scene versions.
#[derive(Debug, Default)]
pub struct BlasCache(HashMap<ContentHash, Arc<Blas>>);

/// A run of the scene that has one hierarchy: the static mesh, or a mesh that is placed often.
struct Piece {
    hash: ContentHash,
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    vertices: Vec<layout::Vertex>,
    /// Per triangle: its number in the mesh that it came from, and [`codes::TRIANGLE_ALPHA`] where a hit needs a test.
    numbers: Vec<u32>,
}

/// Geometry in the kernels' layout.
pub(super) struct Geometry {
    pub nodes: Vec<CwBvhNode>,
    /// Nine coordinates a triangle, in leaf order.
    pub positions: Vec<[f32; 9]>,
    /// Per triangle: its three vertices, and its number in its mesh with [`codes::TRIANGLE_ALPHA`].
    pub triangles: Vec<[u32; 4]>,
    pub vertices: Vec<layout::Vertex>,
    /// Entries of the upper level in leaf order, then the parts of the static mesh.
    pub instances: Vec<layout::Instance>,
    /// Scene instance of each entry; `None` for the static mesh as a whole.
    pub sources: Vec<Option<u32>>,
    /// Node that traversal starts at: of the upper level, or of the only hierarchy when nothing is instanced.
    pub root: u32,
    /// Nothing is instanced: there is one level only.
    pub is_single_level: bool,
    /// Entries that the traversal stack needs.
    pub stack_size: u32,
    /// Root node and triangles of each piece.
    pieces: Vec<(u32, std::ops::Range<u32>)>,
}

impl Geometry {
    pub(super) fn build(scene: &Scene, cache: &mut BlasCache) -> Self {
        let (fixed, placed) = split(scene);
        let mut meshes: Vec<u32> = placed.iter().map(|&i| scene.instances[i as usize].mesh).collect();
        meshes.sort_unstable();
        meshes.dedup();

        // Entries of the upper level, in scene order for now; part numbers are known once the leaf order is.
        let entry_count = placed.len() + usize::from(!fixed.is_empty());
        let mut pieces: Vec<Piece> = meshes.par_iter().map(|&m| own_piece(scene, m)).collect();
        if !fixed.is_empty() {
            pieces.push(static_piece(scene, &fixed, entry_count as u32));
        }
        let blas = cache.build(&pieces);

        let mut geometry = Self {
            nodes: Vec::with_capacity(blas.iter().map(|b| b.nodes.len()).sum()),
            positions: Vec::with_capacity(blas.iter().map(|b| b.triangle_order.len()).sum()),
            triangles: Vec::with_capacity(blas.iter().map(|b| b.triangle_order.len()).sum()),
            vertices: Vec::with_capacity(pieces.iter().map(|p| p.vertices.len()).sum()),
            instances: Vec::new(),
            sources: Vec::new(),
            root: 0,
            is_single_level: placed.is_empty() && !fixed.is_empty(),
            stack_size: 0,
            pieces: Vec::new(),
        };
        let roots: Vec<u32> = pieces.iter().zip(&blas).map(|(piece, blas)| geometry.push_piece(piece, blas)).collect();
        let deepest = blas.iter().map(|b| b.depth).max().unwrap_or(1);

        let mut entries: Vec<TlasEntry> = placed
            .iter()
            .map(|&source| {
                let instance = &scene.instances[source as usize];
                let piece = meshes.binary_search(&instance.mesh).expect("every placed mesh has a piece");
                TlasEntry { world_from_mesh: instance.world_from_mesh, blas: blas[piece].clone(), source: Some(source) }
            })
            .collect();
        if let (false, Some(blas)) = (fixed.is_empty(), blas.last()) {
            entries.push(TlasEntry { world_from_mesh: Affine3A::IDENTITY, blas: blas.clone(), source: None });
        }
        let tlas = Tlas::build(&entries);
        for &order in &tlas.order {
            let entry = &entries[order as usize];
            let (root, instance) = match entry.source {
                Some(source) => {
                    let instance = &scene.instances[source as usize];
                    (roots[meshes.binary_search(&instance.mesh).expect("found above")], Some(instance))
                }
                None => (*roots.last().expect("the static piece is the last"), None),
            };
            geometry.instances.push(encode_instance(instance, &entry.world_from_mesh, root));
            geometry.sources.push(entry.source);
        }
        for &source in &fixed {
            let instance = &scene.instances[source as usize];
            geometry.instances.push(encode_instance(Some(instance), &Affine3A::IDENTITY, codes::NONE));
            geometry.sources.push(Some(source));
        }
        if geometry.is_single_level {
            geometry.root = roots[0];
            geometry.stack_size = deepest.next_multiple_of(4);
        } else {
            geometry.root = geometry.nodes.len() as u32;
            geometry.nodes.extend(rebased(&tlas.nodes, geometry.root, 0));
            // Each level leaves at most one group behind, and entering a mesh leaves two.
            geometry.stack_size = (tlas.depth + deepest + 2).next_multiple_of(4);
        }
        geometry
    }

    /// Number in its mesh and slot of every triangle of the piece whose root node this is.
    pub(super) fn slots_below(&self, root: u32) -> impl Iterator<Item = (u32, u32)> + '_ {
        let range = self.pieces.iter().find(|(r, _)| *r == root).map_or(0..0, |(_, range)| range.clone());
        range.map(|slot| (self.triangles[slot as usize][3] & !codes::TRIANGLE_ALPHA, slot))
    }

    /// Appends a piece in the leaf order of its hierarchy; returns the index of its root node.
    fn push_piece(&mut self, piece: &Piece, blas: &Blas) -> u32 {
        let root = self.nodes.len() as u32;
        let first_vertex = self.vertices.len() as u32;
        self.nodes.extend(rebased(&blas.nodes, root, self.triangles.len() as u32));
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
        self.pieces.push((root, end - blas.triangle_order.len() as u32..end));
        root
    }
}

impl BlasCache {
    /// The pieces' hierarchies; builds those that are new on all cores and forgets unused ones.
    fn build(&mut self, pieces: &[Piece]) -> Vec<Arc<Blas>> {
        let known = &self.0;
        let blas: Vec<Arc<Blas>> = pieces
            .par_iter()
            .map(|p| known.get(&p.hash).cloned().unwrap_or_else(|| Arc::new(Blas::build(&p.positions, &p.triangles))))
            .collect();
        self.0 = pieces.iter().zip(&blas).map(|(piece, blas)| (piece.hash, blas.clone())).collect();
        blas
    }
}

/// Visible instances that join the static mesh, and those that stay instances.
fn split(scene: &Scene) -> (Vec<u32>, Vec<u32>) {
    let mut uses = vec![0usize; scene.meshes.len()];
    for instance in scene.instances.iter().filter(|i| i.visible) {
        uses[instance.mesh as usize] += 1;
    }
    (0..scene.instances.len() as u32).filter(|&i| scene.instances[i as usize].visible).partition(|&i| {
        let mesh = scene.instances[i as usize].mesh as usize;
        uses[mesh] == 1 || uses[mesh] * scene.meshes[mesh].triangles.len() <= LARGEST_COPIED
    })
}

fn own_piece(scene: &Scene, mesh: u32) -> Piece {
    let passes_light = scene.instances.iter().any(|i| i.mesh == mesh && passes_light(scene, i));
    let mesh = &*scene.meshes[mesh as usize];
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
