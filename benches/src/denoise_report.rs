//! `denoise-report OUT_DIR WORK_DIR PYTHON SCENE...`: what the reconstruction of a view is worth, in FLIP against samples and seconds.
//!
//! One looks at the middle of a view of 640x360 pixels before the usual monitor, in FV. At counts of samples that double, the view is
//! shown as the film has it, with holes filled, guided, and by Intel's Open Image Denoise (PyPI `pyoidn` for PYTHON, with `numpy`),
//! and compared with a reference in the foveal disc and outside. WORK_DIR keeps references and pictures; references that are
//! there are not rendered again. Writes `denoise.json` (raw numbers) and `denoise.md` (tables).

use std::{
    path::{Path, PathBuf},
    process::{Command, ExitCode},
    sync::Arc,
    time::Instant,
};

use fovea_app::commands::study::flip::Prepared;
use fovea_benches::{AnyError, Subject, report_main};
use fovea_sampler::{Angle, Geometry, Inverse, RadialDistribution, Reddy2001};
use glam::{Quat, Vec2, Vec3};
use serde_json::{Value, json};
use tracer::{
    distribution::{Distribution, Gaze, View},
    film::FilmOptions,
    gpu::{AdapterSelect, Gpu},
    provenance::Provenance,
    renderer::{FilmPose, Renderer, RendererOptions, SequenceKind, StopCondition},
    view::{DebugView, ToneMap, ViewProjection, ViewSettings},
};

#[path = "denoise_report/pfm.rs"]
mod pfm;
#[path = "denoise_report/tables.rs"]
mod tables;

/// Pixels of the view that is judged, and of the one whose cost is measured.
const SIZE: [u32; 2] = [640, 360];
const TIMED_SIZE: [u32; 2] = [1280, 720];
/// The view's height, degrees.
const VFOV_DEG: f32 = 45.0;
/// Half width and half height of the usual monitor over the viewing distance.
const SCREEN: Vec2 = Vec2::new(265.5 / 650.0, 149.5 / 650.0);
/// Radius of the foveal disc at the eye, degrees.
const FOVEA_DEG: f32 = 5.79;
/// Samples a pixel of the reference, and in the film at each look.
const REFERENCE_SPP: u64 = 128;
const COUNTS: [u64; 7] = [1 << 15, 1 << 16, 1 << 17, 1 << 18, 1 << 19, 1 << 20, 1 << 21];
/// Mean luminance that the reference is exposed to before it is encoded and clipped at 1.
const EXPOSED_MEAN: f64 = 0.3;
/// Presentations whose median is taken.
const TIMED: usize = 7;
/// How the same film is shown.
const METHODS: [&str; 4] = ["raw", "filled", "guided", "oidn"];

fn main() -> ExitCode {
    report_main(run)
}

fn run(args: &[String]) -> Result<(), AnyError> {
    let [out, work, python, files @ ..] = args else {
        return Err("usage: denoise-report OUT_DIR WORK_DIR PYTHON SCENE...".into());
    };
    let (out, work) = (Path::new(out), Path::new(work));
    std::fs::create_dir_all(work)?;
    let gpu = Gpu::headless(&AdapterSelect::Auto)?;
    let mut scenes = Vec::new();
    for file in files {
        scenes.push(Bench::open(&gpu, Path::new(file), work)?.measure(python)?);
    }
    let provenance = Provenance::on(&gpu);
    let machine: serde_json::Map<_, _> =
        provenance.fields().into_iter().map(|(name, value)| (name.into(), value.into())).collect();
    let raw = json!({
        "machine": machine,
        "view": SIZE,
        "vfov_deg": VFOV_DEG,
        "reference_spp": REFERENCE_SPP,
        "load": std::fs::read_to_string("/proc/loadavg").unwrap_or_default().split_whitespace().next(),
        "scenes": scenes,
    });
    std::fs::create_dir_all(out)?;
    std::fs::write(out.join("denoise.json"), format!("{raw:#}\n"))?;
    std::fs::write(out.join("denoise.md"), tables::page(&raw))?;
    Ok(())
}

struct Bench {
    gpu: Gpu,
    name: String,
    work: PathBuf,
    view: View,
    renderer: Renderer,
    inverse: Arc<Inverse>,
    world_from_film: Quat,
}

