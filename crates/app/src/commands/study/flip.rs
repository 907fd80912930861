//! FLIP, the difference that one notices when alternating between two pictures (Andersson et al. 2020, LDR).
//!
//! Definition: opponent colours filtered by the eye's contrast sensitivity, compared in a perceptually uniform space by the
//! HyAB distance; edges and points compared beside them; the colour difference to the power of 1 - feature difference.
//! Letters are the paper's.

/// Pixels a degree of the usual monitor: 0.7 m from a 4K screen 0.7 m wide, as the paper has it.
pub const PIXELS_PER_DEGREE: f64 = 67.020_643;
/// Exponent q_c, and the part p_c of the largest colour difference that maps to p_t.
const QC: f64 = 0.7;
const PC: f64 = 0.4;
const PT: f64 = 0.95;
/// Exponent q_f and width w of the feature detectors, degrees.
const QF: f64 = 0.5;
const FEATURE_WIDTH_DEG: f64 = 0.082;
/// Contrast sensitivity as sums of Gaussians: a1, b1, a2, b2 of the achromatic, red-green and blue-yellow channel.
const CSF: [[f64; 4]; 3] = [[1.0, 0.0047, 0.0, 1e-5], [1.0, 0.0053, 0.0, 1e-5], [34.1, 0.04, 13.5, 0.025]];
/// D65 as the paper's matrix has it.
const WHITE: [f64; 3] = [0.950_428_545, 1.0, 1.088_900_371];

/// Pictures, display-encoded sRGB, row by row.
pub type Encoded = [[u8; 3]];

/// A picture, ready to be compared.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// Filtered, in L*a*b* with Hunt's adjustment.
    lab: Vec<[f64; 3]>,
    /// Strength of edges and points.
    features: Vec<[f64; 2]>,
}

impl Prepared {
    /// Prepares a picture that is `width` pixels wide.
    pub fn new(picture: &Encoded, width: usize) -> Self {
        let opponent: Vec<[f64; 3]> = picture.iter().map(|texel| ycxcz(xyz(linear(*texel)))).collect();
        let filtered = contrast_filtered(&opponent, width);
        let lab = filtered.iter().map(|&c| hunt(lab(clamped_xyz(c)))).collect();
        let achromatic: Vec<f64> = opponent.iter().map(|c| (c[0] + 16.0) / 116.0).collect();
        Self { lab, features: features(&achromatic, width) }
    }

    /// The difference of two pictures of one size, 0..=1 a pixel.
    pub fn difference(&self, other: &Self) -> Vec<f64> {
        let largest = hyab(hunt(lab(xyz([0.0, 1.0, 0.0]))), hunt(lab(xyz([0.0, 0.0, 1.0])))).powf(QC);
        let pixel = |i: usize| {
            let colour = hyab(self.lab[i], other.lab[i]).powf(QC);
            let colour = if colour < PC * largest {
                PT / (PC * largest) * colour
            } else {
                PT + (colour - PC * largest) / (largest - PC * largest) * (1.0 - PT)
            };
            let [edge, point] = [0, 1].map(|k| (self.features[i][k] - other.features[i][k]).abs());
            let feature = (edge.max(point) / 2f64.sqrt()).powf(QF);
            colour.powf(1.0 - feature)
        };
        (0..self.lab.len().min(other.lab.len())).map(pixel).collect()
    }
}

/// Linear light of an encoded texel.
pub fn linear(texel: [u8; 3]) -> [f64; 3] {
    texel.map(|value| {
        let c = f64::from(value) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    })
}

/// CIE XYZ of linear Rec. 709.
pub fn xyz([r, g, b]: [f64; 3]) -> [f64; 3] {
    [
        10_135_552.0 / 24_577_794.0 * r + 8_788_810.0 / 24_577_794.0 * g + 4_435_075.0 / 24_577_794.0 * b,
        2_613_072.0 / 12_288_897.0 * r + 8_788_810.0 / 12_288_897.0 * g + 887_015.0 / 12_288_897.0 * b,
        1_425_312.0 / 73_733_382.0 * r + 8_788_810.0 / 73_733_382.0 * g + 70_074_185.0 / 73_733_382.0 * b,
    ]
}

fn rgb([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.241_003_6 * x - 1.537_398_97 * y - 0.498_615_882 * z,
        -0.969_224_252 * x + 1.875_929_984 * y + 0.041_554_226 * z,
        0.055_639_42 * x - 0.204_011_206 * y + 1.057_148_977 * z,
    ]
}

