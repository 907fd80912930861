//! Appendix A, "Mode 0: attributes": bytes in planes, as deltas in groups of 16.

use super::{Cursor, short};

const GROUP: usize = 16;
/// Most elements of a block.
const MAX_BLOCK: usize = 256;

/// How the deltas of a channel (4 bytes of an element) become values.
#[derive(Clone, Copy)]
enum Channel {
    Bytes,
    Words,
    /// Exclusive or with the previous value after a rotation to the right.
    Xor {
        rotation: u32,
    },
}

impl Channel {
    fn parse(mode: u8) -> Result<Self, String> {
        match (mode & 15, mode >> 4) {
            (0, 0) => Ok(Self::Bytes),
            (1, 0) => Ok(Self::Words),
            (2, rotation) => Ok(Self::Xor { rotation: u32::from(rotation) }),
            _ => Err(format!("the compressed stream has the unknown channel mode {mode:#04x}")),
        }
    }

    fn apply(self, previous: [u8; 4], delta: [u8; 4]) -> [u8; 4] {
        match self {
            Self::Bytes => std::array::from_fn(|i| {
                let d = delta[i];
                previous[i].wrapping_add(if d & 1 == 1 { !(d >> 1) } else { d >> 1 })
            }),
            Self::Words => {
                let word = |bytes: [u8; 4], i: usize| u16::from_le_bytes([bytes[i], bytes[i + 1]]);
                let next = |i: usize| {
                    let d = word(delta, i);
                    word(previous, i).wrapping_add(if d & 1 == 1 { !(d >> 1) } else { d >> 1 }).to_le_bytes()
                };
                let ([a, b], [c, d]) = (next(0), next(2));
                [a, b, c, d]
            }
            Self::Xor { rotation } => {
                let delta = u32::from_le_bytes(delta).rotate_right(rotation);
                (u32::from_le_bytes(previous) ^ delta).to_le_bytes()
            }
        }
    }
}

/// `count` elements of `stride` bytes.
pub(super) fn decode(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    let (&header, rest) = bytes.split_first().ok_or_else(short)?;
    let (is_v1, min_tail) = match header {
        0xA0 => (false, 32),
        0xA1 => (true, 24),
        other => return Err(format!("the compressed stream starts with {other:#04x} instead of 0xa0 or 0xa1")),
    };
    let channel_count = stride / 4;
    let tail = stride + if is_v1 { channel_count } else { 0 };
    let body_length = rest.len().checked_sub(tail.max(min_tail)).ok_or_else(short)?;
    let tail = &rest[rest.len() - tail..];
    let channels: Vec<Channel> = if is_v1 {
        tail[stride..].iter().map(|&mode| Channel::parse(mode)).collect::<Result<_, _>>()?
    } else {
        vec![Channel::Bytes; channel_count]
    };
    let mut previous = tail[..stride].to_vec();
    let mut data = Cursor { bytes: &rest[..body_length] };
    let max_block = ((8192 / stride) & !(GROUP - 1)).min(MAX_BLOCK);
    let mut planes = vec![0u8; stride * MAX_BLOCK];
    let mut decoded = Vec::new();
    let mut remaining = count;
    while remaining > 0 {
        let block = remaining.min(max_block);
        let control = if is_v1 { data.take(channel_count)? } else { &[] };
        for (byte, plane) in planes.chunks_exact_mut(MAX_BLOCK).enumerate() {
            let mode = control.get(byte / 4).map(|c| c >> (byte % 4 * 2) & 3);
            decode_plane(&mut data, &mut plane[..block.next_multiple_of(GROUP)], block, mode)?;
        }
        for element in 0..block {
            let delta_at = |byte: usize| planes[byte * MAX_BLOCK + element];
            for (index, (channel, value)) in channels.iter().zip(previous.as_chunks_mut().0).enumerate() {
                *value = channel.apply(*value, std::array::from_fn(|i| delta_at(index * 4 + i)));
            }
            decoded.extend_from_slice(&previous);
        }
        remaining -= block;
    }
    data.finish()?;
    Ok(decoded)
}

/// The deltas of one byte position. `mode` is the control mode of version 1.
fn decode_plane(data: &mut Cursor<'_>, plane: &mut [u8], elements: usize, mode: Option<u8>) -> Result<(), String> {
    let bit_lengths: [u32; 4] = match mode {
        None => [0, 2, 4, 8],
        Some(0) => [0, 1, 2, 4],
        Some(1) => [1, 2, 4, 8],
        Some(2) => {
            plane.fill(0);
            return Ok(());
        }
        Some(_) => {
            plane[..elements].copy_from_slice(data.take(elements)?);
            return Ok(());
        }
    };
    let groups = plane.len() / GROUP;
    let headers = data.take(groups.div_ceil(4))?;
    for (group, deltas) in plane.as_chunks_mut::<GROUP>().0.iter_mut().enumerate() {
        let bits = bit_lengths[usize::from(headers[group / 4] >> (group % 4 * 2) & 3)];
        decode_group(data, deltas, bits)?;
    }
    Ok(())
}

/// Sixteen deltas of `bits` each; all ones is the sentinel for a full byte behind them.
fn decode_group(data: &mut Cursor<'_>, deltas: &mut [u8; GROUP], bits: u32) -> Result<(), String> {
    match bits {
        0 => deltas.fill(0),
        8 => deltas.copy_from_slice(data.take(GROUP)?),
        _ => {
            let packed = data.take(GROUP * bits as usize / 8)?;
            let per_byte = 8 / bits as usize;
            let sentinel = ((1u32 << bits) - 1) as u8;
            for (i, delta) in deltas.iter_mut().enumerate() {
                let place = i % per_byte;
                // One-bit deltas are stored from the lowest bit up, wider ones from the highest down.
                let shift = if bits == 1 { place } else { (per_byte - 1 - place) * bits as usize };
                let value = packed[i / per_byte] >> shift & sentinel;
                *delta = if value == sentinel { data.byte()? } else { value };
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_bit_group_of_the_specification() {
        let bytes = [0x17, 0x5F, 0xF0, 0xBC, 0x77, 0xA9, 0x21, 0x00, 0x34, 0xB5];
        let mut deltas = [0; GROUP];
        let mut data = Cursor { bytes: &bytes };
        assert_eq!(decode_group(&mut data, &mut deltas, 4), Ok(()));
        assert!(data.bytes.is_empty());
        let decoded = deltas.map(|d| Channel::Bytes.apply([0; 4], [d, 0, 0, 0])[0] as i8);
        assert_eq!(decoded, [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]);
    }

    #[test]
    fn channels_undo_their_encoding() {
        // From 0x00ff to 0x0100 is +1 as a 16-bit delta (zigzag 2), but not byte by byte.
        let next = Channel::Words.apply([0xFF, 0, 5, 0], [2, 0, 1, 0]);
        assert_eq!(next, [0, 1, 4, 0]);
        let (old, new) = (0x1234_5678u32, 0x9234_0678u32);
        let delta = (old ^ new).rotate_left(5).to_le_bytes();
        assert_eq!(Channel::Xor { rotation: 5 }.apply(old.to_le_bytes(), delta), new.to_le_bytes());
    }
}
