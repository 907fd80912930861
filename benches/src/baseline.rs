//! obvhs on the CPU, and rays for both sides: what the kernels' traversal is compared with.

use std::time::Instant;

use fovea_sampler::sequence::hash;
use glam::{Vec3, Vec3A};
use obvhs::{
    BvhBuildParams,
    cwbvh::{CwBvh, builder::build_cwbvh},
    ray::{Ray, RayHit},
    triangle::Triangle,
};
use rayon::prelude::*;
use tracer::{
    renderer::{Query, RayKind},
    scene::Scene,
};

/// Columns and rows of the panorama of primary rays.
const FILM: [u32; 2] = [1448, 724];

/// obvhs on the CPU.
#[derive(Debug)]
pub struct Baseline {
    bvh: CwBvh,
    /// In leaf order.
    triangles: Vec<Triangle>,
    /// Of the hierarchy alone.
    pub build_secs: f64,
}

impl Baseline {
    /// The visible triangles of a scene, in world space.
    pub fn build(scene: &Scene) -> Self {
        let world: Vec<Triangle> = scene
            .instances
            .iter()
            .filter(|instance| instance.visible)
            .flat_map(|instance| {
                let mesh = &scene.meshes[instance.mesh as usize];
                mesh.triangles.iter().map(|corners| {
                    let [v0, v1, v2] =
                        corners.map(|v| instance.world_from_mesh.transform_point3a(mesh.positions[v as usize].into()));
                    Triangle { v0, v1, v2 }
                })
            })
            .collect();
        let params = BvhBuildParams { pre_split: false, max_prims_per_leaf: 3, ..BvhBuildParams::medium_build() };
        let started = Instant::now();
        let bvh = build_cwbvh(&world, params, &mut std::time::Duration::default());
        let build_secs = started.elapsed().as_secs_f64();
        let triangles = bvh.primitive_indices.iter().map(|&i| world[i as usize]).collect();
        Self { bvh, triangles, build_secs }
    }

    /// Distance along the ray and normal (of any length) of what it meets first.
    pub fn closest(&self, query: &Query) -> Option<(f32, Vec3A)> {
        let ray = Ray::new(query.origin.into(), query.direction.into(), 0.0, query.t_max);
        let mut hit = RayHit::none();
        let found = self.bvh.ray_traverse(ray, &mut hit, |ray, id| self.triangles[id].intersect(ray));
        found.then(|| (hit.t, self.triangles[hit.primitive_id as usize].compute_normal()))
    }

    /// Whether the ray meets anything.
    pub fn is_occluded(&self, query: &Query) -> bool {
        let ray = Ray::new(query.origin.into(), query.direction.into(), 0.0, query.t_max);
        !self.bvh.ray_traverse_miss(ray, |ray, id| self.triangles[id].intersect(ray))
    }

    /// Rays a second on all cores.
    pub fn time(&self, rays: &[Query]) -> f64 {
        let started = Instant::now();
        let hits = rays
            .par_chunks(1 << 12)
            .map(|chunk| match chunk.first().map(|ray| ray.kind) {
                Some(RayKind::Any) => chunk.iter().filter(|ray| self.is_occluded(ray)).count(),
                _ => chunk.iter().filter(|ray| self.closest(ray).is_some()).count(),
            })
            .sum::<usize>();
        std::hint::black_box(hits);
        rays.len() as f64 / started.elapsed().as_secs_f64()
    }
}

/// A number in 0..1 by index and dimension.
fn random(index: u32, dimension: u32) -> f32 {
    (hash(index.wrapping_mul(8).wrapping_add(dimension)) >> 8) as f32 / 16_777_216.0
}

/// Through the middles of a panorama's pixels, in tiles of 8x8.
pub fn primary_rays(eye: Vec3) -> Vec<Query> {
    let tiles = (0..FILM[1] / 8).flat_map(|y| (0..FILM[0] / 8).map(move |x| (x, y)));
    tiles
        .flat_map(|(tx, ty)| (0..64).map(move |i| (tx * 8 + i % 8, ty * 8 + i / 8)))
        .map(|(x, y)| {
            let yaw = ((x as f32 + 0.5) / FILM[0] as f32 - 0.5) * std::f32::consts::TAU;
            let pitch = (0.5 - (y as f32 + 0.5) / FILM[1] as f32) * std::f32::consts::PI;
            let direction = Vec3::new(yaw.sin() * pitch.cos(), pitch.sin(), -yaw.cos() * pitch.cos());
            Query { origin: eye, direction, t_max: f32::MAX, kind: RayKind::Closest }
        })
        .collect()
}

/// From what the primary rays hit: cosine-distributed directions, and segments to random points of the scene's bounds.
pub fn secondary_rays(scene: &Scene, baseline: &Baseline, primary: &[Query]) -> [Vec<Query>; 2] {
    let (low, high) = scene.bounds().unwrap_or((Vec3::ZERO, Vec3::ONE));
    let origins: Vec<(u32, Vec3, Vec3)> = primary
        .par_iter()
        .enumerate()
        .filter_map(|(i, ray)| {
            let (t, normal) = baseline.closest(ray)?;
            let normal = Vec3::from(normal).try_normalize()?;
            let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
            let origin = ray.origin + ray.direction * t;
            Some((i as u32, origin + normal * (1e-4 * (1.0 + origin.abs().max_element())), normal))
        })
        .collect();
    let diffuse = origins.iter().map(|&(i, origin, normal)| {
        let z = 1.0 - 2.0 * random(i, 0);
        let (sin, cos) = (random(i, 1) * std::f32::consts::TAU).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        let direction = (normal + Vec3::new(r * cos, r * sin, z)).try_normalize().unwrap_or(normal);
        Query { origin, direction, t_max: f32::MAX, kind: RayKind::Closest }
    });
    let shadow = origins.iter().map(|&(i, origin, _)| {
        let end = low + (high - low) * Vec3::new(random(i, 2), random(i, 3), random(i, 4));
        Query { origin, direction: end - origin, t_max: 1.0, kind: RayKind::Any }
    });
    [diffuse.collect(), shadow.collect()]
}