/// CIE L*a*b* under the white of the paper.
pub fn lab(c: [f64; 3]) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let f = |t: f64| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = [0, 1, 2].map(|i| f(c[i] / WHITE[i]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn ycxcz(c: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = [0, 1, 2].map(|i| c[i] / WHITE[i]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// XYZ of a filtered opponent colour, kept to what a display shows.
fn clamped_xyz([y, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (y + 16.0) / 116.0;
    let c = [y + cx / 500.0, y, y - cz / 200.0];
    xyz(rgb([0, 1, 2].map(|i| c[i] * WHITE[i])).map(|v| v.clamp(0.0, 1.0)))
}

fn hunt([l, a, b]: [f64; 3]) -> [f64; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// Sums over a square neighbourhood with weights by offset; edges repeat.
fn convolved<const N: usize>(
    picture: &[[f64; N]],
    width: usize,
    radius: i64,
    weights: impl Fn(i64, i64) -> [f64; N],
) -> Vec<[f64; N]> {
    let offsets: Vec<(i64, i64, [f64; N])> = (-radius..=radius)
        .flat_map(|dy| (-radius..=radius).map(move |dx| (dx, dy)))
        .map(|(x, y)| (x, y, weights(x, y)))
        .collect();
    let (across, down) = (width as i64, (picture.len() / width) as i64);
    let pixel = |index: usize| {
        let (x, y) = ((index % width) as i64, (index / width) as i64);
        let mut sum = [0.0; N];
        for (dx, dy, weight) in &offsets {
            let from = picture[((y + dy).clamp(0, down - 1) * across + (x + dx).clamp(0, across - 1)) as usize];
            for k in 0..N {
                sum[k] += weight[k] * from[k];
            }
        }
        sum
    };
    (0..picture.len()).map(pixel).collect()
}

fn contrast_filtered(opponent: &[[f64; 3]], width: usize) -> Vec<[f64; 3]> {
    use std::f64::consts::PI;
    let widest = CSF.iter().flat_map(|c| [c[1], c[3]]).fold(0.0, f64::max);
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i64;
    let weight = |dx: i64, dy: i64| {
        let d2 = ((dx * dx + dy * dy) as f64) / (PIXELS_PER_DEGREE * PIXELS_PER_DEGREE);
        CSF.map(|[a1, b1, a2, b2]| {
            let gaussian = |a: f64, b: f64| a * (PI / b).sqrt() * (-PI * PI * d2 / b).exp();
            gaussian(a1, b1) + gaussian(a2, b2)
        })
    };
    let mut sum = [0.0; 3];
    for dy in -radius..=radius {
        for dx in -radius..=radius {
            let w = weight(dx, dy);
            for k in 0..3 {
                sum[k] += w[k];
            }
        }
    }
    convolved(opponent, width, radius, |dx, dy| {
        let w = weight(dx, dy);
        [0, 1, 2].map(|k| w[k] / sum[k])
    })
}

/// Strength of edges and of points in the achromatic channel.
fn features(achromatic: &[f64], width: usize) -> Vec<[f64; 2]> {
    let sd = 0.5 * FEATURE_WIDTH_DEG * PIXELS_PER_DEGREE;
    let radius = (3.0 * sd).ceil() as i64;
    let gaussian = |dx: i64, dy: i64| (-((dx * dx + dy * dy) as f64) / (2.0 * sd * sd)).exp();
    let first = |dx: i64, dy: i64| -(dx as f64) * gaussian(dx, dy);
    let second = |dx: i64, dy: i64| ((dx * dx) as f64 / (sd * sd) - 1.0) * gaussian(dx, dy);
    // Positive and negative weights each sum to one.
    let norms = |f: &dyn Fn(i64, i64) -> f64| {
        let (mut positive, mut negative) = (0.0, 0.0);
        for dy in -radius..=radius {
            for dx in -radius..=radius {
                let w: f64 = f(dx, dy);
                positive += w.max(0.0);
                negative -= w.min(0.0);
            }
        }
        [positive, negative]
    };
    let (edge_norms, point_norms) = (norms(&first), norms(&second));
    let normed = |w: f64, [positive, negative]: [f64; 2]| if w > 0.0 { w / positive } else { w / negative };
    let copies: Vec<[f64; 4]> = achromatic.iter().map(|value| [*value; 4]).collect();
    let filtered = convolved(&copies, width, radius, |dx, dy| {
        [
            normed(first(dx, dy), edge_norms),
            normed(first(dy, dx), edge_norms),
            normed(second(dx, dy), point_norms),
            normed(second(dy, dx), point_norms),
        ]
    });
    filtered.iter().map(|f| [f[0].hypot(f[1]), f[2].hypot(f[3])]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 24;

    fn pattern(texel: impl Fn(usize, usize) -> [usize; 3]) -> Vec<[u8; 3]> {
        (0..SIDE * SIDE).map(|i| texel(i % SIDE, i / SIDE).map(|value| value as u8)).collect()
    }

    #[test]
    fn differences_are_those_of_the_authors_program() {
        let a =
            pattern(|x, y| [(x * 37 + y * 91) % 256, (x * 11 + y * 5 + 40) % 256, ((x / 6 + y / 6) % 2) * 200 + 20]);
        let b = pattern(|x, y| {
            [(x * 35 + y * 91 + 12) % 256, (x * 11 + y * 7 + 40) % 256, ((x / 6 + y / 5) % 2) * 180 + 30]
        });
        let map = Prepared::new(&a, SIDE).difference(&Prepared::new(&b, SIDE));
        let mean = map.iter().sum::<f64>() / map.len() as f64;
        // flip-evaluator 1.7, LDR, 67.0206 pixels a degree; it computes in f32.
        assert!((mean - 0.524_659).abs() < 2e-4, "{mean}");
        for (x, y, expected) in [(0, 0, 0.178_920), (12, 12, 0.902_938), (19, 7, 0.308_702)] {
            assert!((map[y * SIDE + x] - expected).abs() < 1e-3, "{x}, {y}: {}", map[y * SIDE + x]);
        }
    }

    #[test]
    fn equal_pictures_do_not_differ_and_order_does_not_matter() {
        let a = Prepared::new(&pattern(|x, y| [x * 10, y * 10, 77]), SIDE);
        let b = Prepared::new(&pattern(|x, y| [y * 10, 200, x * 9]), SIDE);
        assert!(a.difference(&a).iter().all(|d| *d == 0.0));
        for (ab, ba) in a.difference(&b).iter().zip(b.difference(&a)) {
            assert!((ab - ba).abs() < 1e-12 && (0.0..=1.0).contains(ab));
        }
    }
}
