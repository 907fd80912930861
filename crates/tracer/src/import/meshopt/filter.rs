//! Appendix B, "Filters": what encoders apply to attributes before compression is undone here, in place.

use super::super::document::Filter;

/// Undoes `filter` on elements of `stride` bytes.
pub(super) fn apply(filter: Filter, bytes: &mut [u8], stride: usize) {
    match (filter, stride) {
        (Filter::None, _) => {}
        (Filter::Octahedral, 4) => {
            each_of_bytes(bytes, |v| octahedral(v.map(|c| f32::from(c as i8)), 127.0).map(|c| c as i8 as u8));
        }
        (Filter::Octahedral, _) => {
            each_of_words(bytes, |v| octahedral(v.map(|c| f32::from(c as i16)), 32767.0).map(|c| c as i16 as u16));
        }
        (Filter::Quaternion, _) => each_of_words(bytes, quaternion),
        (Filter::Exponential, _) => bytes.as_chunks_mut().0.iter_mut().for_each(|word| *word = exponential(*word)),
        (Filter::Color, 4) => each_of_bytes(bytes, |[y, co, cg, a]| {
            color([i32::from(y), i32::from(co as i8), i32::from(cg as i8), i32::from(a)], 255.0).map(|c| c as u8)
        }),
        (Filter::Color, _) => each_of_words(bytes, |[y, co, cg, a]| {
            color([i32::from(y), i32::from(co as i16), i32::from(cg as i16), i32::from(a)], 65535.0).map(|c| c as u16)
        }),
    }
}

fn each_of_bytes(bytes: &mut [u8], decode: impl Fn([u8; 4]) -> [u8; 4]) {
    bytes.as_chunks_mut().0.iter_mut().for_each(|element| *element = decode(*element));
}

fn each_of_words(bytes: &mut [u8], decode: impl Fn([u16; 4]) -> [u16; 4]) {
    for element in bytes.as_chunks_mut::<8>().0 {
        let words = decode(std::array::from_fn(|i| u16::from_le_bytes([element[2 * i], element[2 * i + 1]])));
        for (i, word) in words.into_iter().enumerate() {
            element[2 * i..2 * i + 2].copy_from_slice(&word.to_le_bytes());
        }
    }
}

/// A unit vector from its octahedral form; the third input is 1 in the input's scale, the fourth passes through.
fn octahedral([x, y, one, w]: [f32; 4], scale: f32) -> [f32; 4] {
    let (mut x, mut y) = (x / one, y / one);
    let z = 1.0 - x.abs() - y.abs();
    let fold = z.min(0.0);
    x -= fold.copysign(x);
    y -= fold.copysign(y);
    let length = (x * x + y * y + z * z).sqrt();
    [(x / length * scale).round(), (y / length * scale).round(), (z / length * scale).round(), w]
}

fn quaternion(v: [u16; 4]) -> [u16; 4] {
    let one = f32::from((v[3] | 3) as i16);
    let [x, y, z] = [v[0], v[1], v[2]].map(|c| f32::from(c as i16) / one * std::f32::consts::FRAC_1_SQRT_2);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let largest = usize::from(v[3] & 3);
    let mut out = [0; 4];
    for (i, component) in [w, x, y, z].into_iter().enumerate() {
        out[(largest + i) % 4] = (component * 32767.0).round() as i16 as u16;
    }
    out
}

fn exponential(word: [u8; 4]) -> [u8; 4] {
    let v = i32::from_le_bytes(word);
    let (exponent, mantissa) = (v >> 24, v << 8 >> 8);
    // In f64 the product is exact for every exponent, also those outside the valid -100..=100.
    ((2.0f64.powi(exponent) * f64::from(mantissa)) as f32).to_le_bytes()
}

/// YCoCg to RGB; the highest bit of alpha tells the scale.
fn color([y, co, cg, alpha]: [i32; 4], max: f32) -> [f32; 4] {
    let scale = (1 << (32 - alpha.leading_zeros())) - 1;
    let a = alpha & (scale >> 1);
    let rgba = [y + co - cg, y + cg, y - co - cg, a << 1 | a & 1];
    rgba.map(|c| (c as f32 * (max / scale as f32)).round())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn octahedral_vectors() {
        for (input, expected) in [
            ([0.0, 0.0, 127.0, 3.0], [0.0, 0.0, 127.0, 3.0]),
            ([127.0, 0.0, 127.0, 0.0], [127.0, 0.0, 0.0, 0.0]),
            ([0.0, -63.5, 127.0, 0.0], [0.0, -90.0, 90.0, 0.0]),
            ([127.0, 127.0, 127.0, 0.0], [0.0, 0.0, -127.0, 0.0]),
            ([-127.0, 127.0, 127.0, 0.0], [0.0, 0.0, -127.0, 0.0]),
        ] {
            assert_eq!(octahedral(input, 127.0), expected, "{input:?}");
        }
    }

    #[test]
    fn quaternions_put_the_largest_component_back() {
        let one = (1u16 << 11) - 1;
        for largest in 0..4u16 {
            let mut expected = [0; 4];
            expected[usize::from(largest)] = 32767;
            assert_eq!(quaternion([0, 0, 0, one & !3 | largest]), expected);
        }
    }

    #[test]
    fn exponential_floats() {
        let encoded = |exponent: i32, mantissa: i32| (exponent << 24 | mantissa & 0xFF_FFFF).to_le_bytes();
        for (exponent, mantissa, expected) in
            [(0, 5, 5.0f32), (-3, -9, -1.125), (10, 3, 3072.0), (-100, 1, 2f32.powi(-100))]
        {
            assert_eq!(exponential(encoded(exponent, mantissa)), expected.to_le_bytes());
        }
    }

    #[test]
    fn colors() {
        // K = 8: alpha has bit 7 set and 7 bits of value.
        assert_eq!(color([128, 0, 0, 0xFF], 255.0), [128.0, 128.0, 128.0, 255.0]);
        assert_eq!(color([64, 128, -64, 0x80], 255.0), [256.0, 0.0, 0.0, 0.0]);
    }
}
