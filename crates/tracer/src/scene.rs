//! An immutable version of a scene, made of shared, content-hashed parts.
//!
//! Positions are metres in a right-handed frame, +Y up, *relative to [`Scene::origin_in_file`]*: import subtracts that
//! point in f64, so that geometry far from the file's origin keeps its precision in f32.
//! Radiance is linear Rec. 709; punctual lights are in glTF's units (candela, lux) with 1:1 radiometry.

use std::{
    collections::{HashMap, HashSet},
    sync::Arc,
};

use glam::{Affine3A, DVec3, Quat, Vec2, Vec3, Vec4};

mod hash;

pub use hash::ContentHash;

/// One version of a scene. Cheap to clone: its parts are shared.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What a person calls it: the file's name without folders, or "built-in".
    pub name: String,
    /// One entry per triangle list (a glTF primitive with triangles).
    pub meshes: Vec<Arc<Mesh>>,
    /// Decoded images, one per (image, encoding) pair that a material uses.
    pub textures: Vec<Arc<Texture>>,
    /// Materials; index 0 need not be the default material.
    pub materials: Vec<Arc<Material>>,
    /// Meshes placed in the world. What is hidden is absent or has `visible == false`.
    pub instances: Vec<Instance>,
    /// Point, spot and directional lights.
    pub lights: Vec<PunctualLight>,
    /// Cameras in file order.
    pub cameras: Vec<Camera>,
    /// What rays see that leave the scene.
    pub environment: Environment,
    /// What the camera sees there.
    pub backdrop: Backdrop,
    /// The point of the file's world, in metres, that is the origin of every position here.
    pub origin_in_file: DVec3,
}

impl Scene {
    /// Corners of the box around what is visible; `None` when nothing is. Boxes of meshes are turned with their instances.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let boxes: Vec<_> = self
            .meshes
            .iter()
            .map(|mesh| {
                mesh.positions
                    .iter()
                    .fold((Vec3::MAX, Vec3::MIN), |(low, high), &point| (low.min(point), high.max(point)))
            })
            .collect();
        let visible = self.instances.iter().filter(|instance| instance.visible);
        let corners = visible.filter_map(|instance| {
            let &(low, high) = boxes.get(instance.mesh as usize)?;
            let corner =
                |index: u32| Vec3::select(glam::BVec3::new(index & 1 > 0, index & 2 > 0, index & 4 > 0), high, low);
            (low.x <= high.x)
                .then(|| [0, 1, 2, 3, 4, 5, 6, 7].map(|index| instance.world_from_mesh.transform_point3(corner(index))))
        });
        let (low, high) =
            corners.flatten().fold((Vec3::MAX, Vec3::MIN), |(low, high), point| (low.min(point), high.max(point)));
        (low.x <= high.x).then_some((low, high))
    }

    /// The textures, those that several entries share once.
    pub fn distinct_textures(&self) -> Vec<&Arc<Texture>> {
        let mut seen = HashSet::new();
        self.textures.iter().filter(|texture| seen.insert(Arc::as_ptr(texture))).collect()
    }

    /// This version with every part that `last` holds in equal form taken from it, so that equal parts are one in memory
    /// and are recognised by their address.
    #[must_use]
    pub fn sharing_parts_of(mut self, last: &Self) -> Self {
        share(&mut self.meshes, &last.meshes, |mesh| &mesh.name, |a, b| a.hash == b.hash && a.name == b.name);
        share(&mut self.textures, &last.textures, |part| &part.name, |a, b| a.hash == b.hash && a.name == b.name);
        share(&mut self.materials, &last.materials, |material| &material.name, Material::eq);
        if let (Environment::Image { image, .. }, Environment::Image { image: known, .. }) =
            (&mut self.environment, &last.environment)
            && image.hash == known.hash
        {
            *image = Arc::clone(known);
        }
        self
    }
}

/// Replaces parts by equal ones of `known`: the one at the same place if it is equal, else one of the same name.
fn share<T>(parts: &mut [Arc<T>], known: &[Arc<T>], name: impl Fn(&T) -> &str, equal: impl Fn(&T, &T) -> bool) {
    let by_name: HashMap<&str, &Arc<T>> = known.iter().map(|part| (name(part), part)).collect();
    for (index, part) in parts.iter_mut().enumerate() {
        let candidates = known.get(index).into_iter().chain(by_name.get(name(part)).copied());
        if let Some(same) = candidates.into_iter().find(|candidate| equal(candidate, part)).cloned() {
            *part = same;
        }
    }
}

