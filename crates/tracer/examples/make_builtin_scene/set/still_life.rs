//! -Z: the table, what stands on it, and the wall behind.

use glam::{Affine3A, Vec3};

use super::glb::{Builder, Spot};
use super::materials::Palette;
use super::paint::unit;
use super::room::HALF_Z;
use super::shape::{Soup, cuboid, curve, lathe, panel, sphere, torus, tube};

const TOP: f32 = 0.78;
const TABLE_Z: f32 = -2.0;

pub(super) fn build(b: &mut Builder, p: &Palette) {
    table(b, p);
    glassware(b, p);
    metalware(b, p);
    ceramics_and_fruit(b, p);
    wall(b, p);
    pendant(b, p);
}

fn table(b: &mut Builder, p: &Palette) {
    let top = cuboid([2.7, 0.045, 0.95], 0.008).at(0.0, TOP - 0.0225, TABLE_Z).tiled(2.0, 1.0);
    b.fixture("table top", &top, p.walnut, true);
    let profile = [
        [0.0, 0.0],
        [0.03, 0.0],
        [0.034, 0.03],
        [0.022, 0.08],
        [0.03, 0.3],
        [0.04, 0.55],
        [0.026, 0.62],
        [0.042, 0.66],
    ];
    let leg = lathe(&curve(&profile, 4), 24).and(cuboid([0.09, 0.08, 0.09], 0.004).at(0.0, 0.695, 0.0));
    let leg = b.part(&leg, false);
    let leg = b.mesh("table leg", &[(&leg, p.oak)]);
    for (x, z) in [(-1.22, -0.37), (1.22, -0.37), (-1.22, 0.37), (1.22, 0.37)] {
        b.place("table leg", leg, Spot::new(x, 0.0, TABLE_Z + z));
    }
    let apron = cuboid([2.36, 0.08, 0.02], 0.003);
    let apron = apron.clone().at(0.0, 0.695, TABLE_Z - 0.37).and(apron.at(0.0, 0.695, TABLE_Z + 0.37));
    b.fixture("table apron", &apron, p.oak, false);
}

/// A closed wall of glass: up the outside, down the inside.
fn vessel(outside: &[[f32; 2]], inside: &[[f32; 2]], steps: usize, segments: usize) -> Soup {
    let mut profile = curve(outside, steps);
    profile.extend(curve(inside, steps));
    lathe(&profile, segments)
}

fn glassware(b: &mut Builder, p: &Palette) {
    let outside = [
        [0.0, 0.0],
        [0.034, 0.0005],
        [0.035, 0.003],
        [0.012, 0.008],
        [0.0045, 0.03],
        [0.0042, 0.085],
        [0.012, 0.098],
        [0.036, 0.125],
        [0.041, 0.155],
        [0.036, 0.2],
        [0.032, 0.225],
    ];
    let inside = [[0.0308, 0.2255], [0.0346, 0.2], [0.0394, 0.155], [0.034, 0.1265], [0.012, 0.1035], [0.0, 0.101]];
    let wine = b.part(&vessel(&outside, &inside, 3, 36), false);
    let wine = b.mesh("wine glass", &[(&wine, p.glass)]);
    b.place("wine glass", wine, Spot::new(-0.52, TOP, TABLE_Z + 0.12));
    b.place("wine glass", wine, Spot::new(-0.36, TOP, TABLE_Z - 0.12).turned(0.1));

    let ball = b.part(&sphere(0.085, 44), false);
    let ball = b.mesh("glass ball", &[(&ball, p.glass)]);
    b.place("glass ball", ball, Spot::new(-0.17, TOP + 0.085, TABLE_Z + 0.26));

    let outside = [
        [0.0, 0.0],
        [0.06, 0.001],
        [0.066, 0.012],
        [0.066, 0.12],
        [0.05, 0.18],
        [0.02, 0.225],
        [0.017, 0.27],
        [0.022, 0.3],
    ];
    let inside = [
        [0.0185, 0.3005],
        [0.0135, 0.27],
        [0.0165, 0.225],
        [0.0465, 0.178],
        [0.0615, 0.12],
        [0.0615, 0.02],
        [0.052, 0.0075],
        [0.0, 0.007],
    ];
    let decanter = vessel(&outside, &inside, 3, 36);
    b.fixture("decanter", &decanter.at(0.5, TOP, TABLE_Z - 0.16), p.green_glass, false);
    let stopper = lathe(
        &curve(
            &[
                [0.0, 0.28],
                [0.012, 0.282],
                [0.0128, 0.303],
                [0.014, 0.312],
                [0.026, 0.335],
                [0.018, 0.36],
                [0.0, 0.368],
            ],
            3,
        ),
        32,
    );
    b.fixture("stopper", &stopper.at(0.5, TOP, TABLE_Z - 0.16), p.glass, false);

    let marble = sphere(0.016, 16);
    let part = b.part(&marble, false);
    let meshes = [p.glass, p.green_glass, p.amber_glass, p.chrome].map(|m| b.mesh("marble", &[(&part, m)]));
    for i in 0..14 {
        let (x, z) = (-0.95 + 1.9 * unit(i, 0, 61), TABLE_Z + 0.37 + 0.07 * unit(i, 1, 61));
        b.place("marble", meshes[i as usize % 4], Spot::new(x, TOP + 0.016, z));
    }
}

