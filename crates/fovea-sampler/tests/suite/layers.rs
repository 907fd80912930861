//! Layers on films: expected counts against draws, factors, pins, masks, views.

use fovea_sampler::layers::{Factor, FilmDensity, Layers, Mask, Region, Source};
use fovea_sampler::{Angle, Film, GazeWarp, Geometry, RadialDistribution, Reddy2001, SamplerError};

use crate::common::{SIGNIFICANCE, chi_squared_p, uniform};

fn degrees(x: f64) -> Angle {
    Angle::from_degrees(x)
}

fn acuity(gaze: [f64; 3]) -> Source {
    let warp = GazeWarp::new(RadialDistribution::new(Reddy2001, Geometry::Sphere, degrees(80.0), 0.0).unwrap());
    Source::Acuity { warp, gaze }
}

fn painted() -> Mask {
    // A checkered gradient with empty pixels, an empty row and an empty column.
    let weight = |x: u32, y: u32| if y == 3 || x == 5 || (x + y).is_multiple_of(3) { 0.0 } else { (x + 2 * y) as f32 };
    let weights: Vec<f32> = (0..16).flat_map(|y| (0..32).map(move |x| weight(x, y))).collect();
    Mask::new(32, 16, &weights).unwrap()
}

fn rectangle() -> Region {
    Region::rectangle([degrees(150.0), degrees(-120.0)], [degrees(-20.0), degrees(45.0)]).unwrap()
}

/// Sets of layers that use every source and factor, on films of the whole sphere and of a part.
fn cases() -> Vec<(&'static str, Layers, Film)> {
    let panorama = Film::equirectangular(64, 32).unwrap();
    let view = Film::perspective(48, 32, degrees(60.0)).unwrap();
    let gaze = [0.6, 0.48, -0.64];
    let axes = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]];
    let one = |source| Layers::new(vec![(3.0, source)]).unwrap();
    let pins = Source::pins(&[[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-0.6, 0.0, -0.8]], degrees(20.0)).unwrap();
    let all = vec![
        (4.0, acuity(gaze)),
        (1.0, Source::Uniform),
        (0.5, pins.clone()),
        (0.5, Source::Mask(painted())),
        (0.25, Source::Region(rectangle())),
    ];
    let masked = one(Source::Uniform).with_factor(Factor::Mask(painted())).unwrap();
    let spared = one(Source::Uniform)
        .with_factor(Factor::Outside { region: Region::cap([0.0, 0.0, -1.0], degrees(40.0)).unwrap(), inside: 0.1 })
        .unwrap();
    let product = Layers::new(all.clone())
        .unwrap()
        .with_factor(Factor::Inside { region: rectangle(), outside: 0.5 })
        .unwrap()
        .with_factor(Factor::Mask(painted()))
        .unwrap();
    vec![
        ("acuity", one(acuity(gaze)), panorama),
        ("acuity behind", one(acuity([0.0, 0.0, 1.0])), panorama),
        ("uniform", one(Source::Uniform), panorama),
        ("uniform on a view", one(Source::Uniform), view),
        ("panorama", one(Source::Panorama), panorama),
        ("view", one(Source::View { film: view, axes }), panorama),
        ("region across the seam", one(Source::Region(rectangle())), panorama),
        ("pins", one(pins), panorama),
        ("mask", one(Source::Mask(painted())), panorama),
        ("mask as factor", masked, panorama),
        ("spared region", spared, panorama),
        ("mixture", Layers::new(all.clone()).unwrap(), panorama),
        ("mixture times factors", product, panorama),
        ("mixture on a view", Layers::new(all).unwrap(), view),
    ]
}

/// Chi-squared of drawn against expected counts. Sharp-edged sources make a pixel's expected count approximate (4 x 4
/// positions), so pixels are merged into blocks of 8 x 8 and that error is allowed for.
#[test]
fn draws_follow_the_expected_counts() {
    const DRAWS: u32 = 30_000;
    let cases = cases();
    let level = SIGNIFICANCE / cases.len() as f64;
    for (name, layers, film) in cases {
        let density = FilmDensity::new(layers, film).unwrap();
        let [width, height] = film.size_px();
        let blocks = (width / 8) as usize;
        let block = |x: u32, y: u32| (y / 8) as usize * blocks + (x / 8) as usize;
        let mut expected = vec![0.0; blocks * (height / 8) as usize];
        let mut counts = vec![0.0; expected.len()];
        for y in 0..height {
            for x in 0..width {
                expected[block(x, y)] += density.expected_count([x, y], f64::from(DRAWS));
            }
        }
        let total: f64 = expected.iter().sum();
        assert!((total / f64::from(DRAWS) - 1.0).abs() < 1e-12, "{name}: {total}");
        for i in 0..DRAWS {
            let next = |attempt| [0, 1, 2].map(|d| f64::from(uniform(i, 3 * attempt + d, 31)));
            let [x, y] = density.sample(next).unwrap();
            counts[block(x, y)] += 1.0;
        }
        let (mut statistic, mut freedom) = (0.0, -1.0);
        for (count, expected) in counts.iter().zip(&expected) {
            if *expected < 5.0 {
                assert!(*count <= 25.0, "{name}: {count} where {expected} are expected");
                continue;
            }
            let excess = ((count - expected).abs() - 0.01 * expected).max(0.0);
            statistic += excess * excess / expected;
            freedom += 1.0;
        }
        assert!(freedom >= 1.0, "{name}");
        assert!(chi_squared_p(statistic, freedom) > level, "{name}: {statistic} of {freedom}");
    }
}

