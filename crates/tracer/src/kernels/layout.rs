//! Structures shared with the shaders: twins of `shaders/types.wesl`, `shaders/view/bindings.wesl` and
//! `shaders/vr/bindings.wesl`.
//!
//! `tests/layout.rs` reflects the composed WGSL with naga and compares sizes, offsets and names with these.

use bytemuck::{Pod, Zeroable};

use crate::upload::decode_octahedral;

/// A 3x3 matrix as a uniform holds it: columns of four.
pub type Columns3 = [[f32; 4]; 3];

/// Columns of a matrix.
pub fn columns(m: glam::Mat3) -> Columns3 {
    [m.x_axis.extend(0.0).to_array(), m.y_axis.extend(0.0).to_array(), m.z_axis.extend(0.0).to_array()]
}

macro_rules! shared {
    ($($(#[$doc:meta])* struct $name:ident { $($field:ident: $ty:ty,)* })*) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
            #[repr(C)]
            #[expect(missing_docs, reason = "each field is explained beside its twin in the shader")]
            pub struct $name { $(pub $field: $ty,)* }

            impl $name {
                /// Name, size and fields (name, offset), for the test against the shaders.
                pub fn layout() -> StructLayout {
                    StructLayout {
                        name: stringify!($name),
                        size: size_of::<$name>(),
                        fields: vec![$((stringify!($field), std::mem::offset_of!($name, $field)),)*],
                    }
                }
            }
        )*

        /// Every shared structure.
        pub fn shared_layouts() -> Vec<StructLayout> {
            vec![$($name::layout(),)*]
        }
    };
}

/// A structure as the host lays it out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StructLayout {
    /// Name in Rust and WGSL.
    pub name: &'static str,
    /// Bytes.
    pub size: usize,
    /// Name and offset of each field. Names that begin with `pad` exist only on the host.
    pub fields: Vec<(&'static str, usize)>,
}

shared! {
    /// One component of the distribution's mixture.
    struct SampleLayer {
        kind: u32,
        cumulative: f32,
        share: f32,
        clip_tries: u32,
        film_from_layer: Columns3,
        clip_from_film: Columns3,
        off_screen: [f32; 4],
        list_first: u32,
        list_count: u32,
        radius_first: f32,
        radius_size: f32,
    }

    /// One batch of samples.
    struct BatchParams {
        first_index_low: u32,
        first_index_high: u32,
        sample_count: u32,
        seed: u32,
        film_size: [u32; 2],
        max_bounces: u32,
        light_count: u32,
        camera_position: [f32; 3],
        environment_probability: f32,
        world_from_film: Columns3,
        environment_radiance: [f32; 3],
        environment_rotation_turns: f32,
        film_half_extent: [f32; 2],
        first_slab_pixel: u32,
        slab_pixel_count: u32,
        radiance_scale: f32,
        luminance_scale: f32,
        layer_count: u32,
        use_sobol: u32,
        backdrop: [f32; 3],
        has_backdrop: u32,
        stratum_bits: [u32; 2],
        guide_first: u32,
        guide_rows: u32,
        fovea_end: u32,
        fovea_first: u32,
        fovea_cells: u32,
        fovea_cell_bits: u32,
        roulette_block_bits: u32,
        pad_0: [u32; 3],
        order: [[u32; 4]; 5],
        layers: [SampleLayer; MAX_LAYERS],
    }

    /// What a finished path leaves for the film.
    struct SampleRecord {
        radiance: [f32; 3],
        pixel: u32,
        rays: u32,
        index: u32,
        pad_0: [u32; 2],
    }

    /// What lies in memory of a path between two kernels of the wavefront schedule, beside its record.
    struct PathState {
        origin: [f32; 3],
        random_roulette: u32,
        direction: [f32; 3],
        shadow_t_max: f32,
        shadow_origin: [f32; 3],
        bounce: u32,
        shadow_direction: [f32; 3],
        density: f32,
        contribution: [f32; 3],
        travelled: f32,
        throughput: [f32; 3],
        random_index: u32,
        random_seed: u32,
        random_vertex: u32,
        hit_t: f32,
        hit_instance: u32,
        hit_barycentrics: [f32; 2],
        hit_triangle: u32,
        medium: u32,
    }

    /// Which queue a kernel of the wavefront schedule reads and which one it appends to.
    struct QueueTurn {
        read_from: u32,
        append_to: u32,
    }

    /// What the film says about the pixels of some points of a cell of the unit square. Luminance is in its own quanta.
    struct CellNoise {
        points: f32,
        samples: f32,
        light: f32,
        freedom: f32,
        squares: f32,
    }

    /// A ray to be answered alone.
    struct QueryRay {
        origin: [f32; 3],
        t_max: f32,
        direction: [f32; 3],
        kind: u32,
    }

    /// What it meets.
    struct QueryHit {
        t: f32,
        part: u32,
        triangle: u32,
        steps: u32,
    }

    /// A mesh placed in the world.
    struct Instance {
        world_from_mesh: [[f32; 4]; 3],
        mesh_from_world: [[f32; 4]; 3],
        root_node: u32,
        material: u32,
        first_light: u32,
        flags: u32,
    }

    /// Shading attributes of a vertex.
    struct Vertex {
        normal: u32,
        tangent: u32,
        u0: f32,
        v0: f32,
        u1: f32,
        v1: f32,
        color_rg: u32,
        color_ba: u32,
        part: u32,
    }

    /// A material.
    struct Material {
        base_color: [f32; 4],
        emission: [f32; 3],
        flags: u32,
        specular_color: [f32; 3],
        specular: f32,
        absorption: [f32; 3],
        metallic: f32,
        roughness: f32,
        ior: f32,
        transmission: f32,
        alpha_cutoff: f32,
        normal_scale: f32,
        base_color_texture: u32,
        metallic_roughness_texture: u32,
        normal_texture: u32,
        emissive_texture: u32,
        specular_texture: u32,
        specular_color_texture: u32,
        transmission_texture: u32,
        sheen_color: [f32; 3],
        sheen_roughness: f32,
        diffuse_transmission_color: [f32; 3],
        diffuse_transmission: f32,
        anisotropy_direction: [f32; 2],
        iridescence_thickness_nm: [f32; 2],
        anisotropy: f32,
        clearcoat: f32,
        clearcoat_roughness: f32,
        clearcoat_normal_scale: f32,
        iridescence: f32,
        iridescence_ior: f32,
        dispersion: f32,
        sheen_color_texture: u32,
        sheen_roughness_texture: u32,
        diffuse_transmission_texture: u32,
        diffuse_transmission_color_texture: u32,
        anisotropy_texture: u32,
        clearcoat_texture: u32,
        clearcoat_roughness_texture: u32,
        clearcoat_normal_texture: u32,
        iridescence_texture: u32,
        iridescence_thickness_texture: u32,
        pad_0: [u32; 3],
    }

    /// A material's reference to a texture.
    struct TextureSlot {
        matrix_u: [f32; 4],
        matrix_v: [f32; 4],
        offset: u32,
        size: u32,
        flags: u32,
        unused: u32,
    }

    /// An emissive triangle or a punctual light.
    struct Light {
        position: [f32; 3],
        probability: f32,
        edge_1: [f32; 3],
        alias_threshold: f32,
        edge_2: [f32; 3],
        alias_index: u32,
        kind: u32,
        instance: u32,
        triangle: u32,
        unused: u32,
        cone: [f32; 2],
        unused_2: [f32; 2],
    }

    /// Sums over the film's lifetime.
    struct FilmCounters {
        segments_low: u32,
        segments_high: u32,
        shadow_rays_low: u32,
        shadow_rays_high: u32,
        non_finite: u32,
        clamped: u32,
    }

    /// One pass over the view's pixels.
    struct ViewParams {
        kind: u32,
        level: u32,
        size: [u32; 2],
        world_from_view: Columns3,
        film_from_world: Columns3,
        view_half_extent: [f32; 2],
        film_half_extent: [f32; 2],
        film_size: [u32; 2],
        first_slab_pixel: u32,
        slab_pixel_count: u32,
        level_offset: u32,
        coarse_offset: u32,
        coarse_size: [u32; 2],
        quanta_to_radiance: f32,
        confidence_samples: f32,
        exposure: f32,
        tone_map: u32,
        debug_view: u32,
        fill: u32,
        debug_low: f32,
        debug_high: f32,
        stale_from_world: Columns3,
        stale_half_extent: [f32; 2],
        stale_size: [u32; 2],
        gaze_in_view: [f32; 2],
        ring_tangent: f32,
        stale_weight: f32,
        is_debug_logarithmic: u32,
        hit_rows: u32,
        luminance_quanta: f32,
        pad_0: u32,
    }

    /// A band of rows of a view, through whose pixels rays go.
    struct FirstHitParams {
        world_from_view: Columns3,
        half_extent: [f32; 2],
        size: [u32; 2],
        origin: [f32; 3],
        first_row: u32,
        end_row: u32,
        kind: u32,
        pad_0: [u32; 2],
    }

    /// What a ray through the centre of a view's pixel meets first.
    struct FirstHit {
        albedo: [f32; 3],
        depth: f32,
        normal: u32,
        steps: u32,
        deviation: f32,
        coat: f32,
    }

    /// What guides the reconstruction of a view at a pixel.
    struct Guide {
        position: [f32; 3],
        packed: u32,
    }

    /// One pass over a level of the panorama.
    struct PanoramaParams {
        size: [u32; 2],
        coarse_size: [u32; 2],
        first_slab_pixel: u32,
        confidence_samples: f32,
        quanta_to_radiance: f32,
        pad_0: u32,
    }

    /// What an eye sees of the panorama.
    struct EyeParams {
        film_from_eye: Columns3,
        plane_origin: [f32; 2],
        plane_size: [f32; 2],
        size: [u32; 2],
        panorama_size: [u32; 2],
        gaze_in_eye: [f32; 3],
        marker_radius: f32,
        exposure: f32,
        tone_map: u32,
        linear_target: u32,
        pad_0: u32,
    }
}

impl FirstHit {
    /// The shading normal in the world, on the side of the viewer; zero where nothing is hit.
    pub fn world_normal(&self) -> glam::Vec3 {
        if self.depth > 0.0 { decode_octahedral(self.normal) } else { glam::Vec3::ZERO }
    }
}

/// Layers that a mixture may have.
pub const MAX_LAYERS: usize = 8;

/// `SampleLayer::kind` and other enumerations of `types.wesl`.
pub mod codes {
    #![expect(missing_docs, reason = "named as in the shader")]
    pub const LAYER_FILM: u32 = 0;
    pub const LAYER_PIXEL_LIST: u32 = 1;
    pub const LAYER_IMAGE_PLANE: u32 = 2;
    pub const LAYER_SPHERE: u32 = 3;
    pub const LAYER_ACUITY: u32 = 4;
    pub const RAY_CLOSEST: u32 = 1;
    pub const RAY_ANY: u32 = 2;
    pub const NONE: u32 = u32::MAX;
    pub const INSTANCE_MIRRORED: u32 = 1;
    pub const INSTANCE_STATIC: u32 = 2;
    pub const TRIANGLE_ALPHA: u32 = 0x8000_0000;
    pub const MATERIAL_DOUBLE_SIDED: u32 = 1;
    pub const MATERIAL_ALPHA_MASK: u32 = 2;
    pub const MATERIAL_ALPHA_BLEND: u32 = 4;
    pub const MATERIAL_UNLIT: u32 = 8;
    pub const MATERIAL_SOLID: u32 = 16;
    pub const MATERIAL_CLEAR_SHEET: u32 = 32;
    pub const TEXTURE_LINEAR_FILTER: u32 = 1;
    pub const TEXTURE_UV1: u32 = 2;
    pub const WRAP_REPEAT: u32 = 0;
    pub const WRAP_MIRROR: u32 = 1;
    pub const WRAP_CLAMP: u32 = 2;
    pub const LIGHT_TRIANGLE: u32 = 0;
    pub const LIGHT_POINT: u32 = 1;
    pub const LIGHT_SPOT: u32 = 2;
    pub const LIGHT_DIRECTIONAL: u32 = 3;
    pub const VIEW_EQUIRECT: u32 = 0;
    pub const VIEW_PERSPECTIVE: u32 = 1;
}