fn metalware(b: &mut Builder, p: &Palette) {
    let body = curve(
        &[
            [0.0, 0.0],
            [0.06, 0.0],
            [0.068, 0.008],
            [0.1, 0.06],
            [0.108, 0.1],
            [0.09, 0.145],
            [0.058, 0.165],
            [0.052, 0.172],
        ],
        3,
    );
    let lid = curve(
        &[
            [0.054, 0.172],
            [0.05, 0.178],
            [0.03, 0.192],
            [0.012, 0.197],
            [0.008, 0.203],
            [0.014, 0.214],
            [0.009, 0.224],
            [0.0, 0.226],
        ],
        3,
    );
    let spout = curve(&[[0.0, 0.0], [0.055, 0.025], [0.075, 0.075], [0.11, 0.11]], 8);
    let handle: Vec<[f32; 2]> = (0..=16)
        .map(|i| {
            let (sin, cos) = super::shape::sin_cos(0.5 * i as f32 / 16.0);
            [-0.085 - 0.075 * sin, 0.1 + 0.052 * cos]
        })
        .collect();
    let pot = lathe(&body, 44)
        .tiled(6.0, 3.0)
        .and(lathe(&lid, 36).tiled(3.0, 1.0))
        .and(tube(&spout, 0.024, 0.011, 18).at(0.082, 0.05, 0.0))
        .and(tube(&handle, 0.009, 0.009, 12));
    b.fixture("copper pot", &pot.turned(Vec3::Y, 0.04).at(0.12, TOP, TABLE_Z - 0.02), p.hammered_copper, true);

    let ball = b.part(&sphere(0.1, 44), true);
    let worn = b.mesh("worn ball", &[(&ball, p.worn_steel)]);
    b.place("worn ball", worn, Spot::new(-0.78, TOP + 0.1, TABLE_Z + 0.17));
    let chrome = b.mesh("chrome ball", &[(&ball, p.chrome)]);
    b.place("chrome ball", chrome, Spot::new(0.43, TOP + 0.075, TABLE_Z + 0.2).scaled(0.75, 0.75, 0.75));

    let ring = torus(0.085, 0.03, 0.0, [64, 28]).turned(Vec3::X, 0.25).turned(Vec3::Y, 0.07);
    b.fixture("gold ring", &ring.at(1.06, TOP + 0.075 + 0.115, TABLE_Z - 0.02), p.gold, false);
    let book = cuboid([0.3, 0.036, 0.21], 0.003);
    b.fixture("book, lower", &book.clone().turned(Vec3::Y, 0.03).at(1.06, TOP + 0.018, TABLE_Z), p.covers[1], false);
    b.fixture("book, upper", &book.turned(Vec3::Y, -0.02).at(1.05, TOP + 0.055, TABLE_Z), p.covers[6], false);
}

