//! +X: the window. -X: mirror, eye chart, the row of steel spheres and a pierced screen.

use glam::Vec3;

use super::glb::{Builder, Spot};
use super::materials::Palette;
use super::paint::unit;
use super::room::{HALF_X, WINDOW};
use super::shape::{Soup, cuboid, curve, lathe, panel, sin_cos, sphere, torus, tube};

pub(super) fn build(b: &mut Builder, p: &Palette) {
    window(b, p);
    curtains(b, p);
    radiator(b, p);
    for (z, seed) in [(-0.95, 1), (0.9, 2), (0.35, 3)] {
        pot_plant(b, p, Spot::new(HALF_X + 0.03, WINDOW[2] + 0.03, z), 0.55 + 0.1 * seed as f32, 26, seed);
    }
    west_wall(b, p);
    console(b, p);
    screen(b, p);
}

fn window(b: &mut Builder, p: &Palette) {
    let [z0, z1, y0, y1] = WINDOW;
    let view = panel(4.6, 3.2).turned(Vec3::Y, -0.25).at(HALF_X + 0.9, (y0 + y1) / 2.0 + 0.1, 0.0);
    b.fixture("sky", &view, p.landscape, true);
    let x = HALF_X + 0.17;
    let (width, height) = (z1 - z0, y1 - y0);
    let (middle_y, middle_z) = ((y0 + y1) / 2.0, (z0 + z1) / 2.0);
    let upright = |z: f32, w: f32| cuboid([0.06, height, w], 0.006).at(x, middle_y, z);
    let cross = |y: f32, w: f32| cuboid([0.05, w, width], 0.006).at(x, y, middle_z);
    let mut frame = upright(z0 + 0.03, 0.06).and(upright(z1 - 0.03, 0.06)).and(upright(middle_z, 0.07));
    frame = frame.and(cross(y0 + 0.03, 0.06)).and(cross(y1 - 0.03, 0.06)).and(cross(y0 + 1.1, 0.05));
    for z in [-0.7, 0.7] {
        frame = frame.and(upright(z, 0.025));
    }
    frame = frame.and(cross(y0 + 0.55, 0.022));
    let sill = cuboid([0.42, 0.035, width + 0.16], 0.008).at(HALF_X + 0.06, y0 + 0.0125, middle_z);
    b.fixture("window frame", &frame.and(sill), p.trim, false);
}

fn curtains(b: &mut Builder, p: &Palette) {
    let [z0, z1, _, _] = WINDOW;
    let sheet = Soup::grid(80, 8, |u, v| {
        let (fold, _) = sin_cos(u * 8.0);
        let (wave, _) = sin_cos(u * 3.0 + 0.2);
        let gather = 0.82 + 0.18 * (2.0 * v - 1.0).abs();
        Vec3::new(-0.09 + (0.045 * fold + 0.012 * wave) * (1.2 - 0.4 * v), 0.03 + 2.62 * v, (u - 0.5) * 0.62 * gather)
    });
    let part = b.part(&sheet, false);
    let sheet = b.mesh("curtain", &[(&part, p.curtain)]);
    b.place("curtain", sheet, Spot::new(HALF_X - 0.03, 0.0, z0 - 0.3));
    b.place("curtain", sheet, Spot::new(HALF_X - 0.03, 0.0, z1 + 0.3));
    let rail = tube(&[[-2.05, 0.0], [0.0, 0.0], [2.05, 0.0]], 0.014, 0.014, 16).turned(Vec3::Y, 0.25);
    b.fixture("curtain rail", &rail.at(HALF_X - 0.12, 2.68, 0.0), p.iron, false);
    let ring = torus(0.022, 0.003, 0.0, [20, 8]).turned(Vec3::X, 0.25);
    let part = b.part(&ring, false);
    let ring = b.mesh("curtain ring", &[(&part, p.gold)]);
    for i in 0..18 {
        let z = if i < 9 { z0 - 0.58 + 0.07 * i as f32 } else { z1 + 0.02 + 0.07 * (i - 9) as f32 };
        b.place("curtain ring", ring, Spot::new(HALF_X - 0.12, 2.665, z));
    }
}

