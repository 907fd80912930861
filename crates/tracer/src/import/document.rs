//! The parts of a glTF document, parsed into plain structs in which every index is known to be in range.
//!
//! This reads JSON directly: the `gltf` crate's accessors panic on bad indices, and its types refuse files whose only
//! oddity is an optional extension (a texture without a plain source, an animation of something that is no node).

use std::collections::BTreeMap;

use serde_json::Value;

use super::error::{ContentError, Fault};
use super::json::Object;

mod node;
mod storage;

use node::NodeLimits;
pub(super) use node::{Animation, Channel, ChannelPath, Interpolation, Local, Node, unit_or_identity};
pub(super) use storage::{Accessor, Buffer, Component, Compressed, CompressedMode, Filter, Sparse, View};

/// Extensions that take effect here (or need none to be right), and may therefore be required.
pub(super) const SUPPORTED_EXTENSIONS: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_iridescence",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_transform",
];

/// Extensions that only annotate; ignoring them changes no picture.
const METADATA_EXTENSIONS: &[&str] = &["KHR_xmp", "KHR_xmp_json_ld"];

pub(super) struct Document<'a> {
    pub(super) extensions_used: Vec<String>,
    pub(super) generator: Option<String>,
    pub(super) buffers: Vec<Buffer<'a>>,
    pub(super) views: Vec<View>,
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

pub(super) struct Skin {
    pub(super) place: String,
    pub(super) joints: Vec<usize>,
    pub(super) inverse_bind: Option<usize>,
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
        let is_fine = |name: &str| supported(name) || METADATA_EXTENSIONS.contains(&name);
        if let Some(name) = top.strings("extensionsRequired")?.into_iter().find(|name| !is_fine(name)) {
            return Err(top.fault(ContentError::RequiredExtension(super::error::one_line(&name))));
        }

        let buffers = parse_all(&root, "buffers", "buffer", Buffer::parse)?;
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
