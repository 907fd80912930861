//! Progressive path tracer: glTF scenes, two-level BVHs, WGSL compute kernels and an integer film.
//!
//! # Conventions
//! glTF's: metres, right-handed, +Y up, a camera looks along -Z. Equirectangular images have their centre at -Z, +X at
//! u = 0.75, the left edge at +Z and +Y on top. Radiance is linear Rec. 709. Transforms are named `dst_from_src`.
//!
//! # Non-goals
//! The tracer knows no window, no user interface and no headset; whoever has those makes the device.

pub mod builtin;
pub mod bvh;
pub mod coherence;
pub mod distribution;
pub mod environment;
pub mod features;
pub mod film;
pub mod gpu;
pub mod guide;
pub mod import;
pub mod kernels;
pub mod panorama;
pub mod provenance;
pub mod renderer;
pub mod scene;
pub mod upload;
pub mod view;
