//! Reports: evaluation at given numbers, and the table and plot of error against cost.
//!
//! This crate has no clock: who measures costs hands them in as [`Entry`].

mod chart;

use core::fmt::Write;

pub use chart::{Chart, Mark, Shape};

use crate::{Angle, ErrorReport, Form, Geometry, Inverse, RadialDistribution, SamplerError};

/// The forms that reports compare, for Reddy's acuity: from the cheapest to the most accurate.
///
/// Every one is kept for a reason where another is better in both error and cost on some machine: Eq. 6 because it is the
/// paper's; a polynomial because it needs no division and no memory; the table of 64 cells because a larger one, as accurate
/// as f32 allows at the same cost on a CPU, is a constant array that shaders compile slowly.
#[must_use]
pub fn forms(geometry: Geometry) -> Vec<Form> {
    match geometry {
        Geometry::Sphere => vec![
            Form::SquaredPolynomial(5),
            Form::SquaredPolynomial(7),
            Form::Rational(3, 3),
            Form::Table(64),
            Form::Table(256),
        ],
        Geometry::Plane => vec![
            Form::Eq6,
            Form::Polynomial(4),
            Form::Polynomial(5),
            Form::Polynomial(7),
            Form::Rational(4, 3),
            Form::Table(64),
        ],
    }
}

/// Where and from what a report was made.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Provenance {
    /// Processor and operating system.
    pub machine: String,
    /// Graphics adapter and driver, or why there is none.
    pub adapter: String,
    /// Revision of the source.
    pub commit: String,
}

/// One inverse in the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Its geometry.
    pub geometry: Geometry,
    /// Its form's name; `exact` for the quantile in f64.
    pub name: String,
    /// Its measured errors; `None` for the exact quantile.
    pub errors: Option<ErrorReport>,
    /// Nanoseconds a sample (radius and azimuth to a direction) on one core.
    pub cpu_ns: f64,
    /// Milliseconds on the adapter for 65,536 and 2^24 rays, if there is one.
    pub gpu_ms: Option<[f64; 2]>,
}

impl Entry {
    /// The error that the plot shows: relative in eccentricity, in f32. The exact quantile's is f32's own rounding.
    #[must_use]
    pub fn relative_e(&self) -> f64 {
        self.errors.map_or(6e-8, |errors| errors.relative_e)
    }
}

/// For each entry whether no other of its geometry is better in one of error and CPU cost and at least as good in the other.
#[must_use]
pub fn pareto_front(entries: &[Entry]) -> Vec<bool> {
    let dominates = |a: &Entry, b: &Entry| {
        let (error, cost) = (a.relative_e() <= b.relative_e(), a.cpu_ns <= b.cpu_ns);
        let strictly = a.relative_e() < b.relative_e() || a.cpu_ns < b.cpu_ns;
        a.geometry == b.geometry && error && cost && strictly
    };
    entries.iter().map(|b| !entries.iter().any(|a| dominates(a, b))).collect()
}

/// The table as CSV, with comment lines that say where it was made.
#[must_use]
pub fn csv(entries: &[Entry], provenance: &Provenance) -> String {
    let Provenance { machine, adapter, commit } = provenance;
    let mut text = format!("# machine: {machine}\n# adapter: {adapter}\n# commit: {commit}\n");
    text.push_str(
        "geometry,inverse,max_relative_e_f32,max_relative_density,max_cdf,cpu_ns,gpu_ms_65536,gpu_ms_16777216,pareto\n",
    );
    for (entry, pareto) in entries.iter().zip(pareto_front(entries)) {
        let errors = entry.errors.map_or_else(
            || ",,".to_owned(),
            |e| format!("{:.3e},{:.3e},{:.3e}", e.relative_e, e.relative_density, e.cdf),
        );
        let gpu = entry.gpu_ms.map_or_else(|| ",".to_owned(), |[small, large]| format!("{small:.4},{large:.3}"));
        let geometry = entry.geometry.name();
        // Writing to a string does not fail.
        let _ = writeln!(text, "{geometry},{},{errors},{:.2},{gpu},{}", entry.name, entry.cpu_ns, u8::from(pareto));
    }
    text
}

/// The table for people, in columns.
#[must_use]
pub fn table(entries: &[Entry], provenance: &Provenance) -> String {
    let Provenance { machine, adapter, commit } = provenance;
    let mut text = format!("machine: {machine}\nadapter: {adapter}\ncommit:  {commit}\n\n");
    let _ = writeln!(
        text,
        "{:<9}{:<15}{:>12}{:>14}{:>11}{:>10}{:>13}{:>12}  front",
        "geometry", "inverse", "error in e", "density error", "CDF error", "CPU ns", "GPU ms 2^16", "GPU ms 2^24"
    );
    for (entry, pareto) in entries.iter().zip(pareto_front(entries)) {
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |x| format!("{x:.2e}"));
        let time = |index: usize| entry.gpu_ms.map_or_else(|| "-".to_owned(), |ms| format!("{:.3}", ms[index]));
        let _ = writeln!(
            text,
            "{:<9}{:<15}{:>12}{:>14}{:>11}{:>10.2}{:>13}{:>12}  {}",
            entry.geometry.name(),
            entry.name,
            number(entry.errors.map(|e| e.relative_e)),
            number(entry.errors.map(|e| e.relative_density)),
            number(entry.errors.map(|e| e.cdf)),
            entry.cpu_ns,
            time(0),
            time(1),
            if pareto { "*" } else { "" }
        );
    }
    text
}

