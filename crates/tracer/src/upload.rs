//! A scene version as buffers and textures of the device.

use std::time::Instant;

use glam::Vec3;
use thiserror::Error;
use wgpu::util::DeviceExt;

use crate::{
    features::{Feature, SceneFeatures},
    gpu::Gpu,
    kernels::KernelConstants,
    scene::Scene,
};

mod albedo;
mod alias;
mod environment;
mod geometry;
mod lights;
mod materials;
mod texels;
mod vertices;

pub use alias::AliasTable;
pub use geometry::BlasCache;
use geometry::Geometry;

/// Why a scene cannot go to the device.
#[derive(Debug, Error)]
pub enum UploadError {
    /// One buffer would exceed what the adapter binds.
    #[error("the scene's {what} need {bytes} bytes in one buffer; adapter {adapter} allows {limit}")]
    TooLarge {
        /// Which data.
        what: &'static str,
        /// What they need.
        bytes: u64,
        /// What the adapter allows.
        limit: u64,
        /// Its name.
        adapter: String,
    },
    /// The device has no memory left for it.
    #[error("the device has no room for the scene's {what} ({bytes} bytes)")]
    OutOfMemory {
        /// Which data.
        what: &'static str,
        /// What they need.
        bytes: u64,
    },
}

/// What an upload took and made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UploadReport {
    /// Seconds to build the hierarchies.
    pub bvh_build_secs: f64,
    /// Seconds to encode and hand over the rest.
    pub upload_secs: f64,
    /// Bytes of buffers and textures on the device.
    pub device_bytes: u64,
    /// Triangles in the hierarchies, each mesh once.
    pub triangles: u64,
    /// Lights in the alias table.
    pub lights: u32,
}

/// A scene on the device, ready to bind.
#[derive(Debug)]
pub struct SceneOnGpu {
    /// What the kernels must contain.
    pub features: SceneFeatures,
    /// Numbers that the kernels contain.
    pub constants: KernelConstants,
    /// Buffers and textures in the order of `shaders/path_bindings.wesl`, group 1.
    pub bindings: SceneBindings,
    /// The scene's instance behind each entry of the instance table; `None` for the static mesh as a whole.
    pub sources: Vec<Option<u32>>,
    /// Entries of the light table.
    pub light_count: u32,
    /// Probability of sampling the environment instead of a light.
    pub environment_probability: f32,
    /// Radiance of a constant environment, or the factor of an image's.
    pub environment_radiance: Vec3,
    /// Turns to the right of the environment image.
    pub environment_rotation_turns: f32,
    /// Largest radiance of any source, for the film's scale.
    pub brightest_radiance: f32,
    /// What it took.
    pub report: UploadReport,
}

/// Group 1 of the path kernels.
#[derive(Debug)]
pub struct SceneBindings {
    /// Storage buffers, binding 0 to 7.
    pub buffers: [wgpu::Buffer; 8],
    /// Textures, binding 8 to 12.
    pub textures: [wgpu::TextureView; 5],
}

/// Uploads buffers and keeps count.
struct Uploader<'a> {
    gpu: &'a Gpu,
    bytes: u64,
}

impl Uploader<'_> {
    fn storage<T: bytemuck::NoUninit>(&mut self, what: &'static str, data: &[T]) -> Result<wgpu::Buffer, UploadError> {
        // A binding must not be empty.
        const EMPTY: [u8; 128] = [0; 128];
        let contents: &[u8] = if data.is_empty() { &EMPTY } else { bytemuck::cast_slice(data) };
        let bytes = contents.len() as u64;
        let limit = self.gpu.largest_binding();
        if bytes > limit {
            let adapter = self.gpu.info().name.clone();
            return Err(UploadError::TooLarge { what, bytes, limit, adapter });
        }
        self.bytes += bytes;
        Ok(self.gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(what),
            contents,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        }))
    }
}

/// A texture of four floats a texel.
fn upload_image(gpu: &Gpu, label: &str, [width, height]: [u32; 2], texels: &[[f32; 4]]) -> wgpu::TextureView {
    gpu.device
        .create_texture_with_data(
            &gpu.queue,
            &wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba32Float,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            },
            wgpu::util::TextureDataOrder::LayerMajor,
            bytemuck::cast_slice(texels),
        )
        .create_view(&Default::default())
}

impl SceneOnGpu {
    /// Builds what is missing in `cache`, encodes the scene and uploads it.
    ///
    /// # Errors
    /// When a part exceeds the adapter's limits or its memory.
    pub fn upload(gpu: &Gpu, scene: &Scene, cache: &mut BlasCache) -> Result<Self, UploadError> {
        let started = Instant::now();
        let mut geometry = Geometry::build(scene, cache);
        let bvh_build_secs = started.elapsed().as_secs_f64();

        let started = Instant::now();
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let mut uploader = Uploader { gpu, bytes: 0 };
        let light_table = lights::LightTable::build(scene, &mut geometry);
        let (texels, offsets) = texels::TexelHeap::upload(gpu, &scene.textures, &mut uploader.bytes)?;
        let (materials, slots) = materials::encode(scene, &offsets);
        let environment = environment::EnvironmentOnGpu::build(gpu, &scene.environment, &mut uploader.bytes)?;
        let features = SceneFeatures::of(scene);
        let lobe_tables = albedo::upload(gpu, features, &mut uploader.bytes);
        let buffers = [
            uploader.storage("hierarchy nodes", &geometry.nodes)?,
            uploader.storage("triangle positions", &geometry.positions)?,
            uploader.storage("triangles", &geometry.triangles)?,
            uploader.storage("vertices", &geometry.vertices)?,
            uploader.storage("instances", &geometry.instances)?,
            uploader.storage("materials", &materials)?,
            uploader.storage("texture slots", &slots)?,
            uploader.storage("lights", &light_table.lights)?,
        ];
        if pollster::block_on(scope.pop()).is_some() {
            return Err(UploadError::OutOfMemory { what: "buffers and textures", bytes: uploader.bytes });
        }

        let light_count = light_table.lights.len() as u32;
        let has_image = environment.cells_size[0] > 0;
        Ok(Self {
            features: features
                .with(Feature::Lights, light_count > 0)
                .with(Feature::Instances, !geometry.is_single_level),
            constants: KernelConstants {
                stack_size: geometry.stack_size,
                root_node: geometry.root,
                environment_cells: environment.cells_size,
            },
            bindings: SceneBindings {
                buffers,
                textures: [texels.srgb, texels.linear, environment.image, environment.cells, lobe_tables],
            },
            sources: geometry.sources,
            light_count,
            environment_probability: match (has_image, light_count > 0) {
                (true, true) => 0.5,
                (true, false) => 1.0,
                (false, _) => 0.0,
            },
            environment_radiance: environment.radiance,
            environment_rotation_turns: environment.rotation_turns,
            brightest_radiance: environment.brightest.max(light_table.brightest).max(1.0),
            report: UploadReport {
                bvh_build_secs,
                upload_secs: started.elapsed().as_secs_f64(),
                device_bytes: uploader.bytes,
                triangles: geometry.triangles.len() as u64,
                lights: light_count,
            },
        })
    }
}
