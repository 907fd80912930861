//! Fitting: minimax polynomials and rationals by Remez' second algorithm.

mod linear;
mod remez;

pub(crate) use remez::{Minimax, Problem, minimax};
