//! The preview window.

use std::sync::{Arc, PoisonError};

use anyhow::{Context, anyhow};
use egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use tracer::gpu::{AdapterSelect, Gpu};

use crate::cli::PreviewArgs;
use crate::commands::print_json;
use crate::gaze::hub::GazeHub;
use crate::reload::Loader;
use crate::reload::rule::Timing;
use crate::session::{self, Source};
use engine::Engine;
use gaze_control::GazeControl;
use screenshot::{Outcome, Screenshot};
use window::Window;

pub mod attention_tools;
pub mod controls;
pub mod editor;
pub mod engine;
pub mod gaze;
pub mod gaze_control;
pub mod gaze_panel;
pub mod navigation;
pub mod open_scene;
pub mod overlay;
pub mod pacing;
pub mod screenshot;
pub mod split_panel;
pub mod theme;
pub mod tracing;
pub mod window;

/// Opens the window and stays until it is closed.
///
/// # Errors
/// No display, no usable adapter, or a scene that cannot be opened.
pub fn run(args: PreviewArgs) -> anyhow::Result<()> {
    let source = Source::from(args.scene.scene.as_deref());
    if let Source::File(path) = &source {
        // A window that opens only to say that the file is missing helps nobody.
        std::fs::File::open(path).with_context(|| path.display().to_string())?;
    }
    let gaze = Arc::new(GazeHub::new(&args.gaze.sources, args.gaze.accuracy_deg)?);
    let select = args.scene.adapter.clone().map_or(AdapterSelect::Auto, AdapterSelect::Named);
    let outcome = Outcome::default();
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            // The scene's name comes when it is open.
            .with_title("Fovea")
            .with_app_id("fovea")
            .with_inner_size([args.window.width as f32, args.window.height as f32])
            .with_min_inner_size([320.0, 240.0])
            .with_drag_and_drop(true),
        wgpu_options: WgpuConfiguration { wgpu_setup: setup(select), ..WgpuConfiguration::default() },
        persist_window: false,
        ..eframe::NativeOptions::default()
    };
    let screenshot = args
        .screenshot_after
        .zip(args.screenshot.clone())
        .map(|(after, path)| Screenshot::new(after, path, Arc::clone(&outcome)));
    let creator: eframe::AppCreator<'_> = Box::new(move |creation| {
        theme::apply(&creation.egui_ctx);
        let state = creation.wgpu_render_state.as_ref().context("the window has no graphics device")?;
        let gpu = Gpu::adopt(state.adapter.clone(), state.device.clone(), state.queue.clone())?;
        let adapter = gpu.info().name.clone();
        let ctx = creation.egui_ctx.clone();
        let engine = Engine::start(gpu, &args, Arc::clone(&gaze), move || ctx.request_repaint())?;
        let ctx = creation.egui_ctx.clone();
        let loader = Loader::start(args.scene.clone(), Timing::default(), move || ctx.request_repaint())?;
        loader.open(source);
        let gaze = GazeControl::new(gaze, &args);
        Ok(Box::new(Window::new(engine, loader, adapter, &args, gaze, screenshot)))
    });
    eframe::run_native("fovea", options, creator).map_err(explain)?;
    let outcome = outcome.lock().unwrap_or_else(PoisonError::into_inner).take();
    match outcome {
        Some(figures) => print_json(&figures?),
        None => Ok(()),
    }
}

/// The window's device: the adapter that a headless run takes among those that can show a window, with what the tracer
/// asks for.
fn setup(select: AdapterSelect) -> WgpuSetup {
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    let backends = &mut setup.instance_descriptor.backends;
    *backends &= wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    setup.native_adapter_selector = Some(Arc::new(move |adapters, surface| {
        let fits = |adapter: &&wgpu::Adapter| surface.is_none_or(|surface| adapter.is_surface_supported(surface));
        let presenting: Vec<wgpu::Adapter> = adapters.iter().filter(fits).cloned().collect();
        if presenting.is_empty() && !adapters.is_empty() {
            return Err("no graphics adapter can show a window on this display".into());
        }
        Gpu::choose(&presenting, &select).cloned().map_err(|error| error.to_string())
    }));
    setup.device_descriptor = Arc::new(|adapter| {
        let (required_features, required_limits) = Gpu::requirements(adapter);
        wgpu::DeviceDescriptor { label: Some("fovea"), required_features, required_limits, ..Default::default() }
    });
    WgpuSetup::CreateNew(setup)
}

/// An eframe error in the words of somebody who wants to see a picture.
fn explain(error: eframe::Error) -> anyhow::Error {
    match error {
        eframe::Error::WinitEventLoop(error) => {
            let cause = session::one_line(&anyhow!("{error}"));
            anyhow!("no display to open a window on ({cause}); `fovea render` needs none")
        }
        eframe::Error::AppCreation(error) => anyhow!("{error:#}"),
        error => anyhow!("no window: {error}"),
    }
}
