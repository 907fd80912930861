//! The outline of what is selected: its silhouette on a coarse grid, and the line around that.

use glam::{Affine3A, Vec2, Vec3};
use tracer::scene::{Mesh, Scene};

use crate::preview::navigation::Standpoint;

/// With more triangles than this, the boxes around the meshes are outlined instead: the line is drawn anew whenever the view
/// moves.
const MOST_TRIANGLES: usize = 200_000;
/// What lies nearer to the eye than this part of the object's distance is cut off.
const NEAR: f32 = 1e-4;

/// Which cells of a grid over the view something covers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Silhouette {
    size: [usize; 2],
    covered: Vec<bool>,
}

/// A line from one point of the view to another: +-1 at the edges, y up.
pub type Segment = [Vec2; 2];

impl Silhouette {
    /// Of what instances show, on a grid of so many cells across and down.
    pub fn new(scene: &Scene, instances: &[u32], standpoint: &Standpoint, size: [usize; 2]) -> Self {
        let size = size.map(|side| side.clamp(1, 4096));
        let mut silhouette = Self { size, covered: vec![false; size[0] * size[1]] };
        let placed: Vec<(&Mesh, Affine3A)> = instances
            .iter()
            .filter_map(|index| scene.instances.get(*index as usize).filter(|instance| instance.visible))
            .filter_map(|instance| Some((&**scene.meshes.get(instance.mesh as usize)?, instance.world_from_mesh)))
            .collect();
        let triangles: usize = placed.iter().map(|(mesh, _)| mesh.triangles.len()).sum();
        let view_from_world = standpoint.view.film_from_view().inverse();
        let tan_half = standpoint.view.tan_half;
        for (mesh, world_from_mesh) in placed {
            let in_view = |point: Vec3| {
                let in_view = view_from_world * (world_from_mesh.transform_point3(point) - standpoint.position);
                (in_view / tan_half.extend(1.0)).with_z(-in_view.z)
            };
            if triangles > MOST_TRIANGLES {
                for corners in box_triangles(mesh) {
                    silhouette.cover(corners.map(in_view));
                }
                continue;
            }
            let points: Vec<Vec3> = mesh.positions.iter().map(|&point| in_view(point)).collect();
            for corners in &mesh.triangles {
                let [a, b, c] = corners.map(|corner| points.get(corner as usize).copied());
                if let (Some(a), Some(b), Some(c)) = (a, b, c) {
                    silhouette.cover([a, b, c]);
                }
            }
        }
        silhouette
    }

    /// Covers a triangle: x and y are image-plane offsets times depth, z is the depth ahead.
    fn cover(&mut self, corners: [Vec3; 3]) {
        let (clipped, count) = clip_near(corners);
        let project = |point: Vec3| {
            let [width, height] = self.size.map(|side| side as f32);
            Vec2::new((0.5 + 0.5 * point.x / point.z) * width, (0.5 - 0.5 * point.y / point.z) * height)
        };
        let points = clipped.map(project);
        for fan in 1..count.saturating_sub(1) {
            self.fill([points[0], points[fan], points[fan + 1]]);
        }
    }

    /// Covers all cells whose centre lies in a triangle of the grid, and the cells of its corners: what is thinner than a
    /// cell is seen all the same.
    fn fill(&mut self, corners: [Vec2; 3]) {
        let [width, height] = self.size;
        let [a, b, c] = corners;
        for corner in corners {
            if corner.cmpge(Vec2::ZERO).all() && corner.x < width as f32 && corner.y < height as f32 {
                self.covered[corner.y as usize * width + corner.x as usize] = true;
            }
        }
        let low = a.min(b).min(c).max(Vec2::ZERO);
        let high = a.max(b).max(c).min(Vec2::new(width as f32, height as f32));
        let area = (b - a).perp_dot(c - a);
        if !(low.x < high.x && low.y < high.y) || area == 0.0 || !area.is_finite() {
            return;
        }
        let sign = area.signum();
        for y in low.y as usize..(high.y.ceil() as usize).min(height) {
            for x in low.x as usize..(high.x.ceil() as usize).min(width) {
                let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let inside =
                    [(a, b), (b, c), (c, a)].iter().all(|(p, q)| (*q - *p).perp_dot(centre - *p) * sign >= 0.0);
                if inside {
                    self.covered[y * width + x] = true;
                }
            }
        }
    }

    /// Whether a cell is covered; beyond the grid it is what the nearest cell is, so that no line runs along the window.
    fn at(&self, x: isize, y: isize) -> bool {
        let place = |at: isize, side: usize| at.clamp(0, side as isize - 1) as usize;
        self.covered[place(y, self.size[1]) * self.size[0] + place(x, self.size[0])]
    }

    /// Whether anything is covered.
    pub fn is_empty(&self) -> bool {
        !self.covered.contains(&true)
    }

