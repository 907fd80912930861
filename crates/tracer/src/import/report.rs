//! What an import met and what it made of it.

use std::path::PathBuf;

use glam::Affine3A;

use crate::bvh::LARGEST_COORDINATE;

/// What was read, ignored, repaired or replaced.
#[derive(Clone, Debug, Default)]
pub struct ImportReport {
    /// In the order in which they were met.
    pub warnings: Vec<ImportWarning>,
    /// The file's `extensionsUsed`.
    pub extensions_used: Vec<String>,
    /// Those of them that this program ignores.
    pub extensions_unsupported: Vec<String>,
    /// The program that wrote the file.
    pub generator: Option<String>,
    /// Names of the material variants that one can choose from.
    pub variants: Vec<String>,
    /// Names of the file's scenes (empty strings for unnamed ones).
    pub scenes: Vec<String>,
    /// Which of `scenes` was loaded.
    pub scene: usize,
    /// Length of the longest animation, seconds; 0 without animations.
    pub animation_secs: f32,
    /// Triangles dropped because they have no area.
    pub degenerate_triangles: usize,
    /// Time that the stages took.
    pub stage_seconds: ImportSeconds,
    /// The file and its companions, for watching.
    pub files: Vec<PathBuf>,
    /// All nodes of the file by index, those of other scenes too; [`Instance::node`](crate::scene::Instance::node) refers
    /// to them.
    pub nodes: Vec<SceneNode>,
}

/// A node of the file's graph.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneNode {
    /// As in the file; may be empty, need not be unique.
    pub name: String,
    /// Index of the node that it hangs on.
    pub parent: Option<u32>,
    /// Its place, relative to [`Scene::origin_in_file`](crate::scene::Scene::origin_in_file); need not be invertible.
    pub world_from_node: Affine3A,
}

/// Wall-clock time of the stages of an import, seconds. Tangents and textures are made at the same time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImportSeconds {
    /// Reading the file and its buffers, parsing its JSON.
    pub read: f64,
    /// Building meshes.
    pub geometry: f64,
    /// Making the tangents that the file lacks.
    pub tangents: f64,
    /// Reading and decoding images.
    pub textures: f64,
    /// All of it.
    pub total: f64,
}

/// Something that the import could go on after. `Display` is one line: place and what was done.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ImportWarning {
    /// An optional extension that has no effect here.
    #[error("extension {name} is not supported and was ignored")]
    ExtensionIgnored {
        /// Its name.
        name: String,
    },
    /// An image that is missing or does not decode; it acts as if it were neutral.
    #[error("{place}: {cause}; a neutral texture takes its place")]
    ImageReplaced {
        /// Which image or texture.
        place: String,
        /// What was wrong.
        cause: String,
    },
    /// A 16-bit image used as a normal map was rounded to 8 bits, which can show as steps on smooth metal.
    #[error("{place}: a 16-bit normal map was rounded to 8 bits")]
    NormalMapRounded {
        /// Which image.
        place: String,
    },
    /// Other 16-bit images were rounded to 8 bits.
    #[error("{count} images of 16 bits a channel were rounded to 8 bits")]
    ImagesRounded {
        /// How many.
        count: usize,
    },
    /// A property that changes nothing here; all places that have it are one entry.
    #[error("{property} has no effect ({count}x): {reason}")]
    PropertyIgnored {
        /// Its name in the file.
        property: &'static str,
        /// How often it was met.
        count: usize,
        /// What counts in its place.
        reason: &'static str,
    },
    /// Triangles without area were dropped.
    #[error("{place}: dropped {count} triangles without area")]
    DegenerateTriangles {
        /// Which primitive.
        place: String,
        /// How many.
        count: usize,
    },
    /// Triangles that reach beyond [`LARGEST_COORDINATE`] in their mesh were dropped: nobody means them.
    #[error("{place}: dropped {count} triangles with corners beyond {limit:e} m", limit = LARGEST_COORDINATE)]
    FarTriangles {
        /// Which primitive.
        place: String,
        /// How many.
        count: usize,
    },
    /// What a node places reaches beyond [`LARGEST_COORDINATE`].
    #[error("{place}: what it places reaches beyond {limit:e} m and was dropped", limit = LARGEST_COORDINATE)]
    FarPlacement {
        /// Which node.
        place: String,
    },
    /// Zero or non-finite normals were replaced by those of the adjoining triangles.
    #[error("{place}: repaired {count} normals that were zero or not finite")]
    NormalsRepaired {
        /// Which primitive.
        place: String,
        /// How many.
        count: usize,
    },
    /// Texture coordinates or colours that are not finite became zero.
    #[error("{place}: {count} values of {attribute} were not finite and became 0")]
    AttributeRepaired {
        /// Which primitive.
        place: String,
        /// Which attribute.
        attribute: String,
        /// How many vertices.
        count: usize,
    },
    /// Points or lines, which have no surface.
    #[error("{place}: {mode} are not rendered")]
    PrimitiveSkipped {
        /// Which primitive.
        place: String,
        /// What it consists of.
        mode: &'static str,
    },
    /// A transform that flattens what it places, or is not finite.
    #[error("{place}: its transform cannot be inverted; what it places was dropped")]
    SingularTransform {
        /// Which node.
        place: String,
    },
    /// A material uses texture coordinates that its mesh does not have.
    #[error("{place}: its material uses TEXCOORD_{set}, which it lacks; (0, 0) is used")]
    TexCoordMissing {
        /// Which primitive.
        place: String,
        /// Which set.
        set: u32,
    },
    /// A texture was left out.
    #[error("{place}: {slot} was left out: {cause}")]
    TextureDropped {
        /// Which material.
        place: String,
        /// Which property.
        slot: String,
        /// Why.
        cause: String,
    },
    /// A value outside its range was clamped.
    #[error("{place}: '{key}' = {value} is out of range and was clamped")]
    ValueClamped {
        /// Where.
        place: String,
        /// Which property.
        key: String,
        /// What the file says.
        value: f64,
    },
    /// An old specular-glossiness material was expressed by metallic-roughness and specular.
    #[error("{place}: specular-glossiness was converted to metallic-roughness with specular")]
    SpecularGlossinessConverted {
        /// Which material.
        place: String,
    },
    /// A camera or light of a kind that is not known.
    #[error("{place}: {kind} '{value}' is not known and was ignored")]
    UnknownKind {
        /// Where.
        place: String,
        /// What kind of thing.
        kind: &'static str,
        /// What the file says.
        value: String,
    },
    /// Nothing in the file gives light.
    #[error("the file has no light: a neutral sky of radiance 0.8 lights it")]
    NoLight,
}

/// Adds a [`ImportWarning::PropertyIgnored`], or counts it.
pub(super) fn ignore(warnings: &mut Vec<ImportWarning>, ignored: &'static str, reason: &'static str) {
    let known = warnings.iter_mut().find_map(|warning| match warning {
        ImportWarning::PropertyIgnored { property, count, .. } if *property == ignored => Some(count),
        _ => None,
    });
    match known {
        Some(count) => *count += 1,
        None => warnings.push(ImportWarning::PropertyIgnored { property: ignored, count: 1, reason }),
    }
}
