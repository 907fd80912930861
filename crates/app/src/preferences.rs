//! What a window keeps from one run to the next: `settings.json` in the user's settings. Films and scenes are not in it.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use egui::ThemePreference;
use serde_json::{Value, json};

use crate::cli::choices::{Mode, ToneMapping};
use crate::cli::values::EXPOSURE_EV;
use crate::config;
use crate::preview::overlay::Visibility;
use crate::recent::RecentFiles;

/// What has changed is written after it has rested so long.
const RESTED: Duration = Duration::from_secs(2);
/// Themes by name.
const THEMES: [(ThemePreference, &str); 3] =
    [(ThemePreference::System, "system"), (ThemePreference::Light, "light"), (ThemePreference::Dark, "dark")];

/// Where a window is on the desktop, points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowPlace {
    /// Of its content.
    pub size: [f32; 2],
    /// Top left with its frame; `None` where the system does not say.
    pub position: Option<[f32; 2]>,
    /// It fills the screen; size and position are those it goes back to.
    pub maximized: bool,
}

/// What is kept; `None`: nothing is, and the usual counts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Preferences {
    /// Light, dark, or as the system has it.
    pub theme: ThemePreference,
    /// How samples are distributed.
    pub mode: Option<Mode>,
    /// More samples to where the film is noisy.
    pub adaptive: Option<bool>,
    /// Stops.
    pub exposure_ev: Option<f32>,
    /// From radiance to display values.
    pub tone_map: Option<ToneMapping>,
    /// Whether the picture is denoised.
    pub denoise: Option<bool>,
    /// Which panels are open.
    pub panels: Option<Visibility>,
    /// The window.
    pub window: Option<WindowPlace>,
    /// Where the last file was chosen.
    pub folder: Option<PathBuf>,
    /// Files that were opened, the newest first.
    pub recent: Vec<PathBuf>,
}

impl Preferences {
    fn to_json(&self) -> Value {
        let panels = self.panels.map(|panels| {
            json!({ "settings": panels.panel, "scene": panels.editor, "gaze": panels.gaze, "ring": panels.ring })
        });
        let window = self
            .window
            .map(|window| json!({ "size": window.size, "position": window.position, "maximized": window.maximized }));
        json!({
            "theme": THEMES.iter().find(|entry| entry.0 == self.theme).map(|entry| entry.1),
            "mode": name(self.mode),
            "adaptive": self.adaptive,
            "exposure_ev": self.exposure_ev,
            "tone_map": name(self.tone_map),
            "denoise": self.denoise,
            "panels": panels,
            "window": window,
            // A path that is no text cannot be in a JSON file.
            "folder": self.folder.as_deref().and_then(Path::to_str),
            "recent": self.recent.iter().filter_map(|path| path.to_str()).collect::<Vec<_>>(),
        })
    }

    /// What of a file makes sense; the rest is as if it were not there.
    fn from_json(value: &Value) -> Self {
        let panels = &value["panels"];
        let usual = Visibility::default();
        let open = |name: &str, usual: bool| panels[name].as_bool().unwrap_or(usual);
        let path = |value: &Value| value.as_str().map(PathBuf::from);
        let recent = value["recent"].as_array().into_iter().flatten().filter_map(path);
        Self {
            theme: THEMES.iter().find(|entry| value["theme"] == entry.1).map_or_else(Default::default, |entry| entry.0),
            mode: choice(&value["mode"]),
            adaptive: value["adaptive"].as_bool(),
            exposure_ev: value["exposure_ev"].as_f64().map(|ev| ev as f32).filter(|ev| EXPOSURE_EV.contains(ev)),
            tone_map: choice(&value["tone_map"]),
            denoise: value["denoise"].as_bool(),
            panels: panels.is_object().then(|| Visibility {
                panel: open("settings", usual.panel),
                editor: open("scene", usual.editor),
                gaze: open("gaze", usual.gaze),
                ring: open("ring", usual.ring),
                ..usual
            }),
            window: window_place(&value["window"]),
            folder: path(&value["folder"]),
            recent: RecentFiles::new(recent).paths().to_vec(),
        }
    }
}

fn window_place(value: &Value) -> Option<WindowPlace> {
    let pair = |value: &Value, range: std::ops::RangeInclusive<f64>| {
        let number = |index: usize| value[index].as_f64().filter(|x| range.contains(x)).map(|x| x as f32);
        Some([number(0)?, number(1)?])
    };
    Some(WindowPlace {
        size: pair(&value["size"], 100.0..=65_536.0)?,
        position: pair(&value["position"], -65_536.0..=65_536.0),
        maximized: value["maximized"].as_bool().unwrap_or(false),
    })
}

/// A choice as the command line has it.
fn name<T: ValueEnum>(choice: Option<T>) -> Option<String> {
    Some(choice?.to_possible_value()?.get_name().to_owned())
}

fn choice<T: ValueEnum>(value: &Value) -> Option<T> {
    T::from_str(value.as_str()?, false).ok()
}

/// Preferences with the file that they are kept in.
#[derive(Clone, Debug, Default)]
pub struct Store {
    /// Nowhere when the system names no folder for settings.
    path: Option<PathBuf>,
    kept: Preferences,
    changed: Option<(Preferences, Instant)>,
}

impl Store {
    /// From the user's settings. A file that cannot be read counts as empty and is named in the note.
    pub fn load() -> (Self, Option<String>) {
        config::folder().map_or_else(Default::default, |folder| Self::load_from(&folder.join("settings.json")))
    }

