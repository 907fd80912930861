//! `--gaze-trace`: samples shared out over a recording's time, each where somebody looked then.

use std::ops::Range;
use std::path::Path;

use anyhow::{Context, bail};
use tracer::distribution::View;

use crate::cli::RenderArgs;
use crate::cli::choices::{EccentricityAt, Mode};
use crate::gaze::filter::{FilterSettings, GazeFilter, Phase};
use crate::gaze::geometry::{RectPx, WindowPlace};
use crate::gaze::parse::trace::{Space, Trace};
use crate::gaze::replay;
use crate::sampling::GazePoint;
use crate::screen::ScreenGeometry;
use crate::view::direction;

/// Stretches of time that a recording is cut into at most; each costs a change of the distribution.
const MOST_STEPS: usize = 2000;
/// Largest block of samples that a stretch ends on.
const LARGEST_BLOCK: u64 = 1 << 14;

/// Where somebody looked for a part of the recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Samples of the film when the step is over.
    pub samples: u64,
    /// Where.
    pub gaze: GazePoint,
}

/// A recording as steps of the samples from those that the film has to those that it gets.
///
/// # Errors
/// A file that is no trace or holds no valid row, or a mode that has no gaze.
pub fn steps(path: &Path, args: &RenderArgs, view: &View, samples: Range<u64>) -> anyhow::Result<Vec<Step>> {
    if args.sampling.mode != Mode::Fv {
        bail!("--gaze-trace needs --mode fv: the other modes do not go by the gaze");
    }
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let trace = Trace::parse(&text).with_context(|| path.display().to_string())?;
    let looked = looked(&trace, args, view);
    if looked.is_empty() {
        bail!("{}: no row is valid", path.display());
    }
    Ok(shared_out(&looked, samples))
}

/// A recording as steps of `total` samples, unfiltered, on a screen that shows the view and nothing else.
///
/// # Errors
/// A file that is no trace or holds no valid row.
pub fn within_view(path: &Path, view: &View, total: u64) -> anyhow::Result<Vec<Step>> {
    let text = std::fs::read_to_string(path)?;
    let trace = Trace::parse(&text)?;
    let usual_secs = trace.duration_secs() / (trace.rows.len() - 1).max(1) as f64;
    let ends = trace.rows.iter().skip(1).map(|row| Some(row.time_secs)).chain([None]);
    let valid = trace.rows.iter().zip(ends).filter(|(row, _)| row.valid);
    let looked: Vec<(f64, GazePoint)> = valid
        .map(|(row, end)| {
            let secs = end.map_or(usual_secs.max(1e-6), |end| end - row.time_secs);
            let [x, y] = row.point.map(|value| value as f32);
            let gaze = match trace.header.space {
                Space::ViewDeg => {
                    let in_view = direction(x.to_radians(), y.to_radians());
                    GazePoint::towards(view.world_from_view * in_view, view)
                }
                Space::Screen01 => GazePoint::at(glam::Vec2::new(2.0 * x - 1.0, 1.0 - 2.0 * y), view),
            };
            (secs, gaze)
        })
        .collect();
    if looked.is_empty() {
        bail!("no row is valid");
    }
    Ok(shared_out(&looked, 0..total))
}

/// Filtered gaze, each with the seconds for which it holds. Rows before the first valid one are left out.
fn looked(trace: &Trace, args: &RenderArgs, view: &View) -> Vec<(f64, GazePoint)> {
    let place = place(trace, args);
    let mut filter = GazeFilter::new(FilterSettings::default());
    let usual_secs = trace.duration_secs() / (trace.rows.len() - 1).max(1) as f64;
    let ends = trace.rows.iter().skip(1).map(|row| Some(row.time_secs)).chain([None]);
    let held = |(row, end): (&crate::gaze::parse::trace::Row, Option<f64>)| {
        let point = replay::point(trace.header.space, row.point);
        let filtered = filter.update(row.time_secs, row.valid.then(|| place.deg(point, None)))?;
        let secs = end.map_or(usual_secs.max(1e-6), |end| end - row.time_secs);
        (filtered.phase != Phase::Lost)
            .then(|| (secs, gaze_point(trace.header.space, filtered.point_deg, &place, args, view)))
    };
    trace.rows.iter().zip(ends).filter_map(held).collect()
}

fn gaze_point(space: Space, deg: [f64; 2], place: &WindowPlace, args: &RenderArgs, view: &View) -> GazePoint {
    let gaze = match space {
        Space::ViewDeg => {
            let [yaw, pitch] = deg.map(|angle| angle.to_radians() as f32);
            GazePoint::towards(view.world_from_view * direction(yaw, pitch), view)
        }
        Space::Screen01 => GazePoint::at(glam::DVec2::from(place.picture_from_deg(deg)).as_vec2(), view),
    };
    // Eye space has no gaze beyond the screen; what is looked at there is nearest to its edge.
    let outside = gaze.on_view.abs().max_element() > 1.0;
    if args.eccentricity == EccentricityAt::Eye && outside {
        let edge = gaze.on_view.clamp(glam::Vec2::NEG_ONE, glam::Vec2::ONE);
        return GazePoint::at(edge, view);
    }
    gaze
}

/// The screen that shows the view and nothing else: the command line's, else the recording's.
fn place(trace: &Trace, args: &RenderArgs) -> WindowPlace {
    let asked = args.sampling.screen();
    let recorded = trace.header.screen_mm.filter(|_| args.sampling.screen_mm.is_none());
    let [width_mm, height_mm] = recorded.map_or([asked.width_mm, asked.height_mm], |mm| mm.map(|side| side as f32));
    let distance = trace.header.distance_mm.filter(|_| args.sampling.distance_mm.is_none());
    let distance_mm = distance.map_or(asked.distance_mm, |mm| mm as f32);
    let whole = RectPx { origin: [0.0; 2], size: [1.0; 2] };
    let screen = ScreenGeometry { width_mm, height_mm, distance_mm };
    WindowPlace { monitor: whole, picture: whole, screen, position_known: true }
}

