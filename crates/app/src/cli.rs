//! The command line: what can be asked for, with ranges checked while it is read.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::parser::ValueSource;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::sampling::Acuity;
use crate::screen::ScreenGeometry;
use crate::tev::TevAddress;

pub mod bench;
pub mod choices;
pub mod gaze;
pub mod sampler;
pub mod study;
pub mod values;

use bench::BenchArgs;
use choices::{
    Clip, EccentricityAt, Geometry, InverseForm, Mode, Model, Orient, ScheduleChoice, Sequence, Show, Switch,
    ToneMapping,
};
use gaze::{GazeArgs, PreviewGazeArgs};
use sampler::SamplerArgs;
use study::StudyArgs;
use values::{CameraChoice, EditsChoice, FilmShape, GazeAngles, Rgb, SizeMm, SizePx, ViewAngles};

/// Foveated progressive preview of glTF scenes: looks converge first where you look.
#[derive(Debug, Parser)]
#[command(name = "fovea", version, args_conflicts_with_subcommands = true, disable_help_subcommand = true)]
pub struct Cli {
    /// What to do; the preview window without one.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// The preview window's options.
    #[command(flatten)]
    pub preview: PreviewArgs,
}

/// What `fovea` does beside the preview window.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render without a window to an EXR or PNG file
    Render(Box<RenderArgs>),
    /// Add films of one scene that were rendered apart
    Merge(MergeArgs),
    /// Say what a scene holds and what of it is not supported
    Info(InfoArgs),
    /// List the graphics adapters and which one would be used
    Adapters(AdaptersArgs),
    /// List gaze sources, watch one, or record one
    Gaze(GazeArgs),
    /// Compare the sampler's inverses in error and speed, or evaluate one
    Sampler(SamplerArgs),
    /// Measure how much sooner each mode converges where one looks, scene by scene
    Study(StudyArgs),
    /// Measure speed: rays, samples, passes, edits and start-up, beside a CPU tracer
    Bench(BenchArgs),
}

/// `fovea [SCENE]`.
#[derive(Clone, Debug, Args)]
pub struct PreviewArgs {
    /// What to show.
    #[command(flatten)]
    pub scene: SceneArgs,
    /// How samples are placed.
    #[command(flatten)]
    pub sampling: SamplingArgs,
    /// How radiance becomes a picture.
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Clip foveated samples to the view and a margin; in the window 95 % of them (default) or none
    #[arg(long, value_enum, default_value_t = Clip::View, value_name = "CLIP")]
    pub clip: Clip,
    /// Where eccentricity is measured: at the eye before the screen, or in the scene
    #[arg(long, value_enum, default_value_t = EccentricityAt::Eye, value_name = "PLACE")]
    pub eccentricity: EccentricityAt,
    /// Where the gaze comes from.
    #[command(flatten)]
    pub gaze: PreviewGazeArgs,
    /// Go on with a film of this scene that fovea wrote, from where it was taken
    #[arg(long, value_name = "FILM.exr")]
    pub resume: Option<PathBuf>,
    /// Send the picture to the image viewer tev as it converges
    #[arg(long, value_name = "HOST:PORT")]
    pub tev: Option<TevAddress>,
    /// The window's size when it opens, pixels
    #[arg(long, default_value = "1280x720", value_name = "WxH")]
    pub window: SizePx,
    /// Begin in the headset, by OpenXR; the window shows a mirror
    #[arg(long)]
    pub vr: bool,
    /// Those of [`KEPT_OPTIONS`] that were asked for, rather than left at their defaults.
    #[arg(skip)]
    pub stated: Vec<&'static str>,
    /// Memory that the film may take, MiB; more gives a finer one
    #[arg(long, default_value_t = 512, value_parser = clap::value_parser!(u32).range(16..=65536), value_name = "MIB")]
    pub film_memory: u32,
    /// Destroy the graphics device this many seconds after the window opened (for tests)
    #[arg(long, hide = true, value_parser = values::positive_seconds, value_name = "SECONDS")]
    pub lose_device_after: Option<f64>,
    /// Save what the window shows after this many seconds, then close it (for tests and documentation)
    #[arg(
        long, hide = true,
        value_parser = values::positive_seconds, requires = "screenshot", value_name = "SECONDS"
    )]
    pub screenshot_after: Option<f64>,
    /// Where that picture goes; the figures of the overlay go to standard output as JSON
    #[arg(long, hide = true, requires = "screenshot_after", value_name = "OUT.png")]
    pub screenshot: Option<PathBuf>,
}

