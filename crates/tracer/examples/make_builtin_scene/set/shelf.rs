//! +Z: the bookshelf.

use glam::Vec3;

use super::glb::{Builder, Part, Spot};
use super::materials::Palette;
use super::paint::{hash, unit};
use super::room::HALF_Z;
use super::shape::{Soup, cuboid, curve, lathe, sin_cos, sphere, torus};

const COLUMNS: u32 = 4;
const ROWS: u32 = 6;
const CELL_WIDTH: f32 = 0.95;
const CELL_HEIGHT: f32 = 0.38;
const BOARD: f32 = 0.028;
const DEPTH: f32 = 0.32;
const BACK_Z: f32 = HALF_Z - 0.03;

pub(super) fn build(b: &mut Builder, p: &Palette) {
    case(b, p);
    let book = BookParts::new(b, p);
    for row in 0..ROWS {
        for column in 0..COLUMNS {
            fill_cell(b, p, &book, row, column);
        }
    }
}

fn cell_left(column: u32) -> f32 {
    (column as f32 - COLUMNS as f32 / 2.0) * CELL_WIDTH + BOARD / 2.0
}

fn cell_floor(row: u32) -> f32 {
    0.08 + row as f32 * CELL_HEIGHT + BOARD
}

fn case(b: &mut Builder, p: &Palette) {
    let (width, height) = (COLUMNS as f32 * CELL_WIDTH + BOARD, ROWS as f32 * CELL_HEIGHT + BOARD);
    let z = BACK_Z - DEPTH / 2.0;
    let mut boards = cuboid([width, height, 0.012], 0.0).at(0.0, 0.08 + height / 2.0, BACK_Z);
    for column in 0..=COLUMNS {
        let x = (column as f32 - COLUMNS as f32 / 2.0) * CELL_WIDTH;
        boards = boards.and(cuboid([BOARD, height, DEPTH], 0.003).at(x, 0.08 + height / 2.0, z));
    }
    for row in 0..=ROWS {
        let y = 0.08 + row as f32 * CELL_HEIGHT + BOARD / 2.0;
        boards = boards.and(cuboid([width - BOARD, BOARD, DEPTH - 0.004], 0.003).at(0.0, y, z + 0.002));
    }
    boards = boards.and(cuboid([width, 0.08, DEPTH - 0.05], 0.0).at(0.0, 0.04, z));
    boards = boards.and(cuboid([width + 0.06, 0.035, DEPTH + 0.04], 0.008).at(0.0, 0.08 + height + 0.0175, z));
    b.fixture("bookshelf", &boards, p.oak, false);
}

/// A book of unit size, spine towards -Z, in each cover.
struct BookParts {
    meshes: [usize; 8],
}

impl BookParts {
    fn new(b: &mut Builder, p: &Palette) -> Self {
        let spine: Vec<[f32; 2]> = (0..=5)
            .map(|i| {
                let (sin, cos) = sin_cos(0.5 * i as f32 / 5.0);
                [0.5 * cos, -0.44 - 0.06 * sin]
            })
            .collect();
        // The cover is an open profile in the xz plane, extruded along y.
        let mut outline = vec![[0.5, 0.5]];
        outline.extend(spine);
        outline.push([-0.5, 0.5]);
        let last = outline.len() - 1;
        let wall = Soup::grid(last, 1, |u, v| {
            let [x, z] = outline[last - (u * last as f32).round() as usize];
            Vec3::new(x, 1.0 - v, z)
        });
        let caps = [1.0f32, 0.0].into_iter().fold(Soup::default(), |soup, y| {
            let cap = Soup::grid(1, last / 2, |u, v| {
                let i = (v * (last / 2) as f32).round() as usize;
                let u = if y > 0.5 { 1.0 - u } else { u };
                let (a, b) = (outline[i], outline[last - i]);
                Vec3::new(a[0] + (b[0] - a[0]) * u, y, a[1] + (b[1] - a[1]) * u)
            });
            soup.and(cap)
        });
        // Three raised bands across the spine.
        let mut bands = Soup::default();
        for y in [0.16, 0.72, 0.86] {
            bands = bands.and(Soup::grid(5, 2, |u, v| {
                let (sin, cos) = sin_cos(0.5 * (1.0 - u));
                let out = if v > 0.2 && v < 0.8 { 0.07 } else { 0.045 };
                Vec3::new(0.52 * cos, y + 0.03 * (1.0 - v), -0.44 - out * sin)
            }));
        }
        let cover: Part = b.part(&wall.and(caps), false);
        let bands = b.part(&bands, false);
        let pages = b.part(&cuboid([0.84, 0.985, 0.02], 0.0).at(0.0, 0.5, 0.5), false);
        let mut number = 0;
        let meshes = p.covers.map(|material| {
            number += 1;
            let band = if number % 3 == 0 { p.gold } else { p.covers[(number * 3) % 8] };
            b.mesh("book", &[(&cover, material), (&bands, band), (&pages, p.paper)])
        });
        Self { meshes }
    }
}

