//! From raw rows to what the report says: curves, ratios at equal error, split times.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde_json::Value;

use super::observer::{self, Split};
use super::plan::Method;
use super::rates::Rates;
use super::record::{self, Row, RunKey, Table, column};
use super::statistics::{self, Crossing, Curve, Estimate};

/// Largest share of empty foveal pixels at which curves are compared at equal error: with fewer than about 1.6 samples a pixel
/// the error of the pixels that have one hardly depends on their number.
const MOST_EMPTY: f64 = 0.2;

/// The numbers of the page, with each scene's settings.
pub const SUMMARY: &str = "study.json";

/// All raw data of a study.
#[derive(Clone, Debug, Default)]
pub struct Analysis {
    /// Error against samples.
    pub table: Table,
    /// Seconds a sample.
    pub rates: Rates,
    /// What decided each scene's curves, by its name.
    pub settings: BTreeMap<String, Value>,
}

/// A scene seen towards a gaze.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sight<'a> {
    /// File name without its ending.
    pub scene: &'a str,
    /// `yaw_pitch`.
    pub gaze: &'a str,
}

impl Sight<'_> {
    /// Pitch of the gaze, degrees: its latitude on the film.
    pub fn latitude_deg(&self) -> f64 {
        self.gaze.rsplit('_').next().and_then(|pitch| pitch.parse().ok()).unwrap_or(0.0)
    }

    /// The gaze as `yaw, pitch`.
    pub fn gaze_text(&self) -> String {
        self.gaze.replace('_', ", ")
    }
}

/// A ratio in samples and in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sooner {
    /// Samples of the slower over the faster at equal error.
    pub samples: Estimate,
    /// Seconds a sample of the slower over the faster, by the clock.
    pub rate: Option<f64>,
    /// The same in processor time.
    pub cpu_rate: Option<f64>,
}

impl Sooner {
    /// Time of the slower over the faster.
    pub fn time(&self) -> Option<f64> {
        Some(self.samples.value * self.rate?)
    }
}

impl Analysis {
    /// Reads a study's folder, or what is kept of one that is done: `curves.csv`, `rates.csv` and `study.json`.
    ///
    /// # Errors
    /// When a file in it is not what a study made.
    pub fn read(folder: &Path) -> anyhow::Result<Self> {
        let table = record::read_all(folder)?;
        let read = |path: PathBuf| -> anyhow::Result<Value> {
            let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
            serde_json::from_str(&text).with_context(|| path.display().to_string())
        };
        let references = folder.join("references");
        let kept = if references.exists() { None } else { Some(read(folder.join(SUMMARY))?) };
        let names: BTreeSet<&str> = table.keys().map(|key| key.scene.as_str()).collect();
        let settings = names.into_iter().map(|scene| {
            let settings = match &kept {
                Some(kept) => kept["settings"][scene].clone(),
                None => read(references.join(format!("{scene}.json")))?,
            };
            Ok((scene.to_owned(), settings))
        });
        let settings = settings.collect::<anyhow::Result<_>>()?;
        Ok(Self { table, rates: Rates::read(folder)?, settings })
    }

    /// Pixels of a scene's film; 1 where it is not known.
    pub fn film_pixels(&self, scene: &str) -> f64 {
        let side = |k: usize| self.settings.get(scene)?.get("film")?.get(k)?.as_f64();
        side(0).zip(side(1)).map_or(1.0, |(width, height)| width * height)
    }

    /// Scenes, in the order of their names.
    pub fn scenes(&self) -> Vec<&str> {
        let names: BTreeSet<&str> = self.table.keys().map(|key| key.scene.as_str()).collect();
        names.into_iter().collect()
    }

