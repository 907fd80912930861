//! What the tests that span crates share: the adapter, scenes made in code, and the statistics that decide.

pub mod cycles;
pub mod device;
pub mod known;
pub mod lobes;
pub mod pencil;
pub mod plant;
pub mod probes;
pub mod scenes;
pub mod statistics;