/// `fovea render`.
#[derive(Clone, Debug, Args)]
pub struct RenderArgs {
    /// What to render.
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The image to write: .exr (radiance, variance, samples) or .png (the reconstructed picture)
    #[arg(short, long, value_name = "OUT.exr|OUT.png")]
    pub output: PathBuf,
    /// How samples are placed.
    #[command(flatten)]
    pub sampling: SamplingArgs,
    /// The film: equirect:WxH is the whole panorama, perspective:WxH what the camera's lens sees
    #[arg(long, default_value = "equirect:2048x1024", value_name = "KIND:WxH")]
    pub film: FilmShape,
    /// What the film's centre points at: the world's -Z or the camera's axis [default: world; camera for perspective]
    #[arg(long, value_enum, value_name = "AXES")]
    pub orient: Option<Orient>,
    /// The view of modes vp and vp-region and of --clip view, degrees from the film's centre
    /// [default: 0,0,100x100; the whole film for perspective, which must show some of it]
    #[arg(long, allow_hyphen_values = true, value_name = "YAW,PITCH,HFOVxVFOV")]
    pub view: Option<ViewAngles>,
    /// Where one looks, degrees from the film's centre, + to the right and + up
    #[arg(long, allow_hyphen_values = true, default_value = "0,0", value_name = "YAW,PITCH")]
    pub gaze: GazeAngles,
    /// Follow a recorded gaze: samples are shared out over the recording's time (mode fv; the screen shows --view)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["gaze", "seconds"])]
    pub gaze_trace: Option<PathBuf>,
    /// Clip foveated samples to the view and a margin [default: none; view for perspective, beside which samples are lost]
    #[arg(long, value_enum, value_name = "CLIP")]
    pub clip: Option<Clip>,
    /// Where eccentricity is measured: in the scene, or at the eye before a screen that shows the view
    #[arg(long, value_enum, default_value_t = EccentricityAt::Scene, value_name = "PLACE")]
    pub eccentricity: EccentricityAt,
    /// Go on with a film that fovea wrote: what it is of (--film, --seed, --max-bounces, place) comes from there; mode,
    /// gaze and scene are the command line's, and --samples and --spp count what the film holds already
    #[arg(long, value_name = "FILM.exr")]
    pub resume: Option<PathBuf>,
    /// Edits that the window saved: those beside the scene (SCENE.fovea.json), those of a file, or none [default: none, with a
    /// note where some lie beside it]
    #[arg(long, value_name = "beside|FILE|none")]
    pub edits: Option<EditsChoice>,
    /// Index of the first sample: ranges of one seed that are rendered apart add up to one render (`fovea merge`)
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 0, conflicts_with = "resume",
        value_parser = clap::value_parser!(u64).range(0..=1 << 61), value_name = "N"
    )]
    pub first_sample: u64,
    /// Those of [`FILM_OPTIONS`] that were asked for, rather than left at their defaults.
    #[arg(skip)]
    pub stated: Vec<&'static str>,
    /// When to stop.
    #[command(flatten)]
    pub stop: StopArgs,
    /// How radiance becomes a PNG.
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Send the film to the image viewer tev as it converges
    #[arg(long, value_name = "HOST:PORT")]
    pub tev: Option<TevAddress>,
    /// Print one JSON object about the run on standard output
    #[arg(long)]
    pub json: bool,
    /// Write the shaders that ran, one WGSL file a kernel, into this folder
    #[arg(long, value_name = "DIR")]
    pub dump_kernels: Option<PathBuf>,
}

