//! `fovea render`: the same renderer without a window.

use std::io::IsTerminal;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use glam::{Quat, Vec2};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Map, Value, json};
use tracer::distribution::{Distribution, View, film_direction};
use tracer::film::{FilmMapping, FilmOptions, FilmSnapshot};
use tracer::gpu::{AdapterSelect, Gpu};
use tracer::renderer::{FilmPose, RenderStatistics, Renderer, RendererOptions, SceneReport, Schedule, StopCondition};
use tracer::scene::Scene;
use tracer::view::{ViewProjection, ViewSettings};

use super::{edits, print_json};
use crate::cli::choices::{Clip, EccentricityAt, Mode, Orient, Switch};
use crate::cli::values::{FilmShape, ViewAngles};
use crate::cli::{RenderArgs, StopArgs};
use crate::output::exr::{self, FilmFile};
use crate::output::{ImageFormat, check_writable, png};
use crate::readback;
use crate::sampling::{Aim, GazePoint};
use crate::session::{self, Loaded, Source, Viewpoint};
use crate::settings::RunSettings;
use crate::tev::{TevLink, TevPicture};
use crate::view::direction;
use follow::Step;

pub(super) mod follow;
mod resume;

/// Samples a film pixel unless told otherwise.
const DEFAULT_SPP: u64 = 16;
/// The view unless told otherwise, degrees across and up.
const DEFAULT_VIEW: ViewAngles = ViewAngles { yaw_deg: 0.0, pitch_deg: 0.0, hfov_deg: 100.0, vfov_deg: 100.0 };

/// Renders a scene to a file.
///
/// # Errors
/// Bad input, an unwritable output, or an adapter that cannot do it; the output file is then as it was.
pub fn run(args: &RenderArgs) -> anyhow::Result<()> {
    let format = ImageFormat::of(&args.output)?;
    check_writable(&args.output)?;
    let source = Source::from(args.scene.scene.as_deref());
    let import_start = Instant::now();
    let mut loaded = session::load(&source, &args.scene)?;
    edits::apply(args.edits.as_ref(), &source, &mut loaded)?;
    let import_seconds = import_start.elapsed().as_secs_f64();
    let Loaded { scene, notes, .. } = loaded;
    for note in &notes {
        eprintln!("note: {note}");
    }
    let viewpoints = session::viewpoints(&scene);
    let camera = &viewpoints[session::choose(&viewpoints, args.scene.camera.as_ref())?];

    let gpu = Gpu::headless(&args.scene.adapter.clone().map_or(AdapterSelect::Auto, AdapterSelect::Named))?;
    let resumed = args.resume.as_deref().map(exr::read).transpose()?;
    let (options, pose) = match &resumed {
        Some(file) => resume::take_over(args, &file.film.header, camera)?,
        None => fresh(args, camera),
    };
    let film = options.film;
    if format == ImageFormat::Png {
        readback::check(&gpu, &whole_film(args, &film))?;
    }
    let aim = aim(args, &film, pose.world_from_film)?;
    let steps = match &args.gaze_trace {
        Some(path) => {
            let held = resumed.as_ref().map_or(0, |file| file.film.header.statistics.samples);
            follow::steps(path, args, &aim.view, held..samples(&args.stop, &film))?
        }
        None => Vec::new(),
    };
    let inverse = args.sampling.acuity().inverse()?;
    let mut renderer = Renderer::new(&gpu, &options, aim.distribution(&film, pose.world_from_film, &inverse))?;
    renderer.set_schedule(args.sampling.schedule.on(&gpu))?;
    let prepared = renderer.set_scene(&scene)?;
    renderer.set_pose(pose);
    renderer.set_first_sample(args.first_sample);
    renderer.set_adaptive(args.sampling.adaptive == Switch::On);
    let held_on_film = resumed.as_ref().map_or(0, |file| file.film.samples_on_film());
    let earlier = match resumed.zip(args.resume.as_ref()) {
        Some((file, path)) => Some(resume::restore(&mut renderer, file, path)?),
        None => None,
    };
    let before = renderer.statistics()?;
    if let Some(folder) = &args.dump_kernels {
        dump_kernels(&renderer, folder)?;
    }

    let mut tev = tev(args)?;
    let seconds = if steps.is_empty() {
        trace(&mut renderer, stop(&args.stop, &film), tev.as_mut())?
    } else {
        let at = |gaze| Aim { gaze, ..aim }.distribution(&film, pose.world_from_film, &inverse);
        trace_steps(&mut renderer, &steps, at, tev.as_mut())?
    };
    let header = renderer.film_header()?;
    let run = RunSettings { scene: &scene.name, film: &header, aim: &aim, acuity: args.sampling.acuity() };
    let settings = with_trace(run.to_json(), args);
    // A panorama has all samples: it is not read for that.
    let is_panorama = film.mapping == FilmMapping::Equirect;
    let snapshot = (format == ImageFormat::Exr || !is_panorama).then(|| renderer.snapshot()).transpose()?;
    let samples = header.statistics.samples;
    let on_film = snapshot.as_ref().map_or(samples, FilmSnapshot::samples_on_film);
    if on_film < samples {
        let percent = (samples - on_film) as f64 / samples as f64 * 100.0;
        eprintln!("note: {percent:.1} % of the samples fell beside the film");
    }
    match format {
        ImageFormat::Exr => {
            let film = snapshot.map_or_else(|| renderer.snapshot(), Ok)?;
            let file = match earlier {
                Some(earlier) => FilmFile::gone_on(earlier, film, &settings),
                None => FilmFile::new(film, settings.clone()),
            };
            exr::write(&args.output, &file)?;
        }
        ImageFormat::Png => {
            let texels = readback::draw(&mut renderer, &whole_film(args, &film))?;
            png::write(&args.output, film.width, film.height, &texels)?;
        }
    }
    if args.json {
        let (schedule, statistics) = (renderer.schedule(), header.statistics);
        let on_film = [held_on_film, on_film];
        let run = Run { seconds, import_seconds, prepared, before, statistics, on_film, schedule };
        return print_json(&run.to_json(&gpu, &scene, &film, &settings));
    }
    Ok(())
}

