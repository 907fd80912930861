//! The walk over a scene's nodes: what they place, and where.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DQuat, DVec3, Quat, Vec3};

use super::accessor::Data;
use super::document::Primitive;
use super::error::{ContentError, Fault};
use super::json::Object;
use super::material::LARGEST_RADIANCE;
use super::pose::{self, Pose};
use super::primitive::{MeshKey, MeshRequest, mode_without_triangles};
use super::report::{ImportWarning, ignore};
use super::skin::JointMatrices;
use crate::bvh::LARGEST_COORDINATE;
use crate::scene::{Camera, LARGEST_YFOV_DEG, Projection, PunctualKind, PunctualLight};

/// Most instances of a scene.
const MAX_INSTANCES: u64 = 1 << 22;

/// A primitive placed in the file's world.
pub(super) struct Placement {
    /// Index into [`Graph::requests`].
    pub(super) request: usize,
    /// Index of the file's material; `None` is the default material.
    pub(super) material: Option<usize>,
    pub(super) world_from_mesh: DAffine3,
    pub(super) visible: bool,
    pub(super) node: usize,
}

/// A camera or light and its place in f64.
pub(super) struct Posed<T> {
    pub(super) item: T,
    pub(super) position_in_world: DVec3,
}

/// What a scene's nodes place.
pub(super) struct Graph<'a> {
    pub(super) requests: Vec<MeshRequest<'a>>,
    pub(super) placements: Vec<Placement>,
    pub(super) cameras: Vec<Posed<Camera>>,
    pub(super) lights: Vec<Posed<PunctualLight>>,
    /// By index of the node.
    pub(super) world_from_node: Vec<DAffine3>,
}

/// What the walk needs to know.
pub(super) struct Walk<'a> {
    pub(super) data: &'a Data<'a>,
    pub(super) roots: Vec<usize>,
    pub(super) time_secs: Option<f32>,
    pub(super) variant: Option<usize>,
}

