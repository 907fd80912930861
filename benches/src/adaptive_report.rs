//! `adaptive-report OUT_DIR SCENE...`: what adaptive sampling gains where the eye looks, and what it costs in bias and time.
//!
//! FV, 8 bounces, a film of 512x256, the gaze at its centre, three ways in turn with the same number of samples in all: plain; one
//! buffer, whose own noise steers; two buffers, where half of the samples steer and the other half is shown. Each seed's film is a
//! run; errors are variances over the runs, so that no reference is needed. Writes `adaptive.json` (raw numbers) and
//! `adaptive.md` (the tables).

use std::{f64::consts::PI, path::Path, process::ExitCode, sync::Arc, time::Instant};

use fovea_benches::{AnyError, Subject, report_main};
use fovea_sampler::{Angle, Geometry, Inverse, RadialDistribution, Reddy2001};
use glam::Vec3;
use serde_json::{Value, json};
use tracer::{
    distribution::{Distribution, Gaze, film_direction},
    film::FilmOptions,
    gpu::{AdapterSelect, Gpu},
    provenance::Provenance,
    renderer::{Renderer, RendererOptions, SequenceKind, StopCondition},
};

use statistics::{Elements, Runs, Truth};

#[path = "adaptive_report/statistics.rs"]
mod statistics;
#[path = "adaptive_report/tables.rs"]
mod tables;

const FILM: FilmOptions = FilmOptions::equirect(512, 256);
/// What the window has for a view of 1280x720 pixels: the guide's cost is that of its cells there.
const USUAL_FILM: FilmOptions = FilmOptions::equirect(2048, 1024);
/// Samples in all at which films are compared, with the seeds that go so far.
const STOPS: [(u64, u32); 3] = [(1 << 15, 64), (1 << 17, 64), (1 << 19, 8)];
/// Samples of the steering film of two buffers when it is first looked at: as many as one buffer waits for.
const FIRST_LOOK: u64 = 1 << 14;

/// How samples are placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Plain,
    OneBuffer,
    TwoBuffers,
}

impl Way {
    const ALL: [Self; 3] = [Self::Plain, Self::OneBuffer, Self::TwoBuffers];

    const fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::OneBuffer => "one buffer",
            Self::TwoBuffers => "two buffers",
        }
    }
}

fn main() -> ExitCode {
    report_main(run)
}

fn run(args: &[String]) -> Result<(), AnyError> {
    let [out, files @ ..] = args else { return Err("usage: adaptive-report OUT_DIR SCENE...".into()) };
    let gpu = Gpu::headless(&AdapterSelect::Auto)?;
    let mut scenes = Vec::new();
    for file in files {
        scenes.push(measure(&gpu, &Subject::open(Some(Path::new(file)))?)?);
    }
    let provenance = Provenance::on(&gpu);
    let machine: serde_json::Map<_, _> =
        provenance.fields().into_iter().map(|(name, value)| (name.into(), value.into())).collect();
    let raw = json!({ "machine": machine, "scenes": scenes });
    std::fs::create_dir_all(out)?;
    std::fs::write(Path::new(out).join("adaptive.json"), format!("{raw:#}\n"))?;
    std::fs::write(Path::new(out).join("adaptive.md"), tables::page(&raw))?;
    Ok(())
}

/// A renderer of a scene in FV.
fn renderer(gpu: &Gpu, subject: &Subject, film: FilmOptions) -> Result<Renderer, AnyError> {
    let acuity = RadialDistribution::new(Reddy2001, Geometry::Sphere, Angle::from_degrees(80.0), 0.002)?;
    let gaze = Gaze::Scene { direction: Vec3::NEG_Z };
    let foveated = Distribution::foveated(gaze, None, Arc::new(Inverse::default_for(&acuity)));
    let mut renderer = Renderer::new(gpu, &RendererOptions { film, ..Default::default() }, foveated)?;
    renderer.set_scene(&subject.scene)?;
    renderer.set_pose(subject.pose);
    Ok(renderer)
}

