//! From a glTF primitive to a [`Mesh`]: attributes, triangles, morph targets, skin, normals, tangents.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat3, DVec3, Vec2, Vec3, Vec4};

use super::accessor::Data;
use super::document::Primitive;
use super::error::{ContentError, Fault};
use super::report::ImportWarning;
use super::skin::{Influences, JointMatrices};
use super::tangent;
use crate::bvh::LARGEST_COORDINATE;
use crate::scene::{ContentHash, Mesh};

const TRIANGLES: u64 = 4;
const TRIANGLE_STRIP: u64 = 5;
const TRIANGLE_FAN: u64 = 6;

/// What makes one mesh; equal requests share it.
#[derive(Clone)]
pub(super) struct MeshRequest<'a> {
    pub(super) primitive: &'a Primitive,
    pub(super) name: String,
    /// Weight per morph target; empty without targets.
    pub(super) weights: Vec<f32>,
    /// Set for skinned meshes, whose vertices are then in the world.
    pub(super) joints: Option<Arc<JointMatrices>>,
    /// The texture coordinate set along which tangents are needed.
    pub(super) tangent_uv_set: Option<u32>,
}

/// Identity of a [`MeshRequest`]: primitives of several meshes often share all accessors and differ in material only.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct MeshKey {
    mode: u64,
    attributes: BTreeMap<String, usize>,
    indices: Option<usize>,
    targets: Vec<BTreeMap<String, usize>>,
    weight_bits: Vec<u32>,
    /// Skinned meshes are shared by nothing: the node that places them.
    skinned_by_node: Option<usize>,
    tangent_uv_set: Option<u32>,
}

impl MeshRequest<'_> {
    pub(super) fn key(&self, node: usize) -> MeshKey {
        MeshKey {
            mode: self.primitive.mode,
            attributes: self.primitive.attributes.clone(),
            indices: self.primitive.indices,
            targets: self.primitive.targets.clone(),
            weight_bits: self.weights.iter().map(|w| w.to_bits()).collect(),
            skinned_by_node: self.joints.as_ref().map(|_| node),
            tangent_uv_set: self.tangent_uv_set,
        }
    }
}

/// A mesh and what its making met.
pub(super) struct Built {
    /// Without a hash and without tangents that are not in the file; `None` when no triangle is left.
    pub(super) mesh: Option<Mesh>,
    /// The texture coordinate set along which tangents are to be made.
    pub(super) tangents_along: Option<usize>,
    pub(super) degenerate_triangles: usize,
    pub(super) warnings: Vec<ImportWarning>,
}

/// Vertex attributes; optional ones are empty.
#[derive(Default)]
pub(super) struct Vertices {
    pub(super) positions: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
    pub(super) tangents: Vec<Vec4>,
    pub(super) uvs: [Vec<Vec2>; 2],
    pub(super) colors: Vec<Vec4>,
}

impl Vertices {
    /// Appends a copy of a vertex (without its tangent) and returns its index.
    pub(super) fn duplicate(&mut self, vertex: usize) -> u32 {
        fn push<T: Copy>(values: &mut Vec<T>, at: usize) {
            if let Some(&value) = values.get(at) {
                values.push(value);
            }
        }
        push(&mut self.positions, vertex);
        push(&mut self.normals, vertex);
        push(&mut self.colors, vertex);
        self.uvs.iter_mut().for_each(|uvs| push(uvs, vertex));
        u32::try_from(self.positions.len() - 1).expect("indices are u32, and each splits into at most one vertex")
    }

    /// These and triangles of them, without a hash.
    fn into_mesh(self, name: String, triangles: Vec<[u32; 3]>) -> Mesh {
        let Self { positions, normals, tangents, uvs, colors } = self;
        Mesh { name, positions, normals, tangents, uvs, colors, triangles, hash: ContentHash::default() }
    }

    /// One vertex per triangle corner.
    fn unshare(&mut self, triangles: &mut [[u32; 3]]) {
        fn gather<T: Copy>(values: &mut Vec<T>, triangles: &[[u32; 3]]) {
            if !values.is_empty() {
                *values = triangles.as_flattened().iter().map(|&v| values[v as usize]).collect();
            }
        }
        gather(&mut self.positions, triangles);
        gather(&mut self.normals, triangles);
        gather(&mut self.tangents, triangles);
        gather(&mut self.colors, triangles);
        self.uvs.iter_mut().for_each(|uvs| gather(uvs, triangles));
        for (vertex, slot) in (0..).zip(triangles.as_flattened_mut()) {
            *slot = vertex;
        }
    }
}