impl Bench {
    fn open(gpu: &Gpu, file: &Path, work: &Path) -> Result<Self, AnyError> {
        let Subject { name, scene, pose } = Subject::open(Some(file))?;
        eprintln!("{name} ...");
        let camera = scene.cameras.iter().find(|camera| camera.position == pose.position);
        let world_from_film = camera.map_or(Quat::IDENTITY, |camera| camera.rotation);
        let vfov = VFOV_DEG.to_radians();
        let half_height = (0.5 * vfov).tan();
        let hfov = 2.0 * (half_height * SIZE[0] as f32 / SIZE[1] as f32).atan();
        let view = View::new(world_from_film, hfov, vfov);
        let radial = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002)?;
        let inverse = Arc::new(Inverse::default_for(&radial));
        let options =
            RendererOptions { film: FilmOptions::perspective(SIZE[0], SIZE[1], vfov), ..RendererOptions::default() };
        let mut renderer = Renderer::new(gpu, &options, Distribution::omnidirectional(Arc::clone(&inverse)))?;
        renderer.set_scene(&scene)?;
        renderer.set_pose(FilmPose { position: pose.position, world_from_film });
        Ok(Self { gpu: gpu.clone(), name, work: work.to_owned(), view, renderer, inverse, world_from_film })
    }

    fn measure(mut self, python: &str) -> Result<Value, AnyError> {
        let reference = self.reference()?;
        let mean = reference.iter().map(|texel| luminance(*texel)).sum::<f64>() / reference.len() as f64;
        let exposure = EXPOSED_MEAN / mean.max(1e-9);
        let gaze = Gaze::Eye { on_screen: Vec2::ZERO, screen_half_extent: SCREEN, view: self.view };
        self.renderer.set_distribution(Distribution::foveated(gaze, None, Arc::clone(&self.inverse)))?;
        self.renderer.set_randomness(1, SequenceKind::Sobol);
        let hits_secs = self.write_guides()?;
        // And the first samples theirs.
        self.renderer.trace(1)?;
        self.renderer.restart_clean();
        let mut seconds = 0.0;
        let mut looks = Vec::new();
        for count in COUNTS {
            seconds += self.renderer.render(StopCondition::Samples(count), |_| true)?;
            let shown = |denoise, fill| self.settings(SIZE, denoise, fill);
            let [raw, filled, guided] = [shown(false, false), shown(false, true), shown(true, true)];
            let raw = self.radiance(&raw)?;
            let filled = self.radiance(&filled)?;
            let guided = self.radiance(&guided)?;
            // A denoiser cannot know a hole from a black pixel.
            let noisy: Vec<[f32; 3]> =
                raw.iter().zip(&filled).map(|(raw, filled)| rgb(if raw[3] > 0.0 { *raw } else { *filled })).collect();
            pfm::write(&self.path(&format!("{count}.color")), SIZE, &noisy)?;
            for (method, texels) in METHODS.iter().zip([&raw, &filled, &guided]) {
                let texels: Vec<[f32; 3]> = texels.iter().map(|texel| rgb(*texel)).collect();
                pfm::write(&self.path(&format!("{count}.{method}")), SIZE, &texels)?;
            }
            looks.push((count, seconds));
        }
        let oidn_secs = self.run_oidn(python)?;
        let reference_encoded = Prepared::new(&encoded(&reference, exposure), SIZE[0] as usize);
        let mut rows = Vec::new();
        for (count, seconds) in looks {
            let mut row = json!({ "samples": count, "seconds": seconds });
            for method in METHODS {
                let texels = encoded(&pfm::read(&self.path(&format!("{count}.{method}")), SIZE)?, exposure);
                image_png(&self.path(&format!("{count}.{method}.png")), &texels)?;
                let [fovea, periphery] =
                    split(&Prepared::new(&texels, SIZE[0] as usize).difference(&reference_encoded));
                row[method] = json!({ "fovea": fovea, "periphery": periphery });
            }
            rows.push(row);
        }
        image_png(&self.path("reference.png"), &encoded(&reference, exposure))?;
        let present = self.present_seconds()?;
        Ok(json!({
            "scene": self.name,
            "exposure": exposure,
            "first_hits_seconds": hits_secs,
            "oidn_seconds": oidn_secs,
            "present_seconds_1280x720": present,
            "looks": rows,
        }))
    }

    fn path(&self, what: &str) -> PathBuf {
        let ending = if what.ends_with(".png") { "" } else { ".pfm" };
        self.work.join(format!("{}.{what}{ending}", self.name))
    }

    fn reference(&mut self) -> Result<Vec<[f32; 3]>, AnyError> {
        let path = self.path("reference");
        if path.exists() {
            return pfm::read(&path, SIZE);
        }
        let region = Distribution::region(
            self.view,
            &self.renderer.options().film,
            self.world_from_film,
            Arc::clone(&self.inverse),
        );
        self.renderer.set_distribution(region)?;
        self.renderer.set_randomness(77, SequenceKind::Sobol);
        let samples = REFERENCE_SPP * u64::from(SIZE[0] * SIZE[1]);
        self.renderer.render(StopCondition::Samples(samples), |_| true)?;
        let settings = self.settings(SIZE, false, false);
        let texels: Vec<_> = self.radiance(&settings)?.into_iter().map(rgb).collect();
        pfm::write(&path, SIZE, &texels)?;
        Ok(texels)
    }

    /// First hits of the judged view as pictures for the other denoiser; seconds for those of the larger view.
    fn write_guides(&mut self) -> Result<f64, AnyError> {
        // The first ray compiles the kernel.
        self.find_hits()?;
        let large = self.settings(TIMED_SIZE, true, true);
        let started = Instant::now();
        while !self.renderer.trace_first_hits(&large, 1 << 15)? {}
        let seconds = started.elapsed().as_secs_f64();
        self.find_hits()?;
        let hits = self.renderer.first_hits()?;
        let albedo: Vec<[f32; 3]> =
            hits.iter().map(|hit| if hit.depth > 0.0 { hit.albedo.map(|a| a.min(1.0)) } else { [1.0; 3] }).collect();
        let normal: Vec<[f32; 3]> = hits.iter().map(|hit| hit.world_normal().to_array()).collect();
        pfm::write(&self.path("albedo"), SIZE, &albedo)?;
        pfm::write(&self.path("normal"), SIZE, &normal)?;
        Ok(seconds)
    }

    fn find_hits(&mut self) -> Result<(), AnyError> {
        let settings = self.settings(SIZE, true, true);
        while !self.renderer.trace_first_hits(&settings, 1 << 15)? {}
        Ok(())
    }

    fn run_oidn(&self, python: &str) -> Result<f64, AnyError> {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/peers/with_oidn.py");
        let output = Command::new(python).arg(script).arg(&self.work).arg(&self.name).output()?;
        if !output.status.success() {
            return Err(String::from_utf8_lossy(&output.stderr).into_owned().into());
        }
        Ok(String::from_utf8_lossy(&output.stdout).trim().parse()?)
    }

    fn settings(&self, size: [u32; 2], denoise: bool, fill: bool) -> ViewSettings {
        ViewSettings {
            projection: ViewProjection::Perspective(self.view),
            size,
            exposure_ev: 0.0,
            tone_map: ToneMap::AgX,
            debug_view: DebugView::Beauty,
            fill,
            denoise,
            ring: None,
        }
    }

    /// The view as it is shown, linear.
    fn radiance(&mut self, settings: &ViewSettings) -> Result<Vec<[f32; 4]>, AnyError> {
        if settings.denoise {
            while !self.renderer.trace_first_hits(settings, 1 << 15)? {}
        }
        self.present(settings)?;
        Ok(self.renderer.presented_radiance()?.1)
    }

    /// Presents once and waits; the seconds that it took.
    fn present(&mut self, settings: &ViewSettings) -> Result<f64, AnyError> {
        let format = wgpu::TextureFormat::Rgba8Unorm;
        let target = self.gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture"),
            size: wgpu::Extent3d { width: settings.size[0], height: settings.size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            view_formats: &[],
        });
        let started = Instant::now();
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.renderer.present(&mut encoder, settings, &target.create_view(&Default::default()), format)?;
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.wait()?;
        Ok(started.elapsed().as_secs_f64())
    }

    /// Medians with holes filled and guided, in turn.
    fn present_seconds(&mut self) -> Result<Value, AnyError> {
        let [filled, guided] = [false, true].map(|denoise| self.settings(TIMED_SIZE, denoise, true));
        let mut times = [Vec::new(), Vec::new()];
        for round in 0..=TIMED {
            for (settings, times) in [filled, guided].iter().zip(&mut times) {
                if settings.denoise {
                    // What is made once for a view is made before.
                    while !self.renderer.trace_first_hits(settings, 1 << 15)? {}
                    self.present(settings)?;
                }
                let seconds = self.present(settings)?;
                // The first round makes buffers and pipelines.
                if round > 0 {
                    times.push(seconds);
                }
            }
        }
        let [filled, guided] = times.map(|mut times| {
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        });
        Ok(json!({ "filled": filled, "guided": guided }))
    }
}

