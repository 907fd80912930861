//! Comparison with panoramas by Blender Cycles of scenes whose materials are not all Lambertian.
//!
//! Blender's principled material and glTF's differ where light is transmitted, under a clearcoat and on metals. Pixels whose first
//! hit is one of these are masked; the masks are committed, and the claims are about the other pixels.

use std::{path::PathBuf, sync::Arc};

use glam::{Quat, Vec3};
use tracer::{
    distribution::Distribution,
    film::{FilmOptions, FilmSnapshot},
    gpu::Gpu,
    renderer::{FilmPose, Renderer, RendererOptions},
    scene::{AlphaMode, Environment, EnvironmentImage, Material, PunctualLight, Scene},
};

use crate::{device, statistics::median};

/// Pixels along a block's side.
pub const BLOCK: usize = 16;
/// Samples a pixel that make a mask.
const MASK_SAMPLES: u64 = 4;
/// Fewest pixels of a block outside the mask that make its mean worth comparing.
const FEWEST_PIXELS: usize = 64;

/// A scene with a reference.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Of the scene and of the reference.
    pub name: &'static str,
    /// In file order.
    pub camera: usize,
    /// Radiance from outside, the same in all channels.
    pub background: f32,
}

/// The scenes in full.
pub const CASES: [Case; 4] = [
    Case { name: "sibenik", camera: 0, background: 1.0 },
    Case { name: "sponza", camera: 2, background: 1.0 },
    Case { name: "classroom", camera: 0, background: 0.0 },
    Case { name: "bmw", camera: 2, background: 1.0 },
];

/// Rec. 709 luminance.
pub fn luminance(rgb: [f64; 3]) -> f64 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

/// Where a committed mask is.
pub fn mask_file(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/masks")).join(format!("{name}.png"))
}

/// A renderer of panoramas of a reference's size.
///
/// # Panics
/// When the film or the scene does not fit the adapter.
pub fn renderer(gpu: &Gpu, case: &Case, scene: &Scene, reference: &EnvironmentImage, max_bounces: u32) -> Renderer {
    let film = FilmOptions::equirect(reference.width, reference.height);
    let options = RendererOptions { film, max_bounces, ..Default::default() };
    let distribution = Distribution::omnidirectional(device::inverse());
    let mut renderer = Renderer::new(gpu, &options, distribution).expect("a small film");
    renderer.set_scene(scene).expect("the scene fits");
    renderer.set_pose(FilmPose { position: scene.cameras[case.camera].position, world_from_film: Quat::IDENTITY });
    renderer
}

/// A scene in which the first hit is all that is seen: 1 where a mask is to be, 0 elsewhere.
fn first_hits(scene: &Scene) -> Scene {
    let differs = |m: &Material| m.transmission > 0.0 || m.clearcoat > 0.0 || m.metallic > 0.0;
    let flag = |m: &Arc<Material>| {
        let emission = if differs(m) { Vec3::ONE } else { Vec3::ZERO };
        // The texture's alpha decides what is hit; its colour is multiplied by 0.
        let has_alpha = m.alpha_mode != AlphaMode::Opaque;
        Arc::new(Material {
            name: m.name.clone(),
            base_color: Vec3::ZERO.extend(m.base_color.w),
            base_color_texture: m.base_color_texture.filter(|_| has_alpha),
            metallic: 0.0,
            specular: 0.0,
            emission,
            alpha_mode: m.alpha_mode,
            double_sided: true,
            ..Default::default()
        })
    };
    let environment = Environment::Constant(Vec3::ZERO);
    let lights: Vec<PunctualLight> = Vec::new();
    Scene { materials: scene.materials.iter().map(flag).collect(), environment, lights, ..scene.clone() }
}

/// Pixels whose first hit is transmissive, clearcoated or metal for any of a few samples.
///
/// # Panics
/// When the device is lost.
pub fn make_mask(gpu: &Gpu, case: &Case, scene: &Scene, reference: &EnvironmentImage) -> Vec<bool> {
    let mut renderer = renderer(gpu, case, &first_hits(scene), reference, 0);
    let samples = MASK_SAMPLES * u64::from(reference.width * reference.height);
    let film = device::trace(&mut renderer, samples).expect("the device stays");
    film.pixels().map(|pixel| pixel.mean[0] > 0.0).collect()
}

/// The committed mask.
///
/// # Panics
/// When there is none.
pub fn committed_mask(name: &str) -> Vec<bool> {
    let file = mask_file(name);
    let image = image::open(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    image.into_luma8().pixels().map(|pixel| pixel.0[0] > 127).collect()
}

/// A block's means over its pixels on one side of the mask.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Ours, linear luminance.
    pub ours: f64,
    /// The reference's.
    pub theirs: f64,
    /// Standard error of the difference.
    pub error: f64,
}

impl Block {
    /// Ours over the reference's, less one.
    pub fn relative(&self) -> f64 {
        self.ours / self.theirs - 1.0
    }

    /// Whether the means differ by at most this share and so many standard errors.
    pub fn is_within(&self, share: f64, errors: f64) -> bool {
        (self.ours - self.theirs).abs() <= share * self.theirs + errors * self.error
    }
}

/// The blocks of a panorama, row by row; `None` where too few pixels are chosen.
pub fn blocks(film: &FilmSnapshot, reference: &EnvironmentImage, chosen: &[bool]) -> Vec<Option<Block>> {
    let (width, height) = (reference.width as usize, reference.height as usize);
    let ours: Vec<_> = film.pixels().collect();
    let theirs = |i: usize| luminance(reference.pixels[i].map(f64::from));
    let block = |number: usize| {
        let (x0, y0) = (number % (width / BLOCK) * BLOCK, number / (width / BLOCK) * BLOCK);
        let inside = (0..BLOCK * BLOCK).map(|i| (y0 + i / BLOCK) * width + x0 + i % BLOCK);
        let pixels: Vec<usize> = inside.filter(|&i| chosen[i] && ours[i].samples > 1).collect();
        if pixels.len() < FEWEST_PIXELS {
            return None;
        }
        let n = pixels.len() as f64;
        let mean = |value: &dyn Fn(usize) -> f64| pixels.iter().map(|&i| value(i)).sum::<f64>() / n;
        let own_variance = mean(&|i| ours[i].variance_of_mean) / n;
        // The reference's noise from second differences along rows, whose median does not see edges: a residual has 1.5
        // times a pixel's variance, and 1.4826 takes a median to a standard deviation.
        let interior = pixels.iter().filter(|&&i| i % BLOCK > 0 && i % BLOCK < BLOCK - 1);
        let residuals: Vec<f64> =
            interior.map(|&i| (theirs(i) - 0.5 * (theirs(i - 1) + theirs(i + 1))).abs()).collect();
        let their_error = 1.4826 * median(&residuals) / 1.5f64.sqrt() / n.sqrt();
        let error = own_variance.sqrt().hypot(their_error);
        Some(Block { ours: mean(&|i| luminance(ours[i].mean)), theirs: mean(&theirs), error })
    };
    (0..width / BLOCK * (height / BLOCK)).map(block).collect()
}