/// The films of a run.
struct Films {
    shown: Renderer,
    steering: Renderer,
}

impl Films {
    fn begin(&mut self, way: Way, seed: u32) {
        self.shown.set_adaptive(way == Way::OneBuffer);
        self.shown.set_guide(None);
        self.shown.set_randomness(seed, SequenceKind::Sobol);
        self.steering.set_randomness(seed + 1000, SequenceKind::Sobol);
    }

    /// Goes on to so many samples in all; returns the seconds.
    fn go_on(&mut self, way: Way, samples: u64) -> Result<f64, AnyError> {
        let start = Instant::now();
        if way != Way::TwoBuffers {
            self.shown.render(StopCondition::Samples(samples), |_| true)?;
            return Ok(start.elapsed().as_secs_f64());
        }
        let (mut until, half) = (FIRST_LOOK, samples / 2);
        loop {
            let next = StopCondition::Samples(until.min(half));
            self.steering.render(next, |_| true)?;
            if self.steering.samples() > self.shown.samples() {
                let guide = self.steering.measure_guide()?;
                self.shown.set_guide(guide);
            }
            self.shown.render(next, |_| true)?;
            if until >= half {
                return Ok(start.elapsed().as_secs_f64());
            }
            until *= 4;
        }
    }
}

fn measure(gpu: &Gpu, subject: &Subject) -> Result<Value, AnyError> {
    let shown = renderer(gpu, subject, FILM)?;
    let mut films = Films { steering: shown.beside(shown.distribution().clone())?, shown };
    let elements = Elements::new(&FILM);
    let mut runs = STOPS.map(|_| Way::ALL.map(|_| Runs::default()));
    for seed in 1..=STOPS[0].1 {
        eprintln!("{}: seed {seed}", subject.name);
        for way in Way::ALL {
            films.begin(way, seed);
            let mut seconds = 0.0;
            let wanted = STOPS.into_iter().enumerate().filter(|(_, (_, seeds))| seed <= *seeds);
            for (stop, (samples, _)) in wanted {
                seconds += films.go_on(way, samples)?;
                runs[stop][way as usize].push(&elements, &films.shown.snapshot()?, seconds);
            }
        }
    }
    let stops: Vec<Value> = STOPS
        .into_iter()
        .zip(&runs)
        .map(|((samples, seeds), ways)| {
            let truth = Truth::new(&ways[0], ways);
            let rows: Vec<Value> = Way::ALL
                .into_iter()
                .zip(ways)
                .map(|(way, runs)| runs.to_json(way.name(), &ways[0], &elements, &truth))
                .collect();
            json!({ "samples": samples, "seeds": seeds, "ways": rows })
        })
        .collect();
    Ok(json!({ "scene": subject.name, "stops": stops, "guide": cost(gpu, subject)? }))
}

/// What judging the noise costs on the usual film, beside tracing there.
fn cost(gpu: &Gpu, subject: &Subject) -> Result<Value, AnyError> {
    let mut renderer = renderer(gpu, subject, USUAL_FILM)?;
    let samples = 1_u64 << 18;
    let traced = renderer.render(StopCondition::Samples(samples), |_| true)?;
    let mut times = Vec::new();
    for _ in 0..9 {
        let start = Instant::now();
        renderer.measure_guide()?;
        times.push(start.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    Ok(json!({ "seconds": times[4], "samples": samples, "traced_seconds": traced }))
}

/// Angle of a pixel of the film from the gaze, degrees, and its solid angle.
fn place(film: &FilmOptions, index: u32) -> (f64, f64) {
    let direction = film_direction(film, index % film.width, index / film.width);
    let row = f64::from(index / film.width) + 0.5;
    (f64::from(direction.angle_between(Vec3::NEG_Z)).to_degrees(), (PI * row / f64::from(film.height)).sin())
}
