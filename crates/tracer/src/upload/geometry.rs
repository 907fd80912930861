//! Shapes for the kernels: hierarchies, triangles and vertices of the meshes, apart from where instances are placed.
//!
//! A mesh that is placed once, or is small, becomes part of one *static* mesh in world space. Two-level hierarchies over
//! the interleaved, building-sized meshes of real scenes cost 2 to 4 times the traversal (docs/ARCHITECTURE.md).
//! Meshes that are placed often, and instances that were moved, keep a hierarchy of their own, and the upper level places them.
//! What leaves the static mesh leaves degenerate triangles behind, which nothing hits: the hierarchy stays as it is.

use std::{collections::HashMap, ops::Range, sync::Arc};

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

/// A run of the scene that has one hierarchy: the static mesh, or a mesh that is placed.
struct Piece {
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
    triangles: Range<u32>,
}

/// An instance's part of the static mesh.
#[derive(Debug)]
pub(super) struct Part {
    pub source: u32,
    /// Of the mesh, its place, and whether light passes.
    hash: ContentHash,
    /// Its triangles are degenerate: the instance is placed by itself, or hidden.
    pub is_gone: bool,
    /// Its part of the static mesh's vertices.
    vertices: Range<u32>,
    triangles: usize,
}

/// Shapes in the kernels' layout.
#[derive(Debug)]
pub(super) struct Shapes {
    /// The last so many of [`Shapes::node_count`]: those that are not on the device yet.
    pub nodes: Vec<Node>,
    /// Nine coordinates a triangle, in leaf order; of the last triangles, as for the nodes.
    pub positions: Vec<[f32; 9]>,
    /// Per triangle: its three vertices, and its number in its mesh with [`codes::TRIANGLE_ALPHA`].
    pub triangles: Vec<[u32; 4]>,
    pub vertices: Vec<layout::Vertex>,
    /// Traversal starts at the first: a copy of the static mesh's root, which gives way to that of an upper level.
    pub node_count: u32,
    pub static_mesh: Option<PlacedBlas>,
    /// Of the static mesh; each has the entry of its number in the instance table.
    pub parts: Vec<Part>,
    /// Of the placed meshes, their roots ascending.
    placed: Vec<PlacedBlas>,
    /// Which of them, by [`placed_hash`].
    by_hash: HashMap<ContentHash, usize>,
}

/// Rows of the tables that shapes had before they grew, and what has left the static mesh.
pub(super) struct Growth {
    pub nodes: u32,
    pub triangles: usize,
    pub vertices: usize,
    /// Runs of triangles that have become degenerate.
    pub gone: Vec<Range<u32>>,
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

    /// Entries of the upper level, at most.
    pub(super) fn entries(&self) -> usize {
        self.placed.len() + usize::from(!self.fixed.is_empty())
    }

    /// The static mesh's parts, were it built of this.
    fn parts(&self, scene: &Scene) -> Vec<Part> {
        let mut vertices = 0;
        let part = |&source: &u32| {
            let instance = &scene.instances[source as usize];
            let mesh = &scene.meshes[instance.mesh as usize];
            let matrix = instance.world_from_mesh.to_cols_array();
            let hash = mesh.hash.mix(bytemuck::cast_slice(&matrix)).mix(&[u8::from(passes_light(scene, instance))]);
            let first = vertices;
            vertices += mesh.positions.len() as u32;
            Part { source, hash, is_gone: false, vertices: first..vertices, triangles: mesh.triangles.len() }
        };
        self.fixed.iter().map(part).collect()
    }
}

