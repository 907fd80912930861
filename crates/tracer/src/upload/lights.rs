//! The light table: every emissive triangle and punctual light, weighted by power.

use std::collections::HashMap;

use glam::Vec3;

use super::{AliasTable, geometry::Shapes, placement::Placement};
use crate::{
    kernels::layout::{self, codes},
    scene::{AlphaMode, Material, PunctualKind, PunctualLight, Scene, Texture},
};

/// What a light without extent makes of a surface, over its intensity: with the 16 that a film holds beyond the brightest radiance,
/// a white wall at 9 mm, or a highlight of roughness 0.07 at a metre.
const NEAR_A_LAMP: f32 = 256.0;

/// Lights with their alias rows.
pub(super) struct LightTable {
    /// Emissive triangles by instance, in the order of its mesh, then punctual lights.
    pub lights: Vec<layout::Light>,
    /// Largest radiance of a source that is seen, or near one that is not.
    pub brightest: f32,
}

impl LightTable {
    /// Builds the table of a scene's visible lights and enters each instance's first light into `placement`.
    pub(super) fn build(scene: &Scene, shapes: &Shapes, placement: &mut Placement) -> Self {
        let mut lights = Vec::new();
        let mut powers = Vec::new();
        let mut sites = Vec::new();
        let mut brightest: f32 = 0.0;
        let mut means: HashMap<u32, Vec3> = HashMap::new();
        for (index, source) in placement.sources.iter().enumerate() {
            let Some(source) = *source else { continue };
            let instance = &scene.instances[source as usize];
            let material = &scene.materials[instance.material as usize];
            if !material.emits() {
                continue;
            }
            placement.instances[index].first_light = lights.len() as u32;
            brightest = brightest.max(material.emission.max_element());
            let mean = material.emissive_texture.map_or(Vec3::ONE, |reference| {
                let texture = reference.texture;
                *means.entry(texture).or_insert_with(|| mean_color(&scene.textures[texture as usize]))
            });
            let sides = if material.double_sided { 2.0 } else { 1.0 };
            // Black texels in a dark texture still must be reachable where its mean is not zero elsewhere.
            let radiance =
                f64::from(luminance(material.emission * mean.max(Vec3::splat(1e-4))) * most_coverage(material)) * sides;
            let mesh = &scene.meshes[instance.mesh as usize];
            let is_mirrored = instance.world_from_mesh.matrix3.determinant() < 0.0;
            for triangle in &mesh.triangles {
                let [a, mut b, mut c] =
                    triangle.map(|v| instance.world_from_mesh.transform_point3(mesh.positions[v as usize]));
                if is_mirrored {
                    std::mem::swap(&mut b, &mut c);
                }
                let (edge_1, edge_2) = (b - a, c - a);
                let two_areas = edge_1.as_dvec3().cross(edge_2.as_dvec3()).length();
                sites.push(Site { corners: [a, b, c], double_sided: material.double_sided });
                powers.push(radiance * std::f64::consts::PI * 0.5 * two_areas);
                lights.push(layout::Light {
                    position: a.to_array(),
                    edge_1: edge_1.to_array(),
                    edge_2: edge_2.to_array(),
                    kind: codes::LIGHT_TRIANGLE,
                    instance: index as u32,
                    triangle: codes::NONE,
                    ..bytemuck::Zeroable::zeroed()
                });
            }
        }
        if scene.materials.iter().any(|m| m.emits() && varies(m)) {
            enter_triangles(shapes, placement, &mut lights);
        }
        let reach = scene.bounds().map_or(1.0, |(low, high)| f64::from((high - low).length()) * 0.5);
        let (discs, others): (Vec<_>, Vec<_>) =
            scene.lights.iter().filter(|light| light.intensity.max_element() > 0.0).partition(|light| light.is_disc());
        // Discs last: that is where rays that leave the scene look for them.
        for light in others.into_iter().chain(discs) {
            let encoded = encode_punctual(light);
            let seen = if light.is_disc() { encoded.cone[1] } else { NEAR_A_LAMP };
            brightest = brightest.max(light.intensity.max_element() * seen);
            powers.push(punctual_power(light, reach));
            lights.push(encoded);
        }
        let twins = twins(&sites);
        for &(twin, _) in &twins {
            powers[twin] = 0.0;
        }
        let table = AliasTable::build(&powers);
        for (i, light) in lights.iter_mut().enumerate() {
            light.probability = table.probabilities[i];
            light.alias_threshold = table.thresholds[i];
            light.alias_index = table.aliases[i];
        }
        for (twin, first) in twins {
            lights[twin].probability = lights[first].probability;
        }
        Self { lights, brightest }
    }
}

/// Where an emissive triangle stands.
struct Site {
    corners: [Vec3; 3],
    double_sided: bool,
}

impl Site {
    /// Bits of the corners in ascending order, and whether it is an even permutation of them: which side the front is on.
    fn place(&self) -> ([[u32; 3]; 3], bool) {
        // Adding 0 makes one of both zeros; a mirror makes the negative one.
        let mut corners = self.corners.map(|corner| (corner + Vec3::ZERO).to_array().map(f32::to_bits));
        let first = (0..3).min_by_key(|&i| corners[i]).unwrap_or(0);
        corners.rotate_left(first);
        let is_even = corners[1] <= corners[2];
        if !is_even {
            corners.swap(1, 2);
        }
        (corners, is_even)
    }
}

