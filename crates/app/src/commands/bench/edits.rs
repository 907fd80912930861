//! From an edit, or a look elsewhere, to a picture that shows it.

use std::sync::Arc;
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

/// Samples between an edit and the picture, clipped to the view as in the window.
const SAMPLES: u32 = 1 << 13;

/// Seconds from each edit to a presented picture of samples traced after it, and how many of them are in the foveal disc.
///
/// # Errors
/// When the scene does not fit the adapter or the device is lost.
pub fn measure(gpu: &Gpu, args: &BenchArgs, subject: &Subject) -> anyhow::Result<Value> {
    let mut scene = (*subject.scene).clone();
    let (mut renderer, _) = subject.renderer(gpu, args, &scene)?;
    let place = subject.places.first().context("no gaze")?;
    let picture = Picture::new(gpu, place, PICTURE_PX);
    renderer.set_distribution(subject.distribution(Method::FvClip, place))?;
    renderer.trace(SAMPLES)?;
    picture.draw(&mut renderer)?;

    let mut shown = |edit: &dyn Fn(&mut Scene), times: u32| -> anyhow::Result<Vec<f64>> {
        let mut seconds = Vec::new();
        for _ in 0..times {
            edit(&mut scene);
            let started = Instant::now();
            renderer.set_scene(&scene)?;
            renderer.trace(SAMPLES)?;
            picture.draw(&mut renderer)?;
            seconds.push(started.elapsed().as_secs_f64());
        }
        Ok(seconds)
    };
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
    let material = shown(&tint, args.rounds)?;
    let first_move = shown(&shift, 1)?;
    let moves = shown(&shift, args.rounds)?;
    let in_fovea = samples_in_fovea(&renderer, subject, place)?;
    let looks = looks_elsewhere(&mut renderer, gpu, args, subject)?;
    Ok(json!({
        "samples": SAMPLES, "samples_in_foveal_disc": in_fovea,
        "material_s": material, "first_move_s": first_move, "move_s": moves, "gaze_s": looks,
    }))
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
        let picture = Picture::new(gpu, place, PICTURE_PX);
        gpu.wait()?;
        let started = Instant::now();
        renderer.set_distribution(subject.distribution(Method::FvClip, place))?;
        renderer.trace(SAMPLES)?;
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