/// Fins at 35 mm: fine detail at the middle distance.
fn radiator(b: &mut Builder, p: &Palette) {
    let fin = b.part(&cuboid([0.1, 0.52, 0.022], 0.008), false);
    let fin = b.mesh("radiator fin", &[(&fin, p.trim)]);
    for i in 0..48 {
        b.place("radiator fin", fin, Spot::new(HALF_X - 0.1, 0.42, -0.82 + 0.035 * i as f32));
    }
    let pipe = tube(&[[-0.9, 0.0], [0.0, 0.0], [0.9, 0.0]], 0.018, 0.018, 14).turned(Vec3::Y, 0.25);
    let pipes = pipe.clone().at(HALF_X - 0.1, 0.22, 0.0).and(pipe.at(HALF_X - 0.1, 0.62, 0.0));
    b.fixture("radiator pipes", &pipes, p.trim, false);
}

/// A clay pot with `count` leaves; `size` is the length of the longest ones, metres.
pub(super) fn pot_plant(b: &mut Builder, p: &Palette, spot: Spot, size: f32, count: u32, seed: u32) {
    let pot = curve(
        &[
            [0.0, 0.0],
            [0.062, 0.0],
            [0.066, 0.01],
            [0.082, 0.12],
            [0.092, 0.124],
            [0.094, 0.15],
            [0.084, 0.152],
            [0.078, 0.13],
        ],
        3,
    );
    let soil = lathe(&[[0.08, 0.132], [0.0, 0.137]], 32);
    let (pot, soil) = (b.part(&lathe(&pot, 40), false), b.part(&soil, false));
    let pot = b.mesh("pot", &[(&pot, p.clay), (&soil, p.soil)]);
    b.place("pot", pot, spot);
    let leaf = Soup::grid(4, 9, |u, v| {
        let (width, _) = sin_cos(0.5 * (0.06 + 0.94 * v));
        let across = (u - 0.5) * 0.24 * width;
        let droop = 0.9 * v * v;
        Vec3::new(across, (v - 0.62 * droop) * 0.9 + across.abs() * 0.35, 0.55 * droop + 0.12 * v)
    });
    let part = b.part(&leaf, false);
    let leaf = b.mesh("leaf", &[(&part, p.leaf)]);
    for i in 0..count {
        let turn = i as f32 * 0.381_966 + 0.05 * unit(i, seed, 71);
        let length = size * 0.5 * (0.55 + 0.45 * unit(i, seed, 72));
        let lean = 0.015 + 0.12 * unit(i, seed, 73);
        let base = Spot::new(spot.at.x, spot.at.y + 0.13, spot.at.z).turned(turn).rotated(Vec3::X, lean);
        b.place("leaf", leaf, base.scaled(length, length, length));
    }
}

fn west_wall(b: &mut Builder, p: &Palette) {
    let x = -HALF_X;
    let chart = panel(0.8, 1.1).turned(Vec3::Y, 0.25);
    b.fixture("eye chart", &chart.at(x + 0.032, 1.72, 0.25), p.eye_chart, true);
    let bar = |w: f32, h: f32| cuboid([0.04, h, w], 0.006);
    let frame = |w: f32, h: f32, bars: f32| {
        let (side_z, side_y) = ((w + bars) / 2.0, (h + bars) / 2.0);
        bar(w + 2.0 * bars, bars)
            .at(0.0, side_y, 0.0)
            .and(bar(w + 2.0 * bars, bars).at(0.0, -side_y, 0.0))
            .and(bar(bars, h).at(0.0, 0.0, side_z))
            .and(bar(bars, h).at(0.0, 0.0, -side_z))
    };
    b.fixture("chart frame", &frame(0.8, 1.1, 0.03).at(x + 0.02, 1.72, 0.25), p.oak, false);

    let mirror = panel(0.85, 1.35).turned(Vec3::Y, 0.25);
    b.fixture("mirror", &mirror.at(x + 0.03, 1.6, -1.75), p.silver, false);
    let bead = b.part(&sphere(0.017, 12), false);
    let bead = b.mesh("bead", &[(&bead, p.gold)]);
    for i in 0..44 {
        let along = i as f32 / 44.0 * 4.4;
        let (z, y) = match along {
            t if t < 0.85 => (t - 0.425, 0.71),
            t if t < 2.2 => (0.46, 0.675 - (t - 0.85)),
            t if t < 3.05 => (0.425 - (t - 2.2), -0.71),
            t => (-0.46, -0.675 + (t - 3.05)),
        };
        b.place("bead", bead, Spot::new(x + 0.045, 1.6 + y, z - 1.75));
    }
    b.fixture("mirror frame", &frame(0.85, 1.35, 0.07).at(x + 0.02, 1.6, -1.75), p.gold, false);
}