/// Builds the mesh of a request.
pub(super) fn build(data: &Data<'_>, request: &MeshRequest<'_>) -> Result<Built, Fault> {
    let primitive = request.primitive;
    let mut warnings = Vec::new();
    let reader = Reader { data, primitive };
    let mut vertices = reader.vertices(request, &mut warnings)?;
    let mut triangles = reader.triangles(vertices.positions.len())?;

    let count = drop_far(&mut vertices.positions, &mut triangles);
    if count > 0 {
        warnings.push(ImportWarning::FarTriangles { place: primitive.place.clone(), count });
    }
    let before = triangles.len();
    triangles.retain(|&t| face_normal(&vertices.positions, t) != DVec3::ZERO);
    let degenerate_triangles = before - triangles.len();
    if degenerate_triangles > 0 {
        let place = primitive.place.clone();
        warnings.push(ImportWarning::DegenerateTriangles { place, count: degenerate_triangles });
    }
    if triangles.is_empty() {
        return Ok(Built { mesh: None, tangents_along: None, degenerate_triangles, warnings });
    }

    if vertices.normals.is_empty() {
        flat_normals(&mut vertices, &mut triangles);
    } else {
        let count = repair_normals(&mut vertices, &triangles);
        if count > 0 {
            warnings.push(ImportWarning::NormalsRepaired { place: primitive.place.clone(), count });
        }
    }
    let is_needed = |set: &usize| vertices.tangents.is_empty() && !vertices.uvs[*set].is_empty();
    let tangents_along = request.tangent_uv_set.map(|set| set as usize).filter(is_needed);
    let mesh = vertices.into_mesh(request.name.clone(), triangles);
    Ok(Built { mesh: Some(mesh), tangents_along, degenerate_triangles, warnings })
}

/// Gives a mesh tangents along a set of texture coordinates; its triangles stay in their places.
pub(super) fn with_tangents(mesh: Mesh, uv_set: usize) -> Mesh {
    let Mesh { name, positions, normals, tangents, uvs, colors, mut triangles, .. } = mesh;
    let mut vertices = Vertices { positions, normals, tangents, uvs, colors };
    tangent::generate(&mut vertices, &mut triangles, uv_set);
    let mut mesh = vertices.into_mesh(name, triangles);
    mesh.hash = hash(&mesh);
    mesh
}

/// The hash of all that a mesh contains but its name.
pub(super) fn hash(mesh: &Mesh) -> ContentHash {
    ContentHash::of(&[
        bytemuck::cast_slice(&mesh.positions),
        bytemuck::cast_slice(&mesh.normals),
        bytemuck::cast_slice(&mesh.tangents),
        bytemuck::cast_slice(&mesh.uvs[0]),
        bytemuck::cast_slice(&mesh.uvs[1]),
        bytemuck::cast_slice(&mesh.colors),
        bytemuck::cast_slice(&mesh.triangles),
    ])
}

struct Reader<'r, 'd> {
    data: &'r Data<'d>,
    primitive: &'r Primitive,
}

impl Reader<'_, '_> {
    fn fault(&self, cause: ContentError) -> Fault {
        Fault::new(self.primitive.place.clone(), cause)
    }

