//! What lies under a point of the view: every triangle is tried, those in boxes that the ray misses excepted.
//!
//! No hierarchy is kept for it: a click is rare, and 3 million triangles take about 20 ms. Cut-outs of textures are not
//! looked at; the surface that carries them counts.

use std::sync::Arc;

use glam::Vec3;
use tracer::scene::{Mesh, Scene};

/// A ray's first hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// In lengths of the ray's direction.
    pub distance: f32,
}

/// The boxes of a scene's meshes, kept while the meshes stay.
#[derive(Clone, Debug, Default)]
pub struct Picker {
    meshes: Vec<Arc<Mesh>>,
    boxes: Vec<(Vec3, Vec3)>,
}

impl Picker {
    /// The first visible surface along a ray of the world.
    pub fn pick(&mut self, scene: &Scene, origin: Vec3, direction: Vec3) -> Option<Hit> {
        self.follow(scene);
        let mut nearest: Option<Hit> = None;
        for (index, instance) in (0..).zip(&scene.instances).filter(|(_, instance)| instance.visible) {
            let Some((mesh, &bounds)) =
                scene.meshes.get(instance.mesh as usize).zip(self.boxes.get(instance.mesh as usize))
            else {
                continue;
            };
            let mesh_from_world = instance.world_from_mesh.inverse();
            // Directions keep their length: distances are those of the world.
            let origin = mesh_from_world.transform_point3(origin);
            let direction = mesh_from_world.transform_vector3(direction);
            let farthest = nearest.map_or(f32::INFINITY, |hit| hit.distance);
            if !meets_box(bounds, origin, direction, farthest) {
                continue;
            }
            let distances = mesh.triangles.iter().filter_map(|corners| {
                let [a, b, c] = corners.map(|corner| mesh.positions.get(corner as usize).copied());
                meets_triangle([a?, b?, c?], origin, direction)
            });
            if let Some(distance) = distances.min_by(f32::total_cmp).filter(|distance| *distance < farthest) {
                nearest = Some(Hit { instance: index, distance });
            }
        }
        nearest
    }

    fn follow(&mut self, scene: &Scene) {
        let known = self.meshes.len() == scene.meshes.len()
            && self.meshes.iter().zip(&scene.meshes).all(|(a, b)| Arc::ptr_eq(a, b));
        if !known {
            self.meshes.clone_from(&scene.meshes);
            self.boxes = scene.meshes.iter().map(|mesh| bounds(mesh)).collect();
        }
    }
}

fn bounds(mesh: &Mesh) -> (Vec3, Vec3) {
    mesh.positions.iter().fold((Vec3::MAX, Vec3::MIN), |(low, high), &point| (low.min(point), high.max(point)))
}

/// Slabs; a box without thickness is met too.
fn meets_box((low, high): (Vec3, Vec3), origin: Vec3, direction: Vec3, farthest: f32) -> bool {
    let (mut enter, mut leave) = (0.0f32, farthest);
    for axis in 0..3 {
        if direction[axis].abs() < 1e-20 {
            if !(low[axis]..=high[axis]).contains(&origin[axis]) {
                return false;
            }
            continue;
        }
        let [a, b] = [low[axis], high[axis]].map(|side| (side - origin[axis]) / direction[axis]);
        // A margin for rounding: a hit at the box's side must not be lost.
        let margin = 1e-5 * a.abs().max(b.abs());
        enter = enter.max(a.min(b) - margin);
        leave = leave.min(a.max(b) + margin);
    }
    enter <= leave
}

/// Moeller and Trumbore 1997, from both sides.
fn meets_triangle([a, b, c]: [Vec3; 3], origin: Vec3, direction: Vec3) -> Option<f32> {
    let (edge1, edge2) = (b - a, c - a);
    let p = direction.cross(edge2);
    let determinant = edge1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let inverse = 1.0 / determinant;
    let from_a = origin - a;
    let u = from_a.dot(p) * inverse;
    let q = from_a.cross(edge1);
    let v = direction.dot(q) * inverse;
    let distance = edge2.dot(q) * inverse;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0 && distance.is_finite()).then_some(distance)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    /// The built-in scene from its first camera.
    fn scene() -> (Scene, Vec3, glam::Quat) {
        let scene = tracer::builtin::scene().unwrap().0;
        let camera = scene.cameras[0].clone();
        (scene, camera.position, camera.rotation)
    }

    /// All triangles of the world, no boxes, in f64.
    fn oracle(scene: &Scene, origin: Vec3, direction: Vec3) -> Option<(u32, f64)> {
        let (origin, direction) = (origin.as_dvec3(), direction.as_dvec3());
        let mut nearest: Option<(u32, f64)> = None;
        for (index, instance) in (0..).zip(&scene.instances).filter(|(_, instance)| instance.visible) {
            let mesh = &scene.meshes[instance.mesh as usize];
            for corners in &mesh.triangles {
                let [a, b, c] =
                    corners.map(|i| instance.world_from_mesh.transform_point3(mesh.positions[i as usize]).as_dvec3());
                let normal = (b - a).cross(c - a);
                let t = (a - origin).dot(normal) / direction.dot(normal);
                let point = origin + direction * t;
                let inside =
                    [(a, b), (b, c), (c, a)].iter().all(|(p, q)| (*q - *p).cross(point - *p).dot(normal) >= 0.0);
                if t > 0.0 && inside && nearest.is_none_or(|(_, last)| t < last) {
                    nearest = Some((index, t));
                }
            }
        }
        nearest
    }

    #[test]
    fn picks_what_all_triangles_say() {
        let (mut scene, origin, rotation) = scene();
        let mut picker = Picker::default();
        let mut seen = std::collections::BTreeSet::new();
        for hidden in [false, true] {
            for (x, y) in (-3..=3).flat_map(|x| (-2..=2).map(move |y| (x, y))) {
                let direction = rotation * Vec3::new(x as f32 * 0.17, y as f32 * 0.17, -1.0);
                let found = picker.pick(&scene, origin, direction);
                let expected = oracle(&scene, origin, direction);
                assert_eq!(found.is_some(), expected.is_some(), "{x} {y}");
                let (Some(found), Some((instance, t))) = (found, expected) else { continue };
                assert!((f64::from(found.distance) - t).abs() < 1e-4 * t, "{x} {y}: {found:?} {t}");
                assert!(found.instance == instance || scene.instances[found.instance as usize].visible);
                seen.insert(found.instance);
            }
            if !hidden {
                assert!(seen.len() > 5, "only {seen:?} were met");
                seen.iter().take(3).for_each(|index| scene.instances[*index as usize].visible = false);
            }
        }
    }

    #[test]
    fn nothing_is_picked_where_there_is_nothing() {
        let (mut scene, origin, _) = scene();
        let mut picker = Picker::default();
        assert_eq!(picker.pick(&scene, origin, Vec3::ZERO), None);
        assert_eq!(picker.pick(&scene, Vec3::splat(f32::NAN), Vec3::X), None);
        scene.instances.iter_mut().for_each(|instance| instance.visible = false);
        assert_eq!(picker.pick(&scene, origin, Vec3::X), None);
    }
}
