//! `--resume`: what a render takes over from a film, and what of the command line contradicts that.

use std::path::Path;

use anyhow::{Context, bail};
use glam::Quat;
use serde_json::{Map, Value};
use tracer::film::{FilmHeader, FilmMapping, FilmOptions};
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
            "film" => (film_in_words(&film_options(args.film, camera)), film_in_words(&film.options)),
            "camera" => (format!("at {} m", camera.position), format!("at {} m", film.pose.position)),
            "orient" => {
                let (asked, axes) = match args.orient {
                    Some(Orient::Camera) => ("camera", camera.rotation),
                    _ => ("world", Quat::IDENTITY),
                };
                if axes == film.pose.world_from_film {
                    continue;
                }
                let off_deg = axes.angle_between(film.pose.world_from_film).to_degrees();
                (asked.to_owned(), format!("{off_deg:.1} degrees from it"))
            }
            "seed" if film.ranges.iter().any(|range| range.seed == args.sampling.seed) => {
                // A film of several seeds goes on with any of them.
                options.seed = args.sampling.seed;
                continue;
            }
            "seed" => (args.sampling.seed.to_string(), options.seed.to_string()),
            "sequence" => {
                let asked = SequenceKind::from(args.sampling.sequence);
                (format!("{asked:?}").to_lowercase(), format!("{:?}", film.sequence).to_lowercase())
            }
            _ => (args.sampling.max_bounces.to_string(), film.max_bounces.to_string()),
        };
        if asked != found {
            bail!("--{} is {asked}, but that of the film to go on with is {found}", option.replace('_', "-"));
        }
    }
    Ok((options, film.pose))
}

/// A film as the command line has it; of a perspective one also what its lens sees, which the camera decides.
fn film_in_words(film: &FilmOptions) -> String {
    let FilmOptions { mapping, width, height } = film;
    match mapping {
        FilmMapping::Equirect => format!("equirect:{width}x{height}"),
        FilmMapping::Perspective { half_extent: [x, y] } => {
            let [across, up] = [x, y].map(|tan| 2.0 * tan.atan().to_degrees());
            format!("perspective:{width}x{height} of {across} by {up} degrees")
        }
    }
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