/// An indexed triangle list in its own space.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// For reports.
    pub name: String,
    /// Vertex positions, metres; finite, and within [`LARGEST_COORDINATE`](crate::bvh::LARGEST_COORDINATE).
    pub positions: Vec<Vec3>,
    /// Unit normals, one per vertex (import makes flat ones where the file has none).
    pub normals: Vec<Vec3>,
    /// xyz = unit tangent, w = handedness (+-1); empty when no material that uses this mesh needs them.
    pub tangents: Vec<Vec4>,
    /// Texture coordinate sets 0 and 1; each empty or one per vertex.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA vertex colours in 0..=1; empty or one per vertex.
    pub colors: Vec<Vec4>,
    /// Triangles; every index is below `positions.len()`.
    pub triangles: Vec<[u32; 3]>,
    /// Hash of everything above but the name.
    pub hash: ContentHash,
}

/// A mesh placed in the world with a material.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// The glTF node's name, for reports and picking.
    pub name: String,
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Invertible.
    pub world_from_mesh: Affine3A,
    /// Hidden instances are neither hit nor do they emit.
    pub visible: bool,
    /// Index of the glTF node that placed it; several instances (primitives) share one.
    pub node: u32,
}

/// How a texture's stored values map to linear ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TexelEncoding {
    /// RGB is sRGB-encoded, alpha linear.
    Srgb,
    /// All four channels are linear.
    Linear,
}

/// A decoded image: 8-bit RGBA, row by row from the top.
#[derive(Clone)]
pub struct Texture {
    /// For reports.
    pub name: String,
    /// Pixels, at least 1.
    pub width: u32,
    /// Pixels, at least 1.
    pub height: u32,
    /// `width * height` texels.
    pub texels: Vec<[u8; 4]>,
    /// How to read `texels`.
    pub encoding: TexelEncoding,
    /// Hash of everything above but the name.
    pub hash: ContentHash,
}

impl std::fmt::Debug for Texture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Texture({:?}, {}x{}, {:?})", self.name, self.width, self.height, self.encoding)
    }
}

/// What happens outside 0..1 of a texture coordinate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum WrapMode {
    /// Periodic.
    #[default]
    Repeat,
    /// Periodic, every second period mirrored.
    MirroredRepeat,
    /// The border texel goes on.
    ClampToEdge,
}

/// Reference from a material to a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into [`Scene::textures`].
    pub texture: u32,
    /// Which of [`Mesh::uvs`].
    pub uv_set: u32,
    /// Rows of the 2x3 matrix that takes (u, v, 1) to texture space (KHR_texture_transform; identity without).
    pub texture_from_uv: [[f32; 3]; 2],
    /// Wrap mode along u and v.
    pub wrap: [WrapMode; 2],
    /// Bilinear when true, nearest texel when false (magnification filter).
    pub linear_filter: bool,
}

/// How alpha is read.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Present where alpha is at least the cutoff.
    Mask {
        /// At least 0; above 1 nothing is present.
        cutoff: f32,
    },
    /// Alpha is the fraction of light that the surface stops.
    Blend,
}