impl<'a> Walk<'a> {
    /// Visits all nodes of the scene. `tangent_uv_set` tells which tangents a material needs.
    pub(super) fn run(
        &self,
        mut tangent_uv_set: impl FnMut(usize, &mut Vec<ImportWarning>) -> Result<Option<u32>, Fault>,
        warnings: &mut Vec<ImportWarning>,
    ) -> Result<Graph<'a>, Fault> {
        let document = self.data.document;
        let pose = Pose::at(self.data, self.time_secs)?;
        let world_from_node = pose::world_from_node(self.data, &pose)?;
        let mut graph = Graph {
            requests: Vec::new(),
            placements: Vec::new(),
            cameras: Vec::new(),
            lights: Vec::new(),
            world_from_node: Vec::new(),
        };
        let mut request_of_key: BTreeMap<MeshKey, usize> = BTreeMap::new();
        let mut open: Vec<(usize, bool)> = self.roots.iter().rev().map(|&n| (n, true)).collect();
        let mut seen = vec![false; document.nodes.len()];
        while let Some((index, parent_visible)) = open.pop() {
            let node = &document.nodes[index];
            if std::mem::replace(&mut seen[index], true) {
                return Err(Fault::new(node.place.clone(), ContentError::NodeGraph));
            }
            let visible = parent_visible && node.visible;
            open.extend(node.children.iter().rev().map(|&child| (child, visible)));
            let world = world_from_node[index];
            if let Some(camera) = node.camera {
                graph.add_camera(&document.cameras[camera], &node.name, world, warnings)?;
            }
            if let Some(light) = node.light.filter(|_| visible) {
                graph.add_light(&document.lights[light], &node.name, world, warnings)?;
            }
            let Some(mesh) = node.mesh else { continue };
            let mesh = &document.meshes[mesh];
            let joints = match node.skin {
                Some(skin) => Some(JointMatrices::new(self.data, &document.skins[skin], &world_from_node)?),
                None => None,
            }
            .map(Arc::new);
            let worlds = match &joints {
                // The joints alone place a skinned mesh; its node's transform does not count.
                Some(joints) => vec![DAffine3::from_translation(joints.anchor_in_world)],
                None => self.instances(index, world)?,
            };
            let many = mesh.primitives.len() > 1;
            for (number, primitive) in mesh.primitives.iter().enumerate() {
                if let Some(mode) = mode_without_triangles(primitive.mode) {
                    warnings.push(ImportWarning::PrimitiveSkipped { place: primitive.place.clone(), mode });
                    continue;
                }
                let material = self.material(primitive);
                let tangent_uv_set = material.map_or(Ok(None), |m| tangent_uv_set(m, warnings))?;
                let weights = pose.weights[index].clone().unwrap_or_else(|| mesh.weights.clone());
                let request = MeshRequest {
                    primitive,
                    name: if many { format!("{}.{number}", mesh.name) } else { mesh.name.clone() },
                    weights: if primitive.targets.is_empty() { Vec::new() } else { weights },
                    joints: joints.clone(),
                    tangent_uv_set,
                };
                let next = graph.requests.len();
                let request_index = *request_of_key.entry(request.key(index)).or_insert(next);
                if request_index == next {
                    graph.requests.push(request);
                }
                check_count((graph.placements.len() + worlds.len()) as u64, &node.place)?;
                graph.placements.extend(worlds.iter().map(|&world_from_mesh| Placement {
                    request: request_index,
                    material,
                    world_from_mesh,
                    visible,
                    node: index,
                }));
            }
        }
        graph.world_from_node = world_from_node;
        Ok(graph)
    }

    fn material(&self, primitive: &Primitive) -> Option<usize> {
        self.variant.and_then(|v| primitive.variants.get(&v).copied()).or(primitive.material)
    }

    /// The node's own transform, or those of EXT_mesh_gpu_instancing.
    fn instances(&self, index: usize, world: DAffine3) -> Result<Vec<DAffine3>, Fault> {
        let node = &self.data.document.nodes[index];
        let Some(attributes) = &node.instancing else { return Ok(vec![world]) };
        let translations =
            attributes.get("TRANSLATION").map(|&a| self.data.floats::<3>(a, "TRANSLATION")).transpose()?;
        let rotations = attributes.get("ROTATION").map(|&a| self.data.floats::<4>(a, "ROTATION")).transpose()?;
        let scales = attributes.get("SCALE").map(|&a| self.data.floats::<3>(a, "SCALE")).transpose()?;
        let counts =
            [translations.as_ref().map(Vec::len), rotations.as_ref().map(Vec::len), scales.as_ref().map(Vec::len)];
        let Some(count) = counts.into_iter().flatten().min() else { return Ok(vec![world]) };
        check_count(count as u64, &node.place)?;
        let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        let instance = |i: usize| {
            let translation = translations.as_ref().map_or(DVec3::ZERO, |t| vector(t[i]));
            let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |r| DQuat::from_array(r[i].map(f64::from)));
            let scale = scales.as_ref().map_or(DVec3::ONE, |s| vector(s[i]));
            let rotation = super::document::unit_or_identity(rotation);
            world * DAffine3::from_scale_rotation_translation(scale, rotation, translation)
        };
        Ok((0..count).map(instance).collect())
    }
}

fn check_count(count: u64, place: &str) -> Result<(), Fault> {
    if count <= MAX_INSTANCES {
        return Ok(());
    }
    Err(Fault::new(place, ContentError::TooMany { what: "instances", count, limit: MAX_INSTANCES }))
}

