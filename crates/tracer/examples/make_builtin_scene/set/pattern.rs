//! Pictures with hard edges: woven patterns, an eye chart, a globe.

use super::paint::{Picture, hash, noise, shade, unit};

const RED: [u8; 3] = [150, 44, 36];
const INK: [u8; 3] = [32, 40, 66];
const GOLD: [u8; 3] = [206, 158, 76];
const CREAM: [u8; 3] = [226, 212, 182];
const TEAL: [u8; 3] = [44, 104, 104];

/// Weave: every other thread is darker.
fn woven(color: [u8; 3], x: u32, y: u32) -> [u8; 3] {
    shade(color, if (x + y).is_multiple_of(2) { 1.0 } else { 0.875 })
}

/// A carpet with a border, a lattice and medallions. 384 x 256.
pub(super) fn rug() -> Picture {
    const W: u32 = 384;
    const H: u32 = 256;
    Picture::rgb(W, H, |x, y| {
        let edge = x.min(W - 1 - x).min(y).min(H - 1 - y);
        let color = match edge {
            0..4 => CREAM,
            4..8 => INK,
            8..28 => {
                let step = (x / 10 + y / 10) % 3;
                [RED, GOLD, TEAL][step as usize]
            }
            28..32 => INK,
            _ => {
                let (u, v) = (x.abs_diff(W / 2), y.abs_diff(H / 2));
                let diamond = u * 2 / 3 + v;
                match diamond {
                    0..14 => CREAM,
                    14..22 => INK,
                    22..52 => {
                        if (u / 6 + v / 6) % 2 == 0 {
                            TEAL
                        } else {
                            GOLD
                        }
                    }
                    52..60 => CREAM,
                    60..66 => INK,
                    _ if (u % 32 + v % 32).abs_diff(32) < 4 => GOLD,
                    _ if (u % 32).abs_diff(16) + (v % 32).abs_diff(16) < 5 => CREAM,
                    _ => RED,
                }
            }
        };
        woven(color, x, y)
    })
}

/// A tapestry: rings about a star on a field of small motifs. 384 x 288.
pub(super) fn tapestry() -> Picture {
    const W: u32 = 384;
    const H: u32 = 288;
    Picture::rgb(W, H, |x, y| {
        let edge = x.min(W - 1 - x).min(y).min(H - 1 - y);
        let (dx, dy) = (x as i32 - W as i32 / 2, y as i32 - H as i32 / 2);
        let radius2 = (dx * dx + dy * dy) as u32;
        let ring = |r: u32| (r * r..(r + 5) * (r + 5)).contains(&radius2);
        let (ax, ay) = (dx.unsigned_abs(), dy.unsigned_abs());
        let star = ax * ay < 420 && radius2 < 96 * 96 || ax.abs_diff(ay) < 7 && radius2 < 72 * 72;
        let color = if edge < 6 {
            GOLD
        } else if edge < 20 {
            if (x / 7 + y / 7) % 2 == 0 { RED } else { CREAM }
        } else if edge < 24 || ring(118) {
            GOLD
        } else if ring(104) || ring(40) {
            CREAM
        } else if star {
            if radius2 < 24 * 24 { RED } else { GOLD }
        } else if radius2 < 118 * 118 {
            if (x / 8 + y / 8) % 2 == 0 { TEAL } else { shade(TEAL, 0.75) }
        } else if (x % 24).abs_diff(12) + (y % 24).abs_diff(12) < 4 {
            CREAM
        } else if hash(x / 24, y / 24, 5).is_multiple_of(4) && (x % 24).abs_diff(12).max((y % 24).abs_diff(12)) < 7 {
            RED
        } else {
            INK
        };
        woven(color, x, y)
    })
}

/// 5 x 7 letters, one byte a row, bit 4 is the left column.
const LETTERS: [[u8; 7]; 10] = [
    [0b01110, 0b10001, 0b10000, 0b10000, 0b10000, 0b10001, 0b01110], // C
    [0b11110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b11110], // D
    [0b11111, 0b10000, 0b10000, 0b11110, 0b10000, 0b10000, 0b11111], // E
    [0b11111, 0b10000, 0b10000, 0b11110, 0b10000, 0b10000, 0b10000], // F
    [0b10001, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001], // H
    [0b10001, 0b11001, 0b10101, 0b10101, 0b10011, 0b10001, 0b10001], // N
    [0b01110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110], // O
    [0b11110, 0b10001, 0b10001, 0b11110, 0b10100, 0b10010, 0b10001], // R
    [0b10001, 0b10001, 0b10001, 0b01010, 0b01010, 0b00100, 0b00100], // V
    [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b10000, 0b11111], // Z
];

/// An eye chart: rows of letters, each 0.75 x the size of the one above. 1024 x 1408, grey.
pub(super) fn eye_chart() -> Picture {
    const W: u32 = 1024;
    const H: u32 = 1408;
    // Pixel size of a letter's dot by row; a letter is 5 x 7 dots and takes 8 x 7.
    const DOTS: [u32; 11] = [40, 30, 22, 16, 12, 9, 7, 5, 4, 3, 2];
    let mut rows = Vec::new();
    let mut top = 36;
    for (row, dot) in DOTS.into_iter().enumerate() {
        rows.push((row as u32, dot, top));
        top += dot * 8 + 14;
    }
    Picture::grey(W, H, move |x, y| {
        if x < 8 || y < 8 || x >= W - 8 || y >= H - 8 {
            return 40;
        }
        let Some(&(row, dot, top)) = rows.iter().find(|&&(_, dot, top)| (top..top + dot * 7).contains(&y)) else {
            return 232;
        };
        let count = (row + 1).min((W - 120) / (dot * 8)).max(1);
        let left = (W - count * dot * 8 + dot * 3) / 2;
        let column = x.wrapping_sub(left) / dot;
        let (letter, bit) = (column / 8, column % 8);
        if x < left || letter >= count || bit > 4 {
            return 232;
        }
        let glyph = LETTERS[(hash(letter, row, 9) % 10) as usize][((y - top) / dot) as usize];
        if glyph >> (4 - bit) & 1 == 1 { 18 } else { 232 }
    })
}

/// A globe's map with invented continents. 256 x 128.
pub(super) fn globe() -> Picture {
    let p = [256, 128];
    Picture::rgb(256, 128, |x, y| {
        let land =
            noise(x, y, [64, 32], p, 51) * 0.6 + noise(x, y, [16, 16], p, 52) * 0.3 + 0.1 * unit(x / 4, y / 4, 53);
        if x % 32 == 0 || y % 16 == 0 {
            [120, 110, 90]
        } else if !(12..116).contains(&y) {
            [225, 228, 230]
        } else if land > 0.55 {
            [150, 128, 74]
        } else {
            [52, 92, 124]
        }
    })
}