/// glTF's metallic-roughness material with the KHR_materials extensions.
///
/// Each `*_texture` multiplies its factor as the specification says; `Default` is the specification's default material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// For reports and editing.
    pub name: String,
    /// Linear RGBA.
    pub base_color: Vec4,
    /// RGBA, sRGB.
    pub base_color_texture: Option<TextureRef>,
    /// 0..=1.
    pub metallic: f32,
    /// Perceptual roughness, 0..=1 (alpha is its square).
    pub roughness: f32,
    /// G = roughness, B = metallic.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normal map.
    pub normal_texture: Option<TextureRef>,
    /// Scales x and y of the normal map.
    pub normal_scale: f32,
    /// Emitted radiance, linear Rec. 709, `emissive_strength` multiplied in; above 1e18 a film clamps it.
    pub emission: Vec3,
    /// RGB, sRGB.
    pub emissive_texture: Option<TextureRef>,
    /// How alpha is read.
    pub alpha_mode: AlphaMode,
    /// Both faces are shaded with their own normal, and both emit.
    pub double_sided: bool,
    /// KHR_materials_unlit: shows base colour as emission, no lighting.
    pub unlit: bool,
    /// KHR_materials_ior; 1.5 by default.
    pub ior: f32,
    /// KHR_materials_specular: strength, 1 by default.
    pub specular: f32,
    /// A = specular strength.
    pub specular_texture: Option<TextureRef>,
    /// KHR_materials_specular: F0 colour, white by default; may exceed 1.
    pub specular_color: Vec3,
    /// RGB, sRGB.
    pub specular_color_texture: Option<TextureRef>,
    /// KHR_materials_transmission: 0..=1.
    pub transmission: f32,
    /// R = transmission.
    pub transmission_texture: Option<TextureRef>,
    /// KHR_materials_volume: 0 = thin sheet, above 0 = solid with refraction.
    pub thickness: f32,
    /// KHR_materials_volume: metres after which white becomes `attenuation_color`; infinite by default.
    pub attenuation_distance: f32,
    /// KHR_materials_volume.
    pub attenuation_color: Vec3,
    /// KHR_materials_dispersion: 20 / Abbe number; 0 = none.
    pub dispersion: f32,
    /// KHR_materials_diffuse_transmission: 0..=1.
    pub diffuse_transmission: f32,
    /// A = factor.
    pub diffuse_transmission_texture: Option<TextureRef>,
    /// Tint of the transmitted diffuse light.
    pub diffuse_transmission_color: Vec3,
    /// RGB, sRGB.
    pub diffuse_transmission_color_texture: Option<TextureRef>,
    /// KHR_materials_clearcoat: 0..=1.
    pub clearcoat: f32,
    /// R = clearcoat.
    pub clearcoat_texture: Option<TextureRef>,
    /// Perceptual roughness of the coat.
    pub clearcoat_roughness: f32,
    /// G = roughness.
    pub clearcoat_roughness_texture: Option<TextureRef>,
    /// Tangent-space normal map of the coat.
    pub clearcoat_normal_texture: Option<TextureRef>,
    /// Scales x and y of the coat's normal map.
    pub clearcoat_normal_scale: f32,
    /// KHR_materials_sheen: linear colour, black = none.
    pub sheen_color: Vec3,
    /// RGB, sRGB.
    pub sheen_color_texture: Option<TextureRef>,
    /// Perceptual roughness of the sheen.
    pub sheen_roughness: f32,
    /// A = roughness.
    pub sheen_roughness_texture: Option<TextureRef>,
    /// KHR_materials_anisotropy: 0..=1.
    pub anisotropy: f32,
    /// Radians, counter-clockwise from the tangent.
    pub anisotropy_rotation: f32,
    /// RG = direction, B = strength.
    pub anisotropy_texture: Option<TextureRef>,
    /// KHR_materials_iridescence: 0..=1.
    pub iridescence: f32,
    /// R = factor.
    pub iridescence_texture: Option<TextureRef>,
    /// Index of refraction of the film.
    pub iridescence_ior: f32,
    /// Nanometres, minimum and maximum.
    pub iridescence_thickness_nm: [f32; 2],
    /// G = thickness between minimum and maximum.
    pub iridescence_thickness_texture: Option<TextureRef>,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emission: Vec3::ZERO,
            emissive_texture: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
            ior: 1.5,
            specular: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            thickness: 0.0,
            attenuation_distance: f32::INFINITY,
            attenuation_color: Vec3::ONE,
            dispersion: 0.0,
            diffuse_transmission: 0.0,
            diffuse_transmission_texture: None,
            diffuse_transmission_color: Vec3::ONE,
            diffuse_transmission_color_texture: None,
            clearcoat: 0.0,
            clearcoat_texture: None,
            clearcoat_roughness: 0.0,
            clearcoat_roughness_texture: None,
            clearcoat_normal_texture: None,
            clearcoat_normal_scale: 1.0,
            sheen_color: Vec3::ZERO,
            sheen_color_texture: None,
            sheen_roughness: 0.0,
            sheen_roughness_texture: None,
            anisotropy: 0.0,
            anisotropy_rotation: 0.0,
            anisotropy_texture: None,
            iridescence: 0.0,
            iridescence_texture: None,
            iridescence_ior: 1.3,
            iridescence_thickness_nm: [100.0, 400.0],
            iridescence_thickness_texture: None,
        }
    }
}

impl Material {
    /// True for a volume that light enters: it refracts or scatters at its surface and absorbs inside.
    pub fn is_solid(&self) -> bool {
        self.thickness > 0.0 && (self.transmission > 0.0 || self.diffuse_transmission > 0.0)
    }

    /// True for a transmissive surface without thickness that is smooth, or may be by its texture: shadow rays pass it in straight
    /// lines where it is, and lose what it stops.
    pub fn is_clear_sheet(&self) -> bool {
        // The square of the roughness counts as 0 below 1e-3 in the shaders, which ask at each hit.
        let may_be_smooth = self.metallic_roughness_texture.is_some() || self.roughness * self.roughness < 1e-3;
        self.transmission > 0.0 && !self.is_solid() && may_be_smooth
    }

    /// True when it is a light; what is unlit shows its base colour alone.
    pub fn emits(&self) -> bool {
        self.emission.max_element() > 0.0 && !self.unlit
    }

