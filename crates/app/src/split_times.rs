//! Split times: when can somebody tell an object's outline, when its material, in one mode and in another?
//!
//! A run shows every mode as often as wanted, in an order drawn at random, each from an empty film. The person presses one key when the
//! outline is visible and another when the material is. Results are a CSV with all that a reader needs to repeat the run, a
//! table of medians, and a plot.

use std::fmt::Write;
use std::time::Duration;

use tracer::provenance::Provenance;

use crate::cli::choices::Mode;
use crate::settings::mode_name;

/// The CSV's columns.
const HEADER: &str = "trial,mode,blind,object,scene,outline_s,material_s,outline_samples,material_samples,\
    outline_gaze_yaw_deg,outline_gaze_pitch_deg,material_gaze_yaw_deg,material_gaze_pitch_deg";
/// Width and height of the plot, and its left edge and right edge, pixels.
const PLOT_PX: [f64; 2] = [720.0, 90.0];
const AXIS_PX: [f64; 2] = [110.0, 690.0];

/// What is to be done.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Modes that are compared.
    pub modes: Vec<Mode>,
    /// How often each is shown.
    pub repetitions: u32,
    /// The person does not see which mode it is.
    pub blind: bool,
    /// What is looked at, in words.
    pub object: String,
}

/// The moment of a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Since the film was empty.
    pub elapsed: Duration,
    /// Samples in the film.
    pub samples: u64,
    /// Where the person looked, degrees: yaw to the right, pitch up, in the scene.
    pub gaze_deg: [f64; 2],
}

/// One mode shown once.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The mode.
    pub mode: Mode,
    /// When the outline was visible.
    pub outline: Option<Moment>,
    /// When the material was.
    pub material: Option<Moment>,
}

/// A run that goes on.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    plan: Plan,
    trials: Vec<Trial>,
    current: usize,
}

/// What a key led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum After {
    /// Nothing: the key was not due.
    Nothing,
    /// The moment is kept; the trial goes on.
    Kept,
    /// The next trial begins: the film is to be emptied.
    NextTrial,
    /// That was the last.
    Done,
}

impl Run {
    /// Draws the order; equal seeds give equal orders. `None` when there is nothing to show.
    pub fn new(plan: Plan, seed: u64) -> Option<Self> {
        let mut trials: Vec<Trial> = (0..plan.repetitions)
            .flat_map(|_| plan.modes.iter().map(|mode| Trial { mode: *mode, outline: None, material: None }))
            .collect();
        if trials.is_empty() {
            return None;
        }
        // Fisher and Yates, with SplitMix64.
        let mut state = seed;
        for last in (1..trials.len()).rev() {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut mixed = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
            trials.swap(last, ((mixed ^ mixed >> 31) % (last as u64 + 1)) as usize);
        }
        Some(Self { plan, trials, current: 0 })
    }

    /// The plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The mode to show now.
    pub fn mode(&self) -> Option<Mode> {
        self.trials.get(self.current).map(|trial| trial.mode)
    }

    /// Number of the present trial, from 1, and of all.
    pub fn progress(&self) -> (usize, usize) {
        ((self.current + 1).min(self.trials.len()), self.trials.len())
    }

    /// Whether the outline is what is waited for.
    pub fn waits_for_outline(&self) -> bool {
        self.trials.get(self.current).is_some_and(|trial| trial.outline.is_none())
    }

    /// The outline is visible.
    pub fn outline(&mut self, moment: Moment) -> After {
        match self.trials.get_mut(self.current) {
            Some(trial) if trial.outline.is_none() => {
                trial.outline = Some(moment);
                After::Kept
            }
            _ => After::Nothing,
        }
    }

    /// The material is visible, which ends the trial.
    pub fn material(&mut self, moment: Moment) -> After {
        match self.trials.get_mut(self.current) {
            Some(trial) if trial.outline.is_some() => {
                trial.material = Some(moment);
                self.current += 1;
                if self.current == self.trials.len() { After::Done } else { After::NextTrial }
            }
            _ => After::Nothing,
        }
    }

    /// The present trial's picture was disturbed: it is shown anew, from an empty film.
    pub fn begin_trial_again(&mut self) {
        if let Some(trial) = self.trials.get_mut(self.current) {
            trial.outline = None;
        }
    }

