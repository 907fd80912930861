//! Draws a chart's shapes into pixels. The lettering is a 5 x 7 dot alphabet of capitals, so that no font is needed.

use fovea_sampler::report::{Chart, Shape};

/// Pixels a chart pixel: doubled, for screens of today.
const SCALE: f64 = 2.0;
/// Pixels a dot of a letter.
const DOT: i64 = 2;
/// Dots from one letter to the next.
const ADVANCE: i64 = 6;

struct Canvas {
    width: i64,
    height: i64,
    texels: Vec<[u8; 4]>,
}

/// Size in pixels and texels, row by row from the top.
pub(in crate::commands) fn draw(chart: &Chart) -> ([u32; 2], Vec<[u8; 4]>) {
    let [width, height] = chart.size_px.map(|side| (side * SCALE) as i64);
    let mut canvas = Canvas { width, height, texels: vec![[255; 4]; (width * height) as usize] };
    for shape in &chart.shapes {
        match shape {
            Shape::Line { from, to, mark } => canvas.line(*from, *to, opaque(mark.rgb())),
            Shape::Point { at, filled, mark } => canvas.point(*at, *filled, opaque(mark.rgb())),
            Shape::Text { at, text, centred, mark } => canvas.text(*at, text, *centred, opaque(mark.rgb())),
        }
    }
    ([width as u32, height as u32], canvas.texels)
}

fn opaque([r, g, b]: [u8; 3]) -> [u8; 4] {
    [r, g, b, 255]
}

impl Canvas {
    fn set(&mut self, x: i64, y: i64, texel: [u8; 4]) {
        if (0..self.width).contains(&x) && (0..self.height).contains(&y) {
            self.texels[(y * self.width + x) as usize] = texel;
        }
    }

    fn square(&mut self, x: i64, y: i64, side: i64, texel: [u8; 4]) {
        for j in 0..side {
            for i in 0..side {
                self.set(x + i, y + j, texel);
            }
        }
    }

    fn line(&mut self, from: [f64; 2], to: [f64; 2], texel: [u8; 4]) {
        let steps = ((to[0] - from[0]).abs().max((to[1] - from[1]).abs()) * SCALE).ceil().max(1.0);
        for step in 0..=steps as i64 {
            let at = |k: usize| ((from[k] + (to[k] - from[k]) * step as f64 / steps) * SCALE) as i64;
            self.square(at(0), at(1), 2, texel);
        }
    }

    fn point(&mut self, at: [f64; 2], filled: bool, texel: [u8; 4]) {
        let [x, y] = at.map(|c| (c * SCALE) as i64);
        let (outer, inner) = ((5.5 * SCALE).powi(2), (3.5 * SCALE).powi(2));
        for j in -12..=12_i64 {
            for i in -12..=12_i64 {
                let square = (i * i + j * j) as f64;
                if square <= outer {
                    self.set(x + i, y + j, if filled || square > inner { texel } else { [255; 4] });
                }
            }
        }
    }

    fn text(&mut self, at: [f64; 2], text: &str, centred: bool, texel: [u8; 4]) {
        let width = text.chars().count() as i64 * ADVANCE * DOT;
        let mut left = (at[0] * SCALE) as i64 - if centred { width / 2 } else { 0 };
        let top = (at[1] * SCALE) as i64 - 7 * DOT;
        for letter in text.chars() {
            for (j, row) in dots(letter).into_iter().enumerate() {
                for i in (0..5).filter(|i| row >> (4 - i) & 1 == 1) {
                    self.square(left + i * DOT, top + j as i64 * DOT, DOT, texel);
                }
            }
            left += ADVANCE * DOT;
        }
    }
}