/// Options of `fovea render` that say what a film is of, by their field's name: a film that is resumed has them.
pub const FILM_OPTIONS: [&str; 6] = ["film", "camera", "orient", "seed", "sequence", "max_bounces"];

/// Options of the window that are kept from run to run, by their field's name: what was kept gives way to what is asked for.
pub const KEPT_OPTIONS: [&str; 6] = ["mode", "adaptive", "exposure", "tonemap", "denoise", "window"];

/// `fovea merge`.
#[derive(Clone, Debug, Args)]
pub struct MergeArgs {
    /// Films that fovea wrote, of disjoint ranges of samples (--first-sample) or of different seeds
    #[arg(required = true, value_name = "FILM.exr")]
    pub films: Vec<PathBuf>,
    /// Where their sum goes
    #[arg(short, long, value_name = "OUT.exr")]
    pub output: PathBuf,
}

/// `fovea info`.
#[derive(Clone, Debug, Args)]
pub struct InfoArgs {
    /// The glTF scene (.glb or .gltf) [default: the built-in one]
    pub scene: Option<PathBuf>,
    /// What of the file is shown.
    #[command(flatten)]
    pub file: FileArgs,
    /// Edits that the window saved: those beside the scene (SCENE.fovea.json), those of a file, or none [default: none, with a
    /// note where some lie beside it]
    #[arg(long, value_name = "beside|FILE|none")]
    pub edits: Option<EditsChoice>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// `fovea adapters`.
#[derive(Clone, Debug, Args)]
pub struct AdaptersArgs {
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// What is rendered, and from where.
#[derive(Clone, Debug, Args)]
pub struct SceneArgs {
    /// The glTF scene (.glb or .gltf) [default: the built-in one]
    pub scene: Option<PathBuf>,
    /// Camera by its place in the file, from 0, or by name [default: the first, else one that frames the scene]
    #[arg(long, value_name = "N|NAME")]
    pub camera: Option<CameraChoice>,
    /// Radiance from everywhere outside the scene, linear [default: the file's or black; a neutral sky if it is unlit]
    #[arg(long, value_name = "R,G,B", conflicts_with = "env")]
    pub background: Option<Rgb>,
    /// Equirectangular environment image, .hdr or .exr
    #[arg(long, value_name = "FILE")]
    pub env: Option<PathBuf>,
    /// Turns the environment image to the right, degrees
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 0.0, requires = "env", conflicts_with = "background",
        value_parser = values::finite, value_name = "DEG"
    )]
    pub env_rotate: f32,
    /// What the camera sees where it looks past the scene, linear; the environment lights as before [default: it]
    #[arg(long, value_name = "R,G,B")]
    pub backdrop: Option<Rgb>,
    /// Angle that directional lights subtend, degrees: higher softens their shadows; the sun has 0.53
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 0.0,
        value_parser = values::sun_angle_deg, value_name = "DEG"
    )]
    pub sun_angle: f32,
    /// What of the file is shown.
    #[command(flatten)]
    pub file: FileArgs,
    /// Graphics adapter whose name contains this [default: as `fovea adapters` says]
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
}

/// What of a glTF file is shown.
#[derive(Clone, Debug, Default, Args)]
pub struct FileArgs {
    /// Scene of a file that has several, by its place from 0 [default: the file's]
    #[arg(long, value_name = "N")]
    pub gltf_scene: Option<usize>,
    /// Moment of the file's animations, seconds [default: the pose that the file states]
    #[arg(long, allow_negative_numbers = true, value_parser = values::finite, value_name = "SECONDS")]
    pub time: Option<f32>,
    /// Material variant by name; `fovea info` lists them [default: the file's materials]
    #[arg(long, value_name = "NAME")]
    pub variant: Option<String>,
}

