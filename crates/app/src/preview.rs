//! The preview window.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::rc::Rc;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use tracer::gpu::{self, AdapterSelect, Gpu};

use crate::cli::PreviewArgs;
use crate::commands::print_json;
use crate::gaze::hub::GazeHub;
use crate::output::exr;
use crate::preferences::{Store, WindowPlace};
use crate::reload::Loader;
use crate::reload::rule::Timing;
use crate::session::{self, Source};
use engine::{Devices, Engine, Request};
use gaze_control::GazeControl;
use screenshot::{Outcome, Screenshot};
use window::Window;

pub mod attention_tools;
mod background;
mod canvas;
pub mod compare;
pub mod controls;
pub mod dialogs;
pub mod eccentricity;
pub mod editor;
pub mod engine;
pub mod file_menu;
pub mod frame_times;
pub mod gaze;
pub mod gaze_control;
pub mod gaze_panel;
pub mod histogram;
pub mod keeper;
pub mod legend;
pub mod navigation;
pub mod open_scene;
mod orbit;
pub mod overlay;
pub mod pacing;
mod place;
pub mod screenshot;
pub mod seeing;
pub mod split_panel;
pub mod theme;
pub mod tracing;
pub mod unsaved;
pub mod versions;
pub mod window;

/// Opens the window and stays until it is closed.
///
/// # Errors
/// No display, no usable adapter, or a scene that cannot be opened.
pub fn run(args: &PreviewArgs) -> anyhow::Result<()> {
    let source = Source::from(args.scene.scene.as_deref());
    // A window that opens only to say that the file is missing helps nobody.
    match &source {
        Source::File(path) => drop(std::fs::File::open(path).with_context(|| path.display().to_string())?),
        Source::BuiltIn => session::check_built_in(&args.scene.file)?,
    }
    let resumed = args.resume.as_deref().map(exr::read).transpose()?;
    let gaze = Arc::new(GazeHub::new(&args.gaze.sources, args.gaze.accuracy_deg)?);
    let outcome = Outcome::default();
    let screenshot = args
        .screenshot_after
        .zip(args.screenshot.clone())
        .map(|(after, path)| Screenshot::new(after, path, Arc::clone(&outcome)));
    let (store, trouble) = Store::load();
    let (kept_theme, kept_place) = (store.kept().theme, store.kept().window);
    let repaint = Repaint::default();
    let repaints = repaint.clone();
    let first = |engine: Engine, adapter| -> anyhow::Result<Window> {
        let loader = Loader::start(args.scene.clone(), Timing::default(), move || repaints.request())?;
        loader.open(source.clone());
        if args.vr {
            engine.request(Request::EnterHeadset);
        }
        let gaze = GazeControl::new(Arc::clone(&gaze), args);
        let mut window = Window::new(engine, loader, adapter, args, gaze, (store, trouble), screenshot);
        if let Some((path, file)) = args.resume.as_deref().zip(resumed) {
            window.resume(path, Box::new(file));
        }
        Ok(window)
    };
    // What a person has done outlives the device: the window moves to another when its own is lost.
    let (window, mut first) = (Rc::new(RefCell::new(None)), Some(first));
    let mut losses = Losses::default();
    let mut lose_at = args.lose_device_after.map(|secs| Instant::now() + Duration::from_secs_f64(secs));
    let mut show = || loop {
        let (shown, first) = (Rc::clone(&window), first.take());
        let theme = window.borrow().as_ref().map_or(kept_theme, Window::theme);
        let place = window.borrow().as_ref().map_or(kept_place, Window::place);
        let creator: eframe::AppCreator<'_> = Box::new(|creation| {
            theme::apply(&creation.egui_ctx);
            creation.egui_ctx.set_theme(theme);
            repaint.aim_at(&creation.egui_ctx);
            let state = creation.wgpu_render_state.as_ref().context("the window has no graphics device")?;
            let gpu = Gpu::adopt(state.adapter.clone(), state.device.clone(), state.queue.clone())?;
            let adapter = gpu.info().name.clone();
            let repaints = repaint.clone();
            let engine = Engine::start(Devices::beside(gpu), args, Arc::clone(&gaze), move || repaints.request())?;
            match (&mut *shown.borrow_mut(), first) {
                (Some(window), _) => Window::renew(window, engine, adapter),
                (none, Some(first)) => *none = Some(first(engine, adapter)?),
                (None, None) => return Err("the window did not open".into()),
            }
            Ok(Box::new(Shell { window: shown, lose_at }))
        });
        // Between the frame that does not know of a loss yet and its painting, egui's painter panics.
        let run = || eframe::run_native("fovea", native_options(args, place), creator);
        let outcome = catch_unwind(AssertUnwindSafe(run));
        let is_lost = || window.borrow().as_ref().is_some_and(Window::is_lost);
        let lost = match outcome {
            Ok(closed) => {
                closed.map_err(explain)?;
                is_lost()
            }
            Err(panic) if !noticed(is_lost) => resume_unwind(panic),
            Err(_) => true,
        };
        if !lost {
            return Ok(());
        }
        losses.count(Instant::now())?;
        lose_at = None;
    };
    let ended = catch_unwind(AssertUnwindSafe(|| -> anyhow::Result<()> { show() }));
    if !matches!(ended, Ok(Ok(()))) {
        rescue_edits(&window);
    }
    ended.unwrap_or_else(|panic| resume_unwind(panic))?;
    if let Some(window) = &mut *window.borrow_mut() {
        window.close()?;
    }
    let outcome = outcome.lock().unwrap_or_else(PoisonError::into_inner).take();
    match outcome {
        Some(figures) => print_json(&figures?),
        None => Ok(()),
    }
}

