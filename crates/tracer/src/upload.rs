//! A scene version as buffers and textures of the device.

use std::{collections::HashMap, sync::Arc, time::Instant};

use glam::Vec3;
use rayon::prelude::*;
use thiserror::Error;
use wgpu::util::DeviceExt;

use crate::{
    bvh::{Blas, Tlas, rebased},
    features::SceneFeatures,
    gpu::Gpu,
    kernels::{
        KernelConstants,
        layout::{self, codes},
    },
    scene::{AlphaMode, ContentHash, Scene},
};

mod alias;
mod environment;
mod lights;
mod materials;
mod texels;
mod vertices;

pub use alias::AliasTable;

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

/// Hierarchies of meshes, kept between scene versions by content.
#[derive(Debug, Default)]
pub struct BlasCache(HashMap<ContentHash, Arc<Blas>>);

impl BlasCache {
    /// The hierarchies of a scene's meshes, in order; builds those that are new on all cores and forgets unused ones.
    pub fn build(&mut self, scene: &Scene) -> Vec<Arc<Blas>> {
        let known = &self.0;
        let blas: Vec<Arc<Blas>> = scene
            .meshes
            .par_iter()
            .map(|mesh| known.get(&mesh.hash).cloned().unwrap_or_else(|| Arc::new(Blas::build(mesh))))
            .collect();
        self.0 = scene.meshes.iter().zip(&blas).map(|(mesh, blas)| (mesh.hash, blas.clone())).collect();
        blas
    }
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
    /// Textures, binding 8 to 10.
    pub textures: [wgpu::TextureView; 3],
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

impl SceneOnGpu {
    /// Builds what is missing in `cache`, encodes the scene and uploads it.
    ///
    /// # Errors
    /// When a part exceeds the adapter's limits or its memory.
    pub fn upload(gpu: &Gpu, scene: &Scene, cache: &mut BlasCache) -> Result<Self, UploadError> {
        let started = Instant::now();
        let blas = cache.build(scene);
        let tlas = Tlas::build(scene, &blas);
        let bvh_build_secs = started.elapsed().as_secs_f64();

        let started = Instant::now();
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let mut uploader = Uploader { gpu, bytes: 0 };
        let features = SceneFeatures::of(scene);

        let mut nodes = Vec::new();
        let mut triangles: Vec<[f32; 4]> = Vec::new();
        let mut root_nodes = Vec::new();
        let mut first_triangles = Vec::new();
        let mut first_vertices = Vec::new();
        let mut vertex_count = 0;
        for (mesh, blas) in scene.meshes.iter().zip(&blas) {
            let (node_base, triangle_base) = (nodes.len() as u32, (triangles.len() / 3) as u32);
            root_nodes.push(node_base);
            first_triangles.push(triangle_base);
            first_vertices.push(vertex_count);
            vertex_count += mesh.positions.len() as u32;
            nodes.extend(rebased(&blas.nodes, node_base, triangle_base));
            triangles.extend(blas.triangle_order.iter().flat_map(|&t| mesh.triangles[t as usize]).scan((), |(), v| {
                Some(mesh.positions[v as usize].extend(f32::from_bits(v)).to_array())
            }));
        }
        let tlas_root = nodes.len() as u32;
        nodes.extend(rebased(&tlas.nodes, tlas_root, 0));
        let vertices: Vec<layout::Vertex> =
            scene.meshes.par_iter().flat_map_iter(|mesh| vertices::encode(mesh)).collect();

        let light_table = lights::LightTable::build(scene, &tlas.instance_order, &blas, &first_triangles);
        let instances: Vec<layout::Instance> = tlas
            .instance_order
            .iter()
            .zip(&light_table.first_lights)
            .map(|(&index, &first_light)| {
                let instance = &scene.instances[index as usize];
                let mesh = instance.mesh as usize;
                let alpha = scene.materials[instance.material as usize].alpha_mode != AlphaMode::Opaque;
                let mirrored = instance.world_from_mesh.matrix3.determinant() < 0.0;
                layout::Instance {
                    world_from_mesh: rows(&instance.world_from_mesh),
                    mesh_from_world: rows(&instance.world_from_mesh.inverse()),
                    root_node: root_nodes[mesh],
                    material: instance.material,
                    first_light,
                    first_triangle: first_triangles[mesh],
                    flags: u32::from(mirrored) * codes::INSTANCE_MIRRORED + u32::from(alpha) * codes::INSTANCE_ALPHA,
                    first_vertex: first_vertices[mesh],
                    unused_0: 0,
                    unused_1: 0,
                }
            })
            .collect();

        let (texels, offsets) = texels::TexelHeap::upload(gpu, &scene.textures, &mut uploader.bytes)?;
        let (materials, slots) = materials::encode(scene, &offsets);
        let environment = environment::EnvironmentOnGpu::build(gpu, &scene.environment, &mut uploader.bytes);
        let buffers = [
            uploader.storage("hierarchy nodes", &nodes)?,
            uploader.storage("triangles", &triangles)?,
            uploader.storage("vertices", &vertices)?,
            uploader.storage("instances", &instances)?,
            uploader.storage("materials", &materials)?,
            uploader.storage("texture slots", &slots)?,
            uploader.storage("lights", &light_table.lights)?,
            uploader.storage("environment cells", &environment.cells)?,
        ];
        if pollster::block_on(scope.pop()).is_some() {
            return Err(UploadError::OutOfMemory { what: "buffers and textures", bytes: uploader.bytes });
        }

        let deepest = blas.iter().map(|b| b.depth).max().unwrap_or(1);
        let light_count = light_table.lights.len() as u32;
        let has_image = environment.cells_size[0] > 0;
        Ok(Self {
            features: features.with(crate::features::Feature::Lights, false).with(
                crate::features::Feature::Lights,
                light_count > 0,
            ),
            constants: KernelConstants {
                // Each level leaves at most one group behind, and entering a mesh leaves two.
                stack_size: (tlas.depth + deepest + 2).next_multiple_of(4),
                tlas_root,
                environment_cells: environment.cells_size,
            },
            bindings: SceneBindings { buffers, textures: [texels.srgb, texels.linear, environment.image] },
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
                triangles: triangles.len() as u64 / 3,
                lights: light_count,
            },
        })
    }
}

fn rows(m: &glam::Affine3A) -> [[f32; 4]; 3] {
    let t = m.translation;
    let r = m.matrix3.transpose();
    [r.x_axis.extend(t.x).to_array(), r.y_axis.extend(t.y).to_array(), r.z_axis.extend(t.z).to_array()]
}
