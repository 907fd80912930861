//! Seconds a sample of every method, measured in short rounds that take the methods in turn: what slows the machine for a
//! while slows all alike. Raw: `rates.csv`.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use anyhow::{Context, bail};

use super::bench::Bench;
use super::plan::{Method, Place};
use super::{report, statistics};
use crate::cli::study::{Part, StudyArgs};
use crate::output::write_text;
use crate::process::cpu_secs;

/// Rounds over the methods.
const ROUNDS: u32 = 9;
/// Samples of each in a round, at most; no more than OD's curve has. The system counts processor time in hundredths of a second.
const SAMPLES: u64 = 1 << 16;
/// Samples before the first round: kernels compile at their first use.
const WARM_UP: u64 = 1 << 12;
/// The raw file.
const FILE: &str = "rates.csv";
const HEADER: &str = "scene,gaze,method,round,samples,wall_s,cpu_s\n";

/// One method's share of one round.
#[derive(Clone, Debug, PartialEq)]
pub struct Round {
    /// File name of the scene without its ending.
    pub scene: String,
    /// `yaw_pitch`.
    pub gaze: String,
    /// How samples were spread.
    pub method: Method,
    /// Number of the round.
    pub round: u32,
    /// Samples.
    pub samples: u64,
    /// By the clock.
    pub wall_secs: f64,
    /// Of all threads of the process; NaN where the system does not say.
    pub cpu_secs: f64,
}

/// Measures a scene at those of its gazes that the file lacks, or at all where rates alone are asked for. The file is written
/// gaze by gaze; what it holds of others stays.
///
/// # Errors
/// When the device is lost, or the file is not what [`to_csv`] made or cannot be written.
pub fn measure(bench: &mut Bench, args: &StudyArgs) -> anyhow::Result<()> {
    let mut rounds = read(&args.output)?;
    for place in bench.places.clone() {
        if args.only == Part::Rates || is_missing(&rounds, &bench.name, &place.name()) {
            report::write_provenance(args, bench.gpu(), Part::Rates)?;
            put(&mut rounds, measure_at(bench, args, &place)?);
            write_text(&args.output.join(FILE), &to_csv(&rounds))?;
        }
    }
    Ok(())
}

fn measure_at(bench: &mut Bench, args: &StudyArgs, place: &Place) -> anyhow::Result<Vec<Round>> {
    let samples = SAMPLES.min(bench.film.pixels() * args.spp);
    let mut rounds = Vec::new();
    for round in 0..=ROUNDS {
        for method in methods() {
            bench.begin(method, place, round + 1, method.sequence())?;
            bench.go_on(WARM_UP)?;
            // The zeroth round compiles and warms caches.
            if round > 0 {
                let cpu = cpu_secs();
                let wall_secs = bench.go_on(WARM_UP + samples)?;
                let cpu_secs = cpu_secs() - cpu;
                let (scene, gaze) = (bench.name.clone(), place.name());
                rounds.push(Round { scene, gaze, method, round, samples, wall_secs, cpu_secs });
            }
        }
    }
    Ok(rounds)
}

/// What is measured: a wandering gaze costs what a fixed one does.
fn methods() -> impl Iterator<Item = Method> {
    Method::ALL.into_iter().filter(|method| *method != Method::FvWander)
}

fn is_missing(rounds: &[Round], scene: &str, gaze: &str) -> bool {
    let holds = |method| rounds.iter().any(|r| r.scene == scene && r.gaze == gaze && r.method == method);
    !methods().all(holds)
}

/// Adds rounds in the place of older ones of the same scene and gaze.
fn put(rounds: &mut Vec<Round>, newer: Vec<Round>) {
    rounds.retain(|old| !newer.iter().any(|new| new.scene == old.scene && new.gaze == old.gaze));
    rounds.extend(newer);
}

fn to_csv(rounds: &[Round]) -> String {
    let mut text = HEADER.to_owned();
    for r in rounds {
        let cpu = if r.cpu_secs.is_finite() { format!("{:.2}", r.cpu_secs) } else { String::new() };
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{},{},{},{},{},{:.4},{cpu}",
            r.scene,
            r.gaze,
            r.method.name(),
            r.round,
            r.samples,
            r.wall_secs
        );
    }
    text
}

/// All rounds that were measured; none before the first.
fn read(folder: &Path) -> anyhow::Result<Vec<Round>> {
    let path = folder.join(FILE);
    match std::fs::read_to_string(&path) {
        Ok(text) => from_csv(&text).with_context(|| path.display().to_string()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(error) => Err(error).with_context(|| path.display().to_string()),
    }
}

fn from_csv(text: &str) -> anyhow::Result<Vec<Round>> {
    let Some(rows) = text.strip_prefix(HEADER) else { bail!("another version of the rates' columns") };
    rows.lines().map(|row| round(row).with_context(|| format!("`{row}`"))).collect()
}

fn round(row: &str) -> anyhow::Result<Round> {
    let fields: Vec<&str> = row.split(',').collect();
    let [scene, gaze, method, round, samples, wall, cpu] = fields.as_slice() else { bail!("not seven fields") };
    Ok(Round {
        scene: (*scene).to_owned(),
        gaze: (*gaze).to_owned(),
        method: Method::by_name(method).context("no such method")?,
        round: round.parse()?,
        samples: samples.parse()?,
        wall_secs: wall.parse()?,
        cpu_secs: if cpu.is_empty() { f64::NAN } else { cpu.parse()? },
    })
}

/// Seconds a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// By the clock.
    pub wall: f64,
    /// Of the processor, if known.
    pub cpu: Option<f64>,
}

