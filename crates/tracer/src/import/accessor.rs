//! Typed data out of buffers: every range is checked before anything is read or allocated.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::PathBuf;

use rayon::prelude::*;

use super::container::Folder;
use super::document::{Accessor, Component, Document, Sparse, View};
use super::error::{ContentError, Fault};
use super::meshopt;

/// Most elements of an accessor that is not backed by as many bytes (no buffer view: zeros).
const MAX_UNBACKED_ELEMENTS: usize = 1 << 24;

/// The document with its buffers loaded.
pub(super) struct Data<'a> {
    pub(super) document: &'a Document<'a>,
    buffers: Vec<Option<Cow<'a, [u8]>>>,
    /// Buffer views that had to be decompressed.
    decoded_views: BTreeMap<usize, Vec<u8>>,
}

impl<'a> Data<'a> {
    /// Reads the buffers; companion files are added to `files`.
    pub(super) fn load(
        document: &'a Document<'a>,
        folder: &Folder,
        bin: Option<&'a [u8]>,
        files: &mut Vec<PathBuf>,
    ) -> Result<Self, Fault> {
        let mut buffers: Vec<Option<Cow<'a, [u8]>>> = Vec::with_capacity(document.buffers.len());
        for (index, buffer) in document.buffers.iter().enumerate() {
            let bytes = match buffer.uri {
                _ if buffer.is_fallback => None,
                Some(uri) => {
                    let place = if uri.starts_with("data:") {
                        buffer.place.clone()
                    } else {
                        format!("{} '{}'", buffer.place, super::error::one_line(uri))
                    };
                    files.extend(folder.companion(uri));
                    let bytes = folder.read(uri, buffer.length);
                    let bytes = bytes.map_err(|e| Fault::new(place, ContentError::Unreadable(e)))?;
                    Some(Cow::Owned(bytes))
                }
                None if index == 0 => bin.map(Cow::Borrowed),
                None => None,
            };
            if let Some(bytes) = bytes.as_ref().filter(|bytes| (bytes.len() as u64) < buffer.length) {
                let container = "data".to_owned();
                let available = bytes.len() as u64;
                let cause = ContentError::Truncated { needed: buffer.length, container, available };
                return Err(Fault::new(buffer.place.clone(), cause));
            }
            buffers.push(bytes);
        }
        let mut data = Self { document, buffers, decoded_views: BTreeMap::new() };
        data.decoded_views = data.decompress_views()?;
        Ok(data)
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, index: usize) -> Result<&[u8], Fault> {
        if let Some(bytes) = self.decoded_views.get(&index) {
            return Ok(bytes);
        }
        let view = &self.document.views[index];
        self.buffer_range(view, view.buffer, view.offset, view.length)
    }

    fn decompress_views(&self) -> Result<BTreeMap<usize, Vec<u8>>, Fault> {
        let compressed = self.document.views.par_iter().enumerate().filter_map(|(index, view)| {
            let compressed = view.compressed.as_ref()?;
            let decoded = self.buffer_range(view, compressed.buffer, compressed.offset, compressed.length);
            let decoded = decoded.and_then(|bytes| {
                let fault = |problem| Fault::new(view.place.clone(), ContentError::Compressed(problem));
                meshopt::decode(compressed, bytes).map_err(fault)
            });
            Some(decoded.map(|bytes| (index, bytes)))
        });
        compressed.collect()
    }

    fn buffer_range(&self, view: &View, buffer: usize, offset: u64, length: u64) -> Result<&[u8], Fault> {
        let Some(bytes) = &self.buffers[buffer] else {
            let cause = ContentError::Unreadable("it has neither a URI nor a binary chunk".to_owned());
            return Err(Fault::new(self.document.buffers[buffer].place.clone(), cause));
        };
        slice(bytes, offset, length, &view.place, || format!("buffer {buffer}"))
    }

    fn view_from(&self, index: usize, offset: u64, needed: u64, place: &str) -> Result<&[u8], Fault> {
        slice(self.view(index)?, offset, needed, place, || format!("buffer view {index}"))
    }