    /// Gazes of a scene: the one nearest to the camera's axis first.
    pub fn sights<'a>(&'a self, scene: &'a str) -> Vec<Sight<'a>> {
        let here = self.table.keys().filter(|key| key.scene == scene);
        let names: BTreeSet<&str> = here.map(|key| key.gaze.as_str()).collect();
        let mut sights: Vec<_> = names.into_iter().map(|gaze| Sight { scene, gaze }).collect();
        let off = |sight: &Sight<'_>| {
            sight.gaze.split('_').filter_map(|angle| angle.parse::<f64>().ok()).map(|angle| angle * angle).sum::<f64>()
        };
        sights.sort_by(|a, b| off(a).total_cmp(&off(b)));
        sights
    }

    /// Every gaze of every scene.
    pub fn all_sights(&self) -> Vec<Sight<'_>> {
        self.scenes().into_iter().flat_map(|scene| self.sights(scene)).collect()
    }

    fn runs(&self, sight: Sight<'_>, method: Method) -> Vec<&Vec<Row>> {
        let from = RunKey { scene: sight.scene.into(), gaze: sight.gaze.into(), method, seed: 0 };
        let to = RunKey { seed: u32::MAX, ..from.clone() };
        self.table.range(from..=to).map(|(_, rows)| rows).collect()
    }

    /// Number of repetitions of a method.
    pub fn seeds(&self, sight: Sight<'_>, method: Method) -> usize {
        self.runs(sight, method).len()
    }

    /// A measure against samples, at the points where every seed has it.
    pub fn curve(&self, sight: Sight<'_>, method: Method, measure: &str) -> Option<Curve> {
        let runs = self.runs(sight, method);
        let measure = column(measure);
        let first = runs.first()?;
        let everywhere = |point: usize| {
            let value = |rows: &&Vec<Row>| rows.get(point).map_or(f64::NAN, |row| row.measures[measure]);
            runs.iter().map(value).all(f64::is_finite)
        };
        let points: Vec<usize> = (0..first.len()).filter(|point| everywhere(*point)).collect();
        let seeds = runs.iter().map(|rows| points.iter().map(|p| rows[*p].measures[measure]).collect()).collect();
        let samples: Vec<f64> = points.iter().map(|p| first[*p].samples as f64).collect();
        (!samples.is_empty()).then_some(Curve { samples, seeds })
    }

    /// The same where nearly all of the fovea's pixels have samples.
    pub fn filled_curve(&self, sight: Sight<'_>, method: Method, measure: &str) -> Option<Curve> {
        let curve = self.curve(sight, method, measure)?;
        let empty = self.curve(sight, method, "empty")?;
        let filled = |samples: &f64| {
            let at = empty.samples.iter().position(|n| n == samples);
            at.is_some_and(|at| empty.mean()[at] <= MOST_EMPTY)
        };
        let wanted: Vec<bool> = curve.samples.iter().map(filled).collect();
        let kept = curve.filtered(&wanted);
        (!kept.samples.is_empty()).then_some(kept)
    }

    /// How much sooner one method has an error in the fovea than another.
    pub fn sooner(&self, sight: Sight<'_>, slow: Method, fast: Method, measure: &str) -> Option<Sooner> {
        let curves = [slow, fast].map(|method| self.filled_curve(sight, method, measure));
        let [Some(slow_curve), Some(fast_curve)] = curves else { return None };
        let costs = [slow, fast].map(|method| self.rates.of(sight.scene, sight.gaze, method));
        let ratio = |get: fn(super::rates::Cost) -> Option<f64>| match costs {
            [Some(slow), Some(fast)] => Some(get(slow)? / get(fast)?),
            _ => None,
        };
        Some(Sooner {
            samples: statistics::samples_at_equal_error(&slow_curve, &fast_curve)?,
            rate: ratio(|cost| Some(cost.wall)),
            cpu_rate: ratio(|cost| cost.cpu),
        })
    }

    /// Samples at which a method reaches an observer's threshold.
    pub fn crossing(&self, sight: Sight<'_>, method: Method, split: Split) -> Option<Crossing> {
        let curve = self.curve(sight, method, split.measure())?;
        statistics::crossing(&curve, |value| split.square(value), split.threshold())
    }

    /// An observer's split time, seconds.
    pub fn split_secs(&self, sight: Sight<'_>, method: Method, split: Split) -> Option<f64> {
        let cost = self.rates.of(sight.scene, sight.gaze, method)?;
        Some(observer::split_secs(self.crossing(sight, method, split)?.samples.value * cost.wall))
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::commands::study::record::MEASURES;
    use crate::commands::study::statistics::SplitMix;

    /// A study of one scene whose methods have the calculated densities: error 2 over the samples of a foveal pixel.
    pub fn synthetic(fault: f64) -> Analysis {
        let mut table = Table::new();
        let mut random = SplitMix(5);
        let pixels = 512.0 * 256.0;
        for method in [Method::Od, Method::Vp, Method::Fv] {
            let density = method.density_over_od(0.0).unwrap_or(1.0);
            for seed in 1..=8 {
                let row = |samples: &u64| {
                    let in_pixel = *samples as f64 / pixels * density / if method == Method::Fv { fault } else { 1.0 };
                    let mut measures = [0.0; MEASURES];
                    measures[column("film_fovea")] = 2.0 / in_pixel * (1.0 + 0.1 * (random.uniform() - 0.5));
                    measures[column("empty")] = (-in_pixel).exp();
                    measures[column("outline")] = (1.0 / (1.0 + 2.0 / in_pixel)).sqrt();
                    measures[column("colour")] = 14.0 / in_pixel.sqrt();
                    Row { samples: *samples, measures }
                };
                let rows = method.schedule(pixels as u64, 8, false).iter().map(row).collect();
                table.insert(RunKey { scene: "room".into(), gaze: "0_0".into(), method, seed }, rows);
            }
        }
        Analysis { table, ..Analysis::default() }
    }

    #[test]
    fn ratios_are_those_of_the_densities_and_a_fault_is_seen() {
        let sight = Sight { scene: "room", gaze: "0_0" };
        for (slow, fast, expected) in
            [(Method::Od, Method::Fv, 60.5), (Method::Od, Method::Vp, 3.47), (Method::Vp, Method::Fv, 17.4)]
        {
            let found = synthetic(1.0).sooner(sight, slow, fast, "film_fovea").map_or(f64::NAN, |s| s.samples.value);
            assert!((found / expected - 1.0).abs() < 0.04, "{slow:?} over {fast:?}: {found}");
        }
        let faulty = synthetic(1.15).sooner(sight, Method::Od, Method::Fv, "film_fovea");
        assert!(faulty.is_some_and(|s| s.samples.interval[1] < 60.5 * 0.95));
    }

    #[test]
    fn sights_begin_at_the_axis() {
        let mut analysis = synthetic(1.0);
        let rows = analysis.table.values().next().cloned().unwrap_or_default();
        for gaze in ["0_-60", "45_14"] {
            let key = RunKey { scene: "room".into(), gaze: gaze.into(), method: Method::Fv, seed: 1 };
            analysis.table.insert(key, rows.clone());
        }
        let sights = analysis.sights("room");
        assert_eq!(sights.iter().map(|s| s.gaze).collect::<Vec<_>>(), ["0_0", "45_14", "0_-60"]);
        assert_eq!(sights[2].latitude_deg(), -60.0);
    }

    #[test]
    fn thresholds_come_sooner_with_more_samples_where_one_looks() {
        let analysis = synthetic(1.0);
        let sight = Sight { scene: "room", gaze: "0_0" };
        for split in Split::ALL {
            let at = |method| analysis.crossing(sight, method, split).map_or(f64::NAN, |c| c.samples.value);
            assert!((at(Method::Od) / at(Method::Fv) / 60.5 - 1.0).abs() < 0.05, "{split:?}");
        }
    }
}
