//! Round trips, pinned values, adversarial numbers and gazes.

use fovea_sampler::{
    Angle, Form, GazeWarp, Geometry, Inverse, RadialDistribution, Reddy2001, gaze_frame, gaze_frame_f32, sequence,
};

use crate::common::{distributions, distributions_to, inverses, uniform};

/// Gazes at which frames break: axes with either zero, near the pole of the construction, diagonals.
fn gazes() -> Vec<[f64; 3]> {
    let tiny = 1e-9_f64;
    let near = (1.0 - tiny * tiny).sqrt();
    let mut all = vec![[0.0, 0.0, -1.0], [-0.0, 0.0, -1.0], [0.0, -0.0, 1.0], [tiny, 0.0, -near], [0.0, -tiny, near]];
    all.extend([[1.0, 0.0, -0.0], [1.0, 0.0, 0.0], [-1.0, -0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, -0.0]]);
    all.extend([[0.6, 0.48, 0.64], [-0.6, 0.48, -0.64], [near, tiny, 0.0], [0.0, near, -tiny]]);
    all
}

fn adversarial_u(inverse: &Inverse, distribution: &RadialDistribution) -> Vec<f32> {
    let mut all = vec![0.0, -0.0, 1e-45, f32::MIN_POSITIVE, 2f32.powi(-24), 0.5, 1.0 - 2f32.powi(-24), 1.0];
    let joints = [distribution.cdf(distribution.cap()), distribution.cdf(Angle::from_degrees(5.79)), 0.0965];
    for joint in joints {
        let joint = joint as f32;
        all.extend([joint.next_down(), joint, joint.next_up()]);
    }
    assert!(inverse.eval(0.0) == 0.0);
    all.retain(|u| *u <= 1.0);
    all
}

#[test]
fn invert_undoes_sample() {
    let mut trips = 0;
    for (k, (name, distribution)) in distributions().into_iter().enumerate() {
        for inverse in inverses(&distribution) {
            let name = format!("{name} {}", inverse.name());
            let warp = GazeWarp::with_inverse(distribution.clone(), inverse);
            for (i, gaze) in gazes().into_iter().enumerate() {
                for j in 0..40 {
                    let seed = (k * 100 + i) as u32;
                    let u = [uniform(j, 0, seed), uniform(j, 1, seed)].map(f64::from);
                    let sample = warp.sample(u, gaze);
                    let back = warp.invert(sample.direction, gaze);
                    // A direction has 1e-16 absolute; at a small or nearly straight angle that is more of v and azimuth.
                    let e = sample.eccentricity.radians();
                    let tolerance = 2e-14 * (1.0 + 1.0 / e.sin()) * (1.0 + sample.pdf);
                    let u_tolerance = tolerance.max(1e-12) * if back[0] > 0.9 { 100.0 } else { 1.0 };
                    assert!((back[0] - u[0]).abs() < u_tolerance, "{name} {gaze:?}: {u:?} {back:?}");
                    let turns = (back[1] - u[1]).abs();
                    assert!(turns.min(1.0 - turns) < tolerance, "{name} {gaze:?}: {u:?} {back:?}");
                    let pdf = warp.pdf(sample.direction, gaze);
                    assert!((pdf / sample.pdf - 1.0).abs() < 1e-6, "{name} {u:?}: {pdf} {}", sample.pdf);
                    trips += 1;
                }
            }
        }
    }
    assert!(trips > 50_000, "{trips}");
}