impl Shapes {
    pub(super) fn build(scene: &Scene, split: &Split, kind: HierarchyKind, cache: &mut BlasCache) -> Self {
        let mut shapes = Self {
            nodes: vec![Node::default()],
            positions: Vec::new(),
            triangles: Vec::new(),
            vertices: Vec::new(),
            node_count: 1,
            static_mesh: None,
            parts: split.parts(scene),
            placed: Vec::new(),
            by_hash: HashMap::new(),
        };
        let (hashes, mut pieces) = shapes.missing_pieces(scene, split);
        let has_static = !split.fixed.is_empty();
        if has_static {
            pieces.push(static_piece(scene, &split.fixed));
        }
        let blas = build_hierarchies(&pieces, kind, cache);
        *cache = blas.iter().cloned().collect();
        let mut blas: Vec<Arc<Blas>> = blas.into_iter().map(|(_, blas)| blas).collect();
        shapes.reserve(&pieces, &blas);
        if has_static && let (Some(piece), Some(blas)) = (pieces.last(), blas.pop()) {
            shapes.static_mesh = Some(shapes.push_piece(piece, blas));
            shapes.nodes[0] = shapes.nodes[1];
        }
        shapes.push_placed(hashes, &pieces, blas);
        shapes
    }

    /// Follows to another version of the scene by adding the meshes that are placed now and marking what has left the static mesh.
    /// `None`, with nothing changed, where that does not do: something joins the static mesh, or most of it has left.
    pub(super) fn grow(
        &mut self,
        scene: &Scene,
        split: &Split,
        kind: HierarchyKind,
        cache: &mut BlasCache,
    ) -> Option<Growth> {
        let staying = split.parts(scene);
        let mut left = staying.iter().peekable();
        let goes: Vec<bool> = self
            .parts
            .iter()
            .map(|part| left.next_if(|stays| stays.source == part.source && stays.hash == part.hash && !part.is_gone))
            .map(|stays| stays.is_none())
            .collect();
        if left.peek().is_some() {
            return None;
        }
        let gone = self.parts.iter().zip(&goes).filter(|(_, goes)| **goes);
        let all = self.static_mesh.as_ref().map_or(0..0, |piece| piece.triangles.clone());
        if gone.clone().map(|(part, _)| part.triangles).sum::<usize>() > all.len() / 2 {
            return None;
        }
        let leaving: Vec<Range<u32>> =
            gone.filter(|(part, _)| !part.is_gone).map(|(part, _)| part.vertices.clone()).collect();
        let leaves = |slot: u32| {
            let [first, ..] = self.triangles[slot as usize];
            leaving.iter().any(|vertices| vertices.contains(&first))
        };
        let gone = if leaving.is_empty() { Vec::new() } else { runs(all, leaves) };
        let growth =
            Growth { nodes: self.node_count, triangles: self.triangles.len(), vertices: self.vertices.len(), gone };
        for (part, goes) in self.parts.iter_mut().zip(goes) {
            part.is_gone = goes;
        }
        let (hashes, pieces) = self.missing_pieces(scene, split);
        let blas = build_hierarchies(&pieces, kind, cache);
        cache.extend(blas.iter().cloned());
        self.push_placed(hashes, &pieces, blas.into_iter().map(|(_, blas)| blas).collect());
        Some(growth)
    }

    /// The hierarchy of a mesh that is placed.
    pub(super) fn placed(&self, hash: ContentHash) -> Option<&PlacedBlas> {
        self.by_hash.get(&hash).and_then(|&piece| self.placed.get(piece))
    }

    /// Levels of the deepest hierarchy.
    pub(super) fn depth(&self) -> u32 {
        self.placed.iter().chain(&self.static_mesh).map(|piece| piece.blas.depth).max().unwrap_or(1)
    }

    /// Of placed meshes that have none here: what they are known by, and pieces.
    fn missing_pieces(&self, scene: &Scene, split: &Split) -> (Vec<ContentHash>, Vec<Piece>) {
        let passing = meshes_passing_light(scene);
        let mut missing: Vec<(ContentHash, u32)> =
            split.meshes.iter().map(|&mesh| (placed_hash(scene, mesh, &passing), mesh)).collect();
        missing.retain(|(hash, _)| self.placed(*hash).is_none());
        let piece_of = |&(_, mesh): &(_, u32)| own_piece(&scene.meshes[mesh as usize], passing[mesh as usize]);
        let pieces = missing.par_iter().map(piece_of).collect();
        (missing.into_iter().map(|(hash, _)| hash).collect(), pieces)
    }

