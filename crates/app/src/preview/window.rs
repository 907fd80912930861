//! The window: the picture, what lies over it, and what mouse and keys do.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use egui::{Context, Rect, Sense, Ui};
use glam::{UVec2, Vec2, Vec3};
use tracer::scene::Scene;

use super::attention_tools::{self, ToolState};
use super::canvas;
use super::compare;
use super::controls::Controls;
use super::eccentricity;
use super::editor::{self, Editor};
use super::engine::{Destination, Engine, Look, Message, Request, State, Survivors};
use super::gaze::{self, Gaze, ScreenMapping, fovea_ring};
use super::gaze_control::GazeControl;
use super::gaze_panel;
use super::legend;
use super::navigation::{Navigation, point_in_view};
use super::open_scene::OpenScene;
use super::overlay::{self, Action, Facts, Visibility};
use super::screenshot::Screenshot;
use super::seeing;
use super::split_panel::SplitTimes;
use super::unsaved::Unsaved;
use super::versions::Versions;
use crate::cli::PreviewArgs;
use crate::cli::choices::Mode;
use crate::output::OutputError;
use crate::output::exr::FilmFile;
use crate::preferences::Store;
use crate::reload::{Loader, Watched};
use crate::session::Source;

mod files;
mod keys;
mod opening;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod timed_tests;

/// How long a note stays.
const NOTE: Duration = Duration::from_secs(5);
/// How long a complaint stays.
const COMPLAINT: Duration = Duration::from_secs(12);

/// What takes no longer is not worth a word.
const WORTH_SAYING: Duration = Duration::from_millis(200);

/// The application.
pub struct Window {
    engine: Engine,
    loader: Loader,
    /// What the window itself has to tell.
    note: Option<Message>,
    /// Why the files of the open scene cannot be read as they are now.
    broken: Option<String>,
    adapter: String,
    controls: Controls,
    visibility: Visibility,
    gaze: GazeControl,
    /// The scene that the navigation moves in; without an editor it is a sketch of one that is still being read.
    scene: Option<(OpenScene, Navigation)>,
    /// Where that sketch is from.
    sketched: Option<Source>,
    tools: ToolState,
    split: SplitTimes,
    /// Where one looks as far as tracing goes, in the scene.
    gaze_direction: Option<Vec3>,
    /// What is done with it.
    editor: Option<Editor>,
    unsaved: Unsaved,
    /// The present scene as its files are watched.
    watched: Option<Watched>,
    /// The loader goes back to that: what is heard until it does is of another scene.
    going_back: bool,
    /// The version that the engine has been given.
    given: Option<Arc<Scene>>,
    camera: usize,
    screenshot: Option<Screenshot>,
    /// A film to go on with once its scene is open.
    film: Option<files::GoingOn>,
    /// Presses of the headset's mode button that have been followed.
    mode_presses: u64,
    files: files::Files,
    versions: Versions,
}

impl Window {
    /// A window over a running engine, with what was kept of the last one.
    pub fn new(
        engine: Engine,
        loader: Loader,
        adapter: String,
        args: &PreviewArgs,
        gaze: GazeControl,
        (store, trouble): (Store, Option<String>),
        screenshot: Option<Screenshot>,
    ) -> Self {
        let mut controls = Controls::from(args);
        let mut visibility = Visibility { gaze: gaze.is_worth_showing(), ..Visibility::default() };
        files::prefer(args, store.kept(), &mut controls, &mut visibility);
        Self {
            engine,
            loader,
            note: None,
            broken: None,
            adapter,
            controls,
            visibility,
            gaze,
            scene: None,
            sketched: None,
            tools: ToolState::default(),
            split: SplitTimes::default(),
            gaze_direction: None,
            editor: None,
            unsaved: Unsaved::default(),
            watched: None,
            going_back: false,
            given: None,
            camera: 0,
            screenshot,
            film: None,
            mode_presses: 0,
            files: files::Files::new(store, trouble),
            versions: Versions::default(),
        }
    }

    /// Goes on with the film of a file as soon as its scene is open, from where it was taken.
    pub fn resume(&mut self, path: &Path, file: Box<FilmFile>) {
        self.film = Some(files::GoingOn::new(path, file));
    }

    /// Keeps edits that are not saved when the window ends without a question; the file.
    pub fn rescue_edits(&self) -> Option<Result<PathBuf, OutputError>> {
        self.editor.as_ref().and_then(Editor::rescue)
    }

    /// Whether the window's device is gone.
    pub fn is_lost(&self) -> bool {
        self.engine.state().lost
    }

