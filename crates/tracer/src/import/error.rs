//! What can go wrong for good while a glTF file is read.

use std::path::{Path, PathBuf};

/// Why a file could not be imported. Its `Display` is one line: file, place in the file, cause.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file itself could not be read.
    #[error("{}: cannot be read: {source}", one_line(&file.display().to_string()))]
    Read {
        /// As given.
        file: PathBuf,
        /// The operating system's answer.
        source: std::io::Error,
    },
    /// The bytes are neither a binary glTF 2.0 container nor glTF 2.0 JSON.
    #[error("{}: not a glTF 2.0 file: {cause}", one_line(&file.display().to_string()))]
    NotGltf {
        /// As given.
        file: PathBuf,
        /// What was found instead.
        cause: String,
    },
    /// Something inside the file is wrong.
    #[error("{}: {place}: {cause}", one_line(&file.display().to_string()))]
    Content {
        /// As given.
        file: PathBuf,
        /// Where in the file, such as `accessor 3` or `mesh 1 'wall' primitive 0`.
        place: String,
        /// What is wrong there.
        cause: ContentError,
    },
}

/// What is wrong with a part of a file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContentError {
    /// An extension in `extensionsRequired` that this program does not know.
    #[error("the required extension {0} is not supported")]
    RequiredExtension(String),
    /// Data is stored only in a form that needs an unsupported extension.
    #[error("its data is stored only by the extension {0}, which is not supported")]
    DataNeedsExtension(String),
    /// A property is absent or of the wrong type.
    #[error("property '{key}' {problem}")]
    Property {
        /// The JSON key.
        key: String,
        /// What is wrong with its value.
        problem: String,
    },
    /// A reference to something that the file does not have.
    #[error("'{key}' refers to {kind} {index}, but the file has {count}")]
    Reference {
        /// The JSON key that holds the reference.
        key: String,
        /// Kind of thing referred to.
        kind: &'static str,
        /// The reference.
        index: u64,
        /// How many of that kind there are.
        count: usize,
    },
    /// A companion file or embedded data cannot be had.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// A range ends behind the data that should contain it.
    #[error("needs {needed} bytes of {container}, which has {available}")]
    Truncated {
        /// End of the range, bytes.
        needed: u64,
        /// What should contain it.
        container: String,
        /// What there is, bytes.
        available: u64,
    },
    /// A vertex position is NaN or infinite.
    #[error("vertex {vertex} has a position that is not finite")]
    NonFinitePosition {
        /// Its number in the accessor.
        vertex: usize,
    },
    /// A triangle refers to a vertex that does not exist.
    #[error("vertex index {index} is out of range: there are {vertices} vertices")]
    VertexIndex {
        /// The index.
        index: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// Two vertex attributes disagree about the number of vertices.
    #[error("{attribute} has {found} entries where POSITION has {expected}")]
    AttributeCount {
        /// The attribute.
        attribute: String,
        /// Its entries.
        found: usize,
        /// Those of POSITION.
        expected: usize,
    },
    /// A vertex is bound to a joint that its skin does not have.
    #[error("vertex {vertex} is bound to joint {joint}, but the skin has {joints}")]
    Joint {
        /// Its number in the accessor.
        vertex: usize,
        /// The joint.
        joint: u32,
        /// How many joints the skin has.
        joints: usize,
    },
    /// An accessor has a type that its use does not allow.
    #[error("{0}")]
    AccessorType(String),
    /// The scene shows no triangle at all.
    #[error("has no triangles to render")]
    NoTriangles,
    /// An image whose header claims more pixels than are sensible.
    #[error("{width}x{height} pixels exceed the limit of {limit_side} per side and {limit_pixels} in all")]
    ImageTooLarge {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// Largest width or height, pixels.
        limit_side: u32,
        /// Largest area, pixels.
        limit_pixels: u64,
    },
    /// A count beyond what is sensible, refused before memory is asked for.
    #[error("{count} {what} exceed the limit of {limit}")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// How many.
        count: u64,
        /// How many are allowed.
        limit: u64,
    },
    /// A node that is its own ancestor or has two parents.
    #[error("is its own ancestor or the child of two nodes")]
    NodeGraph,
    /// The options name a scene that the file does not have.
    #[error("scene {index} was asked for, but the file has {count}")]
    UnknownScene {
        /// As asked for.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// The options name a material variant that the file does not have.
    #[error("no material variant '{asked}'; the file has: {}", if known.is_empty() { "none".to_owned() } else { known.join(", ") })]
    UnknownVariant {
        /// As asked for.
        asked: String,
        /// Those of the file.
        known: Vec<String>,
    },
    /// Compressed data that does not follow its format.
    #[error("{0}")]
    Compressed(String),
}

/// A [`ContentError`] and its place; the file is added at the top.
#[derive(Debug)]
pub(super) struct Fault {
    pub(super) place: String,
    pub(super) cause: ContentError,
}

impl Fault {
    pub(super) fn new(place: impl Into<String>, cause: ContentError) -> Self {
        Self { place: place.into(), cause }
    }

    pub(super) fn in_file(self, file: &Path) -> ImportError {
        let place = if self.place.is_empty() { "document".to_owned() } else { one_line(&self.place) };
        ImportError::Content { file: file.to_owned(), place, cause: self.cause }
    }
}

/// The text with control characters escaped, so that a name cannot break a message into lines.
pub(super) fn one_line(text: &str) -> String {
    text.chars().flat_map(|c| c.is_control().then(|| c.escape_default().collect()).unwrap_or(vec![c])).collect()
}

/// `kind index 'name'`, or without the name where there is none.
pub(super) fn place_of(kind: &str, index: usize, name: &str) -> String {
    if name.is_empty() { format!("{kind} {index}") } else { format!("{kind} {index} '{}'", one_line(name)) }
}
