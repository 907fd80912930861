//! Geometry: triangle soups made of parametric grids, joined into indexed meshes with creased normals.

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::{Affine3A, Quat, Vec2, Vec3};

/// Positions are multiples of 2^-14 m (0.06 mm).
const SNAP: f32 = 16384.0;

#[derive(Clone, Copy)]
struct Corner {
    position: Vec3,
    uv: Vec2,
}

/// Triangles without connectivity, counter-clockwise seen from outside.
#[derive(Clone, Default)]
pub(super) struct Soup {
    triangles: Vec<[Corner; 3]>,
}

/// An indexed mesh.
pub(super) struct Shape {
    pub(super) positions: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) indices: Vec<u32>,
}

pub(super) fn sin_cos(turns: f32) -> (f32, f32) {
    let (sin, cos) = (f64::from(turns) * TAU).sin_cos();
    (sin as f32, cos as f32)
}

fn snap(v: Vec3) -> Vec3 {
    (v * SNAP).round() / SNAP
}

impl Soup {
    /// `columns` x `rows` quads over (u, v) in the unit square; du x dv points outside.
    pub(super) fn grid(columns: usize, rows: usize, surface: impl Fn(f32, f32) -> Vec3) -> Self {
        let corner = |c: usize, r: usize| {
            let uv = Vec2::new(c as f32 / columns as f32, r as f32 / rows as f32);
            Corner { position: snap(surface(uv.x, uv.y)), uv: Vec2::new(uv.x, 1.0 - uv.y) }
        };
        let mut soup = Self::default();
        for r in 0..rows {
            for c in 0..columns {
                let [a, b, d, e] = [corner(c, r), corner(c + 1, r), corner(c + 1, r + 1), corner(c, r + 1)];
                soup.push([a, b, d]);
                soup.push([a, d, e]);
            }
        }
        soup
    }

    fn push(&mut self, triangle: [Corner; 3]) {
        let [a, b, c] = triangle.map(|corner| corner.position);
        if a != b && b != c && c != a {
            self.triangles.push(triangle);
        }
    }

    pub(super) fn and(mut self, other: Self) -> Self {
        self.triangles.extend(other.triangles);
        self
    }

    pub(super) fn moved(mut self, transform: Affine3A) -> Self {
        for corner in self.triangles.as_flattened_mut() {
            corner.position = snap(transform.transform_point3(corner.position));
        }
        self
    }

    pub(super) fn at(self, x: f32, y: f32, z: f32) -> Self {
        self.moved(Affine3A::from_translation(Vec3::new(x, y, z)))
    }

    pub(super) fn turned(self, axis: Vec3, turns: f32) -> Self {
        let (sin, cos) = sin_cos(turns / 2.0);
        self.moved(Affine3A::from_quat(Quat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos)))
    }

    /// Repeats the texture `u` by `v` times.
    pub(super) fn tiled(mut self, u: f32, v: f32) -> Self {
        for corner in self.triangles.as_flattened_mut() {
            corner.uv *= Vec2::new(u, v);
        }
        self
    }

    /// Joins equal corners. Normals are smooth across edges whose faces differ by less than `crease_deg`.
    pub(super) fn finish(&self, crease_deg: f32) -> Shape {
        let key = |v: Vec3| v.to_array().map(f32::to_bits);
        let normal = |t: &[Corner; 3]| (t[1].position - t[0].position).cross(t[2].position - t[0].position);
        let faces: Vec<Vec3> = self.triangles.iter().map(normal).collect();
        let mut around: HashMap<[u32; 3], Vec<usize>> = HashMap::new();
        for (face, triangle) in self.triangles.iter().enumerate() {
            for corner in triangle {
                around.entry(key(corner.position)).or_default().push(face);
            }
        }
        let limit = f64::from(crease_deg).to_radians().cos() as f32;
        let mut shape = Shape { positions: vec![], normals: vec![], uvs: vec![], indices: vec![] };
        let mut index_of = HashMap::new();
        for (triangle, face) in self.triangles.iter().zip(&faces) {
            let own = face.normalize_or(Vec3::Y);
            for corner in triangle {
                let adjoining = around[&key(corner.position)].iter().map(|&f| faces[f]);
                let sum: Vec3 = adjoining.filter(|f| f.normalize_or(Vec3::Y).dot(own) >= limit).sum();
                let normal = (sum.normalize_or(own) * 1024.0).round() / 1024.0;
                let uv = (corner.uv * 4096.0).round() / 4096.0;
                let identity = (key(corner.position), key(normal), uv.to_array().map(f32::to_bits));
                let index = *index_of.entry(identity).or_insert_with(|| {
                    shape.positions.push(corner.position);
                    shape.normals.push(normal.normalize_or(own));
                    shape.uvs.push(uv);
                    shape.positions.len() as u32 - 1
                });
                shape.indices.push(index);
            }
        }
        shape
    }
}

