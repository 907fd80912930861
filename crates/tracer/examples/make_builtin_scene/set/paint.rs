//! Pictures for textures, made from integer noise and simple rules.

/// 8-bit texels, row by row from the top.
pub(super) struct Picture {
    pub(super) width: u32,
    pub(super) height: u32,
    /// 1 (grey) or 3 (RGB).
    pub(super) channels: u32,
    pub(super) bytes: Vec<u8>,
}

impl Picture {
    pub(super) fn rgb(width: u32, height: u32, color: impl Fn(u32, u32) -> [u8; 3]) -> Self {
        let bytes = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| color(x, y)).collect();
        Self { width, height, channels: 3, bytes }
    }

    pub(super) fn grey(width: u32, height: u32, value: impl Fn(u32, u32) -> u8) -> Self {
        let bytes = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| value(x, y)).collect();
        Self { width, height, channels: 1, bytes }
    }
}

/// A well-mixed 32-bit hash of a lattice point.
pub(super) fn hash(x: u32, y: u32, seed: u32) -> u32 {
    let mut h = x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ seed.wrapping_mul(0xC2B2_AE3D);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
    h ^ (h >> 15)
}

/// 0..1 from a hash.
pub(super) fn unit(x: u32, y: u32, seed: u32) -> f32 {
    (hash(x, y, seed) >> 8) as f32 / 16_777_216.0
}

/// Value noise in 0..1 with cells of `cell` pixels, periodic over `period` pixels along each axis.
pub(super) fn noise(x: u32, y: u32, cell: [u32; 2], period: [u32; 2], seed: u32) -> f32 {
    let cells = [(period[0] / cell[0]).max(1), (period[1] / cell[1]).max(1)];
    let (cx, cy) = (x / cell[0], y / cell[1]);
    let ease = |t: f32| t * t * (3.0 - 2.0 * t);
    let tx = ease((x % cell[0]) as f32 / cell[0] as f32);
    let ty = ease((y % cell[1]) as f32 / cell[1] as f32);
    let at = |dx, dy| unit((cx + dx) % cells[0], (cy + dy) % cells[1], seed);
    let top = at(0, 0) + tx * (at(1, 0) - at(0, 0));
    let bottom = at(0, 1) + tx * (at(1, 1) - at(0, 1));
    top + ty * (bottom - top)
}

/// A colour times a factor, in few levels, so that PNG compresses it.
pub(super) fn shade(color: [u8; 3], factor: f32) -> [u8; 3] {
    let level = (factor * 32.0).round() / 32.0;
    color.map(|c| (f32::from(c) * level).clamp(0.0, 255.0) as u8)
}

/// Herringbone-free parquet: planks along v, staggered, with grain. 512 x 512, periodic.
pub(super) fn parquet() -> Picture {
    wood(512, 8, 256, [168, 118, 72])
}

/// Boards along v, `columns` of them, each `length` pixels long.
pub(super) fn wood(side: u32, columns: u32, length: u32, color: [u8; 3]) -> Picture {
    let width = side / columns;
    Picture::rgb(side, side, |x, y| {
        let column = x / width;
        let shifted = y + hash(column, 0, 7) % length;
        let (board, along) = (shifted / length % (side / length), shifted % length);
        if x % width == 0 || along == 0 {
            return shade(color, 0.35);
        }
        let seed = 11 + column * 16 + board;
        let tone = 0.78 + 0.3 * unit(column, board, 3);
        let grain = noise(x, y, [4, 64], [side, side], seed) - 0.5;
        let fine = noise(x, y, [2, 32], [side, side], seed + 1) - 0.5;
        shade(color, tone + 0.28 * grain + 0.12 * fine)
    })
}

/// A normal map of hammered dents, 128 x 128, periodic.
pub(super) fn hammered() -> Picture {
    const SIDE: i32 = 128;
    const CELL: i32 = 16;
    let height = |x: i32, y: i32| -> f32 {
        let (cx, cy) = (x.div_euclid(CELL), y.div_euclid(CELL));
        let mut nearest = f32::MAX;
        for (gx, gy) in (cx - 1..=cx + 1).flat_map(|gx| (cy - 1..=cy + 1).map(move |gy| (gx, gy))) {
            let cells = SIDE / CELL;
            let (wx, wy) = (gx.rem_euclid(cells) as u32, gy.rem_euclid(cells) as u32);
            let px = gx as f32 * CELL as f32 + CELL as f32 * unit(wx, wy, 21);
            let py = gy as f32 * CELL as f32 + CELL as f32 * unit(wx, wy, 22);
            let (dx, dy) = (x as f32 - px, y as f32 - py);
            nearest = nearest.min(dx * dx + dy * dy);
        }
        nearest / (CELL * CELL) as f32
    };
    Picture::rgb(SIDE as u32, SIDE as u32, |x, y| {
        let (x, y) = (x as i32, y as i32);
        let slope = |a: f32, b: f32| (b - a) * 2.2;
        let (du, dv) = (slope(height(x - 1, y), height(x + 1, y)), slope(height(x, y + 1), height(x, y - 1)));
        let length = (du * du + dv * dv + 1.0).sqrt();
        // Four-level steps keep the PNG small; the slopes are far larger.
        let byte = |v: f32| ((v / length * 0.5 + 0.5) * 63.0).round().mul_add(4.0, 2.0) as u8;
        [byte(-du), byte(-dv), byte(1.0)]
    })
}

/// Worn metal: green = roughness, blue = metalness 1; 128 x 128, periodic.
pub(super) fn worn() -> Picture {
    let p = [128, 128];
    Picture::rgb(128, 128, |x, y| {
        let patches = noise(x, y, [32, 32], p, 31) * 0.6 + noise(x, y, [8, 8], p, 32) * 0.4;
        let roughness = if patches > 0.52 { 0.55 } else { 0.16 } + 0.08 * noise(x, y, [4, 4], p, 33);
        [255, ((roughness * 32.0_f32).round() * 8.0).min(255.0) as u8, 255]
    })
}

/// What the window shows: a sky with clouds over hills.
pub(super) fn landscape() -> Picture {
    const W: u32 = 256;
    const H: u32 = 192;
    Picture::rgb(W, H, |x, y| {
        let ridge =
            |base: f32, swing: f32, cell: u32, seed: u32| base + swing * (noise(x, 0, [cell, 1], [W, 1], seed) - 0.5);
        let row = y as f32 / H as f32;
        if row > ridge(0.86, 0.10, 64, 43) {
            return [26, 40, 18];
        }
        if row > ridge(0.74, 0.18, 64, 42) {
            return [52, 70, 50];
        }
        if row > ridge(0.64, 0.20, 32, 41) {
            return [92, 112, 126];
        }
        let p = [W, H];
        let cloud = noise(x, y, [64, 16], p, 44) * 0.6 + noise(x, y, [16, 8], p, 45) * 0.4;
        let white = ((cloud - 0.5) * 3.0).clamp(0.0, 1.0);
        let sky = [176.0 + 60.0 * row, 208.0 + 35.0 * row, 250.0];
        sky.map(|c: f32| (((c + (255.0 - c) * white) / 4.0).round() * 4.0).min(255.0) as u8)
    })
}
