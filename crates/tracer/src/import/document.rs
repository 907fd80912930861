//! The parts of a glTF document, parsed into plain structs in which every index is known to be in range.
//!
//! This reads JSON directly: the `gltf` crate's accessors panic on bad indices, and its types refuse files whose only
//! oddity is an optional extension (a texture without a plain source, an animation of something that is no node).

use std::collections::BTreeMap;

use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde_json::Value;

use super::error::{ContentError, Fault};
use super::json::Object;

/// Extensions that take effect here (or need none to be right), and may therefore be required.
pub(super) const SUPPORTED_EXTENSIONS: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
];

/// Extensions that only annotate; ignoring them changes no picture.
const METADATA_EXTENSIONS: &[&str] = &["KHR_xmp", "KHR_xmp_json_ld"];

pub(super) struct Document<'a> {
    pub(super) extensions_used: Vec<String>,
    pub(super) generator: Option<String>,
    pub(super) buffers: Vec<Buffer<'a>>,
    pub(super) views: Vec<View<'a>>,
    pub(super) accessors: Vec<Accessor>,
    pub(super) images: Vec<Image<'a>>,
    pub(super) samplers: Vec<Sampler>,
    pub(super) textures: Vec<Texture>,
    pub(super) materials: Vec<Object<'a>>,
    pub(super) meshes: Vec<Mesh>,
    pub(super) nodes: Vec<Node>,
    pub(super) skins: Vec<Skin>,
    pub(super) cameras: Vec<Object<'a>>,
    pub(super) lights: Vec<Object<'a>>,
    pub(super) animations: Vec<Animation>,
    pub(super) scenes: Vec<Scene>,
    pub(super) default_scene: Option<usize>,
    pub(super) variants: Vec<String>,
}

pub(super) struct Buffer<'a> {
    pub(super) place: String,
    pub(super) uri: Option<&'a str>,
    pub(super) length: u64,
}

pub(super) struct View<'a> {
    pub(super) place: String,
    pub(super) buffer: usize,
    pub(super) offset: u64,
    pub(super) length: u64,
    pub(super) stride: Option<usize>,
    /// EXT_ or KHR_meshopt_compression.
    pub(super) meshopt: Option<(&'static str, Object<'a>)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    pub(super) fn from_code(code: u64) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

pub(super) struct Accessor {
    pub(super) place: String,
    pub(super) view: Option<usize>,
    pub(super) offset: u64,
    pub(super) component: Component,
    /// Components per element: 1 to 4, or 4, 9, 16 for matrices.
    pub(super) width: usize,
    pub(super) is_matrix: bool,
    pub(super) normalized: bool,
    pub(super) count: usize,
    pub(super) sparse: Option<Sparse>,
}

pub(super) struct Sparse {
    pub(super) count: usize,
    pub(super) index_view: usize,
    pub(super) index_offset: u64,
    pub(super) index_component: Component,
    pub(super) value_view: usize,
    pub(super) value_offset: u64,
}

pub(super) struct Image<'a> {
    pub(super) place: String,
    pub(super) name: String,
    pub(super) uri: Option<&'a str>,
    pub(super) view: Option<usize>,
}

#[derive(Clone, Copy, Default)]
pub(super) struct Sampler {
    pub(super) wrap: [crate::scene::WrapMode; 2],
    pub(super) nearest: bool,
}

pub(super) struct Texture {
    pub(super) sampler: Option<usize>,
    /// `None`: only an unsupported extension has the image, or nothing has.
    pub(super) image: Option<usize>,
    /// The extension that holds the image which `image` lacks.
    pub(super) other_source: Option<&'static str>,
}

pub(super) struct Mesh {
    pub(super) name: String,
    pub(super) primitives: Vec<Primitive>,
    pub(super) weights: Vec<f32>,
}

