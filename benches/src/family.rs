//! Scenes of any size as glTF files: one surface in more or fewer triangles, and one mesh in more or fewer places.

use std::{
    fs::File,
    io::{self, BufWriter, Write},
    path::Path,
};

use glam::Vec3;
use rayon::prelude::*;
use serde_json::{Value, json};

/// Mean radius of the cave, metres.
const RADIUS: f32 = 10.0;
/// From one instance to the next, metres.
const SPACING: f32 = 1.0;

/// An indexed triangle list.
struct Shape {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    indices: Vec<u32>,
}

/// Writes a closed, bumpy cave around the origin as a `.glb` of nearly so many triangles (the next lower 12 n^2). Its surface is the
/// same whatever the number; every ray from inside meets it. Returns the number.
///
/// # Errors
/// When the file cannot be written.
pub fn write_cave(path: &Path, triangles: u32) -> io::Result<u32> {
    let shape = closed_grid((f64::from(triangles) / 12.0).sqrt().max(1.0) as u32, |direction| {
        direction * (RADIUS * (1.0 + bumps(direction)))
    });
    let count = shape.indices.len() as u32 / 3;
    let lamp = Lamp { position: [3.0, 4.0, 2.0], candelas: 60.0 };
    write(path, &shape, vec![json!({ "name": "cave", "mesh": 0 })], &lamp)?;
    Ok(count)
}

/// Writes a cube of small bumpy balls, each an instance of one mesh of 300 triangles, around an empty middle where the camera is.
///
/// # Errors
/// When the file cannot be written.
pub fn write_balls(path: &Path, instances: u32) -> io::Result<()> {
    let shape = closed_grid(5, |direction| direction * (0.3 * (1.0 + bumps(direction))));
    let side = (f64::from(instances) + 1.0).cbrt().ceil() as u32;
    let place = |i: u32| [i % side, i / side % side, i / side / side].map(|c| (c as f32 - 0.5 * side as f32) * SPACING);
    let far = |place: &[f32; 3]| place.iter().any(|coordinate| coordinate.abs() >= SPACING);
    let places = (0..).map(place).filter(far).take(instances as usize);
    let nodes: Vec<Value> = (0u32..).zip(places).map(|(i, place)| {
        let turn = (i % 8) as f32 / 8.0 * std::f32::consts::TAU * 0.5;
        json!({ "name": format!("ball {i}"), "mesh": 0, "translation": place, "rotation": [0.0, turn.sin(), 0.0, turn.cos()] })
    }).collect();
    write(path, &shape, nodes, &Lamp { position: [0.3, 0.5, 0.2], candelas: 2.0 })
}

/// Height above the sphere over its radius.
fn bumps(d: Vec3) -> f32 {
    [(3.0f32, 0.14f32), (7.0, 0.06), (17.0, 0.025), (41.0, 0.01)]
        .map(|(frequency, height)| {
            let p = d * frequency + Vec3::new(0.3, 1.1, 2.3);
            height * p.x.sin() * p.y.sin() * p.z.sin()
        })
        .iter()
        .sum()
}