/// Median seconds a sample by scene, gaze and method.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rates(BTreeMap<(String, String, Method), Cost>);

impl Rates {
    /// Of the rounds in a study's folder; empty when nothing was measured yet.
    ///
    /// # Errors
    /// When the file is not what [`to_csv`] made.
    pub fn read(folder: &Path) -> anyhow::Result<Self> {
        read(folder).map(Self::of_rounds)
    }

    fn of_rounds(rounds: Vec<Round>) -> Self {
        let mut costs: BTreeMap<_, (Vec<f64>, Vec<f64>)> = BTreeMap::new();
        for Round { scene, gaze, method, samples, wall_secs, cpu_secs, .. } in rounds {
            let all = costs.entry((scene, gaze, method)).or_default();
            all.0.push(wall_secs / samples as f64);
            all.1.extend(Some(cpu_secs / samples as f64).filter(|cpu| cpu.is_finite()));
        }
        let cost = |(walls, cpus)| Some(Cost { wall: statistics::median(walls)?, cpu: statistics::median(cpus) });
        Self(costs.into_iter().filter_map(|(key, all)| Some((key, cost(all)?))).collect())
    }

    /// Seconds a sample; a wandering gaze costs what a fixed one does.
    pub fn of(&self, scene: &str, gaze: &str, method: Method) -> Option<Cost> {
        let method = if method == Method::FvWander { Method::Fv } else { method };
        self.0.get(&(scene.to_owned(), gaze.to_owned(), method)).copied()
    }

    /// Samples of a method in the time that so many of another take.
    ///
    /// # Errors
    /// When one of the two was not measured.
    pub fn in_equal_time(
        &self,
        (scene, gaze): (&str, &str),
        (other, samples): (Method, f64),
        method: Method,
    ) -> anyhow::Result<f64> {
        let wall = |method: Method| {
            let cost = self.of(scene, gaze, method);
            let missing = || format!("{FILE} lacks {} of {scene} at {gaze}; --only rates measures it", method.name());
            cost.map(|cost| cost.wall).with_context(missing)
        };
        Ok(samples * wall(other)? / wall(method)?)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn rates_are_medians_over_rounds() {
        let text = format!("{HEADER}a,0_0,fv,1,1000,1.0,2.00\na,0_0,fv,2,1000,9.0,2.20\na,0_0,fv,3,1000,2.0,\n");
        let rates = Rates::of_rounds(from_csv(&text).unwrap());
        let cost = rates.of("a", "0_0", Method::FvWander).unwrap();
        assert!((cost.wall - 2e-3).abs() < 1e-12 && (cost.cpu.unwrap() - 2.1e-3).abs() < 1e-12);
        assert_eq!(rates.of("a", "0_0", Method::Od), None);
        assert!(from_csv("scene\n").is_err() && from_csv(&format!("{HEADER}a,0_0,fv,1,many,1.0,\n")).is_err());
    }

    fn rounds(scene: &str, gaze: &str, wall_secs: f64) -> Vec<Round> {
        let (scene, gaze) = (scene.to_owned(), gaze.to_owned());
        let one = |method| Round {
            scene: scene.clone(),
            gaze: gaze.clone(),
            method,
            round: 1,
            samples: 1000,
            wall_secs,
            cpu_secs: 0.25,
        };
        methods().map(one).collect()
    }

    #[test]
    fn an_interrupted_study_measures_what_is_missing_and_keeps_the_rest() {
        let mut all = rounds("a", "0_0", 1.0);
        put(&mut all, rounds("b", "0_0", 2.0));
        // As after an interruption: all of one scene and none of the next; and as a version with fewer methods left it.
        let mut all = from_csv(&to_csv(&all)).unwrap();
        assert!(!is_missing(&all, "a", "0_0") && !is_missing(&all, "b", "0_0"));
        assert!(is_missing(&all, "a", "0_-30") && is_missing(&all, "c", "0_0"));
        all.retain(|r| r.scene != "b" || r.method != Method::FvBest);
        assert!(is_missing(&all, "b", "0_0"));
        // One scene anew: no other's rows go, and none of its own stay.
        put(&mut all, rounds("b", "0_0", 4.0));
        assert_eq!(from_csv(&to_csv(&all)).unwrap(), all);
        assert_eq!(all.len(), 2 * methods().count());
        let rates = Rates::of_rounds(all);
        let wall = |scene| rates.of(scene, "0_0", Method::Fv).unwrap().wall;
        assert_eq!((wall("a"), wall("b")), (1e-3, 4e-3));
    }

    #[test]
    fn a_rate_that_is_not_there_is_named() {
        let mut some = rounds("a", "0_0", 1.0);
        some.retain(|r| r.method != Method::Vp);
        let rates = Rates::of_rounds(some);
        let samples = |gaze, method| rates.in_equal_time(("a", gaze), (Method::Od, 100.0), method);
        assert_eq!(samples("0_0", Method::Fv).unwrap(), 100.0);
        let error = samples("0_0", Method::Vp).unwrap_err().to_string();
        assert!(error.contains("rates.csv lacks vp of a at 0_0"), "{error}");
        assert!(samples("0_-30", Method::Fv).is_err());
    }
}
