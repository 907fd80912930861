//! The last step of an import: parts become a [`Scene`] whose indices fit together.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Affine3A, DAffine3, DVec3, Vec3};

use super::document::Document;
use super::error::{ContentError, Fault};
use super::graph::{Graph, Placement};
use super::hash_meshes;
use super::primitive::Built;
use super::report::{ImportReport, ImportWarning, SceneNode};
use crate::bvh::LARGEST_COORDINATE;
use crate::scene::{Backdrop, Environment, Instance, Material, Mesh, Scene, Texture};

/// A scene is stored relative to its centre when that is farther from the file's origin than this many diagonals of its
/// bounding box. At 16, f32 positions have lost 4 of their 24 bits.
pub const REBASE_RATIO: f64 = 16.0;

/// Radiance of the sky that lights a scene without lights.
const NEUTRAL_SKY: Vec3 = Vec3::splat(0.8);

/// What the stages of the import have made.
pub(super) struct Parts<'a> {
    pub(super) name: &'a str,
    pub(super) graph: Graph<'a>,
    /// One per mesh request.
    pub(super) built: Vec<Built>,
    /// By index in the file.
    pub(super) materials: BTreeMap<usize, Material>,
    pub(super) textures: Vec<Arc<Texture>>,
}

impl Parts<'_> {
    /// The scene, and for each of its meshes the texture coordinate set along which it lacks tangents.
    pub(super) fn assemble(
        self,
        document: &Document<'_>,
        report: &mut ImportReport,
    ) -> Result<(Scene, Vec<Option<usize>>), Fault> {
        let Self { name, mut graph, built, materials, textures } = self;
        warn_of_missing_uvs(&graph, &built, &materials, report);
        let mut mesh_of_request = Vec::with_capacity(built.len());
        let mut meshes: Vec<Mesh> = Vec::new();
        let mut tangents_along = Vec::new();
        for built in built {
            report.degenerate_triangles += built.degenerate_triangles;
            report.warnings.extend(built.warnings);
            mesh_of_request.push(built.mesh.map(|mesh| {
                meshes.push(mesh);
                tangents_along.push(built.tangents_along);
                meshes.len() - 1
            }));
        }

        let boxes: Vec<[Vec3; 2]> = meshes.iter().map(bounds).collect();
        let place = |node: usize| document.nodes[node].place.clone();
        let singular = drop_placements(&mut graph.placements, &mesh_of_request, |_, placed| is_invertible(placed));
        report.warnings.extend(singular.into_iter().map(|n| ImportWarning::SingularTransform { place: place(n) }));
        let far = drop_placements(&mut graph.placements, &mesh_of_request, |mesh, placed| {
            let reach = |[low, high]: [DVec3; 2]| low.abs().max(high.abs()).max_element();
            world_bounds([(mesh, placed)].into_iter(), &boxes).map(reach) <= Some(f64::from(LARGEST_COORDINATE))
        });
        report.warnings.extend(far.into_iter().map(|n| ImportWarning::FarPlacement { place: place(n) }));
        let placed = graph.placements.iter().filter_map(|p| Some((mesh_of_request[p.request]?, p.world_from_mesh)));
        let bounds_in_file = world_bounds(placed, &boxes);
        let origin_in_file = bounds_in_file.map_or(DVec3::ZERO, rebased_origin);
        let offsets = if origin_in_file == DVec3::ZERO { Vec::new() } else { recentre(&mut meshes, &boxes) };

        let (materials, material_of) = number_materials(materials, &graph.placements);
        let mut instances = Vec::with_capacity(graph.placements.len());
        for placement in &graph.placements {
            let Some(mesh) = mesh_of_request[placement.request] else { continue };
            let offset = offsets.get(mesh).copied().unwrap_or(DVec3::ZERO);
            let in_world = placement.world_from_mesh * DAffine3::from_translation(offset);
            instances.push(Instance {
                name: document.nodes[placement.node].name.clone(),
                mesh: index_u32(mesh),
                material: material_of[&placement.material],
                world_from_mesh: affine_f32(DAffine3::from_translation(-origin_in_file) * in_world),
                visible: placement.visible,
                node: index_u32(placement.node),
            });
        }
        if instances.is_empty() {
            return Err(Fault::new(scene_place(report), ContentError::NoTriangles));
        }
        report.nodes = nodes(document, &graph.world_from_node, origin_in_file);
        let lights = graph.lights.into_iter().map(|mut light| {
            light.item.position = (light.position_in_world - origin_in_file).as_vec3();
            light.item
        });
        let cameras = graph.cameras.into_iter().map(|mut camera| {
            camera.item.position = (camera.position_in_world - origin_in_file).as_vec3();
            camera.item
        });
        let mut scene = Scene {
            name: name.to_owned(),
            meshes: hash_meshes(meshes),
            textures,
            materials,
            instances,
            lights: lights.collect(),
            cameras: cameras.collect(),
            environment: Environment::Constant(Vec3::ZERO),
            backdrop: Backdrop::default(),
            origin_in_file,
        };
        if !has_light(&scene) {
            scene.environment = Environment::Constant(NEUTRAL_SKY);
            report.warnings.push(ImportWarning::NoLight);
        }
        Ok((scene, tangents_along))
    }
}

