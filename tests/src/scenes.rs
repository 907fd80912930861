//! Scenes made in code.

use std::sync::Arc;

use glam::{Affine3A, DVec3, Vec2, Vec3, Vec4};
use tracer::scene::{
    Backdrop, ContentHash, Environment, EnvironmentImage, Instance, Material, Mesh, PunctualLight, Scene,
    TexelEncoding, Texture, TextureRef, WrapMode,
};

/// A scene under construction.
#[derive(Debug)]
pub struct Builder(Scene);

/// A Lambertian material: no specular lobe.
pub fn lambert(albedo: Vec3) -> Material {
    Material { base_color: albedo.extend(1.0), metallic: 0.0, specular: 0.0, ..Default::default() }
}

/// A black material that emits this radiance from its front.
pub fn emitter(radiance: Vec3) -> Material {
    Material { emission: radiance, ..lambert(Vec3::ZERO) }
}

/// An environment image of one radiance everywhere: unlike a constant environment it is sampled as a light.
pub fn even_image(radiance: f32) -> Environment {
    image(16, 8, vec![[radiance; 3]; 16 * 8])
}

/// An environment image turned by 20 degrees.
pub fn image(width: u32, height: u32, pixels: Vec<[f32; 3]>) -> Environment {
    let hash = ContentHash::of(&[bytemuck::cast_slice(&pixels)]);
    let image = Arc::new(EnvironmentImage { width, height, pixels, hash });
    Environment::Image { image, rotation_deg: 20.0, intensity: 1.0 }
}

/// Points and triangles of a unit sphere.
fn sphere(rings: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let columns = 2 * rings;
    let point = |row: u32, column: u32| {
        let (sin_lat, cos_lat) = (std::f32::consts::PI * row as f32 / rings as f32).sin_cos();
        let (sin_lon, cos_lon) = (std::f32::consts::TAU * (column % columns) as f32 / columns as f32).sin_cos();
        Vec3::new(cos_lon * sin_lat, cos_lat, sin_lon * sin_lat)
    };
    let mut positions = Vec::new();
    for row in 0..=rings {
        positions.extend((0..columns).map(|column| point(row, column)));
    }
    let at = |row: u32, column: u32| row * columns + column % columns;
    let mut triangles = Vec::new();
    for row in 0..rings {
        for column in 0..columns {
            let [a, b, c, d] = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
            if row > 0 {
                triangles.push([a, b, c]);
            }
            if row + 1 < rings {
                triangles.push([a, c, d]);
            }
        }
    }
    (positions, triangles)
}

impl Builder {
    /// Nothing but a constant environment.
    pub fn new(environment: Vec3) -> Self {
        Self(Scene {
            name: "made in code".into(),
            meshes: Vec::new(),
            textures: Vec::new(),
            materials: Vec::new(),
            instances: Vec::new(),
            lights: Vec::new(),
            cameras: Vec::new(),
            environment: Environment::Constant(environment),
            backdrop: Backdrop::default(),
            origin_in_file: DVec3::ZERO,
        })
    }

    /// Adds a material.
    pub fn material(&mut self, material: Material) -> u32 {
        self.0.materials.push(Arc::new(material));
        self.0.materials.len() as u32 - 1
    }

    /// Adds a texture and returns a reference to it, unfiltered and repeated.
    pub fn texture(&mut self, width: u32, encoding: TexelEncoding, texels: Vec<[u8; 4]>) -> TextureRef {
        let height = texels.len() as u32 / width;
        let hash = ContentHash::of(&[&width.to_le_bytes(), bytemuck::cast_slice(&texels)]);
        self.0.textures.push(Arc::new(Texture { name: String::new(), width, height, texels, encoding, hash }));
        TextureRef {
            texture: self.0.textures.len() as u32 - 1,
            uv_set: 0,
            texture_from_uv: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            wrap: [WrapMode::Repeat; 2],
            linear_filter: false,
        }
    }

