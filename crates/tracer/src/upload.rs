//! A scene version as buffers and textures of the device.

use std::time::Instant;

use glam::Vec3;
use thiserror::Error;
use wgpu::util::DeviceExt;

use crate::{
    features::{Feature, SceneFeatures},
    gpu::{Complaints, Gpu, free_text},
    kernels::KernelConstants,
    scene::{Environment, Scene},
};

mod albedo;
mod alias;
mod cache;
mod environment;
mod geometry;
mod lights;
mod materials;
mod pages;
mod placed;
mod placement;
mod sketch;
mod tables;
mod texels;
mod vertices;

pub(crate) use vertices::decode_octahedral;

pub use albedo::lobe_albedos;
pub use alias::AliasTable;
pub use cache::SceneCache;
use pages::Pages;
use placed::Placed;
pub(crate) use sketch::SketchOnGpu;
pub use tables::Edit;
use tables::Tables;

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
    #[error("the scene's {what} need {bytes} bytes, more than adapter {adapter} can give{}", free_text(free))]
    OutOfMemory {
        /// Which data.
        what: &'static str,
        /// What they need.
        bytes: u64,
        /// Its name.
        adapter: String,
        /// Bytes of memory that are free, where that is known.
        free: Option<u64>,
    },
    /// The device refused it for another reason.
    #[error("the device refused the scene: {cause}")]
    Refused {
        /// As wgpu has it.
        cause: String,
    },
}

/// What an upload took and made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UploadReport {
    /// Seconds to build the hierarchies of meshes and to encode and hand over their triangles.
    pub bvh_build_secs: f64,
    /// Seconds to encode and hand over the rest.
    pub upload_secs: f64,
    /// Bytes of buffers and textures on the device.
    pub device_bytes: u64,
    /// Bytes of those that hold hierarchies, corners, triangles and vertices.
    pub geometry_bytes: u64,
    /// Bytes of the whole that were handed over now; the rest was there since an earlier version of the scene.
    pub uploaded_bytes: u64,
    /// Triangles in the hierarchies, each mesh once.
    pub triangles: u64,
    /// Lights in the alias table.
    pub lights: u32,
}

/// A scene on the device, ready to bind. Clones share what is there.
#[derive(Clone, Debug)]
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
    /// What camera rays see instead of the environment.
    pub backdrop: Option<Vec3>,
    /// Largest radiance of any source, for the film's scale.
    pub brightest_radiance: f32,
    /// What it took.
    pub report: UploadReport,
}

/// Group 1 of the path kernels.
#[derive(Clone, Debug)]
pub struct SceneBindings {
    /// Storage buffers, binding 0 to 7; the first four hold nothing where the geometry is in textures.
    pub buffers: [wgpu::Buffer; 8],
    /// Textures, binding 8 to 12.
    pub textures: [wgpu::TextureView; 5],
    /// The geometry's tables where they are textures, binding 13 to 16.
    pub geometry: Option<[wgpu::TextureView; 4]>,
}

/// Uploads buffers and keeps count.
struct Uploader<'a> {
    gpu: &'a Gpu,
    /// Of the scene.
    device_bytes: u64,
    /// Of those, new.
    uploaded_bytes: u64,
}