    /// Goes on over another device, with the scene, the settings and what was last kept of the film.
    pub fn renew(&mut self, engine: Engine, adapter: String) {
        let Survivors { scene, film } = self.engine.survivors();
        if let Some(scene) = scene {
            engine.set_scene(scene);
        }
        if let Some(film) = film {
            engine.request(Request::GoOn(film));
        }
        (self.engine, self.adapter, self.mode_presses) = (engine, adapter, 0);
        self.versions = Versions::default();
        self.unsaved.renew();
        self.split.begin_trial_again(Instant::now());
        self.note =
            Some(Message::now("the graphics device was lost; the film goes on from its last snapshot".into(), false));
    }

    /// Gives the engine the document's version and asks the loader for what that lacks.
    fn hand_over(&mut self) {
        let Some(editor) = &mut self.editor else { return };
        if let Some(path) = editor.ask_for_environment() {
            self.loader.load_environment(path);
        }
        // A first version is not prepared for another film than the one to go on with.
        if self.given.is_none() && self.film.is_some() {
            return;
        }
        let version = editor.document().version();
        if !self.given.as_ref().is_some_and(|given| Arc::ptr_eq(given, version)) {
            self.given = Some(Arc::clone(version));
            self.engine.set_scene(Arc::clone(version));
        }
    }

    fn look(&self, ctx: &Context, rect: Rect, gaze: Gaze, pointer: Option<Vec2>) -> Option<(Look, f32)> {
        let (_, navigation) = self.scene.as_ref()?;
        let monitor = ctx.input(|input| input.viewport().monitor_size);
        let mapping = ScreenMapping::new(self.controls.screen, rect, monitor);
        let pixels = rect.size() * ctx.pixels_per_point();
        let look = Look {
            standpoint: navigation.standpoint,
            gaze,
            controls: self.split.controls(&self.controls),
            mapping,
            size_px: UVec2::new(pixels.x.round().max(1.0) as u32, pixels.y.round().max(1.0) as u32),
            pointer,
        };
        Some((look, mapping.deg_per_px(rect, ctx.pixels_per_point())))
    }

    fn overlay(&mut self, ctx: &Context, state: &State, deg_per_px: f32) {
        self.split.banner(ctx);
        let selected = self.editor.as_ref().map(Editor::selected_name).unwrap_or_default();
        // Who is timed sees the picture and changes nothing.
        if self.split.is_running() {
            return self.message(ctx, state);
        }
        let shown = self.visibility.panel;
        if let Some((scene, _)) = self.scene.as_ref().filter(|_| shown) {
            let cameras: Vec<String> = scene.viewpoints.iter().map(|viewpoint| viewpoint.name.clone()).collect();
            let facts = Facts {
                scene: &scene.name,
                contents: &scene.contents,
                adapter: &self.adapter,
                film: &state.film,
                schedule: state.schedule,
                cameras: &cameras,
                camera: self.camera,
                notes: &scene.notes,
                readout: state.readout,
                headset: state.headset.as_ref(),
                deg_per_px,
                gaze: self.gaze_direction,
                selected: &selected,
                recent: Some(&self.files.recent),
            };
            let (controls, tools, split) = (&mut self.controls, &mut self.tools, &mut self.split);
            for action in overlay::panel(ctx, &facts, controls, tools, split, &mut self.visibility) {
                self.act(action);
            }
        }
        if self.visibility.editor {
            self.show_editor(ctx);
        }
        let offset = if self.visibility.editor { editor::panel::PANEL_WIDTH + 30.0 } else { 0.0 };
        if state.headset.is_none() {
            legend::draw(ctx, &self.controls, state.readout.seen.scale, offset);
        }
        if self.visibility.gaze && !self.gaze.shows_dots() {
            gaze_panel::panel(ctx, &mut self.gaze, offset, Instant::now());
        }
        if self.visibility.keys {
            overlay::keys(ctx);
        }
        self.message(ctx, state);
    }

    /// What a run of split times does with keys, a window of another size, and one that closes.
    fn follow_split(&mut self, ctx: &Context, size: egui::Vec2, state: &State) {
        let now = Instant::now();
        let closes = ctx.input(|input| input.viewport().close_requested());
        let told = self.split.written(ctx).or_else(|| if closes { self.split.stop() } else { None });
        self.note = told.or(self.note.take());
        self.split.follow_size(size, now);
        let gaze = self.gaze_direction.unwrap_or(Vec3::NEG_Z);
        let (yaw, pitch) = crate::view::yaw_pitch(gaze);
        let gaze_deg = [yaw, pitch].map(|angle| f64::from(angle.to_degrees()));
        let told = self.split.keys(ctx, now, (state.readout.samples, gaze_deg));
        self.note = told.or(self.note.take());
    }