fn ceramics_and_fruit(b: &mut Builder, p: &Palette) {
    let outside = [
        [0.0, 0.0],
        [0.06, 0.0],
        [0.065, 0.01],
        [0.1, 0.12],
        [0.108, 0.2],
        [0.08, 0.3],
        [0.042, 0.37],
        [0.05, 0.42],
        [0.062, 0.44],
    ];
    let inside = [[0.056, 0.441], [0.044, 0.42], [0.036, 0.37], [0.072, 0.3], [0.098, 0.2], [0.0, 0.03]];
    b.fixture("vase", &vessel(&outside, &inside, 3, 44).at(-1.05, TOP, TABLE_Z - 0.16), p.glazed_red, false);
    let (lean, bend) = (0.13, 0.34);
    let mut twig = tube(&curve(&[[0.0, 0.3], [lean * 0.4, 0.52], [lean, 0.5 + bend]], 3), 0.003, 0.0015, 6);
    for k in 0..14 {
        let t = k as f32 / 14.0;
        let side = if k % 2 == 0 { 0.014 } else { -0.014 };
        twig = twig.and(sphere(0.011 - 0.004 * t, 8).at(lean * (0.45 + 0.55 * t), 0.54 + t * (bend - 0.04), side));
    }
    let part = b.part(&twig, false);
    let twigs = [p.porcelain, p.orange].map(|m| b.mesh("twig", &[(&part, m)]));
    for i in 0..9u32 {
        let spot = Spot::new(-1.05, TOP + 0.02, TABLE_Z - 0.16).turned(i as f32 / 9.0);
        let (spread, rise) = (0.5 + 0.7 * unit(i, 0, 62), 0.85 + 0.25 * unit(i, 1, 62));
        b.place("twig", twigs[i as usize % 2], spot.scaled(spread, rise, 1.0));
    }

    let outside = [[0.0, 0.0], [0.06, 0.0], [0.062, 0.014], [0.1, 0.035], [0.15, 0.085]];
    let inside = [[0.146, 0.087], [0.096, 0.042], [0.0, 0.022]];
    b.fixture("bowl", &vessel(&outside, &inside, 3, 44).at(0.78, TOP, TABLE_Z + 0.12), p.porcelain, false);
    let fruit = lathe(
        &curve(
            &[[0.0, 0.006], [0.012, 0.0], [0.034, 0.014], [0.041, 0.04], [0.022, 0.068], [0.01, 0.076], [0.0, 0.07]],
            3,
        ),
        22,
    );
    let part = b.part(&fruit, false);
    let fruits = [p.orange, p.apple, p.plum].map(|m| b.mesh("fruit", &[(&part, m)]));
    let heap = [
        (0, 0.0, 0.03, 0.0),
        (1, 0.07, 0.045, 0.02),
        (0, -0.065, 0.045, 0.03),
        (2, 0.02, 0.045, 0.075),
        (1, -0.03, 0.045, -0.07),
        (0, 0.055, 0.05, -0.055),
        (2, -0.01, 0.095, 0.025),
        (1, 0.035, 0.1, -0.02),
    ];
    for (i, (kind, x, y, z)) in heap.into_iter().enumerate() {
        let lean =
            Spot::new(0.78 + x, TOP + y, TABLE_Z + 0.12 + z).turned(0.13 * i as f32).rotated(Vec3::X, 0.03 * i as f32);
        b.place("fruit", fruits[kind], lean);
    }

    let outside = [[0.0, 0.0], [0.022, 0.0], [0.024, 0.006], [0.036, 0.03], [0.04, 0.06]];
    let inside = [[0.0375, 0.0605], [0.0335, 0.03], [0.0, 0.008]];
    let ear: Vec<[f32; 2]> = (0..=14)
        .map(|i| {
            let (sin, cos) = super::shape::sin_cos(0.5 * i as f32 / 14.0);
            [0.036 + 0.018 * sin, 0.034 + 0.017 * cos]
        })
        .collect();
    let cup = vessel(&outside, &inside, 3, 32).and(tube(&ear, 0.0035, 0.0035, 10));
    let saucer =
        lathe(&curve(&[[0.0, 0.0], [0.035, 0.0], [0.07, 0.012], [0.069, 0.015], [0.035, 0.004], [0.0, 0.004]], 3), 40);
    let part = b.part(&cup.at(0.0, 0.005, 0.0).and(saucer), false);
    let cup = b.mesh("cup", &[(&part, p.porcelain)]);
    b.place("cup", cup, Spot::new(-0.33, TOP, TABLE_Z + 0.32).turned(0.1));
    b.place("cup", cup, Spot::new(0.2, TOP, TABLE_Z + 0.31).turned(-0.35));
}

