//! What somebody does who is timed, in the window without a display.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use egui::{Event, Key, Modifiers, MouseWheelSource, MouseWheelUnit, PointerButton, TouchPhase, pos2, vec2};
use egui_kittest::Harness;
use tracer::gpu::{AdapterSelect, Gpu};

use super::tests::{Dropped, frames, step_until, window};
use super::*;
use crate::cli;
use crate::document::edits::{Edits, Part};
use crate::preview::navigation::Standpoint;
use crate::preview::split_panel;

/// What somebody who is timed must not change.
fn what_is_seen(window: &Window) -> (Standpoint, Option<Part>, Edits, Controls, Visibility) {
    let standpoint = window.scene.as_ref().unwrap().1.standpoint;
    let editor = window.editor.as_ref().unwrap();
    let edits = editor.document().edits().clone();
    (standpoint, editor.panel.selected, edits, window.controls.clone(), window.visibility)
}

/// Does what empties the film, changes the scene or says more about it than the picture does.
fn disturb(harness: &mut Harness<'_, Window>, dropped: &str) {
    let middle = pos2(600.0, 400.0);
    for button in [PointerButton::Primary, PointerButton::Middle] {
        let press = |pos, pressed| Event::PointerButton { pos, button, pressed, modifiers: Modifiers::NONE };
        harness.hover_at(middle);
        harness.run_steps(1);
        // A click, which selects, and a drag.
        for end in [middle, middle + vec2(40.0, 30.0)] {
            harness.event(press(middle, true));
            harness.run_steps(1);
            harness.hover_at(end);
            harness.run_steps(1);
            harness.event(press(end, false));
            harness.run_steps(1);
        }
    }
    harness.event(Event::MouseWheel {
        unit: MouseWheelUnit::Point,
        delta: vec2(0.0, 80.0),
        phase: TouchPhase::Move,
        source: MouseWheelSource::Wheel,
        modifiers: Modifiers::NONE,
    });
    harness.run_steps(5);
    for key in [Key::W, Key::M, Key::N, Key::G, Key::CloseBracket] {
        harness.key_down(key);
        harness.run_steps(2);
        harness.key_up(key);
        harness.run_steps(1);
    }
    harness.input_mut().dropped_files.push(Arc::new(Dropped(dropped.into())));
    harness.run_steps(2);
}

#[test]
fn input_during_a_trial_of_split_times_changes_nothing_and_esc_keeps_the_trials_that_are_done() {
    let folder = std::env::temp_dir().join(format!("fovea-window-split-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let line = "fovea --film-memory 16 --max-bounces 0";
    let args = cli::parse(line.split(' ').map(Into::into)).unwrap().preview;
    let mut window = window(&args, &Gpu::headless(&AdapterSelect::Auto).unwrap());
    window.loader.open(Source::BuiltIn);
    window.split.folders = vec![folder.clone()];
    (window.split.plan.modes, window.split.plan.repetitions) = (vec![Mode::Fv, Mode::Od], 2);
    let mut harness = frames(window, [1280.0, 720.0]);
    step_until(&mut harness, "the scene opens", |window| window.editor.is_some());

    let before = what_is_seen(harness.state());
    disturb(&mut harness, "a sky.hdr");
    let after = what_is_seen(harness.state());
    assert!(
        before.0 != after.0 && before.1 != after.1 && before.2 != after.2 && before.3 != after.3 && before.4 != after.4
    );

    let scene = split_panel::Scene { name: "room.glb", adapter: "an adapter" };
    let started = harness.state_mut().split.start(7, &scene, Instant::now());
    assert!(started.is_none());
    for key in [Key::O, Key::P, Key::O] {
        harness.key_press(key);
        harness.run_steps(2);
    }
    let trial = |harness: &Harness<'_, Window>| harness.state().split.controls(&harness.state().controls).trial;
    let (before, second) = (what_is_seen(harness.state()), trial(&harness));
    disturb(&mut harness, "another sky.hdr");
    assert_eq!(what_is_seen(harness.state()), before);
    assert_eq!(trial(&harness), second);
    // Another size of the window is another film, with another clock.
    harness.set_size(vec2(1000.0, 720.0));
    harness.run_steps(2);
    assert_eq!(trial(&harness), second.map(|trial| trial + 1));
    harness.key_press(Key::P);
    harness.key_press(Key::Escape);
    harness.run_steps(2);
    assert_eq!((trial(&harness), harness.state().split.is_running()), (None, false));
    drop(harness);
    let csv = std::fs::read_to_string(folder.join("split-times-1.csv")).unwrap();
    assert_eq!(csv.lines().filter(|line| line.contains(",room.glb,")).count(), 1, "{csv}");
    std::fs::remove_dir_all(folder).unwrap();
}