/// The file's nodes with their parents and places.
fn nodes(document: &Document<'_>, world_from_node: &[DAffine3], origin_in_file: DVec3) -> Vec<SceneNode> {
    let mut nodes: Vec<SceneNode> = document
        .nodes
        .iter()
        .zip(world_from_node)
        .map(|(node, &world)| SceneNode {
            name: node.name.clone(),
            parent: None,
            world_from_node: affine_f32(DAffine3::from_translation(-origin_in_file) * world),
        })
        .collect();
    for (index, node) in document.nodes.iter().enumerate() {
        for &child in &node.children {
            nodes[child].parent = Some(index_u32(index));
        }
    }
    nodes
}

fn scene_place(report: &ImportReport) -> String {
    let name = report.scenes.get(report.scene).map_or("", String::as_str);
    super::error::place_of("scene", report.scene, name)
}

fn has_light(scene: &Scene) -> bool {
    let emits = |i: &Instance| i.visible && scene.materials[i.material as usize].emits();
    scene.lights.iter().any(|l| l.intensity != Vec3::ZERO) || scene.instances.iter().any(emits)
}

fn warn_of_missing_uvs(
    graph: &Graph<'_>,
    built: &[Built],
    materials: &BTreeMap<usize, Material>,
    report: &mut ImportReport,
) {
    let mut pairs: Vec<_> = graph.placements.iter().filter_map(|p| Some((p.request, p.material?))).collect();
    pairs.sort_unstable();
    pairs.dedup();
    for (request, material_index) in pairs {
        let Some(mesh) = &built[request].mesh else { continue };
        for set in 0..2u32 {
            let is_used = materials[&material_index].textures().any(|t| t.uv_set == set);
            if is_used && mesh.uvs[set as usize].is_empty() {
                let place = graph.requests[request].primitive.place.clone();
                report.warnings.push(ImportWarning::TexCoordMissing { place, set });
            }
        }
    }
}

/// Removes placements of a mesh that are not fine and those without a mesh; returns the nodes of the former.
fn drop_placements(
    placements: &mut Vec<Placement>,
    mesh_of_request: &[Option<usize>],
    is_fine: impl Fn(usize, DAffine3) -> bool,
) -> Vec<usize> {
    let mut nodes = Vec::new();
    placements.retain(|p| {
        let Some(mesh) = mesh_of_request[p.request] else { return false };
        let keeps = is_fine(mesh, p.world_from_mesh);
        if !keeps {
            nodes.push(p.node);
        }
        keeps
    });
    nodes.dedup();
    nodes
}

fn is_invertible(world_from_mesh: DAffine3) -> bool {
    let narrow = affine_f32(world_from_mesh);
    let inverse = world_from_mesh.matrix3.inverse();
    world_from_mesh.matrix3.determinant() != 0.0
        && narrow.is_finite()
        && inverse.is_finite()
        && inverse.as_mat3().is_finite()
        && narrow.matrix3.determinant() != 0.0
}

fn affine_f32(a: DAffine3) -> Affine3A {
    Affine3A::from_mat3_translation(a.matrix3.as_mat3(), a.translation.as_vec3())
}

fn index_u32(index: usize) -> u32 {
    u32::try_from(index).expect("limits on files keep all counts below 2^32")
}

fn bounds(mesh: &Mesh) -> [Vec3; 2] {
    let start = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    mesh.positions.iter().fold(start, |[low, high], &p| [low.min(p), high.max(p)])
}

fn world_bounds(placed: impl Iterator<Item = (usize, DAffine3)>, boxes: &[[Vec3; 2]]) -> Option<[DVec3; 2]> {
    let corners = placed.flat_map(|(mesh, world_from_mesh)| {
        let [low, high] = boxes[mesh];
        (0..8).map(move |corner: u32| {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
            world_from_mesh.transform_point3(Vec3::new(pick(0), pick(1), pick(2)).as_dvec3())
        })
    });
    corners.fold(None, |bounds: Option<[DVec3; 2]>, p| {
        let [low, high] = bounds.unwrap_or([p, p]);
        Some([low.min(p), high.max(p)])
    })
}

/// The centre of the bounds when it is far from the origin, else zero.
fn rebased_origin([low, high]: [DVec3; 2]) -> DVec3 {
    let centre = (low + high) / 2.0;
    if centre.length() > REBASE_RATIO * (high - low).length() { centre } else { DVec3::ZERO }
}

/// Moves meshes that are far from their own origin to it; returns what was subtracted from each.
fn recentre(meshes: &mut [Mesh], boxes: &[[Vec3; 2]]) -> Vec<DVec3> {
    let moved = meshes.iter_mut().zip(boxes).map(|(mesh, &[low, high])| {
        let offset = rebased_origin([low.as_dvec3(), high.as_dvec3()]);
        if offset != DVec3::ZERO {
            mesh.positions.iter_mut().for_each(|p| *p = (p.as_dvec3() - offset).as_vec3());
        }
        offset
    });
    moved.collect()
}

/// Materials in file order, the default one last if it is used, and the number of each.
fn number_materials(
    mut materials: BTreeMap<usize, Material>,
    placements: &[Placement],
) -> (Vec<Arc<Material>>, BTreeMap<Option<usize>, u32>) {
    let used: std::collections::BTreeSet<Option<usize>> = placements.iter().map(|p| p.material).collect();
    let mut numbered = Vec::with_capacity(used.len());
    let mut number_of = BTreeMap::new();
    for &index in used.iter().filter(|m| m.is_some()).chain(used.iter().filter(|m| m.is_none())) {
        let material = index.and_then(|i| materials.remove(&i)).unwrap_or_default();
        number_of.insert(index, index_u32(numbered.len()));
        numbered.push(Arc::new(material));
    }
    (numbered, number_of)
}