    /// Trials that are complete.
    pub fn trials(&self) -> &[Trial] {
        &self.trials[..self.current]
    }

    /// The results as CSV; machine, adapter and revision stand above the header as comments.
    pub fn csv(&self, scene: &str, provenance: &Provenance) -> String {
        let mut csv = String::new();
        for (name, value) in provenance.fields() {
            let _ = writeln!(csv, "# {name}: {}", one_line(value));
        }
        let _ = writeln!(csv, "{HEADER}");
        for (number, trial) in (1..).zip(self.trials()) {
            let (Some(outline), Some(material)) = (trial.outline, trial.material) else { continue };
            let _ = writeln!(
                csv,
                "{number},{},{},{},{},{:.3},{:.3},{},{},{:.2},{:.2},{:.2},{:.2}",
                mode_name(trial.mode),
                self.plan.blind,
                quoted(&self.plan.object),
                quoted(scene),
                outline.elapsed.as_secs_f64(),
                material.elapsed.as_secs_f64(),
                outline.samples,
                material.samples,
                outline.gaze_deg[0],
                outline.gaze_deg[1],
                material.gaze_deg[0],
                material.gaze_deg[1],
            );
        }
        csv
    }

    /// Median seconds to outline and material of every mode that was shown, with the number of trials.
    pub fn medians(&self) -> Vec<(Mode, usize, f64, f64)> {
        let of_mode = |mode: &Mode| {
            let trials: Vec<_> = self.trials().iter().filter(|trial| trial.mode == *mode).collect();
            let median = |moment: &dyn Fn(&Trial) -> Option<Moment>| {
                let mut seconds: Vec<f64> =
                    trials.iter().filter_map(|trial| Some(moment(trial)?.elapsed.as_secs_f64())).collect();
                seconds.sort_by(f64::total_cmp);
                let middle = |index: usize| seconds.get(index).copied();
                Some((middle((seconds.len().max(1) - 1) / 2)? + middle(seconds.len() / 2)?) / 2.0)
            };
            Some((*mode, trials.len(), median(&|trial| trial.outline)?, median(&|trial| trial.material)?))
        };
        self.plan.modes.iter().filter_map(of_mode).collect()
    }

    /// A plot: a row a mode, time to the right in logarithmic steps; rings are outlines, discs are materials.
    pub fn svg(&self) -> String {
        let seconds = |moment: Option<Moment>| moment.map(|moment| moment.elapsed.as_secs_f64().max(0.01));
        let all = self.trials().iter().flat_map(|trial| [seconds(trial.outline), seconds(trial.material)]).flatten();
        let (low, high) = all.fold((f64::INFINITY, 0.0f64), |(low, high), x| (low.min(x), high.max(x)));
        let decades = if low <= high { [low.log10().floor(), (high * 1.001).log10().ceil()] } else { [0.0, 1.0] };
        let x = |seconds: f64| {
            AXIS_PX[0] + (seconds.log10() - decades[0]) / (decades[1] - decades[0]) * (AXIS_PX[1] - AXIS_PX[0])
        };
        let height = PLOT_PX[1] + 34.0 * self.plan.modes.len() as f64;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{height}\" font-family=\"sans-serif\" \
             font-size=\"13\" fill=\"#222\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
             <text x=\"20\" y=\"24\">Seconds until the outline (ring) and the material (disc) were visible</text>\n",
            PLOT_PX[0]
        );
        for decade in decades[0] as i32..=decades[1] as i32 {
            let at = x(10f64.powi(decade));
            let _ = writeln!(
                svg,
                "<line x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"40\" y2=\"{:.0}\" stroke=\"#ddd\"/>\
                 <text x=\"{at:.1}\" y=\"{:.0}\" text-anchor=\"middle\">{} s</text>",
                height - 40.0,
                height - 20.0,
                10f64.powi(decade)
            );
        }
        for (row, mode) in self.plan.modes.iter().enumerate() {
            let y = 60.0 + 34.0 * row as f64;
            let _ = writeln!(svg, "<text x=\"20\" y=\"{:.0}\">{}</text>", y + 4.0, mode_name(*mode));
            for trial in self.trials().iter().filter(|trial| trial.mode == *mode) {
                for (moment, fill) in [(trial.outline, "none"), (trial.material, "#005fb8")] {
                    if let Some(seconds) = seconds(moment) {
                        let _ = writeln!(
                            svg,
                            "<circle cx=\"{:.1}\" cy=\"{y:.0}\" r=\"5\" fill=\"{fill}\" stroke=\"#005fb8\"/>",
                            x(seconds)
                        );
                    }
                }
            }
        }
        svg + "</svg>\n"
    }
}

