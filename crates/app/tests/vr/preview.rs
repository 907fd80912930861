//! The preview's engine without a window.

use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::{Pos2, Rect, Vec2};
use fovea_app::cli;
use fovea_app::gaze::hub::GazeHub;
use fovea_app::preview::controls::Controls;
use fovea_app::preview::engine::{Engine, Look, State};
use fovea_app::preview::gaze::{Gaze, ScreenMapping};
use fovea_app::preview::navigation::Standpoint;
use fovea_app::view::View;
use tracer::gpu::{AdapterSelect, Gpu};

/// An engine that shows the built-in scene from its middle.
pub struct Preview {
    pub engine: Engine,
    look: Look,
}

impl Preview {
    /// With these options of the command line.
    pub fn start(options: &[&str]) -> Self {
        Self::looking(options, 0.0, 0.0)
    }

    /// Looking in a direction, radians.
    pub fn looking(options: &[&str], yaw: f32, pitch: f32) -> Self {
        let line = ["fovea", "--max-bounces", "3"].iter().chain(options).map(Into::into);
        let Ok(parsed) = cli::parse(line) else { panic!("{options:?}") };
        let args = parsed.preview;
        let gpu = Gpu::headless(&AdapterSelect::Auto).unwrap();
        let hub = Arc::new(GazeHub::new(&[], None).unwrap());
        let engine = Engine::start(gpu, &args, hub, || ()).unwrap();
        let controls = Controls::from(&args);
        let rect = Rect::from_min_size(Pos2::ZERO, Vec2::new(320.0, 180.0));
        let look = Look {
            standpoint: Standpoint { position: glam::Vec3::new(0.0, 1.6, 0.0), view: View::new(yaw, pitch, 1.4, 0.9) },
            gaze: Gaze::default(),
            mapping: ScreenMapping::new(controls.screen, rect, None),
            controls,
            size_px: glam::UVec2::new(320, 180),
            pointer: None,
        };
        engine.set_scene(Arc::new(tracer::builtin::scene().unwrap().0));
        Self { engine, look }
    }

    /// Waits for something, and returns the state that has it.
    pub fn wait(&self, what: &str, has: impl Fn(&State) -> bool) -> State {
        let start = Instant::now();
        loop {
            // The engine forgets what the window showed when a scene is opened.
            self.engine.look(self.look.clone());
            let state = self.engine.state();
            if has(&state) {
                return state;
            }
            let words = state.message.as_ref().map_or("", |message| &message.text);
            assert!(start.elapsed() < Duration::from_secs(180), "no {what}: {words}; {:?}", state.readout);
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}