/// The numbers in the first column of a CSV text; a first line that is no number is a header.
///
/// # Errors
/// [`SamplerError::Table`] with the line and the problem: no number, or a number outside `[0, 1]`.
pub fn first_column(text: &str) -> Result<Vec<f64>, SamplerError> {
    let mut numbers = Vec::new();
    let mut first = true;
    for (index, line) in text.lines().enumerate() {
        let line = line.trim_start_matches('\u{feff}').trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let cell = line.split(',').next().unwrap_or("").trim();
        let header = core::mem::replace(&mut first, false);
        match cell.parse::<f64>() {
            Ok(u) if (0.0..=1.0).contains(&u) => numbers.push(u),
            Err(_) if header => {}
            _ => {
                let problem = format!("`{cell}` is not a number in [0, 1]");
                return Err(SamplerError::Table { line: index + 1, problem });
            }
        }
    }
    Ok(numbers)
}

/// `u,e_deg,pdf_per_sr` as CSV with 17 significant digits: the exact quantile in f64, or an inverse's f32 evaluation and the
/// density that it implies.
#[must_use]
pub fn evaluate(distribution: &RadialDistribution, inverse: Option<&Inverse>, numbers: &[f64]) -> String {
    let mut text = String::from("u,e_deg,pdf_per_sr\n");
    for u in numbers {
        let (e, pdf): (Angle, f64) = match inverse {
            None => {
                let e = distribution.quantile(*u);
                (e, distribution.pdf(e))
            }
            Some(inverse) => {
                let rounded = *u as f32;
                (inverse.eccentricity(rounded), inverse.implied_pdf(f64::from(rounded)))
            }
        };
        let _ = writeln!(text, "{u:.16e},{:.16e},{pdf:.16e}", e.degrees());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(name: &str, relative_e: f64, cpu_ns: f64) -> Entry {
        let errors = Inverse::eq6().measure(&RadialDistribution::koskela_2017(), 16);
        let errors = Some(ErrorReport { relative_e, ..errors });
        Entry { geometry: Geometry::Plane, name: name.into(), errors, cpu_ns, gpu_ms: Some([0.1, 2.0]) }
    }

    #[test]
    fn front_keeps_what_nothing_beats() {
        let entries = [entry("a", 1e-3, 1.0), entry("b", 1e-4, 2.0), entry("c", 2e-4, 3.0), entry("d", 1e-6, 9.0)];
        assert_eq!(pareto_front(&entries), [true, true, false, true]);
    }

    #[test]
    fn csv_and_svg_hold_every_entry() {
        let entries = [entry("poly4", 1e-3, 1.0), entry("table64", 1e-7, 2.0)];
        let provenance = Provenance { machine: "m".into(), adapter: "a & b".into(), commit: "c".into() };
        let csv = csv(&entries, &provenance);
        assert_eq!(csv.lines().filter(|line| !line.starts_with('#')).count(), 3);
        let svg = Chart::error_against_cost(&entries, &provenance).svg();
        assert!(svg.contains("poly4") && svg.contains("table64") && svg.contains("a &amp; b"), "{svg}");
        assert!(svg.ends_with("</svg>\n"));
        assert!(table(&entries, &provenance).contains("poly4"));
    }

    #[test]
    fn first_column_takes_a_header_and_names_bad_lines() {
        assert_eq!(first_column("u,e\n0,1\n\n0.5,2\n1").expect("valid"), [0.0, 0.5, 1.0]);
        assert_eq!(first_column("0.25").expect("valid"), [0.25]);
        for (text, line) in [("u\nx", 2), ("0.1\n1.5", 2), ("0.1\nNaN", 2), ("u\n-1", 2), ("2", 1)] {
            match first_column(text) {
                Err(SamplerError::Table { line: found, .. }) => assert_eq!(found, line, "{text:?}"),
                other => panic!("{text:?} gave {other:?}"),
            }
        }
    }

    #[test]
    fn evaluation_prints_seventeen_digits() {
        let distribution = RadialDistribution::koskela_2017();
        let text = evaluate(&distribution, None, &[0.5]);
        let row = text.lines().nth(1).expect("one row");
        let numbers: Vec<f64> = row.split(',').map(|x| x.parse().expect("a number")).collect();
        assert!((numbers[1] / 23.651_991_584_252_558 - 1.0).abs() < 1e-14, "{row}");
        assert!((numbers[2] / 0.353_567_121_418_709_6 - 1.0).abs() < 1e-13, "{row}");
        let fitted = evaluate(&distribution, Some(&Inverse::default_for(&distribution)), &[0.5]);
        assert_ne!(fitted, text);
    }
}
