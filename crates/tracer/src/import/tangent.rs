//! Tangents by MikkTSpace, the basis in which normal maps are baked.

use std::collections::HashMap;

use glam::{Vec2, Vec3, Vec4};

use super::primitive::Vertices;

/// One tangent per triangle corner.
struct Corners<'a> {
    vertices: &'a Vertices,
    uvs: &'a [Vec2],
    triangles: &'a [[u32; 3]],
    tangents: Vec<[Vec4; 3]>,
}

impl Corners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.triangles[face][corner] as usize
    }
}

impl mikktspace::Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.triangles.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        self.vertices.positions[self.vertex(face, vert)].to_array()
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        self.vertices.normals[self.vertex(face, vert)].to_array()
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        self.uvs[self.vertex(face, vert)].to_array()
    }

    fn set_tangent_encoded(&mut self, [x, y, z, sign]: [f32; 4], face: usize, vert: usize) {
        // The sign is that of a v axis pointing up; glTF's points down.
        self.tangents[face][vert] = Vec4::new(x, y, z, -sign);
    }
}

/// Gives `vertices` tangents along texture coordinate set `uv_set`. Vertices where the tangents of adjoining triangles
/// differ are split.
pub(super) fn generate(vertices: &mut Vertices, triangles: &mut [[u32; 3]], uv_set: usize) {
    let unset = vec![[Vec4::ZERO; 3]; triangles.len()];
    let mut corners = Corners { vertices, uvs: &vertices.uvs[uv_set], triangles, tangents: unset };
    mikktspace::generate_tangents(&mut corners);
    let tangents = corners.tangents;
    split(vertices, triangles, &tangents);
}

fn split(vertices: &mut Vertices, triangles: &mut [[u32; 3]], tangents: &[[Vec4; 3]]) {
    let mut first: Vec<Option<Vec4>> = vec![None; vertices.positions.len()];
    let mut copies: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    let mut split_tangents = Vec::new();
    for (triangle, tangents) in triangles.iter_mut().zip(tangents) {
        for (vertex, &raw) in triangle.iter_mut().zip(tangents) {
            let tangent = usable(raw, vertices.normals[*vertex as usize]);
            let own = *first[*vertex as usize].get_or_insert(tangent);
            if own != tangent {
                let key = (*vertex, tangent.to_array().map(f32::to_bits));
                *vertex = *copies.entry(key).or_insert_with(|| {
                    split_tangents.push(tangent);
                    vertices.duplicate(*vertex as usize)
                });
            }
        }
    }
    vertices.tangents = first.into_iter().map(|t| t.unwrap_or(Vec4::new(1.0, 0.0, 0.0, 1.0))).collect();
    vertices.tangents.extend(split_tangents);
}

/// A unit tangent with handedness +-1; where the algorithm found none (no texture area), any one along the surface.
pub(super) fn usable(tangent: Vec4, normal: Vec3) -> Vec4 {
    let axis = tangent.truncate().try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
    axis.extend(if tangent.w < 0.0 { -1.0 } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit quad in the xy plane facing +Z; u runs along +x, v down along -y as in glTF images.
    fn quad(mirrored: bool) -> (Vertices, Vec<[u32; 3]>) {
        let u = |x: f32| if mirrored { 1.0 - x } else { x };
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let vertices = Vertices {
            positions: corners.iter().map(|&[x, y]| Vec3::new(x, y, 0.0)).collect(),
            normals: vec![Vec3::Z; 4],
            uvs: [corners.iter().map(|&[x, y]| Vec2::new(u(x), 1.0 - y)).collect(), Vec::new()],
            ..Vertices::default()
        };
        (vertices, vec![[0, 1, 2], [0, 2, 3]])
    }

    #[test]
    fn bitangent_points_up_in_the_image() {
        for (mirrored, expected) in [(false, Vec4::new(1.0, 0.0, 0.0, 1.0)), (true, Vec4::new(-1.0, 0.0, 0.0, -1.0))] {
            let (mut vertices, mut triangles) = quad(mirrored);
            generate(&mut vertices, &mut triangles, 0);
            assert_eq!(vertices.tangents.len(), 4, "no vertex needs splitting");
            for tangent in &vertices.tangents {
                assert!(tangent.abs_diff_eq(expected, 1e-6), "{tangent}, expected {expected}");
                let bitangent = Vec3::Z.cross(tangent.truncate()) * tangent.w;
                assert!(bitangent.abs_diff_eq(Vec3::Y, 1e-6), "+Y of a normal map is up in the image");
            }
        }
    }

    #[test]
    fn vertices_on_a_mirror_seam_are_split() {
        let (mut vertices, _) = quad(false);
        // A second quad to the right whose u runs back.
        for (x, y) in [(2.0, 0.0), (2.0, 1.0)] {
            vertices.positions.push(Vec3::new(x, y, 0.0));
            vertices.normals.push(Vec3::Z);
            vertices.uvs[0].push(Vec2::new(2.0 - x, 1.0 - y));
        }
        let mut triangles = vec![[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]];
        generate(&mut vertices, &mut triangles, 0);
        assert_eq!(vertices.positions.len(), 8, "the two seam vertices are doubled");
        assert_eq!(vertices.tangents.len(), 8);
        for (t, expected) in [(0, 1.0), (1, 1.0), (2, -1.0), (3, -1.0)] {
            for &vertex in &triangles[t] {
                let tangent = vertices.tangents[vertex as usize];
                assert!((tangent.x - expected).abs() < 1e-6 && tangent.w == expected, "triangle {t}: {tangent}");
            }
        }
    }

    #[test]
    fn odd_geometry_gets_unit_tangents() {
        let mut state = 0x9E37_79B9_7F4A_7C15u64;
        let mut next = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state >> 33
        };
        const ODD: [f32; 8] = [0.0, 1.0, -1.0, 1e-30, 1e30, -3e38, 0.5, 1e-45];
        for round in 0..200 {
            let count = 4 + (next() % 30) as usize;
            let mut value = |odd: bool| {
                let pick = next();
                if odd { ODD[pick as usize % 8] } else { (pick % 1000) as f32 / 500.0 - 1.0 }
            };
            let (odd_positions, odd_uvs) = (round % 2 == 1, round % 4 >= 2);
            let mut vertices = Vertices::default();
            for _ in 0..count {
                vertices.positions.push(Vec3::from_array(std::array::from_fn(|_| value(odd_positions))));
                vertices.uvs[0].push(Vec2::from_array(std::array::from_fn(|_| value(odd_uvs))));
                vertices.normals.push(Vec3::new(value(false), value(false), 1.5).normalize());
            }
            let mut triangles: Vec<[u32; 3]> =
                (0..60).map(|_| std::array::from_fn(|_| next() as u32 % count as u32)).collect();
            generate(&mut vertices, &mut triangles, 0);
            assert_eq!(vertices.tangents.len(), vertices.positions.len());
            for tangent in &vertices.tangents {
                assert!(
                    (tangent.truncate().length() - 1.0).abs() < 1e-4 && tangent.w.abs() == 1.0,
                    "{round}: {tangent}"
                );
            }
        }
    }
}
