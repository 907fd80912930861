//! Materials and their texture references in the kernels' layout.

use glam::Vec3;

use crate::{
    kernels::layout::{self, codes},
    scene::{AlphaMode, Material, Scene, TextureRef, WrapMode},
};

/// Materials and texture slots; `offsets` are the textures' first texels in their heap.
pub fn encode(scene: &Scene, offsets: &[u32]) -> (Vec<layout::Material>, Vec<layout::TextureSlot>) {
    let mut slots = Vec::new();
    let materials = scene
        .materials
        .iter()
        .map(|material| {
            encode_one(material, |reference| {
                let Some(reference) = reference else { return codes::NONE };
                slots.push(encode_slot(scene, offsets, reference));
                slots.len() as u32 - 1
            })
        })
        .collect();
    (materials, slots)
}

fn encode_one(m: &Material, mut slot: impl FnMut(Option<&TextureRef>) -> u32) -> layout::Material {
    let alpha = match m.alpha_mode {
        AlphaMode::Opaque => 0,
        AlphaMode::Mask { .. } => codes::MATERIAL_ALPHA_MASK,
        AlphaMode::Blend => codes::MATERIAL_ALPHA_BLEND,
    };
    let flag = |set: bool, bit: u32| if set { bit } else { 0 };
    layout::Material {
        base_color: m.base_color.to_array(),
        emission: m.emission.to_array(),
        flags: alpha
            | flag(m.double_sided, codes::MATERIAL_DOUBLE_SIDED)
            | flag(m.unlit, codes::MATERIAL_UNLIT)
            | flag(m.is_solid(), codes::MATERIAL_SOLID)
            | flag(m.is_clear_sheet(), codes::MATERIAL_CLEAR_SHEET),
        specular_color: m.specular_color.to_array(),
        specular: m.specular,
        absorption: absorption(m).to_array(),
        metallic: m.metallic,
        roughness: m.roughness,
        ior: m.ior,
        transmission: m.transmission,
        alpha_cutoff: if let AlphaMode::Mask { cutoff } = m.alpha_mode { encode_cutoff(cutoff) } else { 0.0 },
        normal_scale: m.normal_scale,
        base_color_texture: slot(m.base_color_texture.as_ref()),
        metallic_roughness_texture: slot(m.metallic_roughness_texture.as_ref()),
        normal_texture: slot(m.normal_texture.as_ref()),
        emissive_texture: slot(m.emissive_texture.as_ref()),
        specular_texture: slot(m.specular_texture.as_ref()),
        specular_color_texture: slot(m.specular_color_texture.as_ref()),
        transmission_texture: slot(m.transmission_texture.as_ref()),
        sheen_color: m.sheen_color.to_array(),
        sheen_roughness: m.sheen_roughness,
        diffuse_transmission_color: m.diffuse_transmission_color.to_array(),
        diffuse_transmission: m.diffuse_transmission,
        anisotropy_direction: [m.anisotropy_rotation.cos(), m.anisotropy_rotation.sin()],
        iridescence_thickness_nm: m.iridescence_thickness_nm,
        anisotropy: m.anisotropy,
        clearcoat: m.clearcoat,
        clearcoat_roughness: m.clearcoat_roughness,
        clearcoat_normal_scale: m.clearcoat_normal_scale,
        iridescence: m.iridescence,
        iridescence_ior: m.iridescence_ior,
        dispersion: m.dispersion,
        sheen_color_texture: slot(m.sheen_color_texture.as_ref()),
        sheen_roughness_texture: slot(m.sheen_roughness_texture.as_ref()),
        diffuse_transmission_texture: slot(m.diffuse_transmission_texture.as_ref()),
        diffuse_transmission_color_texture: slot(m.diffuse_transmission_color_texture.as_ref()),
        anisotropy_texture: slot(m.anisotropy_texture.as_ref()),
        clearcoat_texture: slot(m.clearcoat_texture.as_ref()),
        clearcoat_roughness_texture: slot(m.clearcoat_roughness_texture.as_ref()),
        clearcoat_normal_texture: slot(m.clearcoat_normal_texture.as_ref()),
        iridescence_texture: slot(m.iridescence_texture.as_ref()),
        iridescence_thickness_texture: slot(m.iridescence_thickness_texture.as_ref()),
        pad_0: [0; 3],
    }
}

/// Interpolation rounds: an alpha that equals the cutoff must not fall below it. Above 1 all is cut out.
fn encode_cutoff(cutoff: f32) -> f32 {
    if cutoff > 1.0 { 2.0 } else { cutoff * (1.0 - 1e-6) }
}

/// Beer-Lambert coefficient per metre: after `attenuation_distance` white has become `attenuation_color`.
fn absorption(m: &Material) -> Vec3 {
    if !m.attenuation_distance.is_finite() || m.attenuation_distance <= 0.0 {
        return Vec3::ZERO;
    }
    m.attenuation_color.clamp(Vec3::splat(1e-6), Vec3::ONE).map(|c| -c.ln() / m.attenuation_distance)
}

fn encode_slot(scene: &Scene, offsets: &[u32], reference: &TextureRef) -> layout::TextureSlot {
    let texture = &scene.textures[reference.texture as usize];
    let wrap = |mode| match mode {
        WrapMode::Repeat => codes::WRAP_REPEAT,
        WrapMode::MirroredRepeat => codes::WRAP_MIRROR,
        WrapMode::ClampToEdge => codes::WRAP_CLAMP,
    };
    let filter = if reference.linear_filter { codes::TEXTURE_LINEAR_FILTER } else { 0 };
    let uv = if reference.uv_set == 1 { codes::TEXTURE_UV1 } else { 0 };
    let row = |r: [f32; 3]| [r[0], r[1], r[2], 0.0];
    layout::TextureSlot {
        matrix_u: row(reference.texture_from_uv[0]),
        matrix_v: row(reference.texture_from_uv[1]),
        offset: offsets[reference.texture as usize],
        size: (texture.width - 1) | (texture.height - 1) << 16,
        flags: filter | uv | wrap(reference.wrap[0]) << 8 | wrap(reference.wrap[1]) << 10,
        unused: 0,
    }
}
