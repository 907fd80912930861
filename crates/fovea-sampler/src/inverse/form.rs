//! The pieces that an inverse is made of, and their evaluation in f32 (as the shader) and f64 (with derivative).

use crate::trig::horner;

/// What the core is a function of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Argument {
    U,
    SqrtU,
}

/// The fitted function.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Core {
    /// Ascending coefficients.
    Polynomial(Vec<f32>),
    Rational {
        numerator: Vec<f32>,
        denominator: Vec<f32>,
    },
    /// Cubics on cells of width `1 / per_unit` (a power of two, so that the position in a cell is exact), from cell `first`.
    Table {
        per_unit: u32,
        first: u32,
        cells: Vec<[f32; 4]>,
    },
}

/// What is done to the core's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outer {
    Identity,
    Square,
    Sqrt,
    TimesU,
    TimesSqrtU,
}

/// One piece of an inverse, for `U` up to `end`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Piece {
    pub(crate) end: f32,
    pub(crate) argument: Argument,
    pub(crate) core: Core,
    pub(crate) outer: Outer,
}

impl Piece {
    /// In f32, operation by operation as the shader's text.
    #[inline]
    pub(crate) fn eval(&self, capped_u: f32) -> f32 {
        let t = match self.argument {
            Argument::U => capped_u,
            Argument::SqrtU => capped_u.sqrt(),
        };
        let c = match &self.core {
            Core::Polynomial(coefficients) => horner(coefficients, t),
            Core::Rational { numerator, denominator } => horner(numerator, t) / horner(denominator, t),
            Core::Table { per_unit, first, cells } => {
                let position = t * *per_unit as f32;
                let cell = (position as u32).clamp(*first, first + cells.len() as u32 - 1);
                horner(&cells[(cell - first) as usize], position - cell as f32)
            }
        };
        match self.outer {
            Outer::Identity => c,
            Outer::Square => c * c,
            Outer::Sqrt => c.max(0.0).sqrt(),
            Outer::TimesU => c * capped_u,
            Outer::TimesSqrtU => c * if self.argument == Argument::SqrtU { t } else { capped_u.sqrt() },
        }
    }

    /// Value and derivative in f64.
    pub(crate) fn eval_f64(&self, capped_u: f64) -> (f64, f64) {
        let root = capped_u.sqrt();
        // d sqrt(U) / dU, kept finite at 0, where it only ever meets a vanishing factor or a true divergence.
        let root_slope = 0.5 / root.max(1e-150);
        let (t, t_slope) = match self.argument {
            Argument::U => (capped_u, 1.0),
            Argument::SqrtU => (root, root_slope),
        };
        let (c, by_t) = match &self.core {
            Core::Polynomial(coefficients) => horner_f64(coefficients, t),
            Core::Rational { numerator, denominator } => {
                let ((p, dp), (q, dq)) = (horner_f64(numerator, t), horner_f64(denominator, t));
                (p / q, (dp - p / q * dq) / q)
            }
            Core::Table { per_unit, first, cells } => {
                let position = t * f64::from(*per_unit);
                let cell = (position as u32).clamp(*first, first + cells.len() as u32 - 1);
                let (c, slope) = horner_f64(&cells[(cell - first) as usize], position - f64::from(cell));
                (c, slope * f64::from(*per_unit))
            }
        };
        let slope = by_t * t_slope;
        match self.outer {
            Outer::Identity => (c, slope),
            Outer::Square => (c * c, 2.0 * c * slope),
            Outer::Sqrt => (c.max(0.0).sqrt(), 0.5 * slope / c.max(1e-300).sqrt()),
            Outer::TimesU => (c * capped_u, slope * capped_u + c),
            Outer::TimesSqrtU => (c * root, slope * root + c * root_slope),
        }
    }
}

fn horner_f64(coefficients: &[f32], x: f64) -> (f64, f64) {
    let (mut value, mut slope) = (0.0, 0.0);
    for &c in coefficients.iter().rev() {
        slope = slope * x + value;
        value = value * x + f64::from(c);
    }
    (value, slope)
}