    /// The line around what is covered, by marching squares between the cells' centres.
    pub fn outline(&self) -> Vec<Segment> {
        let [width, height] = self.size.map(|side| side as isize);
        let to_view = |x: f32, y: f32| Vec2::new(2.0 * x / width as f32 - 1.0, 1.0 - 2.0 * y / height as f32);
        let mut segments = Vec::new();
        for y in 0..=height {
            for x in 0..=width {
                // Corners of the square between four cells: left top, right top, left bottom, right bottom.
                let [lt, rt, lb, rb] = [(x - 1, y - 1), (x, y - 1), (x - 1, y), (x, y)].map(|(x, y)| self.at(x, y));
                let (x, y) = (x as f32, y as f32);
                let [top, bottom] = [to_view(x, y - 0.5), to_view(x, y + 0.5)];
                let [left, right] = [to_view(x - 0.5, y), to_view(x + 0.5, y)];
                let mut line = |crossed: bool, from, to| {
                    if crossed {
                        segments.push([from, to]);
                    }
                };
                match [lt != rt, rt != rb, rb != lb, lb != lt] {
                    [true, true, true, true] => {
                        line(true, top, left);
                        line(true, bottom, right);
                    }
                    [t, r, b, l] => {
                        line(t && b, top, bottom);
                        line(l && r, left, right);
                        line(t && r, top, right);
                        line(r && b, right, bottom);
                        line(b && l, bottom, left);
                        line(l && t, left, top);
                    }
                }
            }
        }
        segments
    }
}

/// What of a triangle lies ahead of the eye: up to four corners, and how many.
fn clip_near(corners: [Vec3; 3]) -> ([Vec3; 4], usize) {
    let farthest = corners.iter().fold(0.0f32, |far, corner| far.max(corner.z));
    let near = (farthest * NEAR).max(f32::MIN_POSITIVE);
    let (mut clipped, mut count) = ([Vec3::ONE; 4], 0);
    let mut push = |point| {
        if count < 4 {
            clipped[count] = point;
            count += 1;
        }
    };
    for (index, &from) in corners.iter().enumerate() {
        let to = corners[(index + 1) % 3];
        if from.z >= near {
            push(from);
        }
        if (from.z >= near) != (to.z >= near) {
            push(from.lerp(to, (near - from.z) / (to.z - from.z)).with_z(near));
        }
    }
    (clipped, count)
}

/// The box around a mesh as twelve triangles.
fn box_triangles(mesh: &Mesh) -> [[Vec3; 3]; 12] {
    let start = (Vec3::MAX, Vec3::MIN);
    let (low, high) = mesh.positions.iter().fold(start, |(low, high), &point| (low.min(point), high.max(point)));
    let corner = |index: usize| {
        Vec3::new(
            if index & 1 > 0 { high.x } else { low.x },
            if index & 2 > 0 { high.y } else { low.y },
            if index & 4 > 0 { high.z } else { low.z },
        )
    };
    const FACES: [[usize; 4]; 6] = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let mut triangles = [[Vec3::ZERO; 3]; 12];
    for (face, [a, b, c, d]) in FACES.into_iter().enumerate() {
        triangles[2 * face] = [corner(a), corner(b), corner(c)];
        triangles[2 * face + 1] = [corner(a), corner(c), corner(d)];
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(low: usize, high: usize) -> Silhouette {
        let mut silhouette = Silhouette { size: [16, 16], covered: vec![false; 256] };
        // Just short of the next cell, which a corner would cover.
        let at = |x: usize, y: usize| Vec2::new(x as f32, y as f32).min(Vec2::splat(high as f32 - 0.01));
        silhouette.fill([at(low, low), at(high, low), at(high, high)]);
        silhouette.fill([at(low, low), at(high, high), at(low, high)]);
        silhouette
    }

    #[test]
    fn the_line_around_a_square_is_closed_and_as_long_as_its_sides() {
        let segments = square(4, 12).outline();
        // Every point of a closed line begins one segment and ends another, or is met twice.
        for end in segments.iter().flatten() {
            let meets = segments.iter().flatten().filter(|other| other.distance(*end) < 1e-5).count();
            assert_eq!(meets, 2, "{end}");
        }
        let length: f32 = segments.iter().map(|[from, to]| from.distance(*to)).sum();
        // Eight cells of 1/8 a side, less the cut corners.
        assert!((3.7..=4.0).contains(&length), "{length}");
    }

    #[test]
    fn what_fills_the_view_or_is_not_in_it_has_no_line() {
        assert_eq!(square(0, 16).outline(), Vec::<Segment>::new());
        let mut behind = Silhouette { size: [8, 8], covered: vec![false; 64] };
        behind.cover([Vec3::new(0.0, 0.0, -1.0), Vec3::new(1.0, 0.0, -1.0), Vec3::new(0.0, 1.0, -1.0)]);
        assert!(behind.is_empty());
    }

    #[test]
    fn a_triangle_that_reaches_behind_the_eye_is_cut() {
        let mut silhouette = Silhouette { size: [8, 8], covered: vec![false; 64] };
        // A floor from far ahead to far behind, below the eye: the lower half of the view.
        let floor = |x: f32, z: f32| Vec3::new(x, -1.0, z);
        silhouette.cover([floor(-1e3, -1e3), floor(1e3, -1e3), floor(0.0, 1e4)]);
        assert!(silhouette.at(4, 7) && silhouette.at(0, 7) && !silhouette.at(4, 1));
        let nonsense = Vec3::splat(f32::NAN);
        silhouette.cover([nonsense, floor(1.0, 1.0), floor(2.0, 3.0)]);
    }
}