    /// Adds a mesh of separate triangles with flat normals; corners' texture coordinates are as given, or (0, 0).
    pub fn triangles(&mut self, corners: &[[Vec3; 3]], uvs: &[[Vec2; 3]]) -> u32 {
        let positions: Vec<Vec3> = corners.iter().flatten().copied().collect();
        let normals = corners
            .iter()
            .flat_map(|[a, b, c]| [(*b - *a).cross(*c - *a).try_normalize().unwrap_or(Vec3::Y); 3])
            .collect();
        let uv: Vec<Vec2> = uvs.iter().flatten().copied().collect();
        let triangles = (0..corners.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        self.add(positions, normals, uv, triangles)
    }

    /// Adds a sphere of unit radius with smooth normals, `rings` from pole to pole.
    pub fn sphere(&mut self, rings: u32) -> u32 {
        let (positions, triangles) = sphere(rings);
        self.add(positions.clone(), positions, Vec::new(), triangles)
    }

    /// Adds the same triangles with flat normals.
    pub fn faceted_sphere(&mut self, rings: u32) -> u32 {
        let (positions, triangles) = sphere(rings);
        let corners: Vec<[Vec3; 3]> = triangles.iter().map(|t| t.map(|v| positions[v as usize])).collect();
        self.triangles(&corners, &[])
    }

    fn add(&mut self, positions: Vec<Vec3>, normals: Vec<Vec3>, uv: Vec<Vec2>, triangles: Vec<[u32; 3]>) -> u32 {
        let hash = ContentHash::of(&[
            bytemuck::cast_slice(&positions),
            bytemuck::cast_slice(&normals),
            bytemuck::cast_slice(&uv),
            bytemuck::cast_slice(&triangles),
        ]);
        self.0.meshes.push(Arc::new(Mesh {
            name: String::new(),
            positions,
            normals,
            tangents: Vec::new(),
            uvs: [uv, Vec::new()],
            colors: Vec::<Vec4>::new(),
            triangles,
            hash,
        }));
        self.0.meshes.len() as u32 - 1
    }

    /// Places a mesh.
    pub fn place(&mut self, mesh: u32, material: u32, world_from_mesh: Affine3A) {
        let node = self.0.instances.len() as u32;
        self.0.instances.push(Instance { name: String::new(), mesh, material, world_from_mesh, visible: true, node });
    }

    /// Adds and places a parallelogram; its front is on the side of `edge_1 x edge_2`, texture coordinates run 0..1.
    pub fn quad(&mut self, corner: Vec3, edge_1: Vec3, edge_2: Vec3, material: u32) {
        let [a, b, c, d] = [corner, corner + edge_1, corner + edge_1 + edge_2, corner + edge_2];
        let uv = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        let mesh = self.triangles(&[[a, b, c], [a, c, d]], &[[uv[0], uv[1], uv[2]], [uv[0], uv[2], uv[3]]]);
        self.place(mesh, material, Affine3A::IDENTITY);
    }

    /// Adds the inside of a box: six quads whose fronts look inwards, in the order -x, +x, -y, +y, -z, +z.
    pub fn room(&mut self, low: Vec3, high: Vec3, materials: [u32; 6]) {
        let s = high - low;
        let (x, y, z) = (Vec3::X * s.x, Vec3::Y * s.y, Vec3::Z * s.z);
        self.quad(low, y, z, materials[0]);
        self.quad(low + x, z, y, materials[1]);
        self.quad(low, z, x, materials[2]);
        self.quad(low + y, x, z, materials[3]);
        self.quad(low, x, y, materials[4]);
        self.quad(low + z, y, x, materials[5]);
    }

    /// Adds a punctual light.
    pub fn light(&mut self, light: PunctualLight) {
        self.0.lights.push(light);
    }

    /// The scene.
    pub fn build(self) -> Scene {
        self.0
    }
}

/// One tiny triangle a kilometre above, in a constant environment: nothing to trace.
pub fn empty(environment: Vec3) -> Scene {
    let mut builder = Builder::new(environment);
    let material = builder.material(lambert(Vec3::ONE));
    let corner = Vec3::Y * 1000.0;
    let mesh = builder.triangles(&[[corner, corner + Vec3::X * 1e-3, corner + Vec3::Z * 1e-3]], &[]);
    builder.place(mesh, material, Affine3A::IDENTITY);
    builder.build()
}

/// A closed room with checkered walls, a coloured floor and a lamp under the ceiling; the origin is inside.
pub fn textured_room() -> Scene {
    let mut builder = Builder::new(Vec3::ZERO);
    let texels = (0..64).map(|i| if (i % 8 + i / 8) % 2 == 0 { [240, 200, 160, 255] } else { [40, 60, 90, 255] });
    let checkers = builder.texture(8, TexelEncoding::Srgb, texels.collect());
    let walls = builder.material(Material { base_color_texture: Some(checkers), ..lambert(Vec3::ONE) });
    let floor = builder.material(Material { roughness: 0.6, specular: 1.0, ..lambert(Vec3::new(0.6, 0.5, 0.4)) });
    let ceiling = builder.material(lambert(Vec3::splat(0.8)));
    let lamp = builder.material(emitter(Vec3::splat(4.0)));
    builder.room(Vec3::new(-2.0, -1.2, -3.0), Vec3::new(2.5, 1.8, 2.0), [walls, walls, floor, ceiling, walls, walls]);
    builder.quad(Vec3::new(-0.8, 1.75, -1.6), Vec3::X * 1.6, Vec3::Z * 1.2, lamp);
    builder.build()
}

/// Under an even sky: a checkered floor, two walls, a rough metal sphere and a Lambertian one; the origin is in the middle.
pub fn terrace() -> Scene {
    let mut builder = Builder::new(Vec3::new(0.8, 0.9, 1.0));
    let texels = (0..64).map(|i| if (i % 8 + i / 8) % 2 == 0 { [200, 200, 190, 255] } else { [120, 90, 80, 255] });
    let checkers = builder.texture(8, TexelEncoding::Srgb, texels.collect());
    let floor = builder.material(Material { base_color_texture: Some(checkers), ..lambert(Vec3::ONE) });
    let wall = builder.material(lambert(Vec3::new(0.7, 0.4, 0.3)));
    let metal = builder.material(Material {
        base_color: Vec3::new(0.9, 0.8, 0.6).extend(1.0),
        roughness: 0.4,
        ..Default::default()
    });
    builder.quad(Vec3::new(-6.0, -1.5, -6.0), Vec3::Z * 12.0, Vec3::X * 12.0, floor);
    builder.quad(Vec3::new(-4.0, -1.5, -5.0), Vec3::X * 5.0, Vec3::Y * 4.0, wall);
    builder.quad(Vec3::new(4.0, -1.5, 5.0), Vec3::X * -6.0, Vec3::Y * 3.0, wall);
    let sphere = builder.sphere(24);
    builder.place(sphere, metal, Affine3A::from_translation(Vec3::new(0.5, -0.5, 3.0)));
    builder.place(sphere, wall, Affine3A::from_translation(Vec3::new(-3.0, -0.4, 1.0)));
    builder.build()
}