fn rgb([r, g, b, _]: [f32; 4]) -> [f32; 3] {
    [r, g, b]
}

fn luminance([r, g, b]: [f32; 3]) -> f64 {
    f64::from(Vec3::new(r, g, b).dot(Vec3::new(0.2126, 0.7152, 0.0722)))
}

/// Exposed, clipped at 1, and encoded by sRGB.
fn encoded(texels: &[[f32; 3]], exposure: f64) -> Vec<[u8; 3]> {
    let channel = |value: f32| {
        let c = (f64::from(value) * exposure).clamp(0.0, 1.0);
        let encoded = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
        (255.0 * encoded).round() as u8
    };
    texels.iter().map(|texel| texel.map(channel)).collect()
}

/// Means in the foveal disc about the middle of the screen and outside.
fn split(differences: &[f64]) -> [f64; 2] {
    let mut sums = [(0.0, 0u32); 2];
    for (index, difference) in differences.iter().enumerate() {
        let pixel = Vec2::new((index as u32 % SIZE[0]) as f32 + 0.5, (index as u32 / SIZE[0]) as f32 + 0.5);
        let on_screen = (pixel / Vec2::new(SIZE[0] as f32, SIZE[1] as f32) * 2.0 - 1.0) * SCREEN;
        let side = usize::from(on_screen.length() > FOVEA_DEG.to_radians().tan());
        sums[side].0 += difference;
        sums[side].1 += 1;
    }
    sums.map(|(sum, count)| sum / f64::from(count.max(1)))
}

fn image_png(path: &Path, texels: &[[u8; 3]]) -> Result<(), AnyError> {
    let opaque: Vec<[u8; 4]> = texels.iter().map(|&[r, g, b]| [r, g, b, 255]).collect();
    Ok(fovea_app::output::png::write(path, SIZE[0], SIZE[1], &opaque)?)
}