impl Graph<'_> {
    fn add_camera(
        &mut self,
        o: &Object<'_>,
        node_name: &str,
        world: DAffine3,
        warnings: &mut Vec<ImportWarning>,
    ) -> Result<(), Fault> {
        let positive = |o: &Object<'_>, key: &str| {
            let value = narrow(o.number(key)?.ok_or_else(|| o.bad(key, "is missing"))?);
            if value > 0.0 && value.is_finite() { Ok(value) } else { Err(o.bad(key, "is not above 0")) }
        };
        let part = |key: &str| o.object(key)?.ok_or_else(|| o.bad(key, "is missing"));
        let projection = match o.string("type")? {
            Some("perspective") => {
                let p = part("perspective")?;
                let aspect = p.number("aspectRatio")?.map(narrow).filter(|a| *a > 0.0 && a.is_finite());
                let (yfov, largest) = (positive(&p, "yfov")?, LARGEST_YFOV_DEG.to_radians());
                if yfov > largest {
                    let (place, key) = (o.place.clone(), "yfov".to_owned());
                    warnings.push(ImportWarning::ValueClamped { place, key, value: f64::from(yfov) });
                }
                Projection::Perspective { yfov: yfov.min(largest), aspect }
            }
            Some("orthographic") => {
                let p = part("orthographic")?;
                ignore(warnings, "an orthographic projection", "such cameras are shown in perspective");
                // Negative magnifications mirror the picture in some viewers; the specification only warns.
                let magnitude = |key| Ok(narrow(p.number(key)?.ok_or_else(|| p.bad(key, "is missing"))?.abs()));
                Projection::Orthographic { xmag: magnitude("xmag")?, ymag: magnitude("ymag")? }
            }
            other => {
                let value = super::error::one_line(other.unwrap_or_default());
                warnings.push(ImportWarning::UnknownKind { place: o.place.clone(), kind: "camera type", value });
                return Ok(());
            }
        };
        let name = if node_name.is_empty() { o.name() } else { node_name }.to_owned();
        let camera = Camera { name, position: Vec3::ZERO, rotation: rotation_of(world), projection };
        self.cameras.push(Posed { item: camera, position_in_world: finite(world.translation) });
        Ok(())
    }

    fn add_light(
        &mut self,
        o: &Object<'_>,
        node_name: &str,
        world: DAffine3,
        warnings: &mut Vec<ImportWarning>,
    ) -> Result<(), Fault> {
        let kind = match o.string("type")? {
            Some("point") => PunctualKind::Point,
            Some("directional") => PunctualKind::Directional { angular_diameter: 0.0 },
            Some("spot") => {
                let spot = o.object("spot")?.unwrap_or_else(|| o.clone());
                let limit = std::f64::consts::FRAC_PI_2;
                let outer = spot.number("outerConeAngle")?.unwrap_or(limit / 2.0).clamp(1e-4, limit);
                let inner = spot.number("innerConeAngle")?.unwrap_or(0.0).clamp(0.0, outer);
                PunctualKind::Spot { inner_angle: narrow(inner), outer_angle: narrow(outer) }
            }
            other => {
                let value = super::error::one_line(other.unwrap_or_default());
                warnings.push(ImportWarning::UnknownKind { place: o.place.clone(), kind: "light type", value });
                return Ok(());
            }
        };
        let color = o.numbers::<3>("color")?.unwrap_or([1.0; 3]);
        let intensity = o.number("intensity")?.unwrap_or(1.0);
        if !(0.0..=LARGEST_RADIANCE).contains(&intensity) {
            let (place, key) = (o.place.clone(), "intensity".to_owned());
            warnings.push(ImportWarning::ValueClamped { place, key, value: intensity });
        }
        if o.map.contains_key("range") {
            ignore(warnings, "range", "light falls off by the square of the distance alone");
        }
        let intensity = intensity.clamp(0.0, LARGEST_RADIANCE);
        let intensity = Vec3::from_array(color.map(|c| narrow((c.max(0.0) * intensity).min(LARGEST_RADIANCE))));
        let name = if node_name.is_empty() { o.name() } else { node_name }.to_owned();
        let light = PunctualLight { name, kind, intensity, position: Vec3::ZERO, rotation: rotation_of(world) };
        self.lights.push(Posed { item: light, position_in_world: finite(world.translation) });
        Ok(())
    }
}

fn finite(v: DVec3) -> DVec3 {
    let limit = DVec3::splat(f64::from(LARGEST_COORDINATE));
    if v.is_finite() { v.clamp(-limit, limit) } else { DVec3::ZERO }
}

#[expect(clippy::cast_possible_truncation, reason = "scene data is f32")]
fn narrow(value: f64) -> f32 {
    value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
}

/// The rotation that looks along the transform's -Z with its +Y up; scale, shear and mirroring are left out.
fn rotation_of(world: DAffine3) -> Quat {
    let back = world.matrix3.z_axis.normalize_or(DVec3::Z);
    let up = world.matrix3.y_axis;
    let right = up.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
    DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back)).as_quat().normalize()
}
