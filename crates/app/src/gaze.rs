//! Where one looks: the pointer, eye trackers and recordings behind one trait, and what makes a direction of their samples.
//!
//! A [`source::GazeSource`] hands over [`sample::GazeSample`]s and never blocks; trackers on the network have a thread of
//! their own. The [`hub::GazeHub`] polls the sources, falls back from one to the next, corrects drift, filters in degrees,
//! and answers where in the view somebody looks. Window and tracing thread share it, so that a batch is traced with the
//! newest sample, however long ago the window was drawn.
//!
//! Screen points are fractions of the screen from its top left. Angles are degrees at the eye: yaw + to the right, pitch +
//! up, from the screen's centre. Nothing here listens on the network, and only a Lab Streaming Layer source sends
//! datagrams to more than one host.

pub mod clock;
pub mod drift;
pub mod feed;
pub mod filter;
pub mod geometry;
pub mod hub;
pub mod lsl;
pub mod mouse;
pub mod opengaze;
pub mod parse;
pub mod profile;
pub mod pupil;
pub mod recorder;
pub mod replay;
pub mod sample;
pub mod source;
pub mod spec;
pub mod validation;
