//! Decompression of EXT_meshopt_compression and KHR_meshopt_compression, written from the latter's specification
//! (appendix A, "Bitstream"). Output grows with what has been decoded, never with what a header claims.

use super::document::{Compressed, CompressedMode};

mod attributes;
mod filter;

/// Largest decoded buffer view, bytes: a few bytes of a valid stream can stand for kilobytes.
const MAX_DECODED_BYTES: usize = 1 << 30;

/// Decodes a buffer view. Errors say what about the stream is wrong.
pub(super) fn decode(view: &Compressed, bytes: &[u8]) -> Result<Vec<u8>, String> {
    if view.count.saturating_mul(view.stride) > MAX_DECODED_BYTES {
        let (count, stride) = (view.count, view.stride);
        return Err(format!("{count} elements of {stride} bytes exceed the limit of {MAX_DECODED_BYTES} bytes"));
    }
    match view.mode {
        CompressedMode::Attributes => {
            let mut decoded = attributes::decode(bytes, view.count, view.stride)?;
            filter::apply(view.filter, &mut decoded, view.stride);
            Ok(decoded)
        }
        CompressedMode::Triangles => decode_triangles(bytes, view.count).map(|indices| narrow(&indices, view.stride)),
        CompressedMode::Indices => decode_indices(bytes, view.count).map(|indices| narrow(&indices, view.stride)),
    }
}

/// Stores indices in `stride` (2 or 4) bytes each.
fn narrow(indices: &[u32], stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|i| i.to_le_bytes().into_iter().take(stride)).collect()
}

fn short() -> String {
    "the compressed stream ends too early".to_owned()
}

/// A stream read from the front.
struct Cursor<'a> {
    bytes: &'a [u8],
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self.bytes.split_at_checked(count).ok_or_else(short)?;
        self.bytes = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, String> {
        Ok(self.take(1)?[0])
    }

    fn varint(&mut self) -> Result<u32, String> {
        let mut value = 0;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7F) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err("the compressed stream has a number of more than 5 bytes".to_owned())
    }

    fn finish(self) -> Result<(), String> {
        if self.bytes.is_empty() { Ok(()) } else { Err("the compressed stream has bytes left over".to_owned()) }
    }
}

fn unzigzag(v: u32) -> u32 {
    if v & 1 == 1 { !(v >> 1) } else { v >> 1 }
}

fn body(bytes: &[u8], header: u8, tail: usize) -> Result<(&[u8], &[u8]), String> {
    let (&first, rest) = bytes.split_first().ok_or_else(short)?;
    if first != header {
        return Err(format!("the compressed stream starts with {first:#04x} instead of {header:#04x}"));
    }
    rest.len().checked_sub(tail).map(|at| rest.split_at(at)).ok_or_else(short)
}

fn decode_indices(bytes: &[u8], count: usize) -> Result<Vec<u32>, String> {
    let (data, _) = body(bytes, 0xD1, 4)?;
    if count > data.len() {
        return Err(short());
    }
    let mut data = Cursor { bytes: data };
    let mut last = [0u32; 2];
    let mut indices = Vec::with_capacity(count);
    for _ in 0..count {
        let v = data.varint()?;
        let baseline = &mut last[(v & 1) as usize];
        *baseline = baseline.wrapping_add(unzigzag(v >> 1));
        indices.push(*baseline);
    }
    data.finish()?;
    Ok(indices)
}

/// The last 16 values, the most recent first; reading one that was never written fails.
struct Fifo<T> {
    values: [Option<T>; 16],
    next: usize,
}

impl<T: Copy> Fifo<T> {
    fn new() -> Self {
        Self { values: [None; 16], next: 0 }
    }

    fn push(&mut self, value: T) {
        self.values[self.next % 16] = Some(value);
        self.next += 1;
    }

    fn get(&self, back: u8) -> Result<T, String> {
        let slot = (self.next + 15 - usize::from(back)) % 16;
        self.values[slot].ok_or_else(|| "the compressed stream refers to what it has not yet stored".to_owned())
    }
}

/// The decoder's state of appendix A, "Mode 1: triangles".
struct Triangles<'a> {
    data: Cursor<'a>,
    next: u32,
    last: u32,
    edges: Fifo<[u32; 2]>,
    vertices: Fifo<u32>,
}