/// How samples are placed and paths are traced.
#[derive(Clone, Debug, Args)]
pub struct SamplingArgs {
    /// Omnidirectional, viewport (image plane or film pixels of the view), or foveated
    #[arg(long, value_enum, default_value_t = Mode::Fv, value_name = "MODE")]
    pub mode: Mode,
    /// Visual acuity model of mode fv
    #[arg(long, value_enum, default_value_t = Model::Reddy, value_name = "MODEL")]
    pub model: Model,
    /// Density per solid angle on the sphere, or the planar approximation
    #[arg(long, value_enum, default_value_t = Geometry::Sphere, value_name = "GEOMETRY")]
    pub geometry: Geometry,
    /// How the radius is drawn [default: the cheapest form within 2e-5 (sphere) or 4e-5 (plane)]
    #[arg(long, value_enum, value_name = "FORM")]
    pub inverse: Option<InverseForm>,
    /// Acuity below which no direction falls, 0..=1; higher converges the periphery sooner, the gaze later
    /// [default: 0.002; none with --inverse eq6]
    #[arg(long, allow_negative_numbers = true, value_parser = values::unit_interval, value_name = "M")]
    pub floor: Option<f64>,
    /// The whole screen, millimetres (with --eccentricity eye) [default: in the window what was last set or the monitor
    /// says, else 531x299]
    #[arg(long, value_name = "WxH")]
    pub screen_mm: Option<SizeMm>,
    /// From the eye to the screen, millimetres (with --eccentricity eye) [default: in the window what was last set, else
    /// 650]
    #[arg(long, allow_negative_numbers = true, value_parser = values::distance_mm, value_name = "MM")]
    pub distance_mm: Option<f32>,
    /// Indirect bounces; higher shows more of the light that goes through many surfaces, and costs time
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 8,
        value_parser = clap::value_parser!(u32).range(0..=4096), value_name = "N"
    )]
    pub max_bounces: u32,
    /// Seed of all random choices: the same seed gives the same picture
    #[arg(long, allow_negative_numbers = true, default_value_t = 1, value_name = "N")]
    pub seed: u32,
    /// Low-discrepancy points, or independent ones for statistics
    #[arg(long, value_enum, default_value_t = Sequence::Sobol, value_name = "SEQUENCE")]
    pub sequence: Sequence,
    /// How kernels share the work of a path; the picture is the same, only its speed differs
    #[arg(long, value_enum, default_value_t = ScheduleChoice::Auto, value_name = "SCHEDULE")]
    pub schedule: ScheduleChoice,
    /// More samples to where the film is visibly noisy, fewer to the rest (a quarter at least): clean sooner about the gaze, with a
    /// slight bias that the film's header admits; without a switch it is on
    #[arg(
        long, value_enum, default_value_t = Switch::Off, num_args = 0..=1, require_equals = true,
        default_missing_value = "on", value_name = "SWITCH"
    )]
    pub adaptive: Switch,
}

impl SamplingArgs {
    /// What the foveated mode goes by.
    pub fn acuity(&self) -> Acuity {
        Acuity {
            model: self.model,
            geometry: self.geometry,
            inverse: self.inverse,
            floor: self.floor,
            gaze_error_deg: 0.0,
        }
    }

    /// The screen before the eye.
    pub fn screen(&self) -> ScreenGeometry {
        let usual = ScreenGeometry::default();
        let size = self.screen_mm.unwrap_or(SizeMm { width: usual.width_mm, height: usual.height_mm });
        let distance_mm = self.distance_mm.unwrap_or(usual.distance_mm);
        ScreenGeometry { width_mm: size.width, height_mm: size.height, distance_mm }
    }
}

