//! Raw results: a small CSV file a run, which is there or not, and all of them as one table.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

use super::error::{Errors, FilmMeasures};
use super::picture::PictureMeasures;
use super::plan::Method;
use crate::output::write_text;

/// Measures in a row, by name. `film` is the film's error over pixels that have a sample, `view` that of the reconstructed
/// picture; `r1` to `r6` are rings of eccentricity to 10, 20, 28, 40, 60 and 80 degrees.
pub const COLUMNS: [&str; 21] = [
    "film_fovea",
    "film_r1",
    "film_r2",
    "film_r3",
    "film_r4",
    "film_r5",
    "film_r6",
    "film_view",
    "film_sphere",
    "view_fovea",
    "view_r1",
    "view_r2",
    "view_r3",
    "view_r4",
    "view_r5",
    "view_all",
    "empty",
    "variance",
    "outline",
    "colour",
    "flip",
];
/// Measures in a row.
pub const MEASURES: usize = COLUMNS.len();

/// One repetition of one method at one gaze.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RunKey {
    /// File name of the scene without its ending.
    pub scene: String,
    /// `yaw_pitch`.
    pub gaze: String,
    /// How samples were spread.
    pub method: Method,
    /// Seed of the random numbers.
    pub seed: u32,
}

/// What was measured after so many samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Samples in the film.
    pub samples: u64,
    /// In the order of [`column`].
    pub measures: [f64; MEASURES],
}

/// Place of a measure in a row.
///
/// # Panics
/// For a name that is no column's: the names are constants of this program.
pub fn column(name: &str) -> usize {
    COLUMNS.iter().position(|known| *known == name).expect("a column's name")
}

impl Row {
    /// From what was measured.
    pub fn new(samples: u64, film: &FilmMeasures, view: &Errors, picture: &PictureMeasures) -> Self {
        let Errors { rings, view: in_view, whole } = film.errors;
        let film_errors = rings.into_iter().chain([in_view, whole]);
        let view_errors = view.rings.into_iter().take(6).chain([view.whole]);
        let rest = [film.empty, film.variance, picture.outline, picture.colour, picture.flip];
        let mut measures = [0.0; MEASURES];
        for (to, from) in measures.iter_mut().zip(film_errors.chain(view_errors).chain(rest)) {
            *to = from;
        }
        Self { samples, measures }
    }
}

impl RunKey {
    /// Where its file is.
    pub fn path(&self, folder: &Path) -> PathBuf {
        let Self { scene, gaze, method, seed } = self;
        folder.join("runs").join(format!("{scene}_{gaze}_{}_{seed}.csv", method.name()))
    }

    fn line(&self, row: &Row) -> String {
        let Self { scene, gaze, method, seed } = self;
        let mut line = format!("{scene},{gaze},{},{seed},{}", method.name(), row.samples);
        for value in row.measures {
            // Writing to a string does not fail.
            let _ = write!(line, ",{}", short(value));
        }
        line
    }
}

/// Four digits, and nothing where nothing was measured.
fn short(value: f64) -> String {
    if value.is_finite() { format!("{value:.3e}") } else { String::new() }
}

fn header() -> String {
    format!("scene,gaze,method,seed,samples,{}\n", COLUMNS.join(","))
}

/// All rows of a study by run.
pub type Table = BTreeMap<RunKey, Vec<Row>>;

/// A table as CSV.
pub fn to_csv<'a>(runs: impl IntoIterator<Item = (&'a RunKey, &'a Vec<Row>)>) -> String {
    let mut text = header();
    for (key, rows) in runs {
        for row in rows {
            text.push_str(&key.line(row));
            text.push('\n');
        }
    }
    text
}