    /// True when something is mirrored: metal, or a dielectric whose specular reflectance is not 0.
    pub fn is_specular(&self) -> bool {
        let dielectric = self.specular > 0.0 || self.transmission > 0.0 || self.iridescence > 0.0;
        self.metallic > 0.0 || dielectric
    }

    /// Every texture that it refers to.
    pub fn textures(&self) -> impl Iterator<Item = TextureRef> {
        [
            self.base_color_texture,
            self.metallic_roughness_texture,
            self.normal_texture,
            self.emissive_texture,
            self.specular_texture,
            self.specular_color_texture,
            self.transmission_texture,
            self.diffuse_transmission_texture,
            self.diffuse_transmission_color_texture,
            self.clearcoat_texture,
            self.clearcoat_roughness_texture,
            self.clearcoat_normal_texture,
            self.sheen_color_texture,
            self.sheen_roughness_texture,
            self.anisotropy_texture,
            self.iridescence_texture,
            self.iridescence_thickness_texture,
        ]
        .into_iter()
        .flatten()
    }
}

/// What kind of punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualKind {
    /// Intensity in candela, the same in all directions.
    Point,
    /// Intensity in candela inside the inner cone, falling to zero at the outer one (radians from the axis).
    Spot {
        /// Full intensity up to here.
        inner_angle: f32,
        /// Zero from here on; at most pi/2.
        outer_angle: f32,
    },
    /// Intensity is irradiance in lux on a surface facing the light.
    Directional {
        /// Full angle that the light subtends, radians; 0 = a direction.
        angular_diameter: f32,
    },
}

/// A point, spot or directional light. It shines along -Z of `rotation`.
#[derive(Clone, Debug, PartialEq)]
pub struct PunctualLight {
    /// For reports.
    pub name: String,
    /// Kind and its parameters.
    pub kind: PunctualKind,
    /// Linear colour times intensity.
    pub intensity: Vec3,
    /// Metres.
    pub position: Vec3,
    /// The light's axis is `rotation * -Z`.
    pub rotation: Quat,
}

impl PunctualLight {
    /// A directional light with an angular size that shines: it can be seen, in mirrors too.
    #[must_use]
    pub fn is_disc(&self) -> bool {
        let PunctualKind::Directional { angular_diameter } = self.kind else { return false };
        angular_diameter > 0.0 && self.intensity.max_element() > 0.0
    }
}

/// Largest vertical angle of view of a camera, degrees: a perspective image of 180 has no edge.
pub const LARGEST_YFOV_DEG: f32 = 170.0;

/// What a glTF camera sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Full vertical angle in radians; aspect ratio width / height where the file gives one.
    Perspective {
        /// Radians, above 0 and at most [`LARGEST_YFOV_DEG`].
        yfov: f32,
        /// Width over height.
        aspect: Option<f32>,
    },
    /// Half-width and half-height in metres.
    Orthographic {
        /// Metres.
        xmag: f32,
        /// Metres.
        ymag: f32,
    },
}

/// A camera; it looks along -Z of `rotation`, +Y is up.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The node's or camera's name.
    pub name: String,
    /// Metres.
    pub position: Vec3,
    /// World from camera.
    pub rotation: Quat,
    /// Lens.
    pub projection: Projection,
}

/// Radiance that arrives from outside.
#[derive(Clone, Debug)]
pub enum Environment {
    /// The same radiance from everywhere; black = none.
    Constant(Vec3),
    /// An equirectangular image, its centre at -Z, turned to the right by `rotation_deg`.
    Image {
        /// The pixels.
        image: Arc<EnvironmentImage>,
        /// Degrees to the right.
        rotation_deg: f32,
        /// Multiplies the image's radiance.
        intensity: f32,
    },
}

/// What camera rays see that leave the scene, through cut-outs and clear sheets too. It lights nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Backdrop {
    /// The environment that lights the scene, with suns that have a size.
    #[default]
    Environment,
    /// A plain colour: linear Rec. 709 radiance, finite and not negative.
    Color(Vec3),
}

impl Backdrop {
    /// The colour that hides the environment; what is not finite or negative becomes 0.
    pub fn color(self) -> Option<Vec3> {
        match self {
            Self::Environment => None,
            Self::Color(color) => {
                Some(Vec3::from_array(color.to_array().map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 })))
            }
        }
    }
}

/// An equirectangular HDR image, row by row from the top (+Y).
#[derive(Clone)]
pub struct EnvironmentImage {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Linear Rec. 709 radiance; finite and not negative.
    pub pixels: Vec<[f32; 3]>,
    /// Hash of everything above.
    pub hash: ContentHash,
}

impl std::fmt::Debug for EnvironmentImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "EnvironmentImage({}x{})", self.width, self.height)
    }
}