    /// From a file.
    pub fn load_from(path: &Path) -> (Self, Option<String>) {
        let (value, note) = match config::read(path) {
            Ok(value) => (value, None),
            Err(reason) => {
                // Put aside for whoever wrote it by hand; where that fails it will be said again next time.
                let _ = config::put_aside(path);
                (Value::Null, Some(format!("{reason}; the window's settings start afresh")))
            }
        };
        (Self { path: Some(path.to_owned()), kept: Preferences::from_json(&value), changed: None }, note)
    }

    /// What was kept last.
    pub fn kept(&self) -> &Preferences {
        &self.kept
    }

    /// Keeps what has changed and rested for a while; how long to wait for that.
    ///
    /// # Errors
    /// When the file cannot be written; it is not tried again until something else changes.
    pub fn remember(&mut self, preferences: Preferences, now: Instant) -> anyhow::Result<Option<Duration>> {
        if preferences == self.kept {
            self.changed = None;
            return Ok(None);
        }
        let since = match &self.changed {
            Some((changed, since)) if *changed == preferences => *since,
            _ => now,
        };
        self.changed = Some((preferences, since));
        match RESTED.checked_sub(now.saturating_duration_since(since)) {
            Some(left) if !left.is_zero() => Ok(Some(left)),
            _ => self.flush().map(|()| None),
        }
    }

    /// Keeps what has changed at once.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn flush(&mut self) -> anyhow::Result<()> {
        let Some((changed, _)) = self.changed.take() else { return Ok(()) };
        self.kept = changed;
        self.write()
    }

    fn write(&self) -> anyhow::Result<()> {
        self.path.as_deref().map_or(Ok(()), |path| config::write(path, &self.kept.to_json()))
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn preferences() -> Preferences {
        Preferences {
            theme: ThemePreference::Light,
            mode: Some(Mode::VpRegion),
            adaptive: Some(true),
            exposure_ev: Some(-12.5),
            tone_map: Some(ToneMapping::PbrNeutral),
            denoise: Some(false),
            panels: Some(Visibility { panel: false, editor: true, ring: false, ..Visibility::default() }),
            window: Some(WindowPlace { size: [900.0, 600.5], position: Some([-20.0, 10.0]), maximized: true }),
            folder: Some("/scenes".into()),
            recent: vec!["/scenes/b.glb".into(), "/scenes/a.glb".into()],
        }
    }

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("fovea-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        folder
    }

    #[test]
    fn what_is_kept_is_there_in_the_next_run() {
        let folder = folder("preferences");
        let path = folder.join("fovea/settings.json");
        let (mut store, note) = Store::load_from(&path);
        assert_eq!((store.kept(), note), (&Preferences::default(), None));
        let now = Instant::now();
        let wait = store.remember(preferences(), now).unwrap().unwrap();
        assert!(wait > Duration::ZERO && !path.exists(), "a slider that moves is not written at every step");
        let other = Preferences { mode: Some(Mode::Od), ..preferences() };
        assert!(store.remember(other, now + RESTED).unwrap().is_some(), "what changes again rests anew");
        assert!(store.remember(preferences(), now + 2 * RESTED).unwrap().is_some());
        assert_eq!(store.remember(preferences(), now + 3 * RESTED).unwrap(), None);
        assert_eq!(Store::load_from(&path).0.kept(), &preferences());
        // On closing nothing waits.
        store.remember(Preferences::default(), now + 3 * RESTED).unwrap();
        store.flush().unwrap();
        assert_eq!(Store::load_from(&path).0.kept(), &Preferences::default());
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_broken_file_does_no_harm_and_says_so_once() {
        let folder = folder("broken-preferences");
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("settings.json");
        std::fs::write(&path, "{ \"mode\": ").unwrap();
        let (store, note) = Store::load_from(&path);
        assert_eq!(store.kept(), &Preferences::default());
        assert!(note.unwrap().contains("settings.json"));
        assert_eq!(Store::load_from(&path).1, None, "it has been said");
        assert!(folder.join("settings.broken.json").exists(), "somebody may have written it by hand");
        let odd = r#"{ "theme": 7, "mode": "none", "adaptive": "yes", "exposure_ev": 1e9, "tone_map": "linear", "panels": { "gaze": "x" },
            "window": { "size": [3, "big"] }, "folder": [], "recent": ["/a.glb", 5, "/a.glb"] }"#;
        std::fs::write(&path, odd).unwrap();
        let (store, note) = Store::load_from(&path);
        let expected = Preferences {
            tone_map: Some(ToneMapping::Linear),
            panels: Some(Visibility::default()),
            recent: vec!["/a.glb".into()],
            ..Preferences::default()
        };
        assert_eq!((store.kept(), note), (&expected, None));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_place_that_cannot_be_written_is_an_error_and_no_more() {
        let file = folder("no-folder");
        std::fs::write(&file, "").unwrap();
        let (mut store, note) = Store::load_from(&file.join("settings.json"));
        // What the system calls a folder that is a file differs; either way nothing is kept, and the window goes on.
        assert!(note.is_none_or(|note| note.contains("settings.json")));
        store.remember(preferences(), Instant::now()).unwrap();
        assert!(store.flush().is_err());
        assert_eq!(store.kept(), &preferences());
        std::fs::remove_file(file).unwrap();
    }
}
