//! From an edit, or a look elsewhere, to a picture that shows it.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use anyhow::Context;
use serde_json::{Value, json};
use tracer::distribution::film_direction;
use tracer::gpu::Gpu;
use tracer::renderer::Renderer;
use tracer::scene::Scene;

use super::subject::{PICTURE_PX, Picture, Subject};
use crate::cli::bench::BenchArgs;
use crate::commands::study::plan::{FOVEA_DEG, Method, Place};
use crate::preview::tracing::COARSENESS;

/// Samples between an edit and the picture, in two batches, clipped to the view as in the window.
const BATCHES: [u32; 2] = [1 << 13, 1 << 10];

/// Seconds from each edit to a presented picture of samples traced after it, and how many of them are in the foveal disc.
///
/// # Errors
/// When the scene does not fit the adapter or the device is lost.
pub fn measure(gpu: &Gpu, args: &BenchArgs, subject: &Subject) -> anyhow::Result<Value> {
    let place = subject.places.first().context("no gaze")?;
    let picture = Picture::new(gpu, place, size_px(gpu));
    let tint = |scene: &mut Scene| {
        if let Some(material) = scene.materials.first_mut() {
            Arc::make_mut(material).base_color.x *= 0.9;
        }
    };
    let shift = |scene: &mut Scene| {
        if let Some(instance) = scene.instances.first_mut() {
            instance.world_from_mesh.translation.x += 1e-3;
        }
    };
    // A scene has one first move.
    let first_moves = (0..args.rounds).map(|_| Edited::new(gpu, args, subject, place, &picture)?.shown(&shift));
    let first_moves = first_moves.collect::<anyhow::Result<Vec<f64>>>()?;
    let mut edited = Edited::new(gpu, args, subject, place, &picture)?;
    let material = (0..args.rounds).map(|_| edited.shown(&tint)).collect::<anyhow::Result<Vec<f64>>>()?;
    edited.shown(&shift)?;
    let moves = (0..args.rounds).map(|_| edited.shown(&shift)).collect::<anyhow::Result<Vec<f64>>>()?;
    let mut renderer = edited.renderer;
    let in_fovea = samples_in_fovea(&renderer, subject, place)?;
    let looks = looks_elsewhere(&mut renderer, gpu, args, subject)?;
    Ok(json!({
        "samples": BATCHES.iter().sum::<u32>(), "samples_in_foveal_disc": in_fovea,
        "material_s": material, "first_move_s": first_moves, "move_s": moves, "gaze_s": looks,
    }))
}

/// A scene that is being worked on.
struct Edited<'a> {
    scene: Scene,
    renderer: Renderer,
    picture: &'a Picture,
}

impl<'a> Edited<'a> {
    /// At rest, with a first move rehearsed as by the window.
    fn new(
        gpu: &Gpu,
        args: &BenchArgs,
        subject: &Subject,
        place: &Place,
        picture: &'a Picture,
    ) -> anyhow::Result<Self> {
        let (mut renderer, _) = subject.renderer(gpu, args, &subject.scene)?;
        renderer.set_distribution(subject.distribution(Method::FvClip, place))?;
        trace(&mut renderer)?;
        picture.draw(&mut renderer)?;
        if let Some(rehearsal) = renderer.rehearsal(&subject.scene) {
            rehearsal.run(&AtomicBool::new(false))?.into_iter().for_each(|rehearsed| renderer.take_in(rehearsed));
        }
        Ok(Self { scene: (*subject.scene).clone(), renderer, picture })
    }

    /// Seconds from an edit to its picture.
    fn shown(&mut self, edit: &dyn Fn(&mut Scene)) -> anyhow::Result<f64> {
        edit(&mut self.scene);
        let started = Instant::now();
        self.renderer.set_scene(&self.scene)?;
        trace(&mut self.renderer)?;
        self.picture.draw(&mut self.renderer)?;
        Ok(started.elapsed().as_secs_f64())
    }
}

/// As large as the window draws it while things change.
fn size_px(gpu: &Gpu) -> [u32; 2] {
    PICTURE_PX.map(|pixels| if gpu.is_software() { pixels / COARSENESS } else { pixels })
}

fn trace(renderer: &mut Renderer) -> anyhow::Result<()> {
    for samples in BATCHES {
        renderer.trace(samples)?;
    }
    Ok(())
}

/// Seconds from a gaze elsewhere to a picture with a batch of samples about it; the film goes on.
fn looks_elsewhere(
    renderer: &mut Renderer,
    gpu: &Gpu,
    args: &BenchArgs,
    subject: &Subject,
) -> anyhow::Result<Vec<f64>> {
    let mut seconds = Vec::new();
    for place in subject.places.iter().cycle().skip(1).take(args.rounds as usize) {
        let picture = Picture::new(gpu, place, size_px(gpu));
        gpu.wait()?;
        let started = Instant::now();
        renderer.set_distribution(subject.distribution(Method::FvClip, place))?;
        trace(renderer)?;
        picture.draw(renderer)?;
        seconds.push(started.elapsed().as_secs_f64());
    }
    Ok(seconds)
}

fn samples_in_fovea(renderer: &Renderer, subject: &Subject, place: &Place) -> anyhow::Result<u64> {
    let film = renderer.snapshot()?;
    let gaze = subject.pose.world_from_film.inverse() * place.gaze.direction;
    let nearest = FOVEA_DEG.to_radians().cos() as f32;
    let is_near = |index: usize| {
        let (x, y) = (index as u32 % subject.film.width, index as u32 / subject.film.width);
        film_direction(&subject.film, x, y).dot(gaze) > nearest
    };
    let pixels = film.pixels().enumerate();
    Ok(pixels.filter(|(i, pixel)| pixel.samples > 0 && is_near(*i)).map(|(_, pixel)| u64::from(pixel.samples)).sum())
}
