//! Runs of split times: keys, what is shown meanwhile, and results.

use fovea_app::preview::engine::Message;
use fovea_app::preview::split_panel;

use super::*;

const SCENE: split_panel::Scene<'_> = split_panel::Scene { name: "room.glb", adapter: "an adapter" };

#[test]
fn a_run_of_split_times_goes_through_its_modes_and_writes_its_results() {
    let folder = std::env::temp_dir().join(format!("fovea-split-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let mut split = SplitTimes::default();
    split.folders = vec![folder.clone()];
    split.plan.repetitions = 1;
    let modes = split.plan.modes.clone();
    let mut set = Controls::from(&args());
    (set.paused, set.comparison) = (true, Some(Comparison::default()));
    assert_eq!(split.controls(&set), set);
    assert!(split.start(5, &SCENE, Instant::now()).is_none() && split.hides_mode());
    let mut note = String::new();
    let draw = move |ui: &mut egui::Ui, (split, told): &mut (SplitTimes, Vec<Message>)| {
        told.extend(split.written(ui.ctx()));
        told.extend(split.keys(ui.ctx(), Instant::now(), (1000, [0.0, 0.0])));
        split.banner(ui.ctx());
        let label = ui.label("Note");
        ui.text_edit_singleline(&mut note).labelled_by(label.id);
    };
    // A plot that somebody kept of an earlier run.
    std::fs::write(folder.join("split-times-1.svg"), "kept").unwrap();
    let mut harness = harness(draw, (split, Vec::new()));
    // Letters of a text are no answers.
    harness.get_by_role_and_label(Role::TextInput, "Note").click();
    harness.run_steps(2);
    for key in [egui::Key::O, egui::Key::P] {
        harness.key_press(key);
        harness.run_steps(2);
    }
    assert!(harness.query_by_label("O: the outline is visible").is_some() && harness.state().1.is_empty());
    harness.ctx.memory_mut(egui::Memory::stop_text_input);
    harness.run_steps(2);
    let mut shown = Vec::new();
    for _ in 0..modes.len() {
        assert!(harness.query_by_label("O: the outline is visible").is_some());
        let trial = harness.state().0.controls(&set);
        assert_eq!((trial.comparison, trial.paused), (None, false));
        shown.push((trial.mode, trial.trial));
        // Too early for the material.
        for key in [egui::Key::P, egui::Key::O] {
            harness.key_press(key);
            harness.run_steps(2);
        }
        assert!(harness.query_by_label("P: the material is visible").is_some());
        harness.key_press(egui::Key::P);
        harness.run_steps(2);
    }
    assert!(modes.iter().all(|mode| shown.iter().any(|(shown, _)| shown == mode)), "{shown:?}");
    assert!(shown.windows(2).all(|pair| pair[0].1 != pair[1].1), "each is a film of its own: {shown:?}");
    wait_for_results(&mut harness, 1);
    let (split, told) = harness.state();
    assert!(!told[0].wrong && !split.hides_mode(), "{told:?}");
    assert_eq!(split.controls(&set), set, "as it was before");
    let csv = std::fs::read_to_string(folder.join("split-times-2.csv")).unwrap();
    assert_eq!(csv.lines().filter(|line| line.contains(",room.glb,")).count(), modes.len());
    assert!(folder.join("split-times-2.svg").exists());
    assert_eq!(std::fs::read_to_string(folder.join("split-times-1.svg")).unwrap(), "kept");
    std::fs::remove_dir_all(folder).unwrap();
}

/// Until so many things have been told.
fn wait_for_results(harness: &mut Harness<'_, (SplitTimes, Vec<Message>)>, count: usize) {
    let end = Instant::now() + Duration::from_secs(20);
    while harness.state().1.len() < count && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(5));
        harness.run_steps(1);
    }
    assert_eq!(harness.state().1.len(), count, "{:?}", harness.state().1);
}

#[test]
fn a_run_of_split_times_outlives_folders_that_cannot_be_written() {
    let folder = std::env::temp_dir().join(format!("fovea-split-nowhere-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    let [first, second] = ["first", "second"].map(|name| folder.join(name));
    let mut split = SplitTimes::default();
    split.folders = vec![first.clone(), second.clone()];
    (split.plan.repetitions, split.plan.modes) = (1, vec![Mode::Fv]);
    let told = split.start(5, &SCENE, Instant::now()).unwrap();
    assert!(told.wrong && !split.is_running(), "nothing is asked of anybody in vain: {told:?}");
    std::fs::create_dir_all(&second).unwrap();
    let told = split.start(5, &SCENE, Instant::now()).unwrap();
    assert!(split.is_running() && told.text.contains("second"), "{told:?}");
    let draw = |ui: &mut egui::Ui, (split, told): &mut (SplitTimes, Vec<Message>)| {
        told.extend(split.written(ui.ctx()));
        told.extend(split.keys(ui.ctx(), Instant::now(), (1000, [0.0, 0.0])));
        told.extend(split.show(ui, "", &SCENE, Instant::now()));
    };
    let mut harness = harness(draw, (split, Vec::new()));
    std::fs::remove_dir_all(&folder).unwrap();
    for key in [egui::Key::O, egui::Key::P] {
        harness.key_press(key);
        harness.run_steps(2);
    }
    wait_for_results(&mut harness, 1);
    assert!(harness.state().1[0].wrong);
    std::fs::create_dir_all(&second).unwrap();
    harness.run_steps(2);
    harness.get_by_label("Write results again").click();
    harness.run_steps(2);
    wait_for_results(&mut harness, 2);
    assert!(std::fs::read_to_string(second.join("split-times-1.csv")).unwrap().contains(",room.glb,"));
    assert!(harness.query_by_label("Write results again").is_none());
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_run_that_is_stopped_keeps_the_trials_that_are_done() {
    let folder = std::env::temp_dir().join(format!("fovea-split-stopped-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let rows = |number: u32| {
        let csv = std::fs::read_to_string(folder.join(format!("split-times-{number}.csv"))).unwrap();
        csv.lines().filter(|line| line.contains(",room.glb,")).count()
    };
    let draw = |ui: &mut egui::Ui, (split, told): &mut (SplitTimes, Vec<Message>)| {
        told.extend(split.written(ui.ctx()));
        told.extend(split.keys(ui.ctx(), Instant::now(), (1000, [0.0, 0.0])));
    };
    let mut split = SplitTimes::default();
    split.folders = vec![folder.clone()];
    let mut harness = harness(draw, (split, Vec::new()));
    let press = |harness: &mut Harness<'_, (SplitTimes, Vec<Message>)>, keys: &[egui::Key]| {
        assert!(harness.state_mut().0.start(5, &SCENE, Instant::now()).is_none());
        for key in keys {
            harness.key_press(*key);
            harness.run_steps(2);
        }
    };
    // Without a trial that is done there is nothing to keep.
    press(&mut harness, &[egui::Key::O, egui::Key::Escape]);
    assert!(!harness.state().0.is_running() && std::fs::read_dir(&folder).unwrap().next().is_none());
    press(&mut harness, &[egui::Key::O, egui::Key::P, egui::Key::O, egui::Key::Escape]);
    wait_for_results(&mut harness, 1);
    assert!(!harness.state().1[0].wrong && !harness.state().0.is_running());
    assert_eq!(rows(1), 1);
    // The window closes meanwhile.
    press(&mut harness, &[egui::Key::O, egui::Key::P, egui::Key::O, egui::Key::P]);
    drop(harness);
    assert_eq!(rows(2), 2);
    std::fs::remove_dir_all(folder).unwrap();
}
