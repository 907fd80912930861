//! obvhs on the CPU: the traversal that the kernels are measured against, with the same triangles and build; and the rays that go
//! on from what rays hit.

use std::time::{Duration, Instant};

use fovea_sampler::sequence::hash;
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;
use rayon::prelude::*;
use tracer::renderer::{Query, RayKind};
use tracer::scene::Scene;

/// Rays that a thread takes at once.
const RAYS_AT_ONCE: usize = 1 << 11;

/// The visible triangles of a scene in one hierarchy.
#[derive(Debug)]
pub struct Baseline {
    bvh: CwBvh,
    /// In leaf order.
    triangles: Vec<Triangle>,
    /// What building the hierarchy took.
    pub build_secs: f64,
}

impl Baseline {
    /// Builds it.
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
        let bvh = build_cwbvh(&world, params, &mut Duration::default());
        let build_secs = started.elapsed().as_secs_f64();
        let triangles = bvh.primitive_indices.iter().map(|&i| world[i as usize]).collect();
        Self { bvh, triangles, build_secs }
    }

    /// Distance in units of the direction and unnormalised normal of what a ray meets first.
    pub fn closest(&self, query: &Query) -> Option<(f32, Vec3A)> {
        let mut hit = RayHit::none();
        let found = self.bvh.ray_traverse(ray(query), &mut hit, |ray, id| self.triangles[id].intersect(ray));
        found.then(|| (hit.t, self.triangles[hit.primitive_id as usize].compute_normal()))
    }

    fn is_occluded(&self, query: &Query) -> bool {
        !self.bvh.ray_traverse_miss(ray(query), |ray, id| self.triangles[id].intersect(ray))
    }

    /// Whether a ray meets anything.
    pub fn hits(&self, query: &Query) -> bool {
        match query.kind {
            RayKind::Any => self.is_occluded(query),
            RayKind::Closest => self.closest(query).is_some(),
        }
    }

    /// Seconds for all rays on all cores.
    pub fn time(&self, rays: &[Query]) -> f64 {
        let started = Instant::now();
        let count = |chunk: &[Query]| chunk.iter().filter(|ray| self.hits(ray)).count();
        std::hint::black_box(rays.par_chunks(RAYS_AT_ONCE).map(count).sum::<usize>());
        started.elapsed().as_secs_f64()
    }
}

fn ray(query: &Query) -> Ray {
    Ray::new(query.origin.into(), query.direction.into(), 0.0, query.t_max)
}

/// A number in 0..1 by index and dimension.
fn random(index: u32, dimension: u32) -> f32 {
    (hash(index.wrapping_mul(8).wrapping_add(dimension)) >> 8) as f32 / 16_777_216.0
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
