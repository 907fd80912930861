//! What can go wrong when a distribution or an inverse is built. Evaluation never fails.

use thiserror::Error;

/// Why a distribution, an inverse, a film or a layer could not be built.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SamplerError {
    /// A parameter of an acuity model is outside its range.
    #[error("{model}: {parameter} is {value}, but must be {requirement}")]
    ModelParameter {
        /// The model's name.
        model: &'static str,
        /// The parameter's name and unit.
        parameter: &'static str,
        /// The value that was given.
        value: f64,
        /// What the value must satisfy.
        requirement: &'static str,
    },
    /// The cap is not an angle in (0, 180] degrees.
    #[error("the cap is {degrees} degrees, but must lie in (0, 180]")]
    Cap {
        /// The value that was given, in degrees.
        degrees: f64,
    },
    /// The floor is not in [0, 1].
    #[error("the floor is {0}, but must lie in [0, 1] (a density relative to the gaze's)")]
    Floor(f64),
    /// The model's acuity is negative, zero inside its support, or not a number.
    #[error("acuity model {model}: the acuity at {degrees} degrees is {acuity}; it must be finite and positive")]
    Acuity {
        /// The model's name.
        model: String,
        /// Where, in degrees.
        degrees: f64,
        /// The offending value.
        acuity: f64,
    },
    /// No form on offer reaches the accuracy that was asked for.
    #[error("no inverse reaches a relative error of {requested:e} in f32; the best found has {best:e}")]
    Accuracy {
        /// The accuracy asked for.
        requested: f64,
        /// The smallest error found.
        best: f64,
    },
    /// The inverse asked for exists only for another distribution.
    #[error("{0}")]
    Unsupported(&'static str),
    /// A text of numbers could not be read: a tabulated model, or where to evaluate one.
    #[error("line {line}: {problem}")]
    Table {
        /// 1-based line number.
        line: usize,
        /// What is wrong with it.
        problem: String,
    },
    /// A film, screen or layer has an impossible size or parameter.
    #[error("{what} is {value}, but must be {requirement}")]
    Parameter {
        /// The parameter's name and unit.
        what: &'static str,
        /// The value that was given.
        value: f64,
        /// What the value must satisfy.
        requirement: &'static str,
    },
}