    fn vertices(&self, request: &MeshRequest<'_>, warnings: &mut Vec<ImportWarning>) -> Result<Vertices, Fault> {
        let position = self.primitive.attributes.get("POSITION").copied();
        let Some(position) = position else {
            let problem = "has no POSITION".to_owned();
            return Err(self.fault(ContentError::Property { key: "attributes".to_owned(), problem }));
        };
        if self.primitive.draco && self.data.document.accessors[position].view.is_none() {
            return Err(self.fault(ContentError::DataNeedsExtension("KHR_draco_mesh_compression".to_owned())));
        }
        let mut positions: Vec<Vec3> = bytemuck::cast_vec(self.data.floats::<3>(position, "POSITION")?);
        let count = positions.len();
        let mut normals: Vec<Vec3> = bytemuck::cast_vec(self.optional::<3>("NORMAL", count)?);
        let mut tangents = match request.tangent_uv_set {
            Some(_) => self.optional::<4>("TANGENT", count)?.into_iter().map(Vec4::from_array).collect(),
            None => Vec::new(),
        };
        self.morph(request, &mut positions, &mut normals, &mut tangents)?;
        self.skin(request, &mut positions, &mut normals, &mut tangents)?;
        if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
            return Err(self.fault(ContentError::NonFinitePosition { vertex }));
        }
        let usable = |t: &Vec4| t.is_finite() && t.truncate().length_squared() > 0.0 && t.w != 0.0;
        if tangents.iter().all(usable) && !normals.is_empty() {
            tangents.iter_mut().zip(&normals).for_each(|(t, &n)| *t = tangent::usable(*t, n));
        } else {
            tangents.clear();
        }
        let uvs = [self.uvs("TEXCOORD_0", count, warnings)?, self.uvs("TEXCOORD_1", count, warnings)?];
        let colors = self.colors(count, warnings)?;
        Ok(Vertices { positions, normals, tangents, uvs, colors })
    }

    /// An attribute that may be absent (empty) but otherwise has one entry per vertex.
    fn optional<const N: usize>(&self, name: &str, vertices: usize) -> Result<Vec<[f32; N]>, Fault> {
        let Some(&accessor) = self.primitive.attributes.get(name) else { return Ok(Vec::new()) };
        let values = self.data.floats::<N>(accessor, name)?;
        self.check_count(name, values.len(), vertices)?;
        Ok(values)
    }

    fn check_count(&self, attribute: &str, found: usize, expected: usize) -> Result<(), Fault> {
        let cause = || ContentError::AttributeCount { attribute: attribute.to_owned(), found, expected };
        if found == expected { Ok(()) } else { Err(self.fault(cause())) }
    }

    fn uvs(&self, name: &str, vertices: usize, warnings: &mut Vec<ImportWarning>) -> Result<Vec<Vec2>, Fault> {
        let mut uvs: Vec<Vec2> = bytemuck::cast_vec(self.optional::<2>(name, vertices)?);
        self.repair(name, &mut uvs, |uv| uv.is_finite(), warnings);
        Ok(uvs)
    }

    fn colors(&self, vertices: usize, warnings: &mut Vec<ImportWarning>) -> Result<Vec<Vec4>, Fault> {
        let name = "COLOR_0";
        let Some(&accessor) = self.primitive.attributes.get(name) else { return Ok(Vec::new()) };
        let mut colors: Vec<Vec4> = if self.data.document.accessors[accessor].width == 3 {
            self.optional::<3>(name, vertices)?.into_iter().map(|c| Vec3::from_array(c).extend(1.0)).collect()
        } else {
            self.optional::<4>(name, vertices)?.into_iter().map(Vec4::from_array).collect()
        };
        self.repair(name, &mut colors, |c| c.is_finite(), warnings);
        colors.iter_mut().for_each(|c| *c = c.clamp(Vec4::ZERO, Vec4::ONE));
        Ok(colors)
    }

    fn repair<T: Default>(
        &self,
        attribute: &str,
        values: &mut [T],
        is_fine: impl Fn(&T) -> bool,
        warnings: &mut Vec<ImportWarning>,
    ) {
        let mut count = 0;
        for value in values.iter_mut().filter(|v| !is_fine(v)) {
            *value = T::default();
            count += 1;
        }
        if count > 0 {
            let (place, attribute) = (self.primitive.place.clone(), attribute.to_owned());
            warnings.push(ImportWarning::AttributeRepaired { place, attribute, count });
        }
    }

    fn morph(
        &self,
        request: &MeshRequest<'_>,
        positions: &mut [Vec3],
        normals: &mut [Vec3],
        tangents: &mut [Vec4],
    ) -> Result<(), Fault> {
        for (target, &weight) in self.primitive.targets.iter().zip(&request.weights).filter(|(_, w)| **w != 0.0) {
            let deltas = |name: &str, wanted: bool| -> Result<Vec<[f32; 3]>, Fault> {
                let Some(&accessor) = target.get(name).filter(|_| wanted) else { return Ok(Vec::new()) };
                let deltas = self.data.floats::<3>(accessor, name)?;
                self.check_count(&format!("morph target {name}"), deltas.len(), positions.len())?;
                Ok(deltas)
            };
            let normal_deltas = deltas("NORMAL", !normals.is_empty())?;
            let tangent_deltas = deltas("TANGENT", !tangents.is_empty())?;
            let position_deltas = deltas("POSITION", true)?;
            positions.iter_mut().zip(position_deltas).for_each(|(p, d)| *p += weight * Vec3::from_array(d));
            normals.iter_mut().zip(normal_deltas).for_each(|(n, d)| *n += weight * Vec3::from_array(d));
            let delta = |d: [f32; 3]| (weight * Vec3::from_array(d)).extend(0.0);
            tangents.iter_mut().zip(tangent_deltas).for_each(|(t, d)| *t += delta(d));
        }
        Ok(())
    }

    fn skin(
        &self,
        request: &MeshRequest<'_>,
        positions: &mut [Vec3],
        normals: &mut [Vec3],
        tangents: &mut [Vec4],
    ) -> Result<(), Fault> {
        let Some(joints) = &request.joints else { return Ok(()) };
        let influences = Influences::read(self.data, self.primitive, positions.len())?;
        for (vertex, position) in positions.iter_mut().enumerate() {
            let world_from_mesh = influences.blend(vertex, joints, &self.primitive.place)?;
            *position = world_from_mesh.transform_point3(position.as_dvec3()).as_vec3();
            if let Some(normal) = normals.get_mut(vertex) {
                *normal = (cofactor(world_from_mesh.matrix3) * normal.as_dvec3()).normalize_or_zero().as_vec3();
            }
            if let Some(tangent) = tangents.get_mut(vertex) {
                let turned = world_from_mesh.transform_vector3(tangent.truncate().as_dvec3());
                *tangent = turned.normalize_or_zero().as_vec3().extend(tangent.w);
            }
        }
        Ok(())
    }

    fn triangles(&self, vertices: usize) -> Result<Vec<[u32; 3]>, Fault> {
        let indices: Vec<u32> = match self.primitive.indices {
            Some(accessor) => self.data.integers::<1>(accessor, "indices")?.into_flattened(),
            None => (0..u32::try_from(vertices).unwrap_or(u32::MAX)).collect(),
        };
        if let Some(&index) = indices.iter().find(|&&index| index as usize >= vertices) {
            return Err(self.fault(ContentError::VertexIndex { index, vertices }));
        }
        Ok(match self.primitive.mode {
            TRIANGLE_STRIP => {
                let turn = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] };
                indices.windows(3).enumerate().map(turn).collect()
            }
            TRIANGLE_FAN => indices[1.min(indices.len())..].windows(2).map(|w| [w[0], w[1], indices[0]]).collect(),
            _ => indices.as_chunks().0.to_vec(),
        })
    }
}

