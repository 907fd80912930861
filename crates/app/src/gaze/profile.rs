//! What is remembered of a person before a screen: millimetres, distance, drift, accuracy. A JSON file of the user's.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use super::drift::DriftCorrection;
use super::parse::edid::{self, MonitorSize};
use crate::config;
use crate::screen::ScreenGeometry;

/// One person before one screen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Profile {
    /// Screen and distance, once somebody has said or accepted them.
    pub screen: Option<ScreenGeometry>,
    /// Taken off every sample.
    pub drift: DriftCorrection,
    /// What the last validation found, degrees.
    pub accuracy_deg: Option<f64>,
    /// What the last validation found, degrees.
    pub precision_deg: Option<f64>,
}

impl Profile {
    fn to_json(self) -> Value {
        json!({
            "screen_mm": self.screen.map(|screen| [screen.width_mm, screen.height_mm]),
            "distance_mm": self.screen.map(|screen| screen.distance_mm),
            "drift_deg": self.drift.offset_deg,
            "accuracy_deg": self.accuracy_deg,
            "precision_deg": self.precision_deg,
        })
    }

    /// What of an entry makes sense; the rest is as if it were not there.
    fn from_json(value: &Value) -> Self {
        let number = |value: &Value, low: f64, high: f64| value.as_f64().filter(|found| (low..=high).contains(found));
        let mm = |value: &Value| number(value, 10.0, 100_000.0).map(|found| found as f32);
        let screen = || {
            Some(ScreenGeometry {
                width_mm: mm(&value["screen_mm"][0])?,
                height_mm: mm(&value["screen_mm"][1])?,
                distance_mm: mm(&value["distance_mm"])?,
            })
        };
        let drift = |axis: usize| number(&value["drift_deg"][axis], -20.0, 20.0).unwrap_or(0.0);
        Self {
            screen: screen(),
            drift: DriftCorrection { offset_deg: [drift(0), drift(1)] },
            accuracy_deg: number(&value["accuracy_deg"], 0.0, 90.0),
            precision_deg: number(&value["precision_deg"], 0.0, 90.0),
        }
    }
}

/// All that is remembered.
#[derive(Clone, Debug, Default)]
pub struct Profiles {
    /// Where it is kept; nowhere when the system names no folder for settings.
    path: Option<PathBuf>,
    entries: BTreeMap<String, Profile>,
}

impl Profiles {
    /// From the user's settings. A file that cannot be read is put aside and named in the note.
    pub fn load() -> (Self, Option<String>) {
        config::folder().map_or((Self::default(), None), |folder| Self::load_from(&folder.join("gaze.json")))
    }

    /// From a file.
    pub fn load_from(path: &Path) -> (Self, Option<String>) {
        let (entries, note) = match read(path) {
            Ok(entries) => (entries, None),
            Err(reason) => {
                let aside = match config::put_aside(path) {
                    Ok(aside) => format!("it is kept as {}", aside.display()),
                    Err(error) => format!("it cannot be put aside: {error}"),
                };
                (Map::new(), Some(format!("{reason}; {aside}, and settings of gaze start afresh")))
            }
        };
        let entries = entries.iter().map(|(key, value)| (key.clone(), Profile::from_json(value))).collect();
        (Self { path: Some(path.to_owned()), entries }, note)
    }

    /// What is remembered of a person before a screen.
    pub fn get(&self, person: &str, monitor: &str) -> Profile {
        self.entries.get(&key(person, monitor)).copied().unwrap_or_default()
    }

    /// Remembers a person before a screen, and puts that into the file; what another window or version has put there stays.
    ///
    /// # Errors
    /// When the file cannot be read or written.
    pub fn set(&mut self, person: &str, monitor: &str, profile: Profile) -> anyhow::Result<()> {
        let key = key(person, monitor);
        self.entries.insert(key.clone(), profile);
        let Some(path) = &self.path else { return Ok(()) };
        let mut entries = read(path).map_err(anyhow::Error::msg)?;
        entries.insert(key, profile.to_json());
        config::write(path, &Value::Object(entries))
    }
}

/// The file's entries; none when there is no file.
fn read(path: &Path) -> Result<Map<String, Value>, String> {
    match config::read(path)? {
        Value::Object(entries) => Ok(entries),
        Value::Null => Ok(Map::new()),
        _ => Err(format!("{}: no list of profiles", path.display())),
    }
}

fn key(person: &str, monitor: &str) -> String {
    format!("{person} @ {monitor}")
}

/// The size of the monitor with so many pixels, as the monitor states it. Linux offers that in `/sys/class/drm`; `None`
/// elsewhere, and when monitors of that many pixels differ in size.
pub fn monitor_mm(size_px: [u32; 2]) -> Option<[f32; 2]> {
    let entries = std::fs::read_dir("/sys/class/drm").ok()?;
    let files = entries.filter_map(|entry| std::fs::read(entry.ok()?.path().join("edid")).ok());
    agreed_mm(files.filter_map(|bytes| edid::monitor_size(&bytes)), size_px)
}

