//! What a sketch of a scene needs on the device: its geometry, and one colour for each of its parts.

use glam::Vec3;

use super::{Placed, SceneCache, UploadError, Uploader, tables::Tables};
use crate::{
    features::SceneFeatures,
    gpu::{Complaints, Gpu},
    kernels::KernelConstants,
    scene::{Material, Scene, TexelEncoding, Texture},
};

/// Texels of a texture that its mean colour is found from.
const MOST_TEXELS: usize = 1024;
/// What has no material.
const PLAIN: Vec3 = Vec3::splat(0.5);

/// Geometry on the device, with a colour a part.
pub(crate) struct SketchOnGpu {
    /// Those of the geometry alone.
    pub features: SceneFeatures,
    /// Numbers that the kernel contains.
    pub constants: KernelConstants,
    /// Linear RGB of each entry of the instance table.
    pub part_colors: wgpu::Buffer,
    instances: wgpu::Buffer,
    tables: Tables,
}

impl SketchOnGpu {
    /// Builds and uploads what is not in `cache`; an upload of the same scene finds it there. Scenes that share the cache's tables
    /// are no longer to be traced.
    pub fn upload(gpu: &Gpu, scene: &Scene, cache: &mut SceneCache) -> Result<Self, UploadError> {
        Self::try_upload(gpu, scene, cache).inspect_err(|_| cache.forget_device())
    }

    fn try_upload(gpu: &Gpu, scene: &Scene, cache: &mut SceneCache) -> Result<Self, UploadError> {
        let complaints = Complaints::of(&gpu.device);
        let mut uploader = Uploader { gpu, device_bytes: 0, uploaded_bytes: 0 };
        let placed = Placed::upload(scene, cache, &mut uploader)?;
        let colors: Vec<Vec3> = scene.materials.iter().map(|material| mean_color(scene, material)).collect();
        let color_of = |source: &Option<u32>| {
            let instance = source.and_then(|source| scene.instances.get(source as usize));
            let color = instance.and_then(|instance| colors.get(instance.material as usize));
            color.copied().unwrap_or(PLAIN).extend(1.0).to_array()
        };
        let part_colors: Vec<[f32; 4]> = placed.placement.sources.iter().map(color_of).collect();
        let part_colors = uploader.storage("part colours", &part_colors)?;
        let instances = uploader.storage("instances", &placed.placement.instances)?;
        uploader.settle(complaints)?;
        let (features, constants) = (placed.features(cache.hierarchy()), placed.constants([0; 2]));
        let tables = placed.edit.tables().clone();
        placed.edit.write(gpu);
        Ok(Self { features, constants, part_colors, instances, tables })
    }

    /// Of group 1 of the path kernels, what is there.
    pub fn resources(&self) -> Vec<(u32, wgpu::BindingResource<'_>)> {
        let mut resources = self.tables.resources();
        resources.push((4, self.instances.as_entire_binding()));
        resources
    }
}

/// Of a surface in white light, roughly; what emits is white.
fn mean_color(scene: &Scene, material: &Material) -> Vec3 {
    if material.emission.max_element() > 0.0 {
        return Vec3::ONE;
    }
    let texture = material.base_color_texture.as_ref().and_then(|it| scene.textures.get(it.texture as usize));
    material.base_color.truncate() * texture.map_or(Vec3::ONE, |texture| mean_texel(texture))
}

fn mean_texel(texture: &Texture) -> Vec3 {
    // An odd step visits all columns of a texture whose width is a power of two.
    let step = (texture.texels.len() / MOST_TEXELS) | 1;
    let linear = |texel: &[u8; 4]| {
        let color = Vec3::from_array([0, 1, 2].map(|i| f32::from(texel[i]) / 255.0));
        if texture.encoding == TexelEncoding::Srgb { color.powf(2.2) } else { color }
    };
    let texels = texture.texels.iter().step_by(step);
    let count = texels.len().max(1);
    texels.map(linear).sum::<Vec3>() / count as f32
}