    /// Elements of `N` components as floats; integers are converted, normalised ones to 0..=1 or -1..=1.
    pub(super) fn floats<const N: usize>(&self, index: usize, what: &str) -> Result<Vec<[f32; N]>, Fault> {
        let accessor = &self.document.accessors[index];
        self.require_width(accessor, N, what)?;
        let mut values = match accessor.view {
            None => vec![[0.0; N]; unbacked(accessor)?],
            Some(view) => {
                let elements = self.elements(accessor, view, accessor.offset, accessor.count, accessor.component)?;
                decode_all(&elements, accessor)
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let (at, replacements) = self.sparse(accessor, sparse)?;
            for (at, value) in at.into_iter().zip(decode_all(&replacements, accessor)) {
                *values.get_mut(at).ok_or_else(|| sparse_index(accessor, at))? = value;
            }
        }
        Ok(values)
    }

    /// All components of all elements, whatever the type.
    pub(super) fn scalars(&self, index: usize, what: &str) -> Result<Vec<f32>, Fault> {
        Ok(match self.document.accessors[index].width {
            1 => self.floats::<1>(index, what)?.into_flattened(),
            2 => self.floats::<2>(index, what)?.into_flattened(),
            3 => self.floats::<3>(index, what)?.into_flattened(),
            4 => self.floats::<4>(index, what)?.into_flattened(),
            9 => self.floats::<9>(index, what)?.into_flattened(),
            _ => self.floats::<16>(index, what)?.into_flattened(),
        })
    }

    /// Elements of `N` unsigned integers, not normalised.
    pub(super) fn integers<const N: usize>(&self, index: usize, what: &str) -> Result<Vec<[u32; N]>, Fault> {
        let accessor = &self.document.accessors[index];
        self.require_width(accessor, N, what)?;
        if !matches!(accessor.component, Component::U8 | Component::U16 | Component::U32) {
            let cause = ContentError::AccessorType(format!("{what} must be unsigned integers"));
            return Err(Fault::new(accessor.place.clone(), cause));
        }
        let mut values = match accessor.view {
            None => vec![[0; N]; unbacked(accessor)?],
            Some(view) => {
                let elements = self.elements(accessor, view, accessor.offset, accessor.count, accessor.component)?;
                elements.iter().map(|e| std::array::from_fn(|c| uint(e, c, accessor.component))).collect()
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let (at, replacements) = self.sparse(accessor, sparse)?;
            for (at, e) in at.into_iter().zip(replacements.iter()) {
                let slot = values.get_mut(at).ok_or_else(|| sparse_index(accessor, at))?;
                *slot = std::array::from_fn(|c| uint(e, c, accessor.component));
            }
        }
        Ok(values)
    }

    fn require_width(&self, accessor: &Accessor, width: usize, what: &str) -> Result<(), Fault> {
        if accessor.width == width && accessor.is_matrix == (width == 16) {
            return Ok(());
        }
        let found = accessor.width;
        let cause = ContentError::AccessorType(format!("{what} needs {width} components, but it has {found}"));
        Err(Fault::new(accessor.place.clone(), cause))
    }

    fn sparse(&self, accessor: &Accessor, sparse: &Sparse) -> Result<(Vec<usize>, Elements<'_>), Fault> {
        let component = sparse.index_component;
        let needed = (sparse.count as u64).saturating_mul(component.bytes() as u64);
        let indices = self.view_from(sparse.index_view, sparse.index_offset, needed, &accessor.place)?;
        let indices = indices.chunks_exact(component.bytes()).map(|e| uint(e, 0, component) as usize).collect();
        let size = element_size(accessor);
        let needed = (sparse.count as u64).saturating_mul(size as u64);
        let bytes = self.view_from(sparse.value_view, sparse.value_offset, needed, &accessor.place)?;
        Ok((indices, Elements { bytes, stride: size, size, count: sparse.count }))
    }

    fn elements(
        &self,
        accessor: &Accessor,
        view: usize,
        offset: u64,
        count: usize,
        component: Component,
    ) -> Result<Elements<'_>, Fault> {
        let size = element_size(accessor);
        let stride = self.document.views[view].stride.unwrap_or(size);
        if stride < size || (accessor.is_matrix && component.bytes() < 4) {
            let cause = ContentError::AccessorType(format!("elements of {size} bytes do not fit a stride of {stride}"));
            return Err(Fault::new(accessor.place.clone(), cause));
        }
        let needed = match count {
            0 => 0,
            _ => (count as u64 - 1).saturating_mul(stride as u64).saturating_add(size as u64),
        };
        let bytes = self.view_from(view, offset, needed, &accessor.place)?;
        Ok(Elements { bytes, stride, size, count })
    }
}

/// Equally spaced elements in bytes; the range is checked when it is made.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
    count: usize,
}

