//! A small writer of binary glTF: shapes, PNG textures, materials, nodes and cameras into one file.

use glam::{Mat3, Quat, Vec3};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde_json::{Value, json};

use super::paint::Picture;
use super::shape::{Shape, Soup, sin_cos};

/// The accessors of a shape.
#[derive(Clone)]
pub(super) struct Part {
    attributes: Value,
    indices: usize,
}

/// Where something stands: position, turn about +Y (in turns) and size.
#[derive(Clone, Copy)]
pub(super) struct Spot {
    pub(super) at: Vec3,
    pub(super) rotation: Quat,
    pub(super) scale: Vec3,
}

impl Spot {
    pub(super) fn new(x: f32, y: f32, z: f32) -> Self {
        Self { at: Vec3::new(x, y, z), rotation: Quat::IDENTITY, scale: Vec3::ONE }
    }

    pub(super) fn turned(self, turns: f32) -> Self {
        self.rotated(Vec3::Y, turns)
    }

    pub(super) fn rotated(self, axis: Vec3, turns: f32) -> Self {
        let (sin, cos) = sin_cos(turns / 2.0);
        let turn = Quat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos);
        Self { rotation: self.rotation * turn, ..self }
    }

    pub(super) fn scaled(self, x: f32, y: f32, z: f32) -> Self {
        Self { scale: Vec3::new(x, y, z), ..self }
    }
}

#[derive(Default)]
pub(super) struct Builder {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    images: Vec<Value>,
    textures: Vec<Value>,
    materials: Vec<Value>,
    meshes: Vec<Value>,
    cameras: Vec<Value>,
    nodes: Vec<Value>,
}

fn rounded(values: &[f32]) -> Value {
    values.iter().map(|v| json!((f64::from(*v) * 1e5).round() / 1e5)).collect()
}

impl Builder {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteLength": bytes.len(), "byteOffset": self.bin.len()}));
        self.bin.extend_from_slice(bytes);
        self.views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], kind: &str, component: u32, count: usize) -> usize {
        let view = self.view(bytes);
        self.accessors.push(json!({"bufferView": view, "componentType": component, "count": count, "type": kind}));
        self.accessors.len() - 1
    }

    /// Stores a shape with smooth normals below 40 degrees; texture coordinates only when they are used.
    pub(super) fn part(&mut self, soup: &Soup, is_textured: bool) -> Part {
        const FLOAT: u32 = 5126;
        let Shape { positions, normals, uvs, indices } = soup.finish(40.0);
        let count = positions.len();
        let position = self.accessor(bytemuck::cast_slice(&positions), "VEC3", FLOAT, count);
        let (low, high) = positions.iter().fold((Vec3::MAX, Vec3::MIN), |(l, h), &p| (l.min(p), h.max(p)));
        self.accessors[position]["min"] = json!(low.to_array());
        self.accessors[position]["max"] = json!(high.to_array());
        let normal = self.accessor(bytemuck::cast_slice(&normals), "VEC3", FLOAT, count);
        let mut attributes = json!({"NORMAL": normal, "POSITION": position});
        if is_textured {
            attributes["TEXCOORD_0"] = json!(self.accessor(bytemuck::cast_slice(&uvs), "VEC2", FLOAT, count));
        }
        let indices = if count <= usize::from(u16::MAX) {
            let short: Vec<u16> = indices.iter().map(|&i| i as u16).collect();
            self.accessor(bytemuck::cast_slice(&short), "SCALAR", 5123, short.len())
        } else {
            self.accessor(bytemuck::cast_slice(&indices), "SCALAR", 5125, indices.len())
        };
        Part { attributes, indices }
    }

    pub(super) fn material(&mut self, name: &str, mut definition: Value) -> usize {
        definition["name"] = json!(name);
        self.materials.push(definition);
        self.materials.len() - 1
    }

    /// Adds a picture as a PNG and returns its texture.
    pub(super) fn texture(&mut self, name: &str, picture: &Picture) -> usize {
        let mut png = Vec::new();
        let color = if picture.channels == 1 { ExtendedColorType::L8 } else { ExtendedColorType::Rgb8 };
        PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::Adaptive)
            .write_image(&picture.bytes, picture.width, picture.height, color)
            .expect("writing to memory cannot fail, and the sizes fit");
        let view = self.view(&png);
        self.images.push(json!({"bufferView": view, "mimeType": "image/png", "name": name}));
        self.textures.push(json!({"source": self.images.len() - 1}));
        self.textures.len() - 1
    }

    pub(super) fn mesh(&mut self, name: &str, parts: &[(&Part, usize)]) -> usize {
        let primitive = |(part, material): &(&Part, usize)| json!({"attributes": part.attributes, "indices": part.indices, "material": material});
        let primitives: Vec<Value> = parts.iter().map(primitive).collect();
        self.meshes.push(json!({"name": name, "primitives": primitives}));
        self.meshes.len() - 1
    }

    pub(super) fn place(&mut self, name: &str, mesh: usize, spot: Spot) {
        let mut node = json!({"mesh": mesh, "name": name, "translation": rounded(&spot.at.to_array())});
        if spot.rotation != Quat::IDENTITY {
            node["rotation"] = rounded(&spot.rotation.to_array());
        }
        if spot.scale != Vec3::ONE {
            node["scale"] = rounded(&spot.scale.to_array());
        }
        self.nodes.push(node);
    }

    /// A shape that occurs once, where it was modelled.
    pub(super) fn fixture(&mut self, name: &str, soup: &Soup, material: usize, is_textured: bool) {
        let part = self.part(soup, is_textured);
        let mesh = self.mesh(name, &[(&part, material)]);
        self.place(name, mesh, Spot::new(0.0, 0.0, 0.0));
    }

    pub(super) fn camera(&mut self, name: &str, eye: Vec3, target: Vec3, yfov: f32) {
        self.cameras.push(json!({
            "name": name,
            "perspective": {"aspectRatio": 16.0 / 9.0, "yfov": f64::from(yfov), "znear": 0.01},
            "type": "perspective",
        }));
        let back = (eye - target).normalize();
        let right = Vec3::Y.cross(back).normalize();
        let rotation = Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back));
        self.nodes.push(json!({
            "camera": self.cameras.len() - 1,
            "name": name,
            "rotation": rounded(&rotation.to_array()),
            "translation": rounded(&eye.to_array()),
        }));
    }

    pub(super) fn finish(mut self) -> Vec<u8> {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let roots: Vec<usize> = (0..self.nodes.len()).collect();
        let document = json!({
            "accessors": self.accessors,
            "asset": {"generator": "make_builtin_scene", "version": "2.0"},
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.bin.len()}],
            "cameras": self.cameras,
            "extensionsUsed": super::materials::EXTENSIONS,
            "images": self.images,
            "materials": self.materials,
            "meshes": self.meshes,
            "nodes": self.nodes,
            "scene": 0,
            "scenes": [{"name": "Room", "nodes": roots}],
            "textures": self.textures,
        });
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + text.len() + 8 + self.bin.len();
        let mut file = Vec::with_capacity(total);
        file.extend_from_slice(b"glTF");
        for word in [2, total as u32, text.len() as u32, 0x4E4F_534A] {
            file.extend_from_slice(&word.to_le_bytes());
        }
        file.extend_from_slice(&text);
        for word in [self.bin.len() as u32, 0x004E_4942] {
            file.extend_from_slice(&word.to_le_bytes());
        }
        file.extend_from_slice(&self.bin);
        file
    }
}
