//! Shading attributes in their packed form.

use glam::{Affine3A, Vec2, Vec3, Vec4};

use crate::{kernels::layout, scene::Mesh};

/// Packed vertices of a mesh, in its own order. With `world_from_mesh` their vectors are taken to the world.
pub(super) fn encode(
    mesh: &Mesh,
    world_from_mesh: Option<&Affine3A>,
    part: u32,
) -> impl Iterator<Item = layout::Vertex> {
    let placement = world_from_mesh.copied().unwrap_or(Affine3A::IDENTITY);
    let normals = placement.matrix3.inverse().transpose();
    let handedness = placement.matrix3.determinant().signum();
    (0..mesh.positions.len()).map(move |i| {
        let normal = normals * mesh.normals.get(i).copied().unwrap_or(Vec3::Y);
        let tangent = mesh.tangents.get(i).copied().unwrap_or(Vec4::new(1.0, 0.0, 0.0, 1.0));
        let direction = placement.transform_vector3(tangent.truncate());
        let uv = |set: usize| mesh.uvs[set].get(i).copied().unwrap_or(Vec2::ZERO);
        let color = mesh.colors.get(i).copied().unwrap_or(Vec4::ONE);
        layout::Vertex {
            normal: encode_octahedral(normal),
            // The lowest bit carries the handedness.
            tangent: encode_octahedral(direction) & !1 | u32::from(tangent.w * handedness < 0.0),
            u0: uv(0).x,
            v0: uv(0).y,
            u1: uv(1).x,
            v1: uv(1).y,
            color_rg: pack_unorm16(color.x, color.y),
            color_ba: pack_unorm16(color.z, color.w),
            part,
        }
    })
}

fn pack_unorm16(a: f32, b: f32) -> u32 {
    let quantise = |x: f32| (x.clamp(0.0, 1.0) * 65535.0).round() as u32;
    quantise(a) | quantise(b) << 16
}

/// The unit vector that [`encode_octahedral`] was given, within its error.
pub fn decode_octahedral(packed: u32) -> Vec3 {
    let coordinate = |shift: u32| (f32::from((packed >> shift) as u16 as i16) / 32767.0).max(-1.0);
    let (x, y) = (coordinate(0), coordinate(16));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let unfold = |a: f32| if a >= 0.0 { a - fold } else { a + fold };
    Vec3::new(unfold(x), unfold(y), z).normalize()
}

/// Octahedral map of a direction, of any length, to two signed normalised 16-bit numbers (Cigolle et al. 2014); error 5e-5 rad.
pub fn encode_octahedral(n: Vec3) -> u32 {
    let n = n / (n.x.abs() + n.y.abs() + n.z.abs()).max(1e-20);
    let fold = |a: f32, b: f32| (1.0 - b.abs()) * if a >= 0.0 { 1.0 } else { -1.0 };
    let (x, y) = if n.z >= 0.0 { (n.x, n.y) } else { (fold(n.x, n.y), fold(n.y, n.x)) };
    let quantise = |x: f32| u32::from((x.clamp(-1.0, 1.0) * 32767.0).round() as i16 as u16);
    quantise(x) | quantise(y) << 16
}
