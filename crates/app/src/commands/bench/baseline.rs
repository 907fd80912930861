//! obvhs on the CPU: the traversal that the kernels are measured against, with the same triangles and build.

use std::time::{Duration, Instant};

use glam::Vec3A;
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
pub struct Baseline {
    bvh: CwBvh,
    /// In leaf order.
    triangles: Vec<Triangle>,
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
        let bvh = build_cwbvh(&world, params, &mut Duration::default());
        let triangles = bvh.primitive_indices.iter().map(|&i| world[i as usize]).collect();
        Self { bvh, triangles }
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