/// Steps whose samples are in proportion to their time, on boundaries that cut the sequence into few batches.
fn shared_out(looked: &[(f64, GazePoint)], film: Range<u64>) -> Vec<Step> {
    let count = film.end.saturating_sub(film.start);
    let whole_secs: f64 = looked.iter().map(|(secs, _)| secs).sum();
    let most = looked.len().min(MOST_STEPS) as u64;
    let block = (count / (4 * most)).clamp(1, LARGEST_BLOCK);
    let block = 1_u64 << block.ilog2();
    let mut steps: Vec<Step> = Vec::new();
    let mut passed_secs = 0.0;
    for (secs, gaze) in looked {
        passed_secs += secs;
        let ideal = film.start + (count as f64 * (passed_secs / whole_secs)).round() as u64;
        let samples = (ideal / block * block).min(film.end);
        let before = steps.last().map_or(film.start, |step| step.samples);
        // A step shorter than a block joins the next; which of both gazes it takes makes no difference to that.
        let shortest = count / MOST_STEPS as u64;
        if samples > before && samples - before >= shortest {
            steps.push(Step { samples, gaze: *gaze });
        }
    }
    if let Some((_, gaze)) = looked.last()
        && steps.last().is_none_or(|step| step.samples < film.end)
    {
        steps.push(Step { samples: film.end, gaze: *gaze });
    }
    steps
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use glam::{Quat, Vec2, Vec3};

    use super::*;
    use crate::commands::render::tests::args;

    fn view() -> View {
        View { world_from_view: Quat::IDENTITY, half_extent: Vec2::new(1.0, 0.5) }
    }

    fn trace(text: &str) -> Trace {
        Trace::parse(text).unwrap()
    }

    #[test]
    fn a_fraction_of_the_screen_is_the_same_fraction_of_the_view() {
        let screen = trace("# gaze-trace v1; space=screen01\n0,0.75,0.25,1,1\n");
        let gaze = looked(&screen, &args(""), &view())[0].1;
        assert!(gaze.on_view.distance(Vec2::new(0.5, 0.5)) < 1e-5, "{gaze:?}");
        let degrees = trace("# gaze-trace v1; space=view_deg\n0,30,0,1\n");
        let gaze = looked(&degrees, &args(""), &view())[0].1;
        assert!(gaze.direction.distance(Vec3::new(0.5, 0.0, -(0.75_f32.sqrt()))) < 1e-5, "{gaze:?}");
        let off = trace("# gaze-trace v1; space=screen01\n0,1.5,0.5,1,1\n");
        assert!(looked(&off, &args(""), &view())[0].1.on_view.x > 1.5);
        assert_eq!(looked(&off, &args("--eccentricity eye"), &view())[0].1.on_view.x, 1.0);
    }

    #[test]
    fn samples_are_in_proportion_to_time_and_invalid_rows_hold() {
        let rows: String = (0..100)
            .map(|step| {
                format!(
                    "{},{},0.5,{},1\n",
                    f64::from(step) * 0.01,
                    if step < 25 { 0.25 } else { 0.75 },
                    u8::from(step != 50)
                )
            })
            .collect();
        let looked = looked(&trace(&format!("# gaze-trace v1; space=screen01\n{rows}")), &args(""), &view());
        assert_eq!(looked.len(), 100);
        let total = 1 << 20;
        let steps = shared_out(&looked, 0..total);
        assert_eq!(steps.last().unwrap().samples, total);
        assert!(steps.windows(2).all(|pair| pair[0].samples < pair[1].samples));
        let left = steps.iter().rfind(|step| step.gaze.on_view.x < 0.0).unwrap().samples;
        assert!((left as f64 / total as f64 - 0.25).abs() < 0.01, "{left}");
        // A film that has half of them already gets a quarter of the rest at the left.
        let steps = shared_out(&looked, total / 2..total);
        assert_eq!(steps.last().unwrap().samples, total);
        let left = steps.iter().rfind(|step| step.gaze.on_view.x < 0.0).unwrap().samples - total / 2;
        assert!((left as f64 / total as f64 - 0.125).abs() < 0.005, "{left}");
    }

    #[test]
    fn within_a_view_rows_are_taken_as_they_are() {
        let path = std::env::temp_dir().join(format!("fovea-follow-{}.csv", std::process::id()));
        std::fs::write(&path, "# gaze-trace v1; space=view_deg\n0,0,0,1\n1,30,0,1\n2,9,9,0\n3,0,-20,1\n").unwrap();
        let steps = within_view(&path, &view(), 1 << 10).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(steps.last().unwrap().samples, 1 << 10);
        let sines: Vec<Vec3> = steps.iter().map(|step| step.gaze.direction).collect();
        assert!(sines.iter().any(|d| (d.x - 0.5).abs() < 1e-5) && sines.iter().all(|d| d.x < 0.51 && d.y < 1e-6));
        assert!(within_view(&path, &view(), 1).is_err());
    }

    #[test]
    fn few_samples_and_long_recordings_make_few_steps() {
        let gaze = GazePoint { direction: Vec3::NEG_Z, on_view: Vec2::ZERO };
        let long = vec![(0.01, gaze); 100_000];
        for total in [1, 7, 1000, 5_000_000] {
            let steps = shared_out(&long, 0..total);
            assert!(steps.len() <= MOST_STEPS + 1, "{total}: {}", steps.len());
            assert_eq!(steps.last().unwrap().samples, total);
        }
    }
}