/// What is drawn is never where the density is zero, and the pdf of the set integrates to 1 over the film.
#[test]
fn pdf_integrates_to_one() {
    for (name, layers, film) in cases() {
        let density = FilmDensity::new(layers, film).unwrap();
        let [width, height] = film.size_px();
        let mut sum = 0.0;
        for y in 0..height {
            for x in 0..width {
                for k in 0..16 {
                    let at = [
                        f64::from(x) + f64::from(uniform(k, 0, x + 64 * y)),
                        f64::from(y) + f64::from(uniform(k, 1, x)),
                    ];
                    sum += density.pdf(film.direction(at)) * film.steradians_per_pixel(at) / 16.0;
                }
            }
        }
        assert!((sum - 1.0).abs() < 0.03, "{name}: {sum}");
        assert!(density.accepted() <= 1.02, "{name}: {}", density.accepted());
    }
}

#[test]
fn regions_know_their_solid_angle_and_draw_inside() {
    let cap = Region::cap([0.0, 0.0, -1.0], degrees(90.0)).unwrap();
    assert!((cap.solid_angle() / core::f64::consts::TAU - 1.0).abs() < 1e-14);
    // 90 degrees of yaw across the seam, between sines of -20 and 45 degrees.
    let expected = core::f64::consts::FRAC_PI_2 * (degrees(45.0).radians().sin() + degrees(20.0).radians().sin());
    assert!((rectangle().solid_angle() / expected - 1.0).abs() < 1e-12);
    for (region, seed) in [(cap, 1), (rectangle(), 2)] {
        for i in 0..2000 {
            let d = Source::Region(region).sample([uniform(i, 0, seed), uniform(i, 1, seed)].map(f64::from));
            assert!(region.contains(d), "{d:?}");
        }
    }
    assert!(rectangle().contains([0.0, 0.0, 1.0]) && !rectangle().contains([0.0, 0.0, -1.0]));
}

#[test]
fn a_zero_factor_gives_nothing_and_too_little_acceptance_is_refused() {
    let film = Film::equirectangular(64, 32).unwrap();
    let uniform = || Layers::new(vec![(1.0, Source::Uniform)]).unwrap();
    let only = |outside| Factor::Inside { region: rectangle(), outside };
    let density = FilmDensity::new(uniform().with_factor(only(0.0)).unwrap(), film).unwrap();
    assert_eq!(density.expected_count([32, 16], 1e9), 0.0);
    assert_eq!(density.pdf([0.0, 0.0, -1.0]), 0.0);
    assert!(density.pdf([0.0, 0.0, 1.0]) > 0.0);
    let pin = Region::cap([0.0, 0.0, -1.0], degrees(0.1)).unwrap();
    let refused = uniform().with_factor(Factor::Inside { region: pin, outside: 0.0 }).unwrap();
    assert!(matches!(FilmDensity::new(refused, film), Err(SamplerError::Parameter { .. })));
}

#[test]
fn bad_layers_are_refused() {
    assert!(Layers::new(vec![]).is_err());
    for weight in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Layers::new(vec![(weight, Source::Uniform)]).is_err());
    }
    let layers = Layers::new(vec![(1.0, Source::Uniform)]).unwrap();
    for outside in [-0.1, 1.1, f64::NAN] {
        assert!(layers.clone().with_factor(Factor::Inside { region: rectangle(), outside }).is_err());
    }
    assert!(Source::pins(&[], degrees(1.0)).is_err());
    assert!(Mask::new(2, 1, &[0.0, 0.0]).is_err());
    assert!(Mask::new(2, 1, &[1.0]).is_err());
    assert!(Mask::new(2, 1, &[1.0, f32::NAN]).is_err());
    assert!(Region::cap([0.0, 0.0, 1.0], degrees(0.0)).is_err());
    assert!(Region::rectangle([degrees(f64::NAN), degrees(1.0)], [degrees(0.0), degrees(1.0)]).is_err());
    assert!(Region::rectangle([degrees(0.0), degrees(1.0)], [degrees(2.0), degrees(1.0)]).is_err());
}
