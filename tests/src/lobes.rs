//! BSDFs evaluated and sampled on the device by the real shader modules, without rays: materials crossed with outgoing
//! directions, in kernels that stand in the place of the path tracer.

use glam::{Affine3A, Vec3};
use tracer::{
    distribution::Distribution,
    film::{FilmOptions, FilmPixel},
    gpu::Gpu,
    kernels::ShaderSources,
    renderer::{Renderer, RendererOptions, SequenceKind},
    scene::{Material, Scene},
};

use crate::{device, plant::instead_of_paths, scenes::Builder};

/// Bins of directions: equal steps of z, from -1 to 1, by equal steps of azimuth; all of the same solid angle.
pub const BINS_Z: u32 = 32;
/// Bins along the azimuth.
pub const BINS_TURN: u32 = 32;
/// All bins.
pub const BINS: u32 = BINS_Z * BINS_TURN;
/// Points a side at which a density is evaluated in each bin.
const POINTS: u32 = 16;

/// An outgoing direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outgoing {
    /// Cosine to the shading normal.
    pub cosine: f32,
    /// Azimuth from the tangent, in turns.
    pub turns: f32,
    /// The ray is inside of the material.
    pub is_inside: bool,
}

/// Materials that are looked at from directions: every pair is a case, numbered by material, then direction.
#[derive(Clone, Debug)]
pub struct Bench {
    /// For messages.
    pub names: Vec<String>,
    /// What is tested.
    pub materials: Vec<Material>,
    /// Whence.
    pub outgoing: Vec<Outgoing>,
    /// Geometric normal; the shading normal is +Z.
    pub geometric: Vec3,
    /// Of the random numbers.
    pub seed: u32,
    /// A texture for the materials, made by the scene's builder.
    pub with_textures: fn(&mut Builder, &mut [Material]),
}

impl Bench {
    /// A bench without textures whose normals agree.
    pub fn new(materials: Vec<(String, Material)>, outgoing: &[Outgoing]) -> Self {
        let (names, materials) = materials.into_iter().unzip();
        Self { names, materials, outgoing: outgoing.to_vec(), geometric: Vec3::Z, seed: 11, with_textures: |_, _| () }
    }

    /// Number of cases.
    pub fn cases(&self) -> u32 {
        (self.materials.len() * self.outgoing.len()) as u32
    }

    /// What a case is.
    pub fn label(&self, case: u32) -> String {
        let (material, direction) = (case as usize / self.outgoing.len(), case as usize % self.outgoing.len());
        let Outgoing { cosine, is_inside, turns } = self.outgoing[direction];
        let side = if is_inside { " inside" } else { "" };
        format!("{}, cosine {cosine}, {turns} turns{side}", self.names[material])
    }

    fn scene(&self) -> Scene {
        // Nothing is lit by it: its radiance sets the range of what the film holds.
        let mut builder = Builder::new(Vec3::splat(4096.0));
        let corner = Vec3::Y * 1000.0;
        let mesh = builder.triangles(&[[corner, corner + Vec3::X * 1e-3, corner + Vec3::Z * 1e-3]], &[]);
        let mut materials = self.materials.clone();
        (self.with_textures)(&mut builder, &mut materials);
        for (i, material) in materials.into_iter().enumerate() {
            let index = builder.material(material);
            builder.place(mesh, index, Affine3A::from_translation(Vec3::X * i as f32));
        }
        builder.build()
    }

    /// Runs `body` for `samples` invocations in all. It sees `case_index`, `part` (the invocation's number in its case),
    /// `u` (three random numbers), `c` (its `bsdf` and `wo`) and sets `radiance` and `pixel` of a film of `columns` by cases.
    ///
    /// # Panics
    /// When the kernel does not compile, or something that it wrote is not finite or beyond the film's range.
    pub fn run(
        &self,
        gpu: &Gpu,
        plant: impl Fn(&ShaderSources) -> ShaderSources,
        (columns, samples): (u32, u32),
        body: &str,
    ) -> Vec<FilmPixel> {
        let film = FilmOptions::equirect(columns, self.cases());
        let options = RendererOptions { film, max_bounces: 0, seed: self.seed, sequence: SequenceKind::Independent };
        let mut renderer =
            Renderer::new(gpu, &options, Distribution::omnidirectional(device::inverse())).expect("a small film");
        let body = format!(
            "    let case_index = index / {samples}u;
    let part = index % {samples}u;
    let u = vec3f(to_unit(independent_u32(index, 0u, batch.seed)), to_unit(independent_u32(index, 1u, batch.seed)),
        to_unit(independent_u32(index, 2u, batch.seed)));
    let c = prepare(case_index);
{body}"
        );
        instead_of_paths(&mut renderer, plant, [IMPORTS, &self.items(), &body]);
        renderer.set_scene(&self.scene()).expect("the kernel compiles");
        let snapshot =
            device::trace(&mut renderer, u64::from(samples) * u64::from(self.cases())).expect("the device answers");
        let statistics = renderer.statistics().expect("the device answers");
        assert_eq!((statistics.non_finite, statistics.clamped), (0, 0), "not finite, or beyond the film's range");
        snapshot.pixels().collect()
    }

