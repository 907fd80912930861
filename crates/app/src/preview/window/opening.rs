//! What the window does about scenes that come from the loader: sketches, opened ones, and newer versions of their files.

use egui::{Context, Rect};
use glam::Quat;
use tracer::film::{FilmHeader, FilmMapping};

use super::Window;
use crate::preview::editor::Editor;
use crate::preview::engine::Message;
use crate::preview::navigation::Navigation;
use crate::preview::open_scene::OpenScene;
use crate::preview::unsaved::{Decision, Next};
use crate::reload::{LoadEvent, Sketchable, Watched};
use crate::session::{Loaded, Source};

impl Window {
    /// Takes what the loader has: a new scene starts from its camera, a new version of the same one keeps the view. While somebody
    /// is timed it waits.
    pub(super) fn follow_loader(&mut self, rect: Rect) {
        while !self.unsaved.is_asking()
            && !self.split.is_running()
            && let Some(event) = self.loader.poll()
        {
            match event {
                LoadEvent::Opened(source, loaded) => {
                    let next = Next::Show(Box::new((source, loaded)));
                    let allowed = self.unsaved.allow(next, self.editor.as_ref());
                    allowed.into_iter().for_each(|next| self.go_on(next, rect));
                }
                LoadEvent::Changed(_) | LoadEvent::Broken(_) if self.going_back => {}
                LoadEvent::Followed => self.going_back = false,
                LoadEvent::Changed(loaded) => self.follow_file(&loaded),
                LoadEvent::Shapes(source, sketchable) if self.editor.is_none() => self.sketch(source, sketchable, rect),
                // The present scene stays until the next one is there.
                LoadEvent::Shapes(..) => {}
                LoadEvent::NotOpened(text) => {
                    self.unsaved.keep();
                    self.give_up_sketch();
                    self.files.forget_waiting(self.editor.is_some());
                    self.note = Some(Message::now(text, true));
                }
                LoadEvent::Broken(text) => self.broken = Some(text),
                LoadEvent::Environment(path, result) => {
                    if let Some(editor) = &mut self.editor {
                        editor.take_environment(path, result);
                    }
                }
            }
        }
    }

    /// Opens a scene, after a question where that would lose edits.
    pub(super) fn open_scene(&mut self, source: Source) {
        self.files.forget_waiting(self.editor.is_some());
        if let Some(Next::Open(source)) = self.unsaved.allow(Next::Open(source), self.editor.as_ref()) {
            self.loader.open(source);
        }
    }

    /// Asks whether edits may be lost, and does what is decided.
    pub(super) fn ask(&mut self, ctx: &Context, rect: Rect) {
        match self.unsaved.ask(ctx, self.editor.as_mut()) {
            Some(Decision::GoOn(next)) => self.go_on(next, rect),
            // The loader follows the files of the other scene by now.
            Some(Decision::Stay(Next::Show(_))) => {
                self.files.forget_waiting(true);
                if let Some(watched) = self.watched.clone() {
                    self.going_back = true;
                    self.loader.follow(watched);
                }
            }
            Some(Decision::Stay(Next::Open(_))) => self.files.forget_waiting(true),
            Some(Decision::Stay(Next::Close)) | None => {}
        }
    }

    fn go_on(&mut self, next: Next, rect: Rect) {
        match next {
            // It closes by itself.
            Next::Close => {}
            Next::Open(source) => self.loader.open(source),
            Next::Show(opened) => {
                let (source, loaded) = *opened;
                self.open(&source, &loaded, rect);
                self.add_recent(&source);
            }
        }
    }

    /// Shows the shapes of a scene that is still being read.
    fn sketch(&mut self, source: Source, sketchable: Sketchable, rect: Rect) {
        let open = OpenScene::sketched(&sketchable.shapes);
        self.scene = self.at_start(&open, rect).map(|navigation| (open, navigation));
        self.sketched = Some(source);
        self.engine.sketch(sketchable);
    }

    /// What was to be opened does not come: without a scene there is nothing to walk about in.
    pub(super) fn give_up_sketch(&mut self) {
        if self.sketched.take().is_some() {
            self.scene = None;
        }
    }

    fn open(&mut self, source: &Source, loaded: &Loaded, rect: Rect) {
        self.unsaved.keep();
        let open = OpenScene::new(loaded);
        // What there was to say before there was anything to see is said now.
        self.note = self.files.trouble.take().map(|text| Message::now(text, false));
        self.broken = None;
        // Who has walked about in its sketch stays where he is.
        let sketched = self.sketched.take().filter(|sketched| sketched == source).and_then(|_| self.scene.take());
        let navigation = sketched.map(|(_, navigation)| navigation).or_else(|| self.at_start(&open, rect));
        if let Some(navigation) = navigation {
            self.scene = Some((open, navigation));
            self.editor = Some(Editor::open(source, loaded));
            self.files.scene_is_open();
            self.watched = Some(Watched::new(source, loaded));
        }
    }

    /// At the camera that a scene starts from, or where a film to go on with was taken.
    fn at_start(&mut self, open: &OpenScene, rect: Rect) -> Option<Navigation> {
        let aspect = rect.width() / rect.height().max(1.0);
        let start = open.viewpoints.get(open.start)?;
        let mut navigation = Navigation::new(start.position, start.rotation, start.vfov, aspect, open.diagonal);
        self.camera = open.start;
        if let Some(film) = &self.film {
            let (rotation, vfov) = looking_at(film.header(), (start.rotation, start.vfov), aspect);
            navigation.jump(film.header().pose.position, rotation, vfov);
        }
        Some(navigation)
    }

    fn follow_file(&mut self, loaded: &Loaded) {
        self.broken = None;
        if let (Some((open, navigation)), Some(editor)) = (&mut self.scene, &mut self.editor) {
            *open = OpenScene::new(loaded);
            navigation.set_scale(open.diagonal);
            self.camera = self.camera.min(open.viewpoints.len().saturating_sub(1));
            editor.follow_file(loaded);
            self.watched = Some(Watched::new(editor.source(), loaded));
        }
    }
}

/// Where to look on a film, with a vertical angle that stays on it: a panorama as given, else along its axis.
pub(super) fn looking_at(film: &FilmHeader, otherwise: (Quat, f32), aspect: f32) -> (Quat, f32) {
    match film.options.mapping {
        FilmMapping::Equirect => otherwise,
        FilmMapping::Perspective { half_extent: [x, y] } => {
            (film.pose.world_from_film, 2.0 * y.min(x / aspect.max(1e-3)).atan())
        }
    }
}