/// The letter's rows from the top, five dots each, the leftmost in the highest bit. Unknown letters are blank.
fn dots(letter: char) -> [u8; 7] {
    match letter.to_ascii_uppercase() {
        'A' => [0b01110, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001],
        'B' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10001, 0b10001, 0b11110],
        'C' => [0b01110, 0b10001, 0b10000, 0b10000, 0b10000, 0b10001, 0b01110],
        'D' => [0b11110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b11110],
        'E' => [0b11111, 0b10000, 0b10000, 0b11110, 0b10000, 0b10000, 0b11111],
        'F' => [0b11111, 0b10000, 0b10000, 0b11110, 0b10000, 0b10000, 0b10000],
        'G' => [0b01110, 0b10001, 0b10000, 0b10111, 0b10001, 0b10001, 0b01110],
        'H' => [0b10001, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001],
        'I' => [0b01110, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        'J' => [0b00111, 0b00010, 0b00010, 0b00010, 0b00010, 0b10010, 0b01100],
        'K' => [0b10001, 0b10010, 0b10100, 0b11000, 0b10100, 0b10010, 0b10001],
        'L' => [0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b11111],
        'M' => [0b10001, 0b11011, 0b10101, 0b10101, 0b10001, 0b10001, 0b10001],
        'N' => [0b10001, 0b11001, 0b10101, 0b10011, 0b10001, 0b10001, 0b10001],
        'O' => [0b01110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110],
        'P' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10000, 0b10000, 0b10000],
        'Q' => [0b01110, 0b10001, 0b10001, 0b10001, 0b10101, 0b10010, 0b01101],
        'R' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10100, 0b10010, 0b10001],
        'S' => [0b01111, 0b10000, 0b10000, 0b01110, 0b00001, 0b00001, 0b11110],
        'T' => [0b11111, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100],
        'U' => [0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110],
        'V' => [0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01010, 0b00100],
        'W' => [0b10001, 0b10001, 0b10001, 0b10101, 0b10101, 0b11011, 0b10001],
        'X' => [0b10001, 0b10001, 0b01010, 0b00100, 0b01010, 0b10001, 0b10001],
        'Y' => [0b10001, 0b10001, 0b01010, 0b00100, 0b00100, 0b00100, 0b00100],
        'Z' => [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b10000, 0b11111],
        '0' => [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110],
        '1' => [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        '2' => [0b01110, 0b10001, 0b00001, 0b00110, 0b01000, 0b10000, 0b11111],
        '3' => [0b11110, 0b00001, 0b00001, 0b01110, 0b00001, 0b00001, 0b11110],
        '4' => [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010],
        '5' => [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110],
        '6' => [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110],
        '7' => [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000],
        '8' => [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110],
        '9' => [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100],
        '.' => [0, 0, 0, 0, 0, 0b01100, 0b01100],
        ',' => [0, 0, 0, 0, 0b01100, 0b00100, 0b01000],
        ':' => [0, 0b01100, 0b01100, 0, 0b01100, 0b01100, 0],
        '-' => [0, 0, 0, 0b11111, 0, 0, 0],
        '/' => [0b00001, 0b00001, 0b00010, 0b00100, 0b01000, 0b10000, 0b10000],
        '(' => [0b00010, 0b00100, 0b01000, 0b01000, 0b01000, 0b00100, 0b00010],
        ')' => [0b01000, 0b00100, 0b00010, 0b00010, 0b00010, 0b00100, 0b01000],
        '\'' => [0b00100, 0b00100, 0b01000, 0, 0, 0, 0],
        _ => [0; 7],
    }
}

#[cfg(test)]
mod tests {
    use fovea_sampler::report::Mark;

    use super::*;

    #[test]
    fn shapes_leave_their_ink_inside_and_nothing_outside() {
        let shapes = vec![
            Shape::Line { from: [-5.0, 5.0], to: [40.0, 5.0], mark: Mark::Grid },
            Shape::Point { at: [10.0, 12.0], filled: true, mark: Mark::Sphere },
            Shape::Text { at: [0.0, 30.0], text: "I".into(), centred: false, mark: Mark::Ink },
        ];
        let ([width, height], texels) = draw(&Chart { size_px: [20.0, 40.0], shapes });
        assert_eq!((width, height, texels.len()), (40, 80, 3200));
        let count = |mark: Mark| texels.iter().filter(|t| **t == opaque(mark.rgb())).count();
        assert_eq!(count(Mark::Grid), 2 * 40, "a line two pixels thick across the width");
        // 11 dots of 2 x 2 pixels.
        assert_eq!(count(Mark::Ink), 11 * 4);
        let area = core::f64::consts::PI * 11.0 * 11.0;
        assert!((count(Mark::Sphere) as f64 / area - 1.0).abs() < 0.05);
    }
}