/// The link to a viewer, when one is asked for; the picture is called as the output.
fn tev(args: &RenderArgs) -> anyhow::Result<Option<TevLink>> {
    let Some(address) = &args.tev else { return Ok(None) };
    let name = args.output.file_name().unwrap_or_default().to_string_lossy();
    Ok(Some(TevLink::start(address.clone(), &name, |line| eprintln!("note: {line}"))?))
}

/// Options and pose of a render that starts with an empty film.
fn fresh(args: &RenderArgs, camera: &Viewpoint) -> (RendererOptions, FilmPose) {
    let options = RendererOptions {
        film: film_options(args.film, camera),
        max_bounces: args.sampling.max_bounces,
        seed: args.sampling.seed,
        sequence: args.sampling.sequence.into(),
    };
    (options, FilmPose { position: camera.position, world_from_film: world_from_film(args, camera) })
}

fn film_options(shape: FilmShape, camera: &Viewpoint) -> FilmOptions {
    match shape {
        FilmShape::Equirect(size) => FilmOptions::equirect(size.width, size.height),
        FilmShape::Perspective(size) => FilmOptions::perspective(size.width, size.height, camera.vfov),
    }
}

fn world_from_film(args: &RenderArgs, camera: &Viewpoint) -> Quat {
    let orient = args.orient.unwrap_or(match args.film {
        FilmShape::Equirect(_) => Orient::World,
        FilmShape::Perspective(_) => Orient::Camera,
    });
    match orient {
        Orient::World => Quat::IDENTITY,
        Orient::Camera => camera.rotation,
    }
}