    fn show_editor(&mut self, ctx: &Context) {
        let (Some(editor), Some((scene, _))) = (&mut self.editor, &self.scene) else { return };
        let cameras: Vec<String> = scene.viewpoints.iter().map(|viewpoint| viewpoint.name.clone()).collect();
        if let Some(camera) = editor.show_panel(ctx, &cameras, self.camera) {
            self.jump(camera);
        }
    }

    fn message(&mut self, ctx: &Context, state: &State) {
        if let Some(text) = &self.broken {
            overlay::broken(ctx, text);
        }
        if let Some(loading) = self.loader.loading() {
            let elapsed = loading.since.elapsed();
            if elapsed >= WORTH_SAYING || self.scene.is_none() {
                if overlay::loading(ctx, &loading.name, elapsed, self.scene.is_some()) {
                    self.loader.cancel();
                    self.unsaved.keep();
                    self.give_up_sketch();
                    self.files.forget_waiting(self.editor.is_some());
                    self.note = Some(Message::now(format!("{} is not read", loading.name), false));
                }
                ctx.request_repaint_after(WORTH_SAYING);
                return;
            }
            ctx.request_repaint_after(WORTH_SAYING - elapsed);
        }
        if let Some((busy, since)) = state.busy.as_ref().zip(state.busy_since) {
            ctx.request_repaint_after(WORTH_SAYING);
            if since.elapsed() >= WORTH_SAYING {
                return overlay::message(ctx, &overlay::under_way(busy, since.elapsed()), false);
            }
        }
        if state.dead {
            overlay::message(ctx, "the renderer has stopped; the terminal says why", true);
            return;
        }
        if let Some(note) = self.gaze.note(Instant::now()) {
            overlay::message(ctx, &note, false);
            return;
        }
        let editor = self.editor.as_ref().and_then(Editor::message);
        let newest = self.note.iter().chain(&state.message).chain(editor).max_by_key(|message| message.at);
        let Some(Message { text, wrong, at }) = newest else { return };
        let stays = if *wrong { COMPLAINT } else { NOTE };
        // Without a scene there is nothing else to see, so the reason stays.
        if let Some(left) = stays.checked_sub(at.elapsed()) {
            ctx.request_repaint_after(left);
        } else if self.scene.is_some() {
            return;
        }
        overlay::message(ctx, text, *wrong);
    }

    fn act(&mut self, action: Action) {
        match action {
            Action::Restart => self.engine.request(Request::Restart),
            Action::SavePng => self.engine.request(Request::SavePng(self.destination())),
            Action::SaveExr => self.engine.request(Request::SaveExr(self.destination())),
            Action::Camera(index) => self.jump(index),
            Action::EnterHeadset => self.engine.request(Request::EnterHeadset),
            Action::LeaveHeadset => self.engine.request(Request::LeaveHeadset),
            Action::File(action) => self.act_on_file(action),
            Action::Tell(message) => self.note = Some(message),
        }
    }

    /// A name in the working directory that is not taken when the file is written.
    fn destination(&self) -> Destination {
        let scene = self.scene.as_ref().map_or("picture", |(scene, _)| scene.name.as_str());
        Destination::Free { folder: PathBuf::new(), scene: scene.to_owned() }
    }

    fn jump(&mut self, index: usize) {
        let Some((scene, navigation)) = &mut self.scene else { return };
        if let Some(viewpoint) = scene.viewpoints.get(index) {
            navigation.jump(viewpoint.position, viewpoint.rotation, viewpoint.vfov);
            self.camera = index;
        }
    }