/// A table from CSV.
///
/// # Errors
/// For text that [`to_csv`] did not make.
pub fn from_csv(text: &str) -> anyhow::Result<Table> {
    let mut table = Table::new();
    let mut lines = text.lines();
    if lines.next().map(str::trim_end) != Some(header().trim_end()) {
        bail!("another version of the study's columns");
    }
    for (line, number) in lines.zip(2..) {
        let (key, row) = parse(line).with_context(|| format!("line {number}"))?;
        table.entry(key).or_default().push(row);
    }
    Ok(table)
}

fn parse(line: &str) -> anyhow::Result<(RunKey, Row)> {
    let fields: Vec<&str> = line.split(',').collect();
    let [scene, gaze, method, seed, samples, values @ ..] = fields.as_slice() else { bail!("too few fields") };
    let mut measures = [f64::NAN; MEASURES];
    if values.len() != MEASURES {
        bail!("{} measures, not {MEASURES}", values.len());
    }
    for (to, value) in measures.iter_mut().zip(values).filter(|(_, value)| !value.is_empty()) {
        *to = value.parse().with_context(|| format!("`{value}`"))?;
    }
    let method = Method::by_name(method).with_context(|| format!("no method `{method}`"))?;
    let key = RunKey { scene: (*scene).to_owned(), gaze: (*gaze).to_owned(), method, seed: seed.parse()? };
    Ok((key, Row { samples: samples.parse()?, measures }))
}

/// Writes a finished run.
///
/// # Errors
/// When the file cannot be written.
pub fn write(folder: &Path, key: &RunKey, rows: &Vec<Row>) -> anyhow::Result<()> {
    Ok(write_text(&key.path(folder), &to_csv([(key, rows)]))?)
}

/// All runs of a study that is done.
pub const ALL_RUNS: &str = "curves.csv";

/// Reads all finished runs, a file each; where only all of them together were kept, that file.
///
/// # Errors
/// When a file is not what [`to_csv`] made.
pub fn read_all(folder: &Path) -> anyhow::Result<Table> {
    let read = |path: &Path| -> anyhow::Result<Table> {
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        from_csv(&text).with_context(|| path.display().to_string())
    };
    let (runs, all) = (folder.join("runs"), folder.join(ALL_RUNS));
    if !runs.exists() && all.exists() {
        return read(&all);
    }
    let mut table = Table::new();
    let entries = std::fs::read_dir(&runs).with_context(|| format!("{} cannot be read", runs.display()))?;
    for entry in entries {
        let path = entry.with_context(|| runs.display().to_string())?.path();
        if path.extension().is_some_and(|extension| extension == "csv") {
            table.extend(read(&path)?);
        }
    }
    Ok(table)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn runs_read_back_to_four_digits() {
        let key = |seed| RunKey { scene: "a room".into(), gaze: "0_-30".into(), method: Method::FvEq6, seed };
        let mut measures = [0.0; MEASURES];
        for (i, value) in measures.iter_mut().enumerate() {
            *value = 1.2345e-3 * (i as f64 - 3.0);
        }
        measures[column("view_r5")] = f64::NAN;
        let rows = vec![Row { samples: 1 << 40, measures }, Row { samples: 3, measures: [0.5; MEASURES] }];
        let table = Table::from([(key(1), rows.clone()), (key(2), rows)]);
        let read = from_csv(&to_csv(&table)).unwrap();
        assert_eq!(read.len(), 2);
        for (found, expected) in read[&key(2)].iter().zip(&table[&key(2)]) {
            assert_eq!(found.samples, expected.samples);
            for (found, expected) in found.measures.iter().zip(expected.measures) {
                assert!((found - expected).abs() <= 1e-3 * expected.abs() || expected.is_nan() && found.is_nan());
            }
        }
    }

    #[test]
    fn other_columns_and_broken_rows_are_refused() {
        assert!(from_csv("scene,gaze\n").is_err());
        let short = format!("{}a,0_0,od,1,5,1.0\n", header());
        assert!(crate::session::one_line(&from_csv(&short).unwrap_err()).contains("line 2"));
    }
}