impl<'a> Elements<'a> {
    fn iter(&self) -> impl Iterator<Item = &'a [u8]> {
        let (bytes, stride, size) = (self.bytes, self.stride, self.size);
        (0..self.count).map(move |i| &bytes[i * stride..i * stride + size])
    }
}

fn slice<'b>(
    bytes: &'b [u8],
    offset: u64,
    length: u64,
    place: &str,
    container: impl Fn() -> String,
) -> Result<&'b [u8], Fault> {
    let end = offset.saturating_add(length);
    let range = usize::try_from(offset).ok().zip(usize::try_from(end).ok());
    range.and_then(|(start, end)| bytes.get(start..end)).ok_or_else(|| {
        let cause = ContentError::Truncated { needed: end, container: container(), available: bytes.len() as u64 };
        Fault::new(place, cause)
    })
}

fn element_size(accessor: &Accessor) -> usize {
    accessor.component.bytes() * accessor.width
}

fn unbacked(accessor: &Accessor) -> Result<usize, Fault> {
    if accessor.count <= MAX_UNBACKED_ELEMENTS {
        return Ok(accessor.count);
    }
    let cause = ContentError::TooMany {
        what: "elements without data",
        count: accessor.count as u64,
        limit: MAX_UNBACKED_ELEMENTS as u64,
    };
    Err(Fault::new(accessor.place.clone(), cause))
}

fn sparse_index(accessor: &Accessor, index: usize) -> Fault {
    let cause = ContentError::Reference {
        key: "sparse.indices".to_owned(),
        kind: "element",
        index: index as u64,
        count: accessor.count,
    };
    Fault::new(accessor.place.clone(), cause)
}

fn decode_all<const N: usize>(elements: &Elements<'_>, accessor: &Accessor) -> Vec<[f32; N]> {
    let component = accessor.component;
    if component == Component::F32 {
        return elements.iter().map(|e| std::array::from_fn(|c| f32::from_bits(uint(e, c, component)))).collect();
    }
    let normalized = accessor.normalized;
    elements
        .iter()
        .map(|e| std::array::from_fn(|c| decode_integer(uint(e, c, component), component, normalized)))
        .collect()
}

/// glTF 2.0, section 3.11: signed values divide by 2^(b-1) - 1 and stop at -1.
fn decode_integer(raw: u32, component: Component, normalized: bool) -> f32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "sign extension of a narrow value")]
    let (value, scale) = match component {
        Component::I8 => (f32::from(raw as u8 as i8), 127.0),
        Component::I16 => (f32::from(raw as u16 as i16), 32767.0),
        Component::U8 => (raw as f32, 255.0),
        Component::U16 => (raw as f32, 65535.0),
        Component::U32 | Component::F32 => (raw as f32, u32::MAX as f32),
    };
    if normalized { (value / scale).max(-1.0) } else { value }
}

/// Component `c` of an element, zero-extended.
fn uint(element: &[u8], c: usize, component: Component) -> u32 {
    match component.bytes() {
        1 => u32::from(element[c]),
        2 => u32::from(u16::from_le_bytes([element[2 * c], element[2 * c + 1]])),
        _ => u32::from_le_bytes([element[4 * c], element[4 * c + 1], element[4 * c + 2], element[4 * c + 3]]),
    }
}