#[test]
fn adversarial_inputs_give_directions_and_never_panic() {
    let bad_numbers = [f32::NAN, -1.0, 2.0, f32::INFINITY, f32::NEG_INFINITY];
    let bad_gazes =
        [[0.0; 3], [f64::NAN, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0], [1e300, 1e300, 0.0], [1e-320, 0.0, 0.0]];
    for (name, distribution) in [20.0, 80.0, 180.0].into_iter().flat_map(distributions_to) {
        let largest = distribution.max_eccentricity().radians();
        for inverse in inverses(&distribution) {
            let farthest = (0..=1 << 12).map(|k| inverse.eccentricity(k as f32 / 4096.0).degrees()).fold(0.0, f64::max);
            assert!(farthest <= 180.0, "{name} {}: {farthest}", inverse.name());
            let numbers = adversarial_u(&inverse, &distribution);
            let (at_zero, at_one) = (inverse.eval(0.0), inverse.eval(1.0));
            assert_eq!([inverse.eval(f32::NAN), inverse.eval(-1.0), inverse.eval(2.0)], [at_zero, at_zero, at_one]);
            let mut ascending: Vec<f32> = numbers.clone();
            ascending.sort_by(f32::total_cmp);
            for pair in ascending.windows(2) {
                let [a, b] = [inverse.eval(pair[0]), inverse.eval(pair[1])];
                assert!(
                    f64::from(b) >= f64::from(a) * (1.0 - 2.0 * inverse.bound().rounding),
                    "{name} {}: {pair:?} gives {a} {b}",
                    inverse.name()
                );
            }
            let warp = GazeWarp::with_inverse(distribution.clone(), inverse);
            for u in numbers.iter().chain(&bad_numbers) {
                for gaze in gazes().iter().chain(&bad_gazes) {
                    let sample = warp.sample([f64::from(*u), f64::from(*u)], *gaze);
                    let length = sample.direction.iter().map(|x| x * x).sum::<f64>();
                    assert!((length - 1.0).abs() < 1e-12, "{name} {u} {gaze:?}: {sample:?}");
                    assert!(sample.pdf.is_finite() && sample.pdf >= 0.0, "{name} {u} {gaze:?}: {sample:?}");
                    assert!(
                        sample.eccentricity.radians() <= largest * (1.0 + 2.0 * warp.inverse().bound().relative_chord),
                        "{name} {u}: {sample:?}"
                    );
                    let back = warp.invert(sample.direction, *gaze);
                    assert!(back.iter().all(|x| (0.0..=1.0).contains(x)), "{name} {u} {gaze:?}: {back:?}");
                    let local = warp.sample_local_f32([*u, *u]);
                    let length = local.iter().map(|x| x * x).sum::<f32>();
                    assert!((length - 1.0).abs() < 1e-6, "{name} {u}: {local:?}");
                }
            }
        }
    }
}

#[test]
fn frames_are_orthonormal_and_right_handed() {
    for n in gazes() {
        for k in 0..1000 {
            let v = if k == 0 { n } else { [0, 1, 2].map(|d| f64::from(uniform(k, d, 5)) - 0.5) };
            let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
            let n = v.map(|x| x / length);
            check_frame(gaze_frame(n), 1e-14);
            check_frame(gaze_frame_f32(n.map(|x| x as f32)).map(|b| b.map(f64::from)), 4e-7);
        }
    }
}

fn check_frame(frame: [[f64; 3]; 3], tolerance: f64) {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    for (i, a) in frame.iter().enumerate() {
        for (j, b) in frame.iter().enumerate() {
            let expected = f64::from(u8::from(i == j));
            assert!((dot(*a, *b) - expected).abs() < tolerance, "{frame:?}");
        }
    }
    let [a, b, n] = frame;
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    assert!(dot(cross, n) > 0.999_999, "{frame:?}");
}

/// The f32 direction against the f64 one: the shader's rounding.
#[test]
fn f32_directions_are_close_to_f64() {
    for geometry in Geometry::ALL {
        let cap = Angle::from_degrees(80.0);
        let warp = GazeWarp::new(RadialDistribution::new(Reddy2001, geometry, cap, 0.002).unwrap());
        for gaze in gazes() {
            for k in 0..2000 {
                let u = [uniform(k, 0, 9), uniform(k, 1, 9)];
                let exact = warp.sample(u.map(f64::from), gaze).direction;
                let found = warp.sample_f32(u, gaze.map(|x| x as f32));
                let error = (0..3).map(|k| (f64::from(found[k]) - exact[k]).abs()).fold(0.0, f64::max);
                // v near 2 leaves sqrt(ulp) in the sine.
                let tolerance = if warp.inverse().eval_versine(u[0]) > 1.99 { 4e-4 } else { 6e-6 };
                assert!(error < tolerance, "{geometry:?} {gaze:?} {u:?}: {error:e}");
            }
        }
    }
}