    /// Histogram of sampled directions and mean weights: one pixel a bin, `samples` a case. Delta samples are left out.
    pub fn sample(&self, gpu: &Gpu, plant: impl Fn(&ShaderSources) -> ShaderSources, samples: u32) -> Vec<FilmPixel> {
        let body = "    let next = sample_bsdf(c.b, c.wo, u);
    if next.is_valid && !next.is_delta {
        pixel = case_index * BINS + bin_of(next.direction);
        radiance = next.weight;
    }";
        self.run(gpu, plant, (BINS, samples), body)
    }

    /// Mean density, and mean value times cosine (green channel), over each bin.
    pub fn integrate(&self, gpu: &Gpu) -> Vec<FilmPixel> {
        let body = format!(
            "    let bin = part / {count}u;
    let sub = part % {count}u;
    let wi = direction_in_bin(bin, (vec2f(f32(sub % {POINTS}u), f32(sub / {POINTS}u)) + 0.5) / f32({POINTS}u));
    let f = evaluate_bsdf(c.b, c.wo, wi);
    pixel = case_index * BINS + bin;
    radiance = vec3f(f.density, f.value.y, 0.0);",
            count = POINTS * POINTS,
        );
        self.run(gpu, Clone::clone, (BINS, BINS * POINTS * POINTS), &body)
    }

    /// Mean weight of samples, 0 for those that fail: the albedo in each case of the first `channels` channels, a pixel each.
    pub fn furnace(&self, gpu: &Gpu, samples: u32, channels: u32) -> Vec<FilmPixel> {
        let body = format!(
            "    let next = sample_bsdf(c.b, c.wo, u);
    let channel = part % {channels}u;
    pixel = case_index * {channels}u + channel;
    let weight = select(next.weight.x, select(next.weight.y, next.weight.z, channel == 2u), channel > 0u);
    radiance = vec3f(select(0.0, weight, next.is_valid));"
        );
        self.run(gpu, Clone::clone, (channels, samples * channels), &body)
    }

    fn items(&self) -> String {
        let mut directions = String::new();
        for (i, o) in self.outgoing.iter().enumerate() {
            let sine = (1.0 - o.cosine * o.cosine).sqrt();
            let (sin, cos) = (std::f32::consts::TAU * o.turns).sin_cos();
            let inside = u32::from(o.is_inside);
            directions += &format!(
                "    if k == {i}u {{ d = vec4f({:?}, {:?}, {:?}, {inside}.0); }}\n",
                sine * cos,
                sine * sin,
                o.cosine
            );
        }
        let [x, y, z] = self.geometric.normalize().to_array();
        format!(
            "const BINS: u32 = {BINS}u;
const OUTGOING: u32 = {}u;

fn outgoing(k: u32) -> vec4f {{
    var d = vec4f(0.0, 0.0, 1.0, 0.0);
{directions}    return d;
}}

fn surface_of(m: u32, is_back: bool) -> Surface {{
    var s: Surface;
    s.material = m;
    s.is_back = is_back;
    s.geometric_normal = vec3f({x:?}, {y:?}, {z:?});
    s.normal = vec3f(0.0, 0.0, 1.0);
    @if(NORMAL_MAPS) {{
        s.smooth_normal = vec3f(0.0, 0.0, 1.0);
    }}
    @if(NORMAL_MAPS || ANISOTROPY) {{
        s.tangent = vec3f(1.0, 0.0, 0.0);
        s.bitangent = vec3f(0.0, 1.0, 0.0);
    }}
    let material = materials[m];
    s.flags = material.flags;
    s.base_color = material.base_color.xyz;
    s.metallic = material.metallic;
    s.alpha = material.roughness * material.roughness;
    s.specular = material.specular;
    s.specular_color = material.specular_color;
    s.ior = material.ior;
    s.transmission = material.transmission;
    return s;
}}
{HELPERS}",
            self.outgoing.len()
        )
    }
}

const IMPORTS: &str = "import package::path_bindings::materials;
import package::maths::{atan2_turns, cos_sin_turns};
import package::sampler::{independent_u32, to_unit};
import package::scene::surface::Surface;
import package::shading::bsdf::{evaluate_bsdf, sample_bsdf};
import package::shading::layers::shading_frame;
import package::shading::lobes::{Bsdf, make_bsdf};
import package::shading::normal::valid_normal;";

const HELPERS: &str = "
struct Case {
    b: Bsdf,
    wo: vec3f,
}

fn case_of(m: u32, wo_in_world: vec3f, is_back: bool) -> Case {
    let s = surface_of(m, is_back);
    let frame = shading_frame(s, valid_normal(s.geometric_normal, s.normal, wo_in_world));
    var wo = wo_in_world * frame.world_from_local;
    wo.z = max(wo.z, 1e-4);
    return Case(make_bsdf(s, frame, wo, vec3f(1.0)), wo);
}

fn prepare(case_index: u32) -> Case {
    let d = outgoing(case_index % OUTGOING);
    return case_of(case_index / OUTGOING, d.xyz, d.w != 0.0);
}

fn bin_of(w: vec3f) -> u32 {
    let turns = atan2_turns(w.y, w.x);
    let column = min(u32((turns - floor(turns)) * 32.0), 31u);
    return min(u32(clamp(0.5 * w.z + 0.5, 0.0, 1.0) * 32.0), 31u) * 32u + column;
}

fn direction_in_bin(bin: u32, place: vec2f) -> vec3f {
    let z = (f32(bin / 32u) + place.x) / 16.0 - 1.0;
    return vec3f(sqrt(max(0.0, 1.0 - z * z)) * cos_sin_turns((f32(bin % 32u) + place.y) / 32.0), z);
}";