/// Six faces of n x n cells, taken from a cube to a sphere and from there by `surface`; fronts inside.
fn closed_grid(n: u32, surface: impl Fn(Vec3) -> Vec3 + Sync) -> Shape {
    const AXES: [[Vec3; 3]; 6] = [
        [Vec3::X, Vec3::Y, Vec3::Z],
        [Vec3::NEG_X, Vec3::Z, Vec3::Y],
        [Vec3::Y, Vec3::Z, Vec3::X],
        [Vec3::NEG_Y, Vec3::X, Vec3::Z],
        [Vec3::Z, Vec3::X, Vec3::Y],
        [Vec3::NEG_Z, Vec3::Y, Vec3::X],
    ];
    let row = n + 1;
    let vertex = |i: u32| {
        let [forward, right, up] = AXES[(i / (row * row)) as usize];
        let [x, y] = [i % row, i / row % row].map(|c| c as f32 / n as f32 * 2.0 - 1.0);
        // Equal angles.
        let direction = |x: f32, y: f32| {
            let [x, y] = [x, y].map(|c| (c * std::f32::consts::FRAC_PI_4).tan());
            (forward + right * x + up * y).normalize()
        };
        let step = 1e-3;
        let slope_x = surface(direction(x + step, y)) - surface(direction(x - step, y));
        let slope_y = surface(direction(x, y + step)) - surface(direction(x, y - step));
        let outwards = slope_x.cross(slope_y).normalize_or(forward);
        (surface(direction(x, y)), -outwards)
    };
    let vertices: Vec<(Vec3, Vec3)> = (0..6 * row * row).into_par_iter().map(vertex).collect();
    let indices = (0..6 * n * n).into_par_iter().flat_map_iter(|cell| {
        let a = cell / (n * n) * row * row + cell / n % n * row + cell % n;
        let (b, c, d) = (a + 1, a + row + 1, a + row);
        [a, c, b, a, d, c]
    });
    let indices = indices.collect();
    let (positions, normals) = vertices.into_iter().unzip();
    Shape { positions, normals, indices }
}

/// A point that shines.
struct Lamp {
    /// Metres.
    position: [f32; 3],
    candelas: f32,
}

/// Adds a camera in the middle, and the lamp.
fn write(path: &Path, shape: &Shape, mut nodes: Vec<Value>, lamp: &Lamp) -> io::Result<()> {
    nodes.push(json!({ "name": "middle", "camera": 0 }));
    nodes.push(json!({
        "name": "lamp", "translation": lamp.position, "extensions": { "KHR_lights_punctual": { "light": 0 } },
    }));
    let (vertices, indices) = (shape.positions.len(), shape.indices.len());
    let (low, high) = shape.positions.iter().fold((Vec3::MAX, Vec3::MIN), |(l, h), &p| (l.min(p), h.max(p)));
    let parts: [&[u8]; 3] = [
        bytemuck::cast_slice(&shape.positions),
        bytemuck::cast_slice(&shape.normals),
        bytemuck::cast_slice(&shape.indices),
    ];
    let view = |i: usize| {
        let before: usize = parts[..i].iter().map(|part| part.len()).sum();
        json!({ "buffer": 0, "byteOffset": before, "byteLength": parts[i].len() })
    };
    let total: usize = parts.iter().map(|part| part.len()).sum();
    let roots: Vec<usize> = (0..nodes.len()).collect();
    let document = json!({
        "asset": { "version": "2.0", "generator": "fovea-benches" },
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": lamp.candelas }] } },
        "buffers": [{ "byteLength": total }],
        "bufferViews": [view(0), view(1), view(2)],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": vertices, "min": low.to_array(), "max": high.to_array() },
            { "bufferView": 1, "componentType": 5126, "type": "VEC3", "count": vertices },
            { "bufferView": 2, "componentType": 5125, "type": "SCALAR", "count": indices },
        ],
        "materials": [{ "name": "chalk", "doubleSided": true, "pbrMetallicRoughness": { "metallicFactor": 0.0, "baseColorFactor": [0.7, 0.7, 0.7, 1.0] } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "NORMAL": 1 }, "indices": 2, "material": 0 }] }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.01 } }],
        "nodes": nodes,
        "scene": 0,
        "scenes": [{ "nodes": roots }],
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let word = |value: usize| {
        u32::try_from(value).map(u32::to_le_bytes).map_err(|_| io::Error::other("a .glb cannot have 4 GiB"))
    };
    let mut file = BufWriter::new(File::create(path)?);
    file.write_all(b"glTF")?;
    for value in [2, 12 + 8 + text.len() + 8 + total, text.len(), 0x4E4F_534A] {
        file.write_all(&word(value)?)?;
    }
    file.write_all(&text)?;
    for value in [total, 0x004E_4942] {
        file.write_all(&word(value)?)?;
    }
    for part in parts {
        file.write_all(part)?;
    }
    file.flush()
}
