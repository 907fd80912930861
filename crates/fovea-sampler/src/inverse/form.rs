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
    /// Cubics on cells of width `1 / per_unit`, from cell `first`. Without a floor `per_unit` is a power of two and the
    /// position in a cell exact.
    Table {
        per_unit: f32,
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

/// One piece of an inverse, for `u` up to `end`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Piece {
    pub(crate) end: f32,
    pub(crate) argument: Argument,
    /// Subtracted from the argument: polynomials on a short piece are expanded about its middle, where no terms cancel.
    pub(crate) origin: f32,
    pub(crate) core: Core,
    pub(crate) outer: Outer,
}

impl Core {
    /// In f32, operation by operation as the shader's text.
    #[inline]
    pub(crate) fn eval(&self, t: f32) -> f32 {
        match self {
            Self::Polynomial(coefficients) => horner(coefficients, t),
            Self::Rational { numerator, denominator } => horner(numerator, t) / horner(denominator, t),
            Self::Table { per_unit, first, cells } => {
                let position = t * per_unit;
                let cell = (position as u32).clamp(*first, first + cells.len() as u32 - 1);
                horner(&cells[(cell - first) as usize], position - cell as f32)
            }
        }
    }
}

impl Piece {
    /// The `u` at which the cells of a table meet; where its `u` ends is no matter here.
    pub(crate) fn edges(&self) -> impl Iterator<Item = f64> {
        let cells = match &self.core {
            Core::Table { per_unit, first, cells } => Some((f64::from(*per_unit), *first, cells.len() as u32)),
            Core::Polynomial(_) | Core::Rational { .. } => None,
        };
        let (origin, is_root) = (f64::from(self.origin), self.argument == Argument::SqrtU);
        cells.into_iter().flat_map(move |(per_unit, first, count)| {
            (first + 1..first + count).map(move |cell| {
                let argument = f64::from(cell) / per_unit + origin;
                if is_root { argument * argument } else { argument }
            })
        })
    }

    /// The same piece of `scale` times its argument: takes a fit in `U = u scale` to `u`.
    pub(crate) fn rescaled(self, scale: f64) -> Self {
        let by_argument = if self.argument == Argument::SqrtU { scale.sqrt() } else { scale };
        let factor = match self.outer {
            Outer::TimesU => scale,
            Outer::TimesSqrtU => scale.sqrt(),
            Outer::Identity | Outer::Square | Outer::Sqrt => 1.0,
        };
        let powers = |coefficients: Vec<f32>, factor: f64| {
            let mut power = factor;
            let scaled = coefficients.into_iter().map(|c| {
                let scaled = (f64::from(c) * power) as f32;
                power *= by_argument;
                scaled
            });
            scaled.collect::<Vec<f32>>()
        };
        let core = match self.core {
            Core::Polynomial(coefficients) => Core::Polynomial(powers(coefficients, factor)),
            Core::Rational { numerator, denominator } => {
                Core::Rational { numerator: powers(numerator, factor), denominator: powers(denominator, 1.0) }
            }
            Core::Table { per_unit, first, cells } => Core::Table {
                per_unit: (f64::from(per_unit) * by_argument) as f32,
                first,
                cells: cells.into_iter().map(|cell| cell.map(|c| (f64::from(c) * factor) as f32)).collect(),
            },
        };
        let (end, origin) = ((f64::from(self.end) / scale) as f32, (f64::from(self.origin) / by_argument) as f32);
        Self { end, argument: self.argument, origin, core, outer: self.outer }
    }

    /// In f32, operation by operation as the shader's text.
    #[inline]
    pub(crate) fn eval(&self, u: f32) -> f32 {
        let argument = match self.argument {
            Argument::U => u,
            Argument::SqrtU => u.sqrt(),
        };
        let c = self.core.eval(argument - self.origin);
        match self.outer {
            Outer::Identity => c,
            Outer::Square => c * c,
            Outer::Sqrt => c.max(0.0).sqrt(),
            Outer::TimesU => c * u,
            Outer::TimesSqrtU => c * if self.argument == Argument::SqrtU { argument } else { u.sqrt() },
        }
    }

    /// Value and derivative in f64.
    pub(crate) fn eval_f64(&self, u: f64) -> (f64, f64) {
        let root = u.sqrt();
        // d sqrt(U) / dU, kept finite at 0, where it only ever meets a vanishing factor or a true divergence.
        let root_slope = 0.5 / root.max(1e-150);
        let (t, t_slope) = match self.argument {
            Argument::U => (u, 1.0),
            Argument::SqrtU => (root, root_slope),
        };
        let t = t - f64::from(self.origin);
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
            Outer::TimesU => (c * u, slope * u + c),
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