fn wall(b: &mut Builder, p: &Palette) {
    let z = -HALF_Z + 0.02;
    b.fixture("tapestry", &panel(1.92, 1.44).at(0.0, 1.78, z), p.tapestry, true);
    let knob = sphere(0.022, 20).moved(Affine3A::from_translation(Vec3::new(1.05, 2.53, z)));
    let rod = tube(&[[-1.05, 2.53], [0.0, 2.53], [1.05, 2.53]], 0.011, 0.011, 16).at(0.0, 0.0, z);
    let rod = rod.and(knob.clone()).and(knob.at(-2.1, 0.0, 0.0));
    b.fixture("tapestry rod", &rod, p.gold, false);
    let tassel =
        lathe(&[[0.0, -0.085], [0.012, -0.085], [0.009, -0.03], [0.005, -0.024], [0.008, -0.012], [0.003, 0.0]], 10);
    let part = b.part(&tassel, false);
    let tassel = b.mesh("tassel", &[(&part, p.curtain)]);
    for i in 0..33 {
        b.place("tassel", tassel, Spot::new(-0.944 + 0.059 * i as f32, 1.06, z));
    }

    let bulb = b.part(&sphere(0.065, 40), false);
    let bulb = b.mesh("wall lamp", &[(&bulb, p.lamp_warm)]);
    let arm = tube(&curve(&[[0.0, -0.12], [0.02, -0.2], [0.1, -0.2], [0.14, -0.06]], 8), 0.009, 0.007, 14)
        .turned(Vec3::Y, -0.25);
    let plate = lathe(&[[0.055, 0.0], [0.05, 0.012], [0.0, 0.016]], 32).turned(Vec3::X, 0.25).at(0.0, -0.12, -0.01);
    let cup = lathe(&curve(&[[0.0, -0.068], [0.03, -0.066], [0.05, -0.045], [0.056, -0.03]], 3), 32).at(0.0, 0.0, 0.14);
    let arm = b.part(&arm.and(plate).and(cup), false);
    let arm = b.mesh("wall lamp's arm", &[(&arm, p.gold)]);
    for x in [-1.75, 1.75] {
        b.place("wall lamp's arm", arm, Spot::new(x, 1.95, -HALF_Z + 0.01));
        b.place("wall lamp", bulb, Spot::new(x, 1.95, -HALF_Z + 0.15));
    }
}

/// A metal shade on a cord above the table, lighting it from close by.
fn pendant(b: &mut Builder, p: &Palette) {
    let shade = curve(&[[0.21, 0.0], [0.2, 0.05], [0.13, 0.13], [0.045, 0.17], [0.03, 0.21], [0.012, 0.22]], 3);
    let mut profile =
        curve(&[[0.012, 0.2], [0.026, 0.195], [0.04, 0.164], [0.126, 0.126], [0.196, 0.047], [0.206, 0.0]], 3);
    profile.extend(shade);
    let cord = tube(&[[0.0, 0.2], [0.0, 0.5], [0.0, 0.86]], 0.004, 0.004, 8);
    let fitting = lathe(&profile, 44).and(cord).at(0.0, 2.14, TABLE_Z);
    b.fixture("pendant", &fitting, p.iron, false);
    b.fixture("pendant's bulb", &sphere(0.05, 40).at(0.0, 2.22, TABLE_Z), p.lamp_bulb, false);
}