impl Triangles<'_> {
    fn next_vertex(&mut self) -> u32 {
        let vertex = self.next;
        self.next = vertex.wrapping_add(1);
        vertex
    }

    fn explicit(&mut self) -> Result<u32, String> {
        self.last = self.last.wrapping_add(unzigzag(self.data.varint()?));
        Ok(self.last)
    }

    /// A vertex by its half of a table byte, and whether it is to be remembered.
    fn by_nibble(&mut self, nibble: u8, may_be_explicit: bool) -> Result<(u32, bool), String> {
        Ok(match nibble {
            0 => (self.next_vertex(), true),
            15 if may_be_explicit => (self.explicit()?, true),
            _ => (self.vertices.get(nibble - 1)?, false),
        })
    }

    /// A triangle on an edge of a recent one.
    fn on_edge(&mut self, code: u8) -> Result<[u32; 3], String> {
        let [a, b] = self.edges.get(code >> 4)?;
        let (c, is_new) = match code & 15 {
            0 => (self.next_vertex(), true),
            13 => {
                self.last = self.last.wrapping_sub(1);
                (self.last, true)
            }
            14 => {
                self.last = self.last.wrapping_add(1);
                (self.last, true)
            }
            15 => (self.explicit()?, true),
            recent => (self.vertices.get(recent)?, false),
        };
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        if is_new {
            self.vertices.push(c);
        }
        Ok([a, b, c])
    }

    /// A triangle of its own: `table` holds the halves for `b` and `c`.
    fn free(&mut self, a: u32, table: u8, may_be_explicit: bool) -> Result<[u32; 3], String> {
        let (b, is_b_new) = self.by_nibble(table >> 4, may_be_explicit)?;
        let (c, is_c_new) = self.by_nibble(table & 15, may_be_explicit)?;
        for edge in [[b, a], [c, b], [a, c]] {
            self.edges.push(edge);
        }
        self.vertices.push(a);
        for (vertex, _) in [(b, is_b_new), (c, is_c_new)].into_iter().filter(|(_, is_new)| *is_new) {
            self.vertices.push(vertex);
        }
        Ok([a, b, c])
    }
}

fn decode_triangles(bytes: &[u8], count: usize) -> Result<Vec<u32>, String> {
    let (body, table) = body(bytes, 0xE1, 16)?;
    let (codes, data) = body.split_at_checked(count / 3).ok_or_else(short)?;
    let mut state =
        Triangles { data: Cursor { bytes: data }, next: 0, last: 0, edges: Fifo::new(), vertices: Fifo::new() };
    let mut indices = Vec::with_capacity(count);
    for &code in codes {
        let triangle = match code {
            0..0xF0 => state.on_edge(code)?,
            0xF0..0xFE => {
                let a = state.next_vertex();
                state.free(a, table[usize::from(code & 15)], false)?
            }
            0xFE | 0xFF => {
                let halves = state.data.byte()?;
                if halves == 0 {
                    state.next = 0;
                }
                let a = if code == 0xFE { state.next_vertex() } else { state.explicit()? };
                state.free(a, halves, true)?
            }
        };
        indices.extend(triangle);
    }
    state.data.finish()?;
    Ok(indices)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn varints_match_the_specification() {
        let read = |bytes: &[u8]| Cursor { bytes }.varint();
        assert_eq!(read(&[0x7F]), Ok(0x7F));
        assert_eq!(read(&[0x81, 0x04]), Ok(0x201));
        assert_eq!(read(&[0xFF, 0xA0, 0x05]), Ok(0x7F | 0x20 << 7 | 0x05 << 14));
    }

    #[test]
    fn triangles_by_table_edge_and_number() {
        // A free triangle of new vertices; one on its last edge with a new vertex; one on the last edge of that with the
        // vertex before last; then one of explicit indices 7, 5, 6 (deltas +7, -2, +1).
        let stream = [&[0xE1, 0xF0, 0x00, 0x01, 0xFF, 0xFF, 14, 3, 2][..], &[0; 16]].concat();
        assert_eq!(decode_triangles(&stream, 12), Ok(vec![0, 1, 2, 0, 2, 3, 0, 3, 2, 7, 5, 6]));
        let unwritten = [&[0xE1, 0x00][..], &[0; 16]].concat();
        assert!(decode_triangles(&unwritten, 3).is_err_and(|e| e.contains("not yet stored")));
        let left_over = [&[0xE1, 0xF0, 0x00][..], &[0; 16]].concat();
        assert!(decode_triangles(&left_over, 3).is_err_and(|e| e.contains("left over")));
    }

    #[test]
    fn indices_follow_two_baselines() {
        // +1 and +1 on the first, +5 on the second, -2 on the first.
        let stream = [0xD1, 4, 4, 21, 6, 0, 0, 0, 0];
        assert_eq!(decode_indices(&stream, 4), Ok(vec![1, 2, 5, 0]));
        assert!(decode_indices(&stream, 5).is_err());
        assert!(decode_indices(&stream, usize::MAX).is_err());
    }

    #[test]
    fn random_streams_never_panic() {
        let mut state = 0x2545_F491_4F6C_DD1Du64;
        let mut next = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 24) as usize
        };
        let mut accepted = 0;
        for round in 0..6000 {
            let mode = [CompressedMode::Attributes, CompressedMode::Triangles, CompressedMode::Indices][round % 3];
            let length = next() % 200;
            let mut bytes: Vec<u8> = (0..length).map(|_| next() as u8).collect();
            if let Some(first) = bytes.first_mut() {
                *first = [0xA0 + (next() & 1) as u8, 0xE1, 0xD1][round % 3];
            }
            let stride = if mode == CompressedMode::Attributes { 4 * (1 + next() % 4) } else { 4 };
            let view = Compressed {
                buffer: 0,
                offset: 0,
                length: 0,
                stride,
                count: 3 * (next() % 20),
                mode,
                filter: super::super::document::Filter::None,
            };
            accepted += usize::from(decode(&view, &bytes).is_ok_and(|d| d.len() == view.count * stride));
        }
        assert!((1..3000).contains(&accepted), "{accepted}");
    }
}