/// The millimetres that all monitors of so many pixels have, either way up.
fn agreed_mm(monitors: impl Iterator<Item = MonitorSize>, size_px: [u32; 2]) -> Option<[f32; 2]> {
    let turned = |[a, b]: [f32; 2]| [b, a];
    let mut fitting = monitors.filter_map(|monitor| match monitor.size_px {
        size if size == size_px => Some(monitor.size_mm),
        [height, width] if [width, height] == size_px => Some(turned(monitor.size_mm)),
        _ => None,
    });
    let first = fitting.next()?;
    let alike = |mm: [f32; 2]| (0..2).all(|axis| (mm[axis] - first[axis]).abs() <= 10.0);
    fitting.all(alike).then_some(first)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn profiles_are_kept_per_person_and_screen_and_broken_files_do_no_harm() {
        let folder = std::env::temp_dir().join(format!("fovea-profile-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        let path = folder.join("gaze.json");
        let (mut profiles, note) = Profiles::load_from(&path);
        assert_eq!((profiles.get("a", "left"), note), (Profile::default(), None));
        let profile = Profile {
            screen: Some(ScreenGeometry { width_mm: 600.0, height_mm: 340.0, distance_mm: 700.0 }),
            drift: DriftCorrection { offset_deg: [0.5, -1.25] },
            accuracy_deg: Some(0.75),
            precision_deg: Some(0.125),
        };
        profiles.set("a", "left", profile).unwrap();
        let (again, note) = Profiles::load_from(&path);
        assert_eq!(note, None);
        assert_eq!((again.get("a", "left"), again.get("b", "left")), (profile, Profile::default()));
        assert_eq!(again.get("a", "right"), Profile::default());

        let odd = r#"{ "a @ left": { "screen_mm": [-1, 2], "distance_mm": "far", "drift_deg": [90, 1], "accuracy_deg": null } }"#;
        std::fs::write(&path, odd).unwrap();
        let (partly, _) = Profiles::load_from(&path);
        let kept = Profile { drift: DriftCorrection { offset_deg: [0.0, 1.0] }, ..Profile::default() };
        assert_eq!(partly.get("a", "left"), kept);
        for (broken, aside) in [("{", "gaze.broken.json"), ("[1]", "gaze.broken-2.json")] {
            std::fs::write(&path, broken).unwrap();
            let (mut empty, note) = Profiles::load_from(&path);
            assert_eq!(empty.get("a", "left"), Profile::default());
            assert!(note.unwrap().contains(aside));
            empty.set("a", "left", profile).unwrap();
            assert_eq!(std::fs::read_to_string(folder.join(aside)).unwrap(), broken, "somebody may mend it");
            assert_eq!(Profiles::load_from(&path).0.get("a", "left"), profile);
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn what_others_keep_in_the_file_stays() {
        let folder = std::env::temp_dir().join(format!("fovea-profiles-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        let path = folder.join("gaze.json");
        let (mut one, mut two) = (Profiles::load_from(&path).0, Profiles::load_from(&path).0);
        let accurate = |deg| Profile { accuracy_deg: Some(deg), ..Profile::default() };
        one.set("a", "left", accurate(0.5)).unwrap();
        two.set("b", "left", accurate(0.75)).unwrap();
        one.set("a", "left", accurate(0.25)).unwrap();
        let (both, _) = Profiles::load_from(&path);
        assert_eq!([both.get("a", "left"), both.get("b", "left")], [accurate(0.25), accurate(0.75)]);
        // As another program is writing it, or a newer version of this one has.
        std::fs::write(&path, "{ half").unwrap();
        assert!(two.set("b", "left", accurate(1.0)).is_err());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "{ half");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn monitors_are_told_apart_by_their_pixels() {
        let monitor = |width, height, mm| MonitorSize { size_px: [width, height], size_mm: mm };
        let desk = [monitor(1920, 1080, [531.0, 299.0]), monitor(2560, 1440, [597.0, 336.0])];
        assert_eq!(agreed_mm(desk.into_iter(), [2560, 1440]), Some([597.0, 336.0]));
        assert_eq!(agreed_mm(desk.into_iter(), [1080, 1920]), Some([299.0, 531.0]));
        assert_eq!(agreed_mm(desk.into_iter(), [800, 600]), None);
        let twins = [desk[0], monitor(1920, 1080, [344.0, 194.0])];
        assert_eq!(agreed_mm(twins.into_iter(), [1920, 1080]), None, "a laptop beside a monitor");
    }
}