fn one_line(text: &str) -> String {
    text.replace(['\n', '\r'], " ")
}

/// A field of a CSV, in quotes where it needs them.
fn quoted(text: &str) -> String {
    let text = one_line(text);
    if text.contains([',', '"']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn plan() -> Plan {
        Plan {
            modes: vec![Mode::Od, Mode::Vp, Mode::Fv],
            repetitions: 4,
            blind: true,
            object: "a \"vase\", red".into(),
        }
    }

    fn at(seconds: f64) -> Moment {
        Moment { elapsed: Duration::from_secs_f64(seconds), samples: (seconds * 1e5) as u64, gaze_deg: [1.0, -2.0] }
    }

    /// A run in which a mode takes its number of seconds times 1, 2, 3 and 4.
    fn finished() -> Run {
        let mut run = Run::new(plan(), 7).unwrap();
        let mut shown = [0.0; 4];
        while let Some(mode) = run.mode() {
            let place = plan().modes.iter().position(|other| *other == mode).unwrap();
            shown[place] += 1.0;
            let seconds = (place as f64 + 1.0) * shown[place];
            assert_eq!(run.material(at(1.0)), After::Nothing, "the outline comes first");
            assert_eq!(run.outline(at(seconds)), After::Kept);
            assert_eq!(run.outline(at(99.0)), After::Nothing);
            let after = run.material(at(10.0 * seconds));
            assert_eq!(after == After::Done, run.mode().is_none());
        }
        run
    }

    #[test]
    fn every_mode_is_shown_as_often_and_the_order_is_drawn() {
        let order = |seed| {
            let run = Run::new(plan(), seed).unwrap();
            run.trials.iter().map(|trial| trial.mode).collect::<Vec<_>>()
        };
        for mode in plan().modes {
            assert_eq!(order(3).iter().filter(|shown| **shown == mode).count(), 4);
        }
        assert_eq!(order(3), order(3));
        // Of 200 orders, each place has each mode about a third of the time: within 5 standard deviations.
        for place in 0..12 {
            let foveated = (0..200).filter(|seed| order(*seed)[place] == Mode::Fv).count();
            assert!((33..=100).contains(&foveated), "place {place}: {foveated}");
        }
        assert_eq!(Run::new(Plan { modes: Vec::new(), ..plan() }, 1), None);
    }

    #[test]
    fn medians_are_those_of_each_mode() {
        let medians = finished().medians();
        let expected = [(Mode::Od, 4, 2.5, 25.0), (Mode::Vp, 4, 5.0, 50.0), (Mode::Fv, 4, 7.5, 75.0)];
        for (found, expected) in medians.iter().zip(expected) {
            assert_eq!((found.0, found.1), (expected.0, expected.1));
            assert!((found.2 - expected.2).abs() < 1e-9 && (found.3 - expected.3).abs() < 1e-9, "{found:?}");
        }
        assert_eq!(medians.len(), 3);
    }

    #[test]
    fn the_csv_has_a_row_a_trial_and_the_plot_two_marks() {
        let provenance = Provenance { machine: "m\nn".into(), adapter: "a".into(), commit: "c".into() };
        let run = finished();
        let csv = run.csv("room, big.glb", &provenance);
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(lines.len(), 3 + 1 + 12);
        assert_eq!(lines[0], "# machine: m n");
        let columns = HEADER.split(',').count();
        for line in &lines[4..] {
            // Two quoted fields hold a comma each.
            assert_eq!(line.split(',').count(), columns + 2, "{line}");
            assert!(line.contains("\"a \"\"vase\"\", red\",\"room, big.glb\""), "{line}");
        }
        let svg = run.svg();
        assert_eq!(svg.matches("<circle").count(), 24);
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert!(!Run::new(plan(), 1).unwrap().svg().contains("NaN"));
    }
}
