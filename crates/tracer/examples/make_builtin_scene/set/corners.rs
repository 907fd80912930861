//! The corners: a large plant, a lantern on a chain, a reading lamp, an armchair.

use glam::Vec3;

use super::glb::{Builder, Spot};
use super::materials::Palette;
use super::room::HEIGHT;
use super::shape::{Soup, cuboid, curve, lathe, sphere, torus, tube};
use super::walls::pot_plant;

pub(super) fn build(b: &mut Builder, p: &Palette) {
    let stand = cuboid([0.34, 0.5, 0.34], 0.012).at(2.75, 0.25, -3.2);
    b.fixture("plant stand", &stand, p.oak, false);
    pot_plant(b, p, Spot::new(2.75, 0.5, -3.2), 1.5, 44, 7);
    lantern(b, p);
    reading_lamp(b, p);
    armchair(b, p);
}

/// A lantern of pierced brass with a lamp in it, on 30 links of chain.
fn lantern(b: &mut Builder, p: &Palette) {
    let (x, z) = (-2.55, -2.85);
    let link = b.part(&torus(0.011, 0.0035, 0.012, [24, 8]).turned(Vec3::Z, 0.25), false);
    let link = b.mesh("chain link", &[(&link, p.gold)]);
    const PITCH: f32 = 0.033;
    for i in 0..30 {
        let y = HEIGHT - 0.02 - PITCH * i as f32;
        b.place("chain link", link, Spot::new(x, y, z).turned(if i % 2 == 0 { 0.0 } else { 0.25 }));
    }
    let top = HEIGHT - 0.02 - PITCH * 30.0;
    let mut cage = lathe(&curve(&[[0.15, -0.1], [0.12, -0.05], [0.03, -0.015], [0.012, 0.012], [0.0, 0.014]], 3), 12);
    cage = cage.and(lathe(&[[0.0, -0.45], [0.13, -0.445], [0.15, -0.42], [0.15, -0.41], [0.0, -0.4]], 12));
    for i in 0..36 {
        let post = cuboid([0.006, 0.32, 0.006], 0.0).at(0.0, -0.255, 0.142);
        cage = cage.and(post.turned(Vec3::Y, i as f32 / 36.0));
    }
    for i in 0..9 {
        cage = cage.and(torus(0.142, 0.0035, 0.0, [36, 6]).at(0.0, -0.12 - 0.035 * i as f32, 0.0));
    }
    b.fixture("lantern", &cage.at(x, top, z), p.gold, false);
    b.fixture("lantern's lamp", &sphere(0.05, 40).at(x, top - 0.26, z), p.lamp_bulb, false);
}

fn reading_lamp(b: &mut Builder, p: &Palette) {
    let (x, z) = (2.95, 3.0);
    let foot = curve(&[[0.0, 0.0], [0.15, 0.0], [0.15, 0.012], [0.05, 0.028], [0.014, 0.05], [0.011, 0.1]], 3);
    let pole = tube(&[[0.0, 0.08], [0.0, 0.8], [0.0, 1.52]], 0.011, 0.011, 16);
    b.fixture("reading lamp", &lathe(&foot, 36).and(pole).at(x, 0.0, z), p.iron, false);
    let shade = Soup::grid(64, 6, |u, v| {
        let (sin, cos) = super::shape::sin_cos(u);
        let (ripple, _) = super::shape::sin_cos(u * 32.0);
        let radius = (0.24 - 0.11 * v) * (1.0 + 0.012 * ripple);
        Vec3::new(radius * sin, 1.36 + 0.3 * v, radius * cos)
    });
    b.fixture("reading lamp's shade", &shade.at(x, 0.0, z), p.lamp_shade, false);
    b.fixture("reading lamp's bulb", &sphere(0.05, 40).at(x, 1.52, z), p.lamp_bulb, false);
}

fn armchair(b: &mut Builder, p: &Palette) {
    let mut chair = cuboid([0.62, 0.2, 0.6], 0.05).at(0.0, 0.36, 0.02);
    chair = chair.and(cuboid([0.6, 0.14, 0.56], 0.06).at(0.0, 0.49, 0.0));
    chair = chair.and(cuboid([0.74, 0.66, 0.17], 0.07).turned(Vec3::X, 0.03).at(0.0, 0.7, 0.34));
    for side in [-1.0, 1.0] {
        chair = chair.and(cuboid([0.15, 0.42, 0.72], 0.06).at(0.37 * side, 0.46, 0.03));
    }
    let legs = lathe(&[[0.014, 0.0], [0.024, 0.26]], 16);
    let mut wood = Soup::default();
    for (x, z) in [(-0.34, -0.26), (0.34, -0.26), (-0.34, 0.32), (0.34, 0.32)] {
        wood = wood.and(legs.clone().at(x, 0.0, z));
    }
    let cushion = sphere(0.2, 40).moved(glam::Affine3A::from_scale(Vec3::new(1.0, 1.0, 0.38)));
    let cushion = cushion.turned(Vec3::X, 0.04).at(0.0, 0.72, 0.18);
    let (chair, wood, cushion) = (b.part(&chair, false), b.part(&wood, false), b.part(&cushion, false));
    let mesh = b.mesh("armchair", &[(&chair, p.armchair), (&wood, p.oak), (&cushion, p.curtain)]);
    b.place("armchair", mesh, Spot::new(2.25, 0.0, 2.45).turned(0.12));
}
