//! The shell: floor, walls, window opening, ceiling with its ring lamp, mouldings and rug.

use glam::{Affine3A, Vec3};

use super::glb::{Builder, Spot};
use super::materials::Palette;
use super::shape::{Soup, cuboid, lathe, panel, sin_cos, sphere, torus, tube};

/// Half extents of the room in x and z, and its height, metres.
pub(super) const HALF_X: f32 = 3.5;
pub(super) const HALF_Z: f32 = 4.0;
pub(super) const HEIGHT: f32 = 3.0;

/// The opening in the +X wall: z from, z to, y from, y to.
pub(super) const WINDOW: [f32; 4] = [-1.4, 1.4, 0.85, 2.5];

pub(super) fn build(b: &mut Builder, p: &Palette) {
    let floor = panel(2.0 * HALF_X, 2.0 * HALF_Z).turned(Vec3::X, -0.25).tiled(4.0, 4.6);
    b.fixture("floor", &floor, p.parquet, true);
    let ceiling = panel(2.0 * HALF_X, 2.0 * HALF_Z).turned(Vec3::X, 0.25).at(0.0, HEIGHT, 0.0);
    b.fixture("ceiling", &ceiling, p.ceiling, false);
    let end_wall = panel(2.0 * HALF_X, HEIGHT).at(0.0, HEIGHT / 2.0, -HALF_Z);
    b.fixture("wall -Z", &end_wall, p.plaster, false);
    b.fixture("wall +Z", &end_wall.turned(Vec3::Y, 0.5), p.plaster, false);
    let side_wall = panel(2.0 * HALF_Z, HEIGHT).turned(Vec3::Y, 0.25).at(-HALF_X, HEIGHT / 2.0, 0.0);
    b.fixture("wall -X", &side_wall, p.terracotta_wall, false);
    b.fixture("wall +X", &window_wall(), p.sage_wall, false);
    b.fixture("mouldings", &mouldings(), p.trim, false);

    let rug = cuboid([2.7, 0.012, 1.8], 0.004).at(0.0, 0.006, 0.1);
    b.fixture("rug's edge", &rug, p.paper, false);
    let face = panel(2.7, 1.8).turned(Vec3::X, -0.25).at(0.0, 0.0125, 0.1);
    b.fixture("rug", &face, p.rug, true);

    ring_lamp(b, p);
}

/// The +X wall, 0.25 m thick, as boxes around the opening.
fn window_wall() -> Soup {
    let [z0, z1, y0, y1] = WINDOW;
    const DEPTH: f32 = 0.25;
    let block = |z: [f32; 2], y: [f32; 2]| {
        let size = [DEPTH, y[1] - y[0], z[1] - z[0]];
        cuboid(size, 0.0).at(HALF_X + DEPTH / 2.0, (y[0] + y[1]) / 2.0, (z[0] + z[1]) / 2.0)
    };
    block([-HALF_Z, z0], [0.0, HEIGHT])
        .and(block([z1, HALF_Z], [0.0, HEIGHT]))
        .and(block([z0, z1], [0.0, y0]))
        .and(block([z0, z1], [y1, HEIGHT]))
}

fn mouldings() -> Soup {
    // A quarter-round in profile: three steps that catch the light.
    let steps = |y: f32, up: f32| {
        let strip = |height: f32, depth: f32, offset: f32| {
            let along_x = cuboid([2.0 * HALF_X, height, depth], 0.004);
            let along_z = cuboid([depth, height, 2.0 * HALF_Z], 0.004);
            let y = y + up * offset;
            along_x
                .clone()
                .at(0.0, y, -HALF_Z + depth / 2.0)
                .and(along_x.at(0.0, y, HALF_Z - depth / 2.0))
                .and(along_z.clone().at(-HALF_X + depth / 2.0, y, 0.0))
                .and(along_z.at(HALF_X - depth / 2.0, y, 0.0))
        };
        strip(0.09, 0.018, 0.045).and(strip(0.03, 0.03, 0.10)).and(strip(0.012, 0.022, 0.121))
    };
    steps(0.0, 1.0).and(steps(HEIGHT, -1.0))
}

/// An emissive ring under the ceiling on three rods, with a rosette above it.
fn ring_lamp(b: &mut Builder, p: &Palette) {
    let ring = torus(0.55, 0.035, 0.0, [72, 16]).at(0.0, 2.62, 0.0);
    b.fixture("ring lamp", &ring, p.lamp_ring, false);
    let mut metal = lathe(&[[0.0, 2.9], [0.06, 2.905], [0.09, 2.93], [0.12, 2.985], [0.12, 3.0]], 36);
    metal = metal.and(torus(0.55, 0.045, 0.0, [72, 12]).at(0.0, 2.68, 0.0));
    for i in 0..3 {
        let rod = tube(&[[0.05, 2.95], [0.30, 2.81], [0.55, 2.68]], 0.006, 0.006, 10);
        metal = metal.and(rod.turned(Vec3::Y, i as f32 / 3.0));
    }
    b.fixture("ring lamp's mount", &metal, p.gold, false);

    let petal = sphere(1.0, 12).moved(Affine3A::from_scale(Vec3::new(1.6, 0.4, 0.8)));
    let petal = b.part(&petal, false);
    let petal = b.mesh("petal", &[(&petal, p.trim)]);
    for (radius, count, size) in [(0.30, 16, 0.05), (0.42, 24, 0.035)] {
        for i in 0..count {
            let (sin, cos) = sin_cos(i as f32 / count as f32);
            let spot = Spot::new(radius * cos, HEIGHT, -radius * sin).turned(i as f32 / count as f32);
            b.place("petal", petal, spot.scaled(size, size, size));
        }
    }
    let rosette = torus(0.50, 0.025, 0.0, [72, 12]).at(0.0, HEIGHT, 0.0);
    let rosette = rosette.and(torus(0.20, 0.02, 0.0, [48, 12]).at(0.0, HEIGHT, 0.0));
    b.fixture("ceiling rosette", &rosette, p.trim, false);
}