    /// Number in its mesh and slot of every triangle of the piece whose root node this is.
    pub(super) fn slots_below(&self, root: u32) -> impl Iterator<Item = (u32, u32)> + '_ {
        let piece = self.placed.binary_search_by_key(&root, |piece| piece.root);
        let range = piece.map_or(0..0, |piece| self.placed[piece].triangles.clone());
        range.map(|slot| (self.triangles[slot as usize][3] & !codes::TRIANGLE_ALPHA, slot))
    }

    fn reserve(&mut self, pieces: &[Piece], blas: &[Arc<Blas>]) {
        let triangles = blas.iter().map(|b| b.triangle_order.len()).sum();
        self.nodes.reserve(blas.iter().map(|b| b.nodes.len()).sum());
        self.positions.reserve(triangles);
        self.triangles.reserve(triangles);
        self.vertices.reserve(pieces.iter().map(|p| p.vertices.len()).sum());
    }

    fn push_placed(&mut self, hashes: Vec<ContentHash>, pieces: &[Piece], blas: Vec<Arc<Blas>>) {
        for ((hash, piece), blas) in hashes.into_iter().zip(pieces).zip(blas) {
            let placed = self.push_piece(piece, blas);
            self.by_hash.insert(hash, self.placed.len());
            self.placed.push(placed);
        }
    }

    /// Appends a piece in the leaf order of its hierarchy.
    fn push_piece(&mut self, piece: &Piece, blas: Arc<Blas>) -> PlacedBlas {
        let root = self.node_count;
        let first_vertex = self.vertices.len() as u32;
        self.nodes.extend(rebased(blas.kind, &blas.nodes, root, self.triangles.len() as u32));
        self.node_count += blas.nodes.len() as u32;
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
        PlacedBlas { root, blas, triangles }
    }
}

/// Maximal runs of what `belongs`.
fn runs(within: Range<u32>, belongs: impl Fn(u32) -> bool) -> Vec<Range<u32>> {
    let mut runs: Vec<Range<u32>> = Vec::new();
    for slot in within.filter(|&slot| belongs(slot)) {
        match runs.last_mut() {
            Some(run) if run.end == slot => run.end += 1,
            _ => runs.push(slot..slot + 1),
        }
    }
    runs
}

/// The pieces' hierarchies by the hash of their corners; builds those that are new on all cores.
fn build_hierarchies(pieces: &[Piece], kind: HierarchyKind, known: &BlasCache) -> Vec<(ContentHash, Arc<Blas>)> {
    let build = |p: &Piece| Arc::new(Blas::build(kind, &p.positions, &p.triangles));
    let hierarchy = |p: &Piece| {
        let hash = p.corners_hash();
        (hash, known.get(&hash).cloned().unwrap_or_else(|| build(p)))
    };
    pieces.par_iter().map(hierarchy).collect()
}

impl Piece {
    /// Of all that a hierarchy is built from. What vertices hold beside their positions does not count, nor which triangles share
    /// them: meshes that were given tangents keep their hierarchies.
    fn corners_hash(&self) -> ContentHash {
        let corner = |&vertex: &u32| self.positions[vertex as usize];
        self.triangles.iter().fold(ContentHash::default(), |hash, triangle| {
            let corners: [Vec3; 3] = std::array::from_fn(|i| corner(&triangle[i]));
            hash.mix(bytemuck::cast_slice(&corners))
        })
    }
}

/// What the shape of a placed mesh depends on.
pub(super) fn placed_hash(scene: &Scene, mesh: u32, passing: &[bool]) -> ContentHash {
    scene.meshes[mesh as usize].hash.mix(&[u8::from(passing[mesh as usize])])
}

