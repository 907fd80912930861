//! A model given by a user's measurements.

use super::AcuityModel;
use crate::{Angle, Eccentricity, SamplerError};

/// Acuity interpolated linearly between the rows of a table.
///
/// # Definition
/// Linear between rows, the first row's value before it, the last row's value beyond it (let the table end at the cap, or
/// choose a smaller cap, if that is not wanted). Values are divided by the largest.
///
/// # Format
/// CSV, two columns: eccentricity in degrees (strictly ascending, in `[0, 180]`) and relative acuity (positive). Blank
/// lines and lines that begin with `#` are skipped; a first line that is not numeric is a header.
#[derive(Clone, Debug, PartialEq)]
pub struct TabulatedAcuity {
    /// Eccentricity in degrees and relative acuity; never empty, strictly ascending.
    rows: Vec<(f64, f64)>,
}

impl TabulatedAcuity {
    /// Most rows a table may have.
    pub const MAX_ROWS: usize = 4096;

    /// Reads the text of a CSV file.
    ///
    /// # Errors
    /// [`SamplerError::Table`] with the line and the problem.
    pub fn from_csv(text: &str) -> Result<Self, SamplerError> {
        let mut rows: Vec<(f64, f64)> = Vec::new();
        let mut header_allowed = true;
        for (index, line) in text.lines().enumerate() {
            let line_number = index + 1;
            let problem = |problem: String| SamplerError::Table { line: line_number, problem };
            let line = line.trim().trim_start_matches('\u{feff}');
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let mut columns = line.split(',').map(str::trim);
            let (first, second) = (columns.next().unwrap_or(""), columns.next());
            let is_header = header_allowed && first.parse::<f64>().is_err();
            header_allowed = false;
            if is_header {
                continue;
            }
            let Some(second) = second else {
                return Err(problem("expected two columns, eccentricity in degrees and relative acuity".into()));
            };
            let number = |text: &str| {
                text.parse::<f64>()
                    .ok()
                    .filter(|x| x.is_finite())
                    .ok_or_else(|| problem(format!("`{text}` is no number")))
            };
            let (e_deg, acuity) = (number(first)?, number(second)?);
            if !(0.0..=180.0).contains(&e_deg) {
                return Err(problem(format!("an eccentricity of {e_deg} degrees is outside [0, 180]")));
            }
            if acuity <= 0.0 {
                return Err(problem(format!("an acuity of {acuity} is not positive; use a cap where vision ends")));
            }
            if let Some(&(previous, _)) = rows.last()
                && e_deg - previous < 1e-6
            {
                return Err(problem(format!(
                    "eccentricities must ascend by at least 1e-6 degrees, but {e_deg} follows {previous}"
                )));
            }
            if rows.len() == Self::MAX_ROWS {
                return Err(problem(format!("more than {} rows", Self::MAX_ROWS)));
            }
            rows.push((e_deg, acuity));
        }
        let largest = rows.iter().fold(0.0, |a: f64, &(_, acuity)| a.max(acuity));
        if rows.is_empty() {
            return Err(SamplerError::Table { line: text.lines().count().max(1), problem: "no rows".into() });
        }
        for row in &mut rows {
            row.1 /= largest;
            if row.1 < 1e-9 {
                let problem = format!("the acuity at {} degrees is below 1e-9 of the largest", row.0);
                return Err(SamplerError::Table { line: text.lines().count(), problem });
            }
        }
        Ok(Self { rows })
    }
}

impl AcuityModel for TabulatedAcuity {
    fn name(&self) -> &str {
        "table"
    }

    fn citation(&self) -> &str {
        "the user's table"
    }

    fn acuity(&self, e: Eccentricity) -> f64 {
        let e_deg = e.degrees();
        let above = self.rows.partition_point(|&(x, _)| x <= e_deg);
        match (above.checked_sub(1).map(|i| self.rows[i]), self.rows.get(above)) {
            (Some((x0, y0)), Some(&(x1, y1))) => y0 + (y1 - y0) * ((e_deg - x0) / (x1 - x0)),
            (Some((_, y)), None) | (None, Some(&(_, y))) => y,
            (None, None) => 1.0,
        }
    }

    fn breakpoints(&self) -> Vec<Eccentricity> {
        self.rows.iter().map(|&(e_deg, _)| Angle::from_degrees(e_deg)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_header_comments_and_normalises() {
        let table = TabulatedAcuity::from_csv("e,acuity\n# a comment\n\n0,2\n10,1\n20,0.5\n").expect("valid");
        for (e_deg, acuity) in [(0.0, 1.0), (5.0, 0.75), (10.0, 0.5), (15.0, 0.375), (90.0, 0.25)] {
            let found = table.acuity(Angle::from_degrees(e_deg));
            assert!((found - acuity).abs() < 1e-12, "{e_deg}: {found}");
        }
    }

    #[test]
    fn names_the_line_and_the_problem() {
        for (text, line, needle) in [
            ("", 1, "no rows"),
            ("0,1\n5", 2, "two columns"),
            ("0,1\n5,x", 2, "no number"),
            ("0,1\n5,NaN", 2, "no number"),
            ("0,1\n5,0", 2, "not positive"),
            ("0,1\n181,1", 2, "outside"),
            ("0,1\n10,1\n9,1", 3, "ascend"),
            ("a,b\nc,d", 2, "no number"),
        ] {
            match TabulatedAcuity::from_csv(text) {
                Err(SamplerError::Table { line: found, problem }) => {
                    assert_eq!(found, line, "{text:?}: {problem}");
                    assert!(problem.contains(needle), "{text:?}: {problem}");
                }
                other => panic!("{text:?} gave {other:?}"),
            }
        }
    }
}
