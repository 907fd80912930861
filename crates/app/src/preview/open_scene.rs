//! What the window knows of the scene that it shows.

use glam::Vec3;
use tracer::scene::Scene;

use super::controls::metric;
use crate::cli::values::CameraChoice;
use crate::session::{self, Loaded, Shapes, Viewpoint};

/// A scene on screen.
#[derive(Clone, Debug)]
pub struct OpenScene {
    /// What a person calls it.
    pub name: String,
    /// Triangles, lights, textures.
    pub contents: String,
    /// The file's cameras, or the one that frames the scene.
    pub viewpoints: Vec<Viewpoint>,
    /// Place in `viewpoints` to start from.
    pub start: usize,
    /// What the import met and did not support, one line each.
    pub notes: Vec<String>,
    /// Across all that is visible, metres.
    pub diagonal: f32,
}

impl OpenScene {
    /// From what was loaded; a camera that does not exist is a note.
    pub fn new(loaded: &Loaded) -> Self {
        Self::of(&loaded.scene, loaded.camera.as_ref(), loaded.notes.clone())
    }

    /// From what is known before images are read.
    pub fn sketched(shapes: &Shapes) -> Self {
        Self::of(&shapes.scene, shapes.camera.as_ref(), Vec::new())
    }

    fn of(scene: &Scene, camera: Option<&CameraChoice>, mut notes: Vec<String>) -> Self {
        let viewpoints = session::viewpoints(scene);
        let start = session::choose(&viewpoints, camera).unwrap_or_else(|error| {
            notes.insert(0, session::one_line(&error));
            0
        });
        let lights = scene.lights.len();
        let contents = format!(
            "{} triangles, {} textures{}",
            metric(session::triangles(scene) as f64),
            scene.distinct_textures().len(),
            if lights == 0 { String::new() } else { format!(", {lights} lights") },
        );
        let (low, high) = scene.bounds().unwrap_or((Vec3::ZERO, Vec3::ONE));
        Self { name: scene.name.clone(), contents, viewpoints, start, notes, diagonal: (high - low).length() }
    }
}