fn fill_cell(b: &mut Builder, p: &Palette, book: &BookParts, row: u32, column: u32) {
    let cell = row * COLUMNS + column;
    let (left, floor) = (cell_left(column) + 0.01, cell_floor(row));
    let right = left + CELL_WIDTH - BOARD - 0.02;
    let is_show_case = matches!(cell, 5 | 10 | 15 | 16 | 21);
    let mut x = if is_show_case { left + 0.5 } else { left };
    let mut i = 0;
    loop {
        let pick = |salt| unit(cell * 64 + i, salt, 81);
        let (width, height, depth) = (0.018 + 0.038 * pick(0), 0.2 + 0.13 * pick(1), 0.15 + 0.08 * pick(2));
        // The last books of a row lean or are missing.
        if x + width > right - 0.14 * unit(cell, 9, 82) {
            break;
        }
        let mesh = book.meshes[(hash(cell * 64 + i, 3, 83) % 8) as usize];
        let spot = Spot::new(x + width / 2.0, floor, BACK_Z - 0.07 - depth / 2.0 - 0.04 * pick(4));
        b.place("book", mesh, spot.scaled(width, height, depth));
        x += width + 0.0015;
        i += 1;
    }
    if x + 0.1 < right && !is_show_case {
        let mesh = book.meshes[(hash(cell, 4, 84) % 8) as usize];
        let lean = Spot::new(x + 0.075, floor, BACK_Z - 0.17).rotated(Vec3::Z, 0.045);
        b.place("leaning book", mesh, lean.scaled(0.03, 0.24, 0.18));
    }
    if is_show_case {
        exhibit(b, p, cell, Vec3::new(left + 0.24, floor, BACK_Z - DEPTH / 2.0));
    }
}

fn exhibit(b: &mut Builder, p: &Palette, cell: u32, at: Vec3) {
    let stand = |soup: Soup| soup.at(at.x, at.y, at.z);
    match cell {
        5 => {
            let globe = sphere(0.11, 40).turned(Vec3::Z, -0.065).at(0.0, 0.17, 0.0);
            b.fixture("globe", &stand(globe), p.globe, true);
            let foot = lathe(&curve(&[[0.0, 0.0], [0.07, 0.0], [0.065, 0.012], [0.015, 0.02], [0.01, 0.06]], 3), 32);
            let arc = torus(0.125, 0.005, 0.0, [56, 8]).turned(Vec3::X, 0.25).at(0.0, 0.17, 0.0);
            b.fixture("globe's stand", &stand(foot.and(arc)), p.gold, false);
        }
        10 => {
            let mut knot = Soup::default();
            for (axis, turns) in [(Vec3::X, 0.0), (Vec3::X, 0.25), (Vec3::Z, 0.25)] {
                knot = knot.and(torus(0.085, 0.014, 0.0, [56, 16]).turned(axis, turns));
            }
            b.fixture("armillary", &stand(knot.at(0.0, 0.12, 0.0)), p.chrome, false);
            b.fixture("armillary's core", &stand(sphere(0.045, 40).at(0.0, 0.12, 0.0)), p.amber_glass, false);
            b.fixture("armillary's foot", &stand(cuboid([0.12, 0.03, 0.12], 0.005).at(0.0, 0.015, 0.0)), p.iron, false);
        }
        15 => {
            for (i, material) in [p.amber_glass, p.glass, p.green_glass].into_iter().enumerate() {
                let profile = curve(
                    &[
                        [0.0, 0.0],
                        [0.045, 0.0],
                        [0.05, 0.01],
                        [0.05, 0.12],
                        [0.02, 0.16],
                        [0.02, 0.2],
                        [0.026, 0.205],
                        [0.0, 0.205],
                    ],
                    3,
                );
                let flask = lathe(&profile, 40).at(-0.13 + 0.13 * i as f32, 0.0, 0.02 * i as f32);
                b.fixture("flask", &stand(flask), material, false);
            }
        }
        16 => {
            let horse = curve(
                &[
                    [0.0, 0.0],
                    [0.06, 0.0],
                    [0.05, 0.02],
                    [0.02, 0.05],
                    [0.045, 0.13],
                    [0.05, 0.17],
                    [0.02, 0.23],
                    [0.03, 0.26],
                    [0.0, 0.29],
                ],
                3,
            );
            b.fixture("turned figure", &stand(lathe(&horse, 36)), p.porcelain, false);
            b.fixture("turned figure", &stand(lathe(&horse, 36).at(0.13, 0.0, 0.03)), p.glazed_red, false);
        }
        _ => {
            let clock =
                lathe(&[[0.13, -0.03], [0.135, 0.0], [0.13, 0.012], [0.12, 0.012], [0.118, 0.004], [0.0, 0.004]], 44);
            let upright = |soup: Soup| stand(soup.turned(Vec3::X, -0.25).at(0.0, 0.15, -0.05));
            b.fixture("clock", &upright(clock), p.paper, false);
            let mut marks = Soup::default();
            for hour in 0..12 {
                let length = if hour % 3 == 0 { 0.026 } else { 0.014 };
                marks = marks
                    .and(cuboid([0.005, 0.003, length], 0.0).at(0.0, 0.006, 0.1).turned(Vec3::Y, hour as f32 / 12.0));
            }
            marks = marks.and(cuboid([0.006, 0.003, 0.085], 0.0).at(0.0, 0.008, 0.035).turned(Vec3::Y, 0.36));
            marks = marks.and(cuboid([0.008, 0.003, 0.06], 0.0).at(0.0, 0.01, 0.024).turned(Vec3::Y, 0.61));
            b.fixture("clock's hands", &upright(marks), p.iron, false);
        }
    }
}