/// View and gaze, which the command line has relative to the film's centre, in the world.
fn aim(args: &RenderArgs, film: &FilmOptions, world_from_film: Quat) -> anyhow::Result<Aim> {
    let view = match (args.view, film.mapping) {
        (None, FilmMapping::Perspective { half_extent }) => {
            View { world_from_view: world_from_film, half_extent: Vec2::from(half_extent) }
        }
        (angles, _) => {
            let angles = angles.unwrap_or(DEFAULT_VIEW);
            let film_from_view = crate::view::View::new(
                angles.yaw_deg.to_radians(),
                angles.pitch_deg.to_radians(),
                angles.hfov_deg.to_radians(),
                angles.vfov_deg.to_radians(),
            );
            View {
                world_from_view: world_from_film * film_from_view.film_from_view(),
                half_extent: film_from_view.tan_half,
            }
        }
    };
    let gaze = world_from_film * direction(args.gaze.yaw_deg.to_radians(), args.gaze.pitch_deg.to_radians());
    let on_screen = view.project(gaze).is_some_and(|point| point.abs().max_element() <= 1.0);
    if args.eccentricity == EccentricityAt::Eye && args.sampling.mode == Mode::Fv && !on_screen {
        bail!("--gaze lies outside --view: with --eccentricity eye one looks at the screen that shows the view");
    }
    let screen = args.sampling.screen();
    let aim = Aim {
        mode: args.sampling.mode,
        view,
        gaze: GazePoint::towards(gaze, &view),
        clip: args.clip.unwrap_or(match film.mapping {
            FilmMapping::Equirect => Clip::None,
            FilmMapping::Perspective { .. } => Clip::View,
        }),
        eccentricity: args.eccentricity,
        screen_half_extent: Vec2::new(screen.width_mm, screen.height_mm) * 0.5 / screen.distance_mm,
    };
    let goes_by_view = match aim.mode {
        Mode::Od => false,
        Mode::Vp | Mode::VpRegion => true,
        Mode::Fv => aim.clip == Clip::View || aim.eccentricity == EccentricityAt::Eye,
    };
    if goes_by_view && !is_met(&view, film, world_from_film) {
        bail!("--view lies beside the film, which shows nothing of it");
    }
    Ok(aim)
}

/// Whether a film shows some of a view.
fn is_met(view: &View, film: &FilmOptions, world_from_film: Quat) -> bool {
    let is_inside = |pixel: u32| {
        let in_film = film_direction(film, pixel % film.width, pixel / film.width);
        view.project(world_from_film * in_film).is_some_and(|point| point.abs().max_element() <= 1.0)
    };
    // A small one may lie between the pixels' centres.
    film.pixel_of(world_from_film.inverse() * view.direction(Vec2::ZERO)).is_some()
        || (0..film.pixels() as u32).any(is_inside)
}

fn stop(args: &StopArgs, film: &FilmOptions) -> StopCondition {
    args.seconds.map_or_else(|| StopCondition::Samples(samples(args, film)), StopCondition::Seconds)
}

/// Samples in all, unless a time is given.
fn samples(args: &StopArgs, film: &FilmOptions) -> u64 {
    args.samples.unwrap_or_else(|| args.spp.unwrap_or(DEFAULT_SPP).saturating_mul(film.pixels()))
}

/// The settings with the recorded gaze that was followed.
fn with_trace(mut settings: Map<String, Value>, args: &RenderArgs) -> Map<String, Value> {
    if let Some(path) = &args.gaze_trace {
        settings.insert("gaze_trace".into(), path.file_name().map(|name| name.to_string_lossy()).into());
    }
    settings
}

/// Steps of a progress bar.
const BAR_STEPS: u64 = 1000;

pub(super) fn progress_bar() -> anyhow::Result<ProgressBar> {
    let bar = if std::io::stderr().is_terminal() { ProgressBar::new(BAR_STEPS) } else { ProgressBar::hidden() };
    let style =
        ProgressStyle::with_template("{bar:40} {percent:>3} %  {elapsed} elapsed, {eta} left").context("style")?;
    bar.set_style(style);
    bar.enable_steady_tick(Duration::from_millis(200));
    Ok(bar)
}