fn own_piece(mesh: &Mesh, passes_light: bool) -> Piece {
    Piece {
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
pub(super) fn meshes_passing_light(scene: &Scene) -> Vec<bool> {
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

/// All fixed instances in world space; their entries in the instance table come first.
fn static_piece(scene: &Scene, fixed: &[u32]) -> Piece {
    let parts: Vec<Piece> = fixed
        .par_iter()
        .enumerate()
        .map(|(part, &source)| {
            let instance = &scene.instances[source as usize];
            let mesh = &scene.meshes[instance.mesh as usize];
            let mirrored = instance.world_from_mesh.matrix3.determinant() < 0.0;
            Piece {
                positions: mesh.positions.iter().map(|&p| instance.world_from_mesh.transform_point3(p)).collect(),
                // A mirror reverses the winding; in world space the order of corners says the same.
                triangles: mesh
                    .triangles
                    .iter()
                    .map(|&[a, b, c]| if mirrored { [a, c, b] } else { [a, b, c] })
                    .collect(),
                vertices: vertices::encode(mesh, Some(&instance.world_from_mesh), part as u32).collect(),
                numbers: numbers(mesh, passes_light(scene, instance)),
            }
        })
        .collect();
    let mut whole = Piece {
        positions: Vec::with_capacity(parts.iter().map(|p| p.positions.len()).sum()),
        triangles: Vec::with_capacity(parts.iter().map(|p| p.triangles.len()).sum()),
        vertices: Vec::with_capacity(parts.iter().map(|p| p.vertices.len()).sum()),
        numbers: Vec::with_capacity(parts.iter().map(|p| p.numbers.len()).sum()),
    };
    for part in parts {
        let base = whole.positions.len() as u32;
        whole.positions.extend_from_slice(&part.positions);
        whole.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + base)));
        whole.vertices.extend_from_slice(&part.vertices);
        whole.numbers.extend_from_slice(&part.numbers);
    }
    whole
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use glam::{Affine3A, DVec3, Vec4};

    use super::*;
    use crate::scene::{Backdrop, Environment, Material};

    /// Two triangles with a seam, placed twice: by the static mesh, and by itself.
    fn scene(triangles: Vec<[u32; 3]>, tangents: Vec<Vec4>) -> Scene {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y, Vec3::X, Vec3::ONE];
        let positions = corners[..triangles.as_flattened().iter().max().map_or(0, |&last| last as usize + 1)].to_vec();
        let normals = vec![Vec3::Z; positions.len()];
        let hash = ContentHash::of(&[bytemuck::cast_slice(&triangles), bytemuck::cast_slice(&tangents)]);
        let mesh = Mesh {
            name: String::new(),
            positions,
            normals,
            tangents,
            uvs: Default::default(),
            colors: Vec::new(),
            triangles,
            hash,
        };
        let place = |x: f32| Instance {
            name: String::new(),
            mesh: 0,
            material: 0,
            world_from_mesh: Affine3A::from_translation(Vec3::new(x, 0.0, 0.0)),
            visible: true,
            node: 0,
        };
        Scene {
            name: String::new(),
            meshes: vec![Arc::new(mesh)],
            textures: Vec::new(),
            materials: vec![Arc::new(Material::default())],
            instances: vec![place(2.0), place(5.0)],
            lights: Vec::new(),
            cameras: Vec::new(),
            environment: Environment::Constant(Vec3::ONE),
            backdrop: Backdrop::default(),
            origin_in_file: DVec3::ZERO,
        }
    }

    #[test]
    fn tangents_leave_hierarchies_as_they_are() {
        let bare = scene(vec![[0, 1, 2], [0, 2, 3]], Vec::new());
        // As tangents that differ along the seam split its vertices.
        let with = scene(vec![[0, 1, 2], [0, 5, 3]], vec![Vec4::X; 6]);
        let mut moved = scene(vec![[0, 1, 2], [0, 2, 3]], Vec::new());
        moved.instances[0].world_from_mesh.translation.x = 3.0;
        let loose = std::collections::BTreeSet::from([1]);
        let mut cache = BlasCache::default();
        let mut built = |scene: &Scene| {
            let shapes = Shapes::build(scene, &Split::of(scene, &loose), HierarchyKind::default(), &mut cache);
            assert_eq!(shapes.vertices.len(), 2 * scene.meshes[0].positions.len());
            [shapes.static_mesh.as_ref(), shapes.placed.first()].map(|piece| Arc::clone(&piece.unwrap().blas))
        };
        let [first, second, third] = [&bare, &with, &moved].map(&mut built);
        assert!(first.iter().zip(&second).all(|(a, b)| Arc::ptr_eq(a, b)));
        assert_eq!([0, 1].map(|piece| Arc::ptr_eq(&first[piece], &third[piece])), [false, true]);
    }
}
