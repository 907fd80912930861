//! Buffers, buffer views and accessors as the JSON describes them.

use super::super::error::{Fault, one_line};
use super::super::json::Object;

pub(in crate::import) struct Buffer<'a> {
    pub(in crate::import) place: String,
    pub(in crate::import) uri: Option<&'a str>,
    pub(in crate::import) length: u64,
    /// The placeholder that meshopt compression leaves for readers that do not know it.
    pub(in crate::import) is_fallback: bool,
}

pub(in crate::import) struct View {
    pub(in crate::import) place: String,
    pub(in crate::import) buffer: usize,
    pub(in crate::import) offset: u64,
    pub(in crate::import) length: u64,
    pub(in crate::import) stride: Option<usize>,
    /// EXT_ or KHR_meshopt_compression.
    pub(in crate::import) compressed: Option<Compressed>,
}

/// Where the compressed form of a buffer view is, and what it is.
pub(in crate::import) struct Compressed {
    pub(in crate::import) buffer: usize,
    pub(in crate::import) offset: u64,
    pub(in crate::import) length: u64,
    /// Bytes per element.
    pub(in crate::import) stride: usize,
    /// Elements.
    pub(in crate::import) count: usize,
    pub(in crate::import) mode: CompressedMode,
    pub(in crate::import) filter: Filter,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::import) enum CompressedMode {
    Attributes,
    Triangles,
    Indices,
}

/// What is applied to attributes after decompression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::import) enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::import) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    pub(in crate::import) fn from_code(code: u64) -> Option<Self> {
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

    pub(in crate::import) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

pub(in crate::import) struct Accessor {
    pub(in crate::import) place: String,
    pub(in crate::import) view: Option<usize>,
    pub(in crate::import) offset: u64,
    pub(in crate::import) component: Component,
    /// Components per element: 1 to 4, or 4, 9, 16 for matrices.
    pub(in crate::import) width: usize,
    pub(in crate::import) is_matrix: bool,
    pub(in crate::import) normalized: bool,
    pub(in crate::import) count: usize,
    pub(in crate::import) sparse: Option<Sparse>,
}

pub(in crate::import) struct Sparse {
    pub(in crate::import) count: usize,
    pub(in crate::import) index_view: usize,
    pub(in crate::import) index_offset: u64,
    pub(in crate::import) index_component: Component,
    pub(in crate::import) value_view: usize,
    pub(in crate::import) value_offset: u64,
}

const MESHOPT: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

impl<'a> Buffer<'a> {
    pub(super) fn parse(o: Object<'a>) -> Result<Self, Fault> {
        let mut is_fallback = false;
        for name in MESHOPT {
            is_fallback |= o.extension(name)?.map_or(Ok(false), |e| e.bool_or("fallback", false))?;
        }
        Ok(Self { uri: o.string("uri")?, length: o.required_uint("byteLength")?, is_fallback, place: o.place })
    }
}

impl View {
    pub(super) fn parse(o: Object<'_>, buffers: usize) -> Result<Self, Fault> {
        let mut compressed = None;
        for name in MESHOPT {
            if let Some(extension) = o.extension(name)? {
                compressed = Some(Compressed::parse(&extension, buffers)?);
            }
        }
        Ok(Self {
            buffer: o.required_index("buffer", "buffer", buffers)?,
            offset: o.uint("byteOffset")?.unwrap_or(0),
            length: o.required_uint("byteLength")?,
            stride: Some(o.size_or("byteStride", 0)?).filter(|&stride| stride > 0),
            compressed,
            place: o.place,
        })
    }
}

impl Compressed {
    /// The rules are those of KHR_meshopt_compression, "JSON schema updates".
    fn parse(o: &Object<'_>, buffers: usize) -> Result<Self, Fault> {
        let (stride, count) = (o.size_or("byteStride", 0)?, o.size_or("count", 0)?);
        let mode = match o.string("mode")? {
            Some("ATTRIBUTES") => CompressedMode::Attributes,
            Some("TRIANGLES") => CompressedMode::Triangles,
            Some("INDICES") => CompressedMode::Indices,
            _ => return Err(o.bad("mode", "is not known")),
        };
        let filter = match o.string("filter")? {
            None | Some("NONE") => Filter::None,
            Some("OCTAHEDRAL") => Filter::Octahedral,
            Some("QUATERNION") => Filter::Quaternion,
            Some("EXPONENTIAL") => Filter::Exponential,
            Some("COLOR") => Filter::Color,
            Some(_) => return Err(o.bad("filter", "is not known")),
        };
        let is_stride_fine = match (mode, filter) {
            (CompressedMode::Attributes, Filter::None | Filter::Exponential) => {
                stride.is_multiple_of(4) && (4..=256).contains(&stride)
            }
            (CompressedMode::Attributes, Filter::Octahedral | Filter::Color) => stride == 4 || stride == 8,
            (CompressedMode::Attributes, Filter::Quaternion) => stride == 8,
            (CompressedMode::Triangles | CompressedMode::Indices, _) => stride == 2 || stride == 4,
        };
        if !is_stride_fine {
            return Err(o.bad("byteStride", format!("is {stride}, which its mode or filter does not allow")));
        }
        if mode != CompressedMode::Attributes && filter != Filter::None {
            return Err(o.bad("filter", "is for attributes only"));
        }
        if mode == CompressedMode::Triangles && !count.is_multiple_of(3) {
            return Err(o.bad("count", "is not a multiple of 3"));
        }
        Ok(Self {
            buffer: o.required_index("buffer", "buffer", buffers)?,
            offset: o.uint("byteOffset")?.unwrap_or(0),
            length: o.required_uint("byteLength")?,
            stride,
            count,
            mode,
            filter,
        })
    }
}

impl Accessor {
    pub(super) fn parse(o: &Object<'_>, views: usize) -> Result<Self, Fault> {
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
            other => return Err(o.bad("type", format!("is '{}', which is not known", one_line(other)))),
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
