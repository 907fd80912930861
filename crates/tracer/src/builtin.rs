//! The scene that is shown when no file is named: a room made by this repository's `make_builtin_scene` example.

use crate::import::{ImportError, ImportOptions, ImportReport, load_glb_bytes};
use crate::scene::Scene;

/// The scene's file, a binary glTF.
pub const BYTES: &[u8] = include_bytes!("../../../assets/builtin.glb");

/// Loads the built-in scene.
///
/// # Errors
/// None for the bytes that are embedded; the tests load them. The type is that of every other import.
pub fn scene() -> Result<(Scene, ImportReport), ImportError> {
    load_glb_bytes("built-in", BYTES, &ImportOptions::default())
}
