//! `--resume`: what a render takes over from a film, and what of the command line contradicts that.

use std::path::Path;

use anyhow::{Context, bail};
use glam::Quat;
use serde_json::{Map, Value};
use tracer::film::FilmHeader;
use tracer::renderer::{FilmPose, Renderer, RendererOptions, SequenceKind};

use super::film_options;
use crate::cli::RenderArgs;
use crate::cli::choices::Orient;
use crate::output::exr::FilmFile;
use crate::session::Viewpoint;

/// Options and pose of a render that goes on with a film.
///
/// # Errors
/// When the command line states something else than the film has; the option is named.
pub fn take_over(
    args: &RenderArgs,
    film: &FilmHeader,
    camera: &Viewpoint,
) -> anyhow::Result<(RendererOptions, FilmPose)> {
    let mut options = film.renderer_options();
    for option in &args.stated {
        let (asked, found) = match *option {
            "film" => (format!("{:?}", film_options(args.film, camera)), format!("{:?}", film.options)),
            "camera" => (camera.position.to_string(), film.pose.position.to_string()),
            "orient" => {
                let asked = if args.orient == Some(Orient::Camera) { camera.rotation } else { Quat::IDENTITY };
                (asked.to_string(), film.pose.world_from_film.to_string())
            }
            "seed" if film.ranges.iter().any(|range| range.seed == args.sampling.seed) => {
                // A film of several seeds goes on with any of them.
                options.seed = args.sampling.seed;
                continue;
            }
            "seed" => (args.sampling.seed.to_string(), options.seed.to_string()),
            "sequence" => {
                let asked = SequenceKind::from(args.sampling.sequence);
                (format!("{asked:?}"), format!("{:?}", film.sequence))
            }
            _ => (args.sampling.max_bounces.to_string(), film.max_bounces.to_string()),
        };
        if asked != found {
            bail!("--{} is {asked}, but the film to go on with has {found}", option.replace('_', "-"));
        }
    }
    Ok((options, film.pose))
}

/// Puts the film into a renderer that has its scene and pose; what is left are its settings. The largest films are too large to
/// be kept beside the renderer's.
///
/// # Errors
/// When the film is of another scene.
pub fn restore(renderer: &mut Renderer, file: FilmFile, path: &Path) -> anyhow::Result<Map<String, Value>> {
    let name = file.settings.get("scene").and_then(|name| name.as_str()).unwrap_or("another scene");
    renderer.restore(&file.film).with_context(|| format!("{} was made of {name}", path.display()))?;
    Ok(file.settings)
}