/// What a mode that has no triangles consists of.
pub(super) fn mode_without_triangles(mode: u64) -> Option<&'static str> {
    match mode {
        0 => Some("points"),
        1..=3 => Some("lines"),
        TRIANGLES | TRIANGLE_STRIP | TRIANGLE_FAN => None,
        _ => Some("primitives of an unknown mode"),
    }
}

/// The matrix that takes normals along: det(m) times the inverse transpose, and finite also where there is no inverse.
fn cofactor(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

/// Twice the area, along the face's normal; exactly zero for triangles without area.
fn face_normal(positions: &[Vec3], triangle: [u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|v| positions[v as usize].as_dvec3());
    (b - a).cross(c - a)
}

/// Drops triangles that reach beyond measure, and moves such vertices to others, whose box counts; returns how many triangles.
fn drop_far(positions: &mut [Vec3], triangles: &mut Vec<[u32; 3]>) -> usize {
    let is_near = |p: Vec3| p.abs().max_element() <= LARGEST_COORDINATE;
    if positions.iter().all(|&p| is_near(p)) {
        return 0;
    }
    let before = triangles.len();
    triangles.retain(|t| t.iter().all(|&v| is_near(positions[v as usize])));
    let kept = triangles.first().map_or(Vec3::ZERO, |&[v, ..]| positions[v as usize]);
    positions.iter_mut().filter(|p| !is_near(**p)).for_each(|p| *p = kept);
    before - triangles.len()
}

fn flat_normals(vertices: &mut Vertices, triangles: &mut [[u32; 3]]) {
    vertices.unshare(triangles);
    let normals = triangles.iter().map(|&t| face_normal(&vertices.positions, t).normalize_or(DVec3::Y).as_vec3());
    vertices.normals = normals.flat_map(|n| [n; 3]).collect();
}

/// Makes all normals unit vectors; returns how many were replaced by the area-weighted mean of the adjoining faces.
fn repair_normals(vertices: &mut Vertices, triangles: &[[u32; 3]]) -> usize {
    let mut is_broken = vec![false; vertices.normals.len()];
    for (normal, broken) in vertices.normals.iter_mut().zip(&mut is_broken) {
        match normal.try_normalize() {
            Some(unit) => *normal = unit,
            None => (*normal, *broken) = (Vec3::ZERO, true),
        }
    }
    if !is_broken.contains(&true) {
        return 0;
    }
    for &triangle in triangles {
        for vertex in triangle.map(|v| v as usize).into_iter().filter(|&v| is_broken[v]) {
            let weighted = face_normal(&vertices.positions, triangle);
            vertices.normals[vertex] += weighted.as_vec3();
        }
    }
    let mut count = 0;
    for (normal, _) in vertices.normals.iter_mut().zip(&is_broken).filter(|(_, broken)| **broken) {
        *normal = normal.normalize_or(Vec3::Y);
        count += 1;
    }
    count
}