/// Twin and first of emissive triangles in the same place that emit to the same side. A ray sees one of them, so only the first is
/// sampled; the others have its density, since a ray may hit any of them. One that emits to both sides is the first of all.
fn twins(sites: &[Site]) -> Vec<(usize, usize)> {
    let mut firsts = HashMap::new();
    let mut pairs = Vec::new();
    let (both, one): (Vec<usize>, Vec<usize>) = (0..sites.len()).partition(|&site| sites[site].double_sided);
    for index in both.into_iter().chain(one) {
        let (place, is_even) = sites[index].place();
        let side = (!sites[index].double_sided).then_some(is_even);
        match firsts.get(&(place, None)).or_else(|| firsts.get(&(place, side))) {
            Some(&first) => pairs.push((index, first)),
            None => {
                firsts.insert((place, side), index);
            }
        }
    }
    pairs
}

/// Whether what a point of the material emits depends on more than the material.
fn varies(material: &Material) -> bool {
    material.emissive_texture.is_some() || material.alpha_mode != AlphaMode::Opaque || material.clearcoat > 0.0
}

/// The most of an emitter that is there at any of its points: textures and vertices only take from it.
fn most_coverage(material: &Material) -> f32 {
    let alpha = material.base_color.w;
    match material.alpha_mode {
        AlphaMode::Opaque => 1.0,
        AlphaMode::Blend => alpha,
        AlphaMode::Mask { cutoff } => f32::from(u8::from(alpha >= cutoff)),
    }
}

/// Tells each light the triangle whose vertices it has. A mesh that is placed often lends its copies one.
fn enter_triangles(shapes: &Shapes, placement: &Placement, lights: &mut [layout::Light]) {
    let mut entries: Vec<(u32, u32)> = Vec::new();
    for (index, instance) in placement.instances.iter().enumerate() {
        if instance.root_node != codes::NONE && instance.first_light != codes::NONE {
            entries.push((instance.root_node, index as u32));
        }
    }
    for (slot, &[first, _, _, number]) in shapes.triangles.iter().enumerate() {
        let part = shapes.vertices[first as usize].part;
        if part != codes::NONE {
            let first_light = placement.instances[part as usize].first_light;
            if first_light != codes::NONE {
                let number = number & !codes::TRIANGLE_ALPHA;
                lights[(first_light + number) as usize].triangle = slot as u32;
            }
        }
    }
    for (root, index) in entries {
        let first_light = placement.instances[index as usize].first_light;
        for (number, slot) in shapes.slots_below(root) {
            lights[(first_light + number) as usize].triangle = slot;
        }
    }
}

fn encode_punctual(light: &PunctualLight) -> layout::Light {
    let (kind, cone) = match light.kind {
        PunctualKind::Point => (codes::LIGHT_POINT, [0.0; 2]),
        PunctualKind::Spot { inner_angle, outer_angle } => (codes::LIGHT_SPOT, [outer_angle.cos(), inner_angle.cos()]),
        PunctualKind::Directional { angular_diameter } => {
            let radius = f64::from(angular_diameter.clamp(0.0, std::f32::consts::PI)) * 0.5;
            let versine = 2.0 * (0.5 * radius).sin().powi(2);
            let per_solid_angle = if versine > 0.0 { 1.0 / (std::f64::consts::TAU * versine) } else { 0.0 };
            (codes::LIGHT_DIRECTIONAL, [versine as f32, per_solid_angle as f32])
        }
    };
    layout::Light {
        position: light.position.to_array(),
        edge_1: (light.rotation * Vec3::NEG_Z).to_array(),
        edge_2: light.intensity.to_array(),
        kind,
        cone,
        ..bytemuck::Zeroable::zeroed()
    }
}

/// Watts (times 683 in photometric terms): what the light sends into a scene of this radius in metres.
fn punctual_power(light: &PunctualLight, reach: f64) -> f64 {
    use std::f64::consts::PI;
    let intensity = f64::from(luminance(light.intensity));
    match light.kind {
        PunctualKind::Point => 4.0 * PI * intensity,
        PunctualKind::Spot { outer_angle, .. } => 2.0 * PI * (1.0 - f64::from(outer_angle).cos()) * intensity,
        PunctualKind::Directional { .. } => PI * reach * reach * intensity,
    }
}

fn mean_color(texture: &Texture) -> Vec3 {
    let decode = |byte: u8| {
        let c = f32::from(byte) / 255.0;
        if texture.encoding == crate::scene::TexelEncoding::Linear {
            c
        } else if c <= 0.04045 {
            c / 12.92
        } else {
            ((c + 0.055) / 1.055).powf(2.4)
        }
    };
    let table: Vec<f32> = (0..=255).map(decode).collect();
    let sum = texture.texels.iter().fold(glam::DVec3::ZERO, |sum, t| {
        sum + Vec3::new(table[t[0] as usize], table[t[1] as usize], table[t[2] as usize]).as_dvec3()
    });
    (sum / texture.texels.len().max(1) as f64).as_vec3()
}

/// Rec. 709 luminance.
pub(super) fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}