/// How radiance becomes a picture.
#[derive(Clone, Copy, Debug, Args)]
pub struct PictureArgs {
    /// Stops by which the picture is brightened, -20..=20
    #[arg(
        long, allow_negative_numbers = true, default_value_t = 0.0,
        value_parser = values::exposure_ev, value_name = "EV"
    )]
    pub exposure: f32,
    /// From radiance to display values
    #[arg(long, value_enum, default_value_t = ToneMapping::Agx, value_name = "NAME")]
    pub tonemap: ToneMapping,
    /// Smooth noise, guided by the surfaces that are seen; an EXR holds the film as it is either way
    #[arg(long, value_enum, default_value_t = Switch::On, value_name = "SWITCH")]
    pub denoise: Switch,
    /// What the picture shows: what is rendered, or what is known about its pixels
    #[arg(long, value_enum, default_value_t = Show::Picture, value_name = "NAME")]
    pub show: Show,
}

/// When `fovea render` stops; 16 samples a pixel unless one is given.
#[derive(Clone, Copy, Debug, Args)]
#[group(multiple = false)]
pub struct StopArgs {
    /// Stop when the film has this many samples
    #[arg(long, allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(1..), value_name = "N")]
    pub samples: Option<u64>,
    /// Stop when the film has this many samples times its pixels, wherever they fall [default: 16]
    #[arg(
        long, allow_negative_numbers = true,
        value_parser = clap::value_parser!(u64).range(1..=1 << 32), value_name = "N"
    )]
    pub spp: Option<u64>,
    /// Stop after tracing for this long
    #[arg(long, allow_negative_numbers = true, value_parser = values::positive_seconds, value_name = "SECONDS")]
    pub seconds: Option<f64>,
}

/// A command line that is not to be carried out.
#[derive(Debug)]
pub enum Stop {
    /// Help or the version was asked for; the text is for standard output.
    Asked(String),
    /// One line that says what is wrong.
    Wrong(String),
}

/// Reads a command line, the program's name first.
pub fn parse(arguments: impl IntoIterator<Item = OsString>) -> Result<Cli, Stop> {
    try_parse(arguments).map_err(|error| {
        let text = error.render().to_string();
        if error.use_stderr() { Stop::Wrong(one_line(&text)) } else { Stop::Asked(text) }
    })
}

/// What can be asked for. Options that the window keeps have no fixed default there.
fn command() -> clap::Command {
    KEPT_OPTIONS.into_iter().fold(Cli::command(), |command, id| {
        command.mut_arg(id, |option| {
            let usual: Vec<_> = option.get_default_values().iter().map(|value| value.to_string_lossy()).collect();
            let usual = usual.join(",");
            let help = option.get_help().map(ToString::to_string).unwrap_or_default();
            option.hide_default_value(true).help(format!("{help} [default: as last left, else {usual}]"))
        })
    })
}

fn try_parse(arguments: impl IntoIterator<Item = OsString>) -> Result<Cli, clap::Error> {
    let mut command = command();
    let matches = command.try_get_matches_from_mut(arguments)?;
    let mut cli = Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))?;
    if let (Some(Command::Render(args)), Some(matches)) = (&mut cli.command, matches.subcommand_matches("render")) {
        let stated = |id: &&str| matches.value_source(id) == Some(ValueSource::CommandLine);
        args.stated = FILM_OPTIONS.into_iter().filter(stated).collect();
    }
    if cli.command.is_none() {
        let stated = |id: &&str| matches.value_source(id) == Some(ValueSource::CommandLine);
        cli.preview.stated = KEPT_OPTIONS.into_iter().filter(stated).collect();
    }
    Ok(cli)
}

/// The first paragraph of clap's message, as one line without its `error: `.
fn one_line(message: &str) -> String {
    let paragraph = message.split("\n\n").next().unwrap_or(message);
    let words: Vec<&str> = paragraph.split_whitespace().collect();
    words.join(" ").trim_start_matches("error: ").to_owned()
}

#[cfg(test)]
mod tests;