impl Uploader<'_> {
    fn storage<T: bytemuck::NoUninit>(&mut self, what: &'static str, data: &[T]) -> Result<wgpu::Buffer, UploadError> {
        // A binding must hold one element.
        let empty = vec![0; size_of::<T>().next_multiple_of(16)];
        let contents: &[u8] = if data.is_empty() { &empty } else { bytemuck::cast_slice(data) };
        let bytes = contents.len() as u64;
        self.check(what, bytes)?;
        self.count_new(bytes);
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        Ok(self.gpu.buffer(what, contents, usage))
    }

    fn check(&self, what: &'static str, bytes: u64) -> Result<(), UploadError> {
        let limit = self.gpu.largest_binding();
        if bytes <= limit {
            return Ok(());
        }
        Err(UploadError::TooLarge { what, bytes, limit, adapter: self.gpu.info().name.clone() })
    }

    /// That there is room for so many bytes more, as far as that can be known beforehand.
    fn check_memory(&self, what: &'static str, bytes: u64) -> Result<(), UploadError> {
        if self.gpu.lacks_memory(bytes) { Err(self.out_of_memory(what, bytes)) } else { Ok(()) }
    }

    /// Finds out whether the device took all that was handed over.
    fn settle(&self, complaints: Complaints) -> Result<(), UploadError> {
        let Some(error) = complaints.end() else { return Ok(()) };
        // Then all is refused, and noticed by whoever waits for the device.
        if self.gpu.is_lost() {
            return Ok(());
        }
        Err(match error {
            wgpu::Error::OutOfMemory { .. } => self.out_of_memory("buffers and textures", self.device_bytes),
            error => UploadError::Refused { cause: error.to_string() },
        })
    }

    fn out_of_memory(&self, what: &'static str, bytes: u64) -> UploadError {
        let adapter = self.gpu.info().name.clone();
        UploadError::OutOfMemory { what, bytes, adapter, free: self.gpu.free_memory() }
    }

    fn count_new(&mut self, bytes: u64) {
        self.device_bytes += bytes;
        self.uploaded_bytes += bytes;
    }

    /// Counts what may have been on the device already.
    fn count(&mut self, bytes: u64, is_new: bool) {
        self.device_bytes += bytes;
        self.uploaded_bytes += if is_new { bytes } else { 0 };
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
    /// Builds and uploads what is not in `cache` since an earlier version of the scene, but for an edit of tables that this version
    /// shares with the last one: once it is written, the last version can no longer be traced. If it is not to be written, the cache
    /// must forget it.
    ///
    /// # Errors
    /// When a part exceeds the adapter's limits or its memory.
    pub fn upload(gpu: &Gpu, scene: &Scene, cache: &mut SceneCache) -> Result<(Self, Edit), UploadError> {
        Self::try_upload(gpu, scene, cache).inspect_err(|_| cache.forget_device())
    }

    fn try_upload(gpu: &Gpu, scene: &Scene, cache: &mut SceneCache) -> Result<(Self, Edit), UploadError> {
        let started = Instant::now();
        let complaints = Complaints::of(&gpu.device);
        let mut uploader = Uploader { gpu, device_bytes: 0, uploaded_bytes: 0 };
        let mut placed = Placed::upload(scene, cache, &mut uploader)?;
        let shapes_secs = started.elapsed().as_secs_f64();
        let light_table = lights::LightTable::build(scene, &placed.shapes, &mut placed.placement);
        let texels = cache.texels(scene, &mut uploader)?;
        let (materials, slots) = materials::encode(scene, &texels.offsets);
        let environment = cache.environment(&scene.environment, &mut uploader)?;
        let features = SceneFeatures::of(scene);
        let lobe_tables = cache.lobe_tables(features, &mut uploader);
        let constants = placed.constants(environment.cells_size);
        // Lights without power are none.
        let features = features.without(Feature::Lights, light_table.lights.is_empty());
        let features = features.union(placed.features(cache.hierarchy()));
        let Placed { shapes, placement, edit } = placed;
        let geometry_bytes = edit.tables().bytes();
        let ([nodes, positions, triangles, vertices], geometry) = match edit.tables() {
            Tables::Buffers(buffers) => (buffers.clone(), None),
            Tables::Textures(tables) => {
                let none = uploader.storage::<u32>("no geometry", &[])?;
                (std::array::from_fn(|_| none.clone()), Some(tables.each_ref().map(|pages: &Pages| pages.view.clone())))
            }
        };
        let buffers = [
            nodes,
            positions,
            triangles,
            vertices,
            cache.table("instances", &placement.instances, &mut uploader)?,
            cache.table("materials", &materials, &mut uploader)?,
            cache.table("texture slots", &slots, &mut uploader)?,
            cache.table("lights", &light_table.lights, &mut uploader)?,
        ];
        uploader.settle(complaints)?;

        let light_count = light_table.lights.len() as u32;
        let backdrop = scene.backdrop.color();
        let has_image = environment.cells_size[0] > 0;
        let (radiance, rotation_turns, brightest) = match &scene.environment {
            Environment::Constant(radiance) => (*radiance, 0.0, radiance.max_element()),
            Environment::Image { rotation_deg, intensity, .. } => {
                (Vec3::splat(*intensity), rotation_deg / 360.0, environment.brightest * intensity)
            }
        };
        let uploaded = Self {
            features,
            constants,
            bindings: SceneBindings {
                buffers,
                textures: [
                    texels.srgb.clone(),
                    texels.linear.clone(),
                    environment.image.clone(),
                    environment.cells.clone(),
                    lobe_tables,
                ],
                geometry,
            },
            sources: placement.sources,
            light_count,
            environment_probability: match (has_image, light_count > 0) {
                (true, true) => 0.5,
                (true, false) => 1.0,
                (false, _) => 0.0,
            },
            environment_radiance: radiance,
            environment_rotation_turns: rotation_turns,
            backdrop,
            brightest_radiance: brightest
                .max(light_table.brightest)
                .max(backdrop.map_or(0.0, Vec3::max_element))
                .max(1.0),
            report: UploadReport {
                bvh_build_secs: shapes_secs,
                upload_secs: started.elapsed().as_secs_f64() - shapes_secs,
                device_bytes: uploader.device_bytes,
                geometry_bytes,
                uploaded_bytes: uploader.uploaded_bytes,
                triangles: shapes.triangles.len() as u64,
                lights: light_count,
            },
        };
        Ok((uploaded, edit))
    }
}