    /// What was pressed in the headset counts as if it had been here.
    fn follow_presses(&mut self, state: &State) {
        while self.mode_presses < state.mode_presses {
            self.mode_presses += 1;
            if !self.split.is_running() {
                self.controls.mode = seeing::next_mode(self.controls.mode);
            }
        }
    }
}

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut Ui, frame: &mut eframe::Frame) {
        let ctx = ui.ctx().clone();
        let state = self.engine.state();
        if state.lost {
            return ctx.send_viewport_cmd(egui::ViewportCommand::Close);
        }
        let rect = ui.max_rect();
        let response = ui.allocate_rect(rect, Sense::click_and_drag());
        if !self.screenshot.as_ref().is_some_and(Screenshot::is_done) {
            self.unsaved.follow_close(&ctx, self.editor.as_ref());
        }
        self.follow_loader(rect);
        self.follow_split(&ctx, rect.size(), &state);
        self.keys(&ctx, state.headset.is_some());
        self.follow_presses(&state);
        if state.headset.is_some() {
            // Both eyes see one film, and it comes back as it is.
            self.controls.comparison = None;
        }
        match (&mut self.scene, &mut self.editor) {
            // A film that is seen from elsewhere starts anew, and whoever is timed does not.
            (Some((_, navigation)), _) if self.split.is_running() => navigation.fit(rect),
            (Some((_, navigation)), Some(editor)) => {
                let attention = &mut self.controls.attention;
                let standpoint = navigation.standpoint;
                let is_views = navigation.dragging() || ctx.input(|input| input.modifiers.alt);
                let used = !is_views && attention_tools::point(&response, &standpoint, self.tools, attention);
                if !used {
                    editor.point(ui, &response, &standpoint);
                }
                if !used && !editor.holds_pointer() {
                    navigation.update(ui, &response, |pointer| editor.pivot(pointer, rect, &standpoint));
                }
            }
            // A sketch can be walked about in.
            (Some((open, navigation)), None) => {
                let standpoint = navigation.standpoint;
                navigation.update(ui, &response, |pointer| {
                    let direction = standpoint.view.direction_at(point_in_view(rect, pointer));
                    standpoint.position + 0.5 * open.diagonal * direction
                });
            }
            (None, _) => {}
        }
        let now = Instant::now();
        let view = self.scene.as_ref().map(|(_, navigation)| navigation.standpoint.view);
        self.gaze.follow_screen(frame, &mut self.controls, now);
        let target = view.map(|view| {
            let place = self.gaze.place(&ctx, rect, self.controls.screen);
            self.gaze.frame(now, place, view, gaze::pointer(&response))
        });
        if let Some(target) = target {
            self.controls.acuity.gaze_error_deg = target.accuracy_deg;
        }
        // Without a scene the picture is a sketch of one that could not be opened.
        let picture = state.picture.as_ref().filter(|_| self.scene.is_some());
        if let (Some(picture), Some(render_state)) = (picture, frame.wgpu_render_state()) {
            ui.painter().add(canvas::shape(picture.clone(), rect, render_state.target_format));
        }
        let mut deg_per_px = 0.0;
        let pointer = gaze::pointer(&response).map(|[x, y]| Vec2::new(x as f32, y as f32));
        let gaze = Gaze { point: target.map(|target| target.point).unwrap_or_default() };
        let attention = &self.controls.attention;
        let gaze = match &self.scene {
            Some((_, navigation)) => attention_tools::gaze(attention, &navigation.standpoint, gaze),
            None => gaze,
        };
        if let Some((look, pixel)) = self.look(&ctx, rect, gaze, pointer) {
            deg_per_px = pixel;
            self.gaze_direction = Some(look.standpoint.view.direction_at(gaze.point));
            attention_tools::draw(ui.painter(), rect, &look.standpoint, &self.controls.attention);
            // A headset's mirror has its own.
            let shows_ring = self.visibility.ring && look.controls.mode == Mode::Fv && !self.split.hides_mode();
            if shows_ring && state.headset.is_none() {
                ui.painter().extend(fovea_ring(&look.mapping, rect, gaze));
            }
            if self.visibility.eccentricity && state.headset.is_none() {
                let at = self.controls.eccentricity;
                eccentricity::draw(ui.painter(), &look.mapping, &look.standpoint, rect, gaze, at);
            }
            let compares = state.headset.is_none() && !self.split.is_running();
            if let Some(comparison) = self.controls.comparison.as_mut().filter(|_| compares) {
                compare::wipe(ui, rect, self.controls.mode, comparison, &state.readout);
            }
            let marks = !self.gaze.shows_dots() && !self.split.is_running();
            if let Some(editor) = self.editor.as_mut().filter(|_| marks) {
                editor.draw(ui, rect, &look.standpoint);
            }
            self.engine.look(look);
        }
        gaze_panel::dots(ui, rect, &self.gaze, now);
        if self.gaze.wants_frames() {
            ctx.request_repaint_after(self.gaze.frame_interval());
        }
        if !self.gaze.shows_dots() {
            self.overlay(&ctx, &state, deg_per_px);
        }
        self.ask(&ctx, rect);
        self.unsaved.follow_title(&ctx, self.editor.as_ref());
        self.hand_over();
        self.go_on_with_film(&ctx);
        self.gaze.remember_screen(&self.controls, now);
        self.follow_files(&ctx, frame);
        if self.versions.frame(SystemTime::now(), state.version) {
            ctx.request_repaint();
        }
        if let Some(screenshot) = &mut self.screenshot {
            let trouble = self.note.as_ref().filter(|note| note.wrong && self.loader.loading().is_none());
            let editor = self.editor.as_ref();
            screenshot.update(&ctx, &state, trouble, || {
                serde_json::json!({
                    "gaze": self.gaze.figures(now),
                    "editor": editor.map(Editor::figures),
                    "broken": self.broken,
                    "versions": self.versions.figures(),
                    "adapter": self.adapter,
                })
            });
        }
    }

    fn clear_color(&self, _visuals: &egui::Visuals) -> [f32; 4] {
        [0.04, 0.04, 0.045, 1.0]
    }
}
