//! Seconds a sample of every method, measured in short rounds that take the methods in turn: what slows the machine for a
//! while slows all alike. Raw: `rates.csv`.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use anyhow::{Context, bail};

use super::bench::Bench;
use super::plan::Method;
use super::statistics;
use crate::cli::study::StudyArgs;
use crate::process::cpu_secs;

/// Rounds over the methods.
const ROUNDS: u32 = 9;
/// Samples of each in a round, at most; no more than OD's curve has. The system counts processor time in hundredths of a second.
const SAMPLES: u64 = 1 << 16;
/// Samples before the first round: kernels compile at their first use.
const WARM_UP: u64 = 1 << 12;
/// The raw file.
pub const FILE: &str = "rates.csv";
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

/// Measures a scene at all its gazes.
///
/// # Errors
/// When the device is lost.
pub fn measure(bench: &mut Bench, args: &StudyArgs, rounds: &mut Vec<Round>) -> anyhow::Result<()> {
    let samples = SAMPLES.min(bench.film.pixels() * args.spp);
    let methods = Method::ALL.into_iter().filter(|method| *method != Method::FvWander);
    for place in bench.places.clone() {
        for round in 0..=ROUNDS {
            for method in methods.clone() {
                bench.begin(method, &place, round + 1, method.sequence())?;
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
    }
    Ok(())
}

/// Writes all rounds.
///
/// # Errors
/// When the file cannot be written.
pub fn write(args: &StudyArgs, rounds: &[Round]) -> anyhow::Result<()> {
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
    super::write_text(&args.output.join(FILE), &text)
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
    /// Reads what [`write`] wrote; empty when nothing was measured yet.
    ///
    /// # Errors
    /// When the file is not what [`write`] made.
    pub fn read(folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join(FILE);
        match std::fs::read_to_string(&path) {
            Ok(text) => Self::from_csv(&text).with_context(|| path.display().to_string()),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Self::default()),
            Err(error) => Err(error).with_context(|| path.display().to_string()),
        }
    }

    fn from_csv(text: &str) -> anyhow::Result<Self> {
        let Some(rows) = text.strip_prefix(HEADER) else { bail!("another version of the rates' columns") };
        let mut rounds: BTreeMap<_, (Vec<f64>, Vec<f64>)> = BTreeMap::new();
        for row in rows.lines() {
            let fields: Vec<&str> = row.split(',').collect();
            let [scene, gaze, method, _, samples, wall, cpu] = fields.as_slice() else { bail!("`{row}`") };
            let method = Method::by_name(method).with_context(|| format!("`{row}`: no such method"))?;
            let samples: f64 = samples.parse().with_context(|| format!("`{row}`"))?;
            let wall: f64 = wall.parse().with_context(|| format!("`{row}`"))?;
            let all = rounds.entry(((*scene).to_owned(), (*gaze).to_owned(), method)).or_default();
            all.0.push(wall / samples);
            all.1.extend(cpu.parse::<f64>().ok().map(|cpu| cpu / samples));
        }
        let cost = |(walls, cpus)| Some(Cost { wall: statistics::median(walls)?, cpu: statistics::median(cpus) });
        Ok(Self(rounds.into_iter().filter_map(|(key, all)| Some((key, cost(all)?))).collect()))
    }

    /// Seconds a sample; a wandering gaze costs what a fixed one does.
    pub fn of(&self, scene: &str, gaze: &str, method: Method) -> Option<Cost> {
        let method = if method == Method::FvWander { Method::Fv } else { method };
        self.0.get(&(scene.to_owned(), gaze.to_owned(), method)).copied()
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn rates_are_medians_over_rounds() {
        let text = format!("{HEADER}a,0_0,fv,1,1000,1.0,2.00\na,0_0,fv,2,1000,9.0,2.20\na,0_0,fv,3,1000,2.0,\n");
        let rates = Rates::from_csv(&text).unwrap();
        let cost = rates.of("a", "0_0", Method::FvWander).unwrap();
        assert!((cost.wall - 2e-3).abs() < 1e-12 && (cost.cpu.unwrap() - 2.1e-3).abs() < 1e-12);
        assert_eq!(rates.of("a", "0_0", Method::Od), None);
        assert!(Rates::from_csv("scene\n").is_err());
    }
}