/// A surface of revolution about +Y. The profile holds (radius, height) and runs upwards along outer walls.
pub(super) fn lathe(profile: &[[f32; 2]], segments: usize) -> Soup {
    let last = profile.len() - 1;
    Soup::grid(segments, last, |u, v| {
        let [radius, height] = profile[((v * last as f32).round() as usize).min(last)];
        let (sin, cos) = sin_cos(u);
        Vec3::new(radius * sin, height, radius * cos)
    })
}

/// A smooth curve through control points (Catmull-Rom), `steps` to each span.
pub(super) fn curve(points: &[[f32; 2]], steps: usize) -> Vec<[f32; 2]> {
    let at = |i: isize| Vec2::from_array(points[i.clamp(0, points.len() as isize - 1) as usize]);
    let mut out = Vec::new();
    for span in 0..points.len() - 1 {
        let i = span as isize;
        let (a, b, c, d) = (at(i - 1), at(i), at(i + 1), at(i + 2));
        for step in 0..steps {
            let t = step as f32 / steps as f32;
            let p = 2.0 * b
                + (c - a) * t
                + (2.0 * a - 5.0 * b + 4.0 * c - d) * (t * t)
                + (3.0 * b - a - 3.0 * c + d) * (t * t * t);
            out.push([(p.x / 2.0).max(0.0), p.y / 2.0]);
        }
    }
    out.push(points[points.len() - 1]);
    out
}

pub(super) fn sphere(radius: f32, segments: usize) -> Soup {
    Soup::grid(segments, segments / 2, |u, v| {
        let (sin_u, cos_u) = sin_cos(u);
        let (sin_v, cos_v) = sin_cos(v / 2.0);
        radius * Vec3::new(sin_v * sin_u, -cos_v, sin_v * cos_u)
    })
}

/// A ring about +Y. `stretch` elongates it along x, as a chain link is.
pub(super) fn torus(ring: f32, tube: f32, stretch: f32, segments: [usize; 2]) -> Soup {
    Soup::grid(segments[0], segments[1], |u, v| {
        let ((sin_u, cos_u), (sin_v, cos_v)) = (sin_cos(u), sin_cos(v));
        let shift = if sin_u.abs() < 1e-4 { 0.0 } else { stretch * sin_u.signum() };
        Vec3::new((ring + tube * cos_v) * sin_u + shift, tube * sin_v, (ring + tube * cos_v) * cos_u)
    })
}

/// A tube along a path in the xy plane; radii run from `from` to `to`.
pub(super) fn tube(path: &[[f32; 2]], from: f32, to: f32, segments: usize) -> Soup {
    let last = path.len() - 1;
    Soup::grid(segments, last, |u, v| {
        let i = ((v * last as f32).round() as usize).min(last);
        let point = |i: usize| Vec2::from_array(path[i]);
        let along = (point((i + 1).min(last)) - point(i.saturating_sub(1))).normalize_or(Vec2::Y);
        let side = Vec3::new(along.y, -along.x, 0.0);
        let (sin, cos) = sin_cos(u);
        point(i).extend(0.0) + (side * cos - Vec3::Z * sin) * (from + (to - from) * v)
    })
}

/// A box about the origin with bevelled edges; `bevel` 0 gives six plain faces.
pub(super) fn cuboid(size: [f32; 3], bevel: f32) -> Soup {
    let half = Vec3::from_array(size) / 2.0;
    let inner = half - bevel;
    let steps = if bevel > 0.0 { 3 } else { 1 };
    let place = |t: f32, axis: usize| -> f32 {
        let stops = [-half[axis], -inner[axis], inner[axis], half[axis]];
        if steps == 1 { (2.0 * t - 1.0) * half[axis] } else { stops[(t * 3.0).round() as usize] }
    };
    let mut soup = Soup::default();
    for axis in 0..3 {
        for side in [-1.0f32, 1.0] {
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            soup = soup.and(Soup::grid(steps, steps, |u, v| {
                let mut p = Vec3::ZERO;
                p[axis] = side * half[axis];
                // Mirrored on the negative side, so that the outside stays outside.
                p[a] = place(if side > 0.0 { u } else { 1.0 - u }, a);
                p[b] = place(v, b);
                let core = p.clamp(-inner, inner);
                if bevel > 0.0 { core + (p - core).normalize_or(Vec3::ZERO) * bevel } else { p }
            }));
        }
    }
    soup
}

/// A rectangle in the xy plane facing +Z, centred.
pub(super) fn panel(width: f32, height: f32) -> Soup {
    Soup::grid(1, 1, |u, v| Vec3::new((u - 0.5) * width, (v - 0.5) * height, 0.0))
}