/// Traces where somebody looked, step by step, with a progress bar; returns the seconds of tracing.
fn trace_steps(
    renderer: &mut Renderer,
    steps: &[Step],
    distribution: impl Fn(GazePoint) -> Distribution,
    mut tev: Option<&mut TevLink>,
) -> anyhow::Result<f64> {
    let bar = progress_bar()?;
    let total = steps.last().map_or(1, |step| step.samples.max(1));
    let mut seconds = 0.0;
    for step in steps {
        renderer.set_distribution(distribution(step.gaze))?;
        seconds += renderer.render(StopCondition::Samples(step.samples), |_| true)?;
        bar.set_position((step.samples as f64 / total as f64 * BAR_STEPS as f64) as u64);
        if let Some(tev) = tev.as_deref_mut()
            && (step.samples == total || tev.is_due())
        {
            push(renderer, tev)?;
        }
    }
    bar.finish_and_clear();
    Ok(seconds)
}

/// Traces with a progress bar on a terminal, and pictures for a viewer; returns the seconds of tracing.
fn trace(renderer: &mut Renderer, stop: StopCondition, mut tev: Option<&mut TevLink>) -> anyhow::Result<f64> {
    let bar = progress_bar()?;
    let mut seconds = 0.0;
    loop {
        let (rest, done) = match stop {
            StopCondition::Seconds(total) => (StopCondition::Seconds(total - seconds), seconds / total),
            samples => (samples, 0.0),
        };
        let mut interrupted = false;
        seconds += renderer.render(rest, |fraction| {
            let fraction = done + (1.0 - done) * fraction;
            bar.set_position((fraction * BAR_STEPS as f64) as u64);
            interrupted = fraction < 1.0 && tev.as_deref().is_some_and(TevLink::is_due);
            !interrupted
        })?;
        if let Some(tev) = tev.as_deref_mut() {
            push(renderer, tev)?;
        }
        if !interrupted {
            bar.finish_and_clear();
            return Ok(seconds);
        }
    }
}

fn push(renderer: &Renderer, tev: &mut TevLink) -> anyhow::Result<()> {
    tev.push(|| renderer.snapshot().map(|film| TevPicture::from(&film)))?;
    Ok(())
}

fn whole_film(args: &RenderArgs, film: &FilmOptions) -> ViewSettings {
    ViewSettings {
        projection: ViewProjection::Film,
        size: [film.width, film.height],
        exposure_ev: args.picture.exposure,
        tone_map: args.picture.tonemap.into(),
        debug_view: args.picture.show.into(),
        fill: true,
        denoise: args.picture.denoise == Switch::On,
        ring: None,
    }
}