/// Keeps what has not been saved of a window that ends without having asked.
fn rescue_edits(window: &RefCell<Option<Window>>) {
    match window.borrow().as_ref().and_then(Window::rescue_edits) {
        Some(Ok(path)) => eprintln!("note: edits that were not saved are in {}", path.display()),
        Some(Err(error)) => eprintln!("note: edits that were not saved are lost: {error}"),
        None => {}
    }
}

/// Whether the loss of the device becomes known within a second.
fn noticed(is_lost: impl Fn() -> bool) -> bool {
    let pause = Duration::from_millis(50);
    (0..20).any(|_| {
        is_lost() || {
            std::thread::sleep(pause);
            false
        }
    })
}

fn native_options(args: &PreviewArgs, place: Option<WindowPlace>) -> eframe::NativeOptions {
    let select = args.scene.adapter.clone().map_or(AdapterSelect::Auto, AdapterSelect::Named);
    let mut viewport = egui::ViewportBuilder::default()
        // The scene's name comes when it is open.
        .with_title("Fovea")
        .with_app_id("fovea")
        .with_inner_size([args.window.width as f32, args.window.height as f32])
        .with_min_inner_size([320.0, 240.0])
        .with_drag_and_drop(true);
    if let Some(place) = place.filter(|_| !args.stated.contains(&"window")) {
        viewport = viewport.with_inner_size(place.size).with_maximized(place.maximized);
        viewport = place.position.map_or(viewport.clone(), |position| viewport.with_position(position));
    }
    eframe::NativeOptions {
        viewport,
        wgpu_options: WgpuConfiguration { wgpu_setup: setup(select), ..WgpuConfiguration::default() },
        persist_window: false,
        // The picture has its own eight bits and panels have no gradients.
        dithering: false,
        ..eframe::NativeOptions::default()
    }
}

/// Shows a window that outlives it.
struct Shell {
    window: Rc<RefCell<Option<Window>>>,
    /// When a test wants the device to be lost.
    lose_at: Option<Instant>,
}

impl eframe::App for Shell {
    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        if self.lose_at.is_some_and(|at| at <= Instant::now())
            && let Some(state) = frame.wgpu_render_state()
        {
            self.lose_at = None;
            state.device.destroy();
        }
        if let Some(window) = &mut *self.window.borrow_mut() {
            window.ui(ui, frame);
        }
    }

    fn clear_color(&self, visuals: &egui::Visuals) -> [f32; 4] {
        self.window.borrow().as_ref().map_or([0.0; 4], |window| window.clear_color(visuals))
    }
}

/// Asks whichever window is open at the moment to be drawn again.
#[derive(Clone, Default)]
struct Repaint(Arc<Mutex<Option<egui::Context>>>);

impl Repaint {
    fn aim_at(&self, ctx: &egui::Context) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(ctx.clone());
    }

    fn request(&self) {
        if let Some(ctx) = &*self.0.lock().unwrap_or_else(PoisonError::into_inner) {
            ctx.request_repaint();
        }
    }
}

/// How often the device was lost of late: a driver that fails at once, time and again, is not tried for ever.
#[derive(Default)]
struct Losses(Vec<Instant>);

impl Losses {
    fn count(&mut self, now: Instant) -> anyhow::Result<()> {
        self.0.retain(|at| now.duration_since(*at) < Duration::from_secs(60));
        self.0.push(now);
        anyhow::ensure!(self.0.len() <= 3, "the graphics device was lost {} times within a minute", self.0.len());
        Ok(())
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
        wgpu::DeviceDescriptor {
            label: Some("fovea"),
            required_features,
            required_limits,
            memory_hints: gpu::MEMORY,
            ..Default::default()
        }
    });
    WgpuSetup::CreateNew(setup)
}

/// An eframe error in the words of somebody who wants to see a picture.
fn explain(error: eframe::Error) -> anyhow::Error {
    match error {
        eframe::Error::WinitEventLoop(error) => {
            let text = session::one_line(&anyhow!("{error}"));
            // The system's errors begin with a place in the sources of the window's library.
            let cause =
                text.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": ")).map_or(&*text, |(_, rest)| rest);
            anyhow!("no display to open a window on ({cause}); `fovea render` needs none")
        }
        eframe::Error::AppCreation(error) => anyhow!("{error:#}"),
        error => anyhow!("no window: {error}"),
    }
}