pub(super) struct Primitive {
    pub(super) place: String,
    pub(super) mode: u64,
    /// Accessors by attribute name.
    pub(super) attributes: BTreeMap<String, usize>,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    /// Material by variant.
    pub(super) variants: BTreeMap<usize, usize>,
    pub(super) targets: Vec<BTreeMap<String, usize>>,
    pub(super) draco: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Local {
    Matrix(DAffine3),
    Trs { translation: DVec3, rotation: DQuat, scale: DVec3 },
}

impl Local {
    pub(super) fn affine(self) -> DAffine3 {
        match self {
            Self::Matrix(matrix) => matrix,
            Self::Trs { translation, rotation, scale } => {
                DAffine3::from_scale_rotation_translation(scale, unit_or_identity(rotation), translation)
            }
        }
    }
}

pub(super) fn unit_or_identity(q: DQuat) -> DQuat {
    let length = q.length();
    if length.is_finite() && length > 0.0 { q / length } else { DQuat::IDENTITY }
}

pub(super) struct Node {
    pub(super) place: String,
    pub(super) name: String,
    pub(super) local: Local,
    pub(super) children: Vec<usize>,
    pub(super) mesh: Option<usize>,
    pub(super) skin: Option<usize>,
    pub(super) camera: Option<usize>,
    pub(super) light: Option<usize>,
    pub(super) weights: Option<Vec<f32>>,
    pub(super) visible: bool,
    /// Accessors of EXT_mesh_gpu_instancing by attribute name.
    pub(super) instancing: Option<BTreeMap<String, usize>>,
}

pub(super) struct Skin {
    pub(super) place: String,
    pub(super) joints: Vec<usize>,
    pub(super) inverse_bind: Option<usize>,
}

pub(super) struct Animation {
    pub(super) channels: Vec<Channel>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum ChannelPath {
    Translation,
    Rotation,
    Scale,
    Weights,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Interpolation {
    Linear,
    Step,
    CubicSpline,
}

pub(super) struct Channel {
    pub(super) place: String,
    pub(super) node: usize,
    pub(super) path: ChannelPath,
    pub(super) interpolation: Interpolation,
    pub(super) input: usize,
    pub(super) output: usize,
}

pub(super) struct Scene {
    pub(super) name: String,
    pub(super) nodes: Vec<usize>,
}

impl<'a> Document<'a> {
    /// Parses and checks `json`. Extensions are looked at first, so that an unknown required one is what is reported.
    pub(super) fn parse(json: &'a Value, supported: impl Fn(&str) -> bool) -> Result<Self, Fault> {
        let map = json.as_object().ok_or_else(|| {
            let problem = "is not a JSON object".to_owned();
            Fault::new("document", ContentError::Property { key: "document".to_owned(), problem })
        })?;
        let root = Object::new(map, "");
        let top = Object::new(map, "document");
        let extensions_used = top.strings("extensionsUsed")?;
        if let Some(name) = top.strings("extensionsRequired")?.into_iter().find(|name| !supported(name)) {
            return Err(top.fault(ContentError::RequiredExtension(super::error::one_line(&name))));
        }

        let buffers = parse_all(&root, "buffers", "buffer", |o| {
            Ok(Buffer { uri: o.string("uri")?, length: o.required_uint("byteLength")?, place: o.place })
        })?;
        let views = parse_all(&root, "bufferViews", "buffer view", |o| View::parse(o, buffers.len()))?;
        let accessors = parse_all(&root, "accessors", "accessor", |o| Accessor::parse(&o, views.len()))?;
        let images = parse_all(&root, "images", "image", |o| {
            let (uri, view) = (o.string("uri")?, o.index("bufferView", "buffer view", views.len())?);
            Ok(Image { uri, view, name: o.name().to_owned(), place: o.place })
        })?;
        let samplers = parse_all(&root, "samplers", "sampler", |o| Sampler::parse(&o))?;
        let textures = parse_all(&root, "textures", "texture", |o| Texture::parse(&o, samplers.len(), images.len()))?;
        let materials = root.objects("materials", "material")?;
        let variants = match top.extension("KHR_materials_variants")? {
            Some(o) => o.objects("variants", "variant")?.iter().map(|v| v.name().to_owned()).collect(),
            None => Vec::new(),
        };
        let limits = MeshLimits { accessors: accessors.len(), materials: materials.len(), variants: variants.len() };
        let meshes = parse_all(&root, "meshes", "mesh", |o| Mesh::parse(&o, &limits))?;
        let cameras = root.objects("cameras", "camera")?;
        let lights = match root.extension("KHR_lights_punctual")? {
            Some(o) => o.objects("lights", "light")?,
            None => Vec::new(),
        };
        let node_count = root.array("nodes")?.len();
        let skins = parse_all(&root, "skins", "skin", |o| {
            let joints = o.indices("joints", "node", node_count)?;
            let inverse_bind = o.index("inverseBindMatrices", "accessor", accessors.len())?;
            Ok(Skin { joints, inverse_bind, place: o.place })
        })?;
        let counts = NodeLimits {
            nodes: node_count,
            meshes: meshes.len(),
            skins: skins.len(),
            cameras: cameras.len(),
            lights: lights.len(),
            accessors: accessors.len(),
        };
        let nodes = parse_all(&root, "nodes", "node", |o| Node::parse(o, &counts))?;
        let animations =
            parse_all(&root, "animations", "animation", |o| Animation::parse(&o, node_count, accessors.len()))?;
        let scenes = parse_all(&root, "scenes", "scene", |o| {
            Ok(Scene { name: o.name().to_owned(), nodes: o.indices("nodes", "node", node_count)? })
        })?;
        let default_scene = top.index("scene", "scene", scenes.len())?;
        let generator = top.object("asset")?.and_then(|a| a.string("generator").ok().flatten()).map(str::to_owned);

        Ok(Self {
            extensions_used,
            generator,
            buffers,
            views,
            accessors,
            images,
            samplers,
            textures,
            materials,
            meshes,
            nodes,
            skins,
            cameras,
            lights,
            animations,
            scenes,
            default_scene,
            variants,
        })
    }

    /// The used extensions that have no effect here although they might change the picture.
    pub(super) fn unsupported_extensions(&self, supported: impl Fn(&str) -> bool) -> Vec<String> {
        let ignored = |name: &&String| !supported(name) && !METADATA_EXTENSIONS.contains(&name.as_str());
        self.extensions_used.iter().filter(ignored).cloned().collect()
    }
}

fn parse_all<'a, T>(
    root: &Object<'a>,
    key: &str,
    kind: &str,
    parse: impl FnMut(Object<'a>) -> Result<T, Fault>,
) -> Result<Vec<T>, Fault> {
    root.objects(key, kind)?.into_iter().map(parse).collect()
}

impl<'a> View<'a> {
    fn parse(o: Object<'a>, buffers: usize) -> Result<Self, Fault> {
        let mut meshopt = None;
        for name in ["KHR_meshopt_compression", "EXT_meshopt_compression"] {
            if let Some(extension) = o.extension(name)? {
                extension.required_index("buffer", "buffer", buffers)?;
                meshopt = Some((name, extension));
            }
        }
        Ok(Self {
            buffer: o.required_index("buffer", "buffer", buffers)?,
            offset: o.uint("byteOffset")?.unwrap_or(0),
            length: o.required_uint("byteLength")?,
            stride: Some(o.size_or("byteStride", 0)?).filter(|&stride| stride > 0),
            meshopt,
            place: o.place,
        })
    }
}

impl Accessor {
    fn parse(o: &Object<'_>, views: usize) -> Result<Self, Fault> {
        let component = |o: &Object<'_>| {
            let code = o.required_uint("componentType")?;
            Component::from_code(code).ok_or_else(|| o.bad("componentType", format!("is {code}, which is not known")))
        };
        let (width, is_matrix) = match o.string("type")?.unwrap_or_default() {
            "SCALAR" => (1, false),
            "VEC2" => (2, false),
            "VEC3" => (3, false),
            "VEC4" => (4, false),
            "MAT2" => (4, true),
            "MAT3" => (9, true),
            "MAT4" => (16, true),
            other => return Err(o.bad("type", format!("is '{}', which is not known", super::error::one_line(other)))),
        };
        let sparse = match o.object("sparse")? {
            None => None,
            Some(sparse) => {
                let part = |key| sparse.object(key)?.ok_or_else(|| sparse.bad(key, "is missing"));
                let (indices, values) = (part("indices")?, part("values")?);
                Some(Sparse {
                    count: sparse.size_or("count", 0)?,
                    index_view: indices.required_index("bufferView", "buffer view", views)?,
                    index_offset: indices.uint("byteOffset")?.unwrap_or(0),
                    index_component: component(&indices)?,
                    value_view: values.required_index("bufferView", "buffer view", views)?,
                    value_offset: values.uint("byteOffset")?.unwrap_or(0),
                })
            }
        };
        let count = o.required_uint("count")?;
        Ok(Self {
            view: o.index("bufferView", "buffer view", views)?,
            offset: o.uint("byteOffset")?.unwrap_or(0),
            component: component(o)?,
            width,
            is_matrix,
            normalized: o.bool_or("normalized", false)?,
            count: usize::try_from(count).map_err(|_| o.bad("count", "is too large"))?,
            sparse,
            place: o.place.clone(),
        })
    }
}

impl Sampler {
    fn parse(o: &Object<'_>) -> Result<Self, Fault> {
        use crate::scene::WrapMode;
        let wrap = |key| {
            Ok(match o.uint(key)? {
                Some(33071) => WrapMode::ClampToEdge,
                Some(33648) => WrapMode::MirroredRepeat,
                _ => WrapMode::Repeat,
            })
        };
        const NEAREST: u64 = 9728;
        Ok(Self { wrap: [wrap("wrapS")?, wrap("wrapT")?], nearest: o.uint("magFilter")? == Some(NEAREST) })
    }
}

impl Texture {
    fn parse(o: &Object<'_>, samplers: usize, images: usize) -> Result<Self, Fault> {
        let source = |name: &str| match o.extension(name)? {
            Some(extension) => extension.index("source", "image", images),
            None => Ok(None),
        };
        let image = source("EXT_texture_webp")?.map_or_else(|| o.index("source", "image", images), |i| Ok(Some(i)))?;
        let mut other_source = None;
        for name in ["KHR_texture_basisu", "MSFT_texture_dds", "EXT_texture_avif"] {
            other_source = other_source.or(o.extension(name)?.map(|_| name));
        }
        Ok(Self { sampler: o.index("sampler", "sampler", samplers)?, image, other_source })
    }
}

struct MeshLimits {
    accessors: usize,
    materials: usize,
    variants: usize,
}

impl Mesh {
    fn parse(o: &Object<'_>, limits: &MeshLimits) -> Result<Self, Fault> {
        let primitives = o.objects("primitives", "primitive")?;
        let primitives = primitives.into_iter().map(|p| Primitive::parse(p, limits)).collect::<Result<_, _>>()?;
        Ok(Self { name: o.name().to_owned(), primitives, weights: weights(o)?.unwrap_or_default() })
    }
}

fn weights(o: &Object<'_>) -> Result<Option<Vec<f32>>, Fault> {
    let values = o.array("weights")?;
    #[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
    let number =
        |v: &Value| v.as_f64().map(|v| v as f32).ok_or_else(|| o.bad("weights", "has an entry that is no number"));
    Ok(if values.is_empty() { None } else { Some(values.iter().map(number).collect::<Result<_, _>>()?) })
}

impl Primitive {
    fn parse(o: Object<'_>, limits: &MeshLimits) -> Result<Self, Fault> {
        let attributes = o.object("attributes")?.ok_or_else(|| o.bad("attributes", "is missing"))?;
        let attributes = attribute_map(&attributes, limits.accessors)?;
        let mut targets = Vec::new();
        for (i, target) in o.objects("targets", "target")?.iter().enumerate() {
            let target = Object::new(target.map, format!("{} target {i}", o.place));
            targets.push(attribute_map(&target, limits.accessors)?);
        }
        let mut variants = BTreeMap::new();
        if let Some(extension) = o.extension("KHR_materials_variants")? {
            for mapping in extension.objects("mappings", "mapping")? {
                let material = mapping.required_index("material", "material", limits.materials)?;
                for variant in mapping.indices("variants", "variant", limits.variants)? {
                    variants.insert(variant, material);
                }
            }
        }
        Ok(Self {
            mode: o.uint("mode")?.unwrap_or(4),
            attributes,
            indices: o.index("indices", "accessor", limits.accessors)?,
            material: o.index("material", "material", limits.materials)?,
            variants,
            targets,
            draco: o.extension("KHR_draco_mesh_compression")?.is_some(),
            place: o.place,
        })
    }
}

/// Attribute names to accessors; entries that are no references are errors.
fn attribute_map(o: &Object<'_>, accessors: usize) -> Result<BTreeMap<String, usize>, Fault> {
    let entry = |key: &String| Ok((key.clone(), o.required_index(key, "accessor", accessors)?));
    o.map
        .keys()
        .filter(|key| key.bytes().all(|b| b.is_ascii_uppercase() || b.is_ascii_digit() || b == b'_'))
        .map(entry)
        .collect()
}

struct NodeLimits {
    nodes: usize,
    meshes: usize,
    skins: usize,
    cameras: usize,
    lights: usize,
    accessors: usize,
}

impl Node {
    fn parse(o: Object<'_>, limits: &NodeLimits) -> Result<Self, Fault> {
        let local = if let Some(matrix) = o.numbers::<16>("matrix")? {
            Local::Matrix(DAffine3::from_mat4(DMat4::from_cols_array(&matrix)))
        } else {
            Local::Trs {
                translation: o.numbers("translation")?.map_or(DVec3::ZERO, DVec3::from_array),
                rotation: o.numbers("rotation")?.map_or(DQuat::IDENTITY, DQuat::from_array),
                scale: o.numbers("scale")?.map_or(DVec3::ONE, DVec3::from_array),
            }
        };
        let instancing = match o.extension("EXT_mesh_gpu_instancing")? {
            Some(extension) => {
                extension.object("attributes")?.map(|a| attribute_map(&a, limits.accessors)).transpose()?
            }
            None => None,
        };
        Ok(Self {
            name: o.name().to_owned(),
            local,
            children: o.indices("children", "node", limits.nodes)?,
            mesh: o.index("mesh", "mesh", limits.meshes)?,
            skin: o.index("skin", "skin", limits.skins)?,
            camera: o.index("camera", "camera", limits.cameras)?,
            light: match o.extension("KHR_lights_punctual")? {
                Some(extension) => extension.index("light", "light", limits.lights)?,
                None => None,
            },
            weights: weights(&o)?,
            visible: o.extension("KHR_node_visibility")?.map_or(Ok(true), |e| e.bool_or("visible", true))?,
            instancing,
            place: o.place,
        })
    }
}

impl Animation {
    fn parse(o: &Object<'_>, nodes: usize, accessors: usize) -> Result<Self, Fault> {
        let samplers = o.objects("samplers", "sampler")?;
        let mut channels = Vec::new();
        for channel in o.objects("channels", "channel")? {
            let sampler = &samplers[channel.required_index("sampler", "sampler", samplers.len())?];
            let target = channel.object("target")?.ok_or_else(|| channel.bad("target", "is missing"))?;
            let path = match target.string("path")? {
                Some("translation") => ChannelPath::Translation,
                Some("rotation") => ChannelPath::Rotation,
                Some("scale") => ChannelPath::Scale,
                Some("weights") => ChannelPath::Weights,
                // "pointer" belongs to KHR_animation_pointer, which the report names as ignored.
                _ => continue,
            };
            let Some(node) = target.index("node", "node", nodes)? else { continue };
            let interpolation = match sampler.string("interpolation")? {
                None | Some("LINEAR") => Interpolation::Linear,
                Some("STEP") => Interpolation::Step,
                Some("CUBICSPLINE") => Interpolation::CubicSpline,
                Some(_) => return Err(sampler.bad("interpolation", "is not known")),
            };
            channels.push(Channel {
                node,
                path,
                interpolation,
                input: sampler.required_index("input", "accessor", accessors)?,
                output: sampler.required_index("output", "accessor", accessors)?,
                place: channel.place,
            });
        }
        Ok(Self { channels })
    }
}