fn console(b: &mut Builder, p: &Palette) {
    let (x, z) = (-HALF_X + 0.24, 0.25);
    let top = cuboid([0.42, 0.035, 1.7], 0.006).at(x, 0.84, z).tiled(1.0, 1.0);
    b.fixture("console top", &top, p.walnut, true);
    let mut legs = Soup::default();
    for (dx, dz) in [(-0.17, -0.78), (0.17, -0.78), (-0.17, 0.78), (0.17, 0.78)] {
        legs = legs.and(cuboid([0.028, 0.822, 0.028], 0.004).at(x + dx, 0.411, z + dz));
    }
    legs = legs.and(cuboid([0.34, 0.02, 1.56], 0.004).at(x, 0.18, z));
    b.fixture("console legs", &legs, p.iron, false);
    let ball = b.part(&sphere(0.12, 48), false);
    for (i, &material) in p.steel_row.iter().enumerate() {
        let mesh = b.mesh("steel ball", &[(&ball, material)]);
        b.place("steel ball", mesh, Spot::new(x + 0.02, 0.8575 + 0.12, z + 0.64 - 0.32 * i as f32));
    }
    let basket = cuboid([0.26, 0.16, 0.36], 0.02).at(x, 0.27, z - 0.4);
    b.fixture("box", &basket, p.covers[4], false);
    let jar = lathe(
        &curve(&[[0.0, 0.0], [0.07, 0.0], [0.1, 0.08], [0.09, 0.2], [0.05, 0.25], [0.06, 0.28], [0.0, 0.27]], 4),
        40,
    );
    b.fixture("jar", &jar.at(x, 0.19, z + 0.3), p.glazed_red, false);
}

/// A folding screen with a grid of 12 mm bars: the finest regular pattern of the room.
fn screen(b: &mut Builder, p: &Palette) {
    let mut bars = Soup::default();
    for i in 0..28 {
        bars = bars.and(cuboid([0.012, 1.62, 0.012], 0.0).at(-0.405 + 0.03 * i as f32, 0.92, 0.0));
    }
    for i in 0..54 {
        bars = bars.and(cuboid([0.83, 0.012, 0.008], 0.0).at(0.0, 0.125 + 0.03 * i as f32, 0.0));
    }
    let frame = cuboid([0.04, 1.75, 0.03], 0.005);
    let frame = frame
        .clone()
        .at(-0.43, 0.875, 0.0)
        .and(frame.at(0.43, 0.875, 0.0))
        .and(cuboid([0.86, 0.04, 0.03], 0.005).at(0.0, 1.74, 0.0))
        .and(cuboid([0.86, 0.06, 0.03], 0.005).at(0.0, 0.08, 0.0));
    let (bars, frame) = (b.part(&bars, false), b.part(&frame, false));
    let leaf = b.mesh("screen", &[(&bars, p.iron), (&frame, p.oak)]);
    b.place("screen", leaf, Spot::new(-3.1, 0.0, 1.75).turned(0.17));
    b.place("screen", leaf, Spot::new(-2.9, 0.0, 2.5).turned(0.32));
}