fn dump_kernels(renderer: &Renderer, folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    for (name, text) in renderer.kernel_texts()? {
        let path = folder.join(format!("{}.wgsl", name.replace('/', "-")));
        std::fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    Ok(())
}

/// What `--json` reports beside the settings.
struct Run {
    seconds: f64,
    import_seconds: f64,
    prepared: SceneReport,
    /// Of the film that was resumed.
    before: RenderStatistics,
    statistics: RenderStatistics,
    /// Samples that fell on the film: before and in all.
    on_film: [u64; 2],
    schedule: Schedule,
}

impl Run {
    fn to_json(&self, gpu: &Gpu, scene: &Scene, film: &FilmOptions, settings: &Map<String, Value>) -> Value {
        let info = gpu.info();
        let (statistics, before) = (&self.statistics, &self.before);
        let per_second = |now: u64, before: u64| (now - before) as f64 / self.seconds.max(1e-9);
        let [on_film_before, on_film] = self.on_film;
        json!({
            "adapter": info.name,
            "backend": info.backend.to_string(),
            "driver": format!("{} {}", info.driver, info.driver_info).trim(),
            "schedule": self.schedule.name(),
            "scene": settings.get("scene"),
            "mode": settings.get("mode"),
            "gaze_trace": settings.get("gaze_trace"),
            "samples": statistics.samples,
            "samples_on_film": on_film,
            "samples_beside_film": statistics.samples - on_film,
            "seconds": self.seconds,
            "stage_seconds": {
                "import": self.import_seconds,
                "bvh_build": self.prepared.upload.bvh_build_secs,
                "upload": self.prepared.upload.upload_secs,
                "kernel_compile": self.prepared.kernel_compile_secs,
                "trace": self.seconds,
            },
            "samples_per_s": per_second(on_film, on_film_before),
            "segments_per_s": per_second(statistics.segments, before.segments),
            "shadow_rays_per_s": per_second(statistics.shadow_rays, before.shadow_rays),
            "mean_path_length": statistics.segments as f64 / on_film.max(1) as f64,
            "non_finite_dropped": statistics.non_finite,
            "clamped": statistics.clamped,
            "triangles": session::triangles(scene),
            "lights": self.prepared.upload.lights,
            "device_bytes": self.prepared.upload.device_bytes,
            "film_bytes": film.bytes(),
            "settings": settings,
        })
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::ffi::OsString;

    use glam::Vec3;

    use super::*;
    use crate::cli::{self, Command};

    pub(super) fn args(line: &str) -> RenderArgs {
        let words = format!("fovea render -o a.exr {line}");
        match cli::parse(words.split_whitespace().map(OsString::from)).unwrap().command {
            Some(Command::Render(args)) => *args,
            other => panic!("{other:?}"),
        }
    }

    fn camera() -> Viewpoint {
        Viewpoint {
            name: "c".into(),
            position: Vec3::ZERO,
            rotation: Quat::from_rotation_y(-std::f32::consts::FRAC_PI_2),
            vfov: 1.0,
        }
    }

    #[test]
    fn angles_are_relative_to_the_films_centre() {
        for (line, gaze) in
            [("--gaze 90,0", Vec3::X), ("--gaze 0,90", Vec3::Y), ("--gaze 0,0 --orient camera", Vec3::X)]
        {
            let args = args(line);
            let film = film_options(args.film, &camera());
            let aim = aim(&args, &film, world_from_film(&args, &camera())).unwrap();
            assert!(aim.gaze.direction.distance(gaze) < 1e-5, "{line}: {}", aim.gaze.direction);
        }
    }

    #[test]
    fn a_perspective_film_looks_through_the_camera_unless_told_otherwise() {
        let args = args("--film perspective:200x100");
        let rotation = world_from_film(&args, &camera());
        assert_eq!(rotation, camera().rotation);
        let film = film_options(args.film, &camera());
        let view = aim(&args, &film, rotation).unwrap().view;
        assert_eq!(FilmMapping::Perspective { half_extent: view.half_extent.to_array() }, film.mapping);
        assert!((view.half_extent.y - 0.5_f32.tan()).abs() < 1e-6);
    }

    #[test]
    fn at_the_eye_the_gaze_must_be_on_the_screen() {
        for (line, on_screen) in [("--gaze 49,0", true), ("--gaze 51,0", false), ("--gaze 180,0", false)] {
            for (place, accepted) in [("eye", on_screen), ("scene", true)] {
                let args = args(&format!("{line} --eccentricity {place}"));
                let film = film_options(args.film, &camera());
                assert_eq!(aim(&args, &film, Quat::IDENTITY).is_ok(), accepted, "{line} {place}");
            }
        }
    }

    #[test]
    fn spp_counts_film_pixels_in_every_mode() {
        let film = FilmOptions::equirect(64, 32);
        for (line, samples) in [("", 16 * 2048), ("--spp 3", 3 * 2048), ("--samples 7", 7)] {
            assert_eq!(stop(&args(line).stop, &film), StopCondition::Samples(samples));
        }
        assert_eq!(stop(&args("--seconds 2.5").stop, &film), StopCondition::Seconds(2.5));
    }
}