/// Pinned values: a change of the sample stream must be a decision. Bits of `v` at fixed `u`.
#[test]
fn values_are_stable() {
    let numbers = [2f32.powi(-24), 0.01, 0.1, 0.25, 0.5, 0.75, 0.9, 0.96, 1.0];
    let bits = |geometry, floor, form: Option<Form>| -> Vec<u32> {
        let d = RadialDistribution::new(Reddy2001, geometry, Angle::from_degrees(80.0), floor).unwrap();
        let inverse = form.map_or_else(|| Inverse::default_for(&d), |form| Inverse::with_form(&d, form).unwrap());
        numbers.iter().map(|u| inverse.eval_versine(*u).to_bits()).collect()
    };
    let found = [
        bits(Geometry::Sphere, 0.002, None),
        bits(Geometry::Plane, 0.0, None),
        bits(Geometry::Plane, 0.0, Some(Form::Eq6)),
        bits(Geometry::Sphere, 0.0, Some(Form::Table(256))),
    ];
    assert_eq!(found, PINNED_RADII.map(Vec::from), "{found:x?}");
    let sequence: Vec<u32> = (0..8).map(|i| sequence::sobol_owen(i * 1001, i % 4 + 30, 7)).collect();
    assert_eq!(sequence, PINNED_SEQUENCE, "{sequence:x?}");
}

const PINNED_RADII: [[u32; 9]; 4] = [
    [0x31549894, 0x3a080fbb, 0x3baa17d8, 0x3c92d957, 0x3da6fd6d, 0x3e96ee7e, 0x3f1f92bf, 0x3f764234, 0x40000000],
    [0x3158d5b3, 0x3a0ac315, 0x3bad614a, 0x3c975c6f, 0x3dac0a30, 0x3e93ea97, 0x3f0e526e, 0x3f355819, 0x3f538f0d],
    [0x3158c238, 0x3a0ab69d, 0x3bad753f, 0x3c973944, 0x3dac2268, 0x3e93e8de, 0x3f0e6bea, 0x3f355d7c, 0x3f5367bf],
    [0x314af976, 0x3a01e756, 0x3ba2612b, 0x3c878d07, 0x3d939680, 0x3e7eea84, 0x3f01fe92, 0x3f2da197, 0x3f538bcb],
];
const PINNED_SEQUENCE: [u32; 8] =
    [0x3370_ce92, 0x1b69_032f, 0x7c8c_7209, 0x0ef1_c1c8, 0x5618_864d, 0x5f36_415e, 0x937d_591d, 0x76c8_5ca7];

/// A batch is the single draws, bit for bit: whole blocks, a part of one, and slices of unequal length.
#[test]
fn batches_equal_single_draws() {
    for (name, distribution) in distributions() {
        let piecewise = [Form::Piecewise(4, 3), Form::Polynomial(2), Form::Table(64)];
        let more = piecewise.iter().filter_map(|form| Inverse::with_form(&distribution, *form).ok());
        for inverse in inverses(&distribution).into_iter().chain(more) {
            let drawn = (0..300).map(|i| uniform(i, 0, 9));
            let bad_numbers = [f32::NAN, -1.0, 2.0, f32::INFINITY, f32::NEG_INFINITY];
            let numbers = adversarial_u(&inverse, &distribution).into_iter().chain(bad_numbers).chain(drawn);
            let first: Vec<f32> = numbers.collect();
            let pairs: Vec<[f32; 2]> = first.iter().zip(first.iter().rev()).map(|(u, v)| [*u, *v]).collect();
            let warp = GazeWarp::with_inverse(distribution.clone(), inverse);
            let mut batch = vec![[7.0; 3]; pairs.len() - 3];
            warp.sample_local_batch(&pairs, &mut batch);
            for (u, found) in pairs.iter().zip(&batch) {
                let single = warp.sample_local_f32(*u);
                assert_eq!(found.map(f32::to_bits), single.map(f32::to_bits), "{name} {} {u:?}", warp.inverse().name());
            }
            let mut longer = vec![[7.0; 3]; pairs.len() + 1];
            warp.sample_local_batch(&pairs, &mut longer);
            assert_eq!(longer[pairs.len()], [7.0; 3], "nothing is written beyond the numbers");
        }
    }
}
