//! Fields of the properties, with real typing and dragging.

use egui::{Event, Key, Modifiers};
use fovea_app::preview::editor::{Editor, properties};
use fovea_app::preview::navigation::Standpoint;
use fovea_app::view::View;
use glam::{Affine3A, Quat, Vec3};
use tracer::import::SceneNode;
use tracer::scene::Instance;

use super::*;

/// The first object of the built-in scene, selected.
fn with_object<'a>() -> (Harness<'a, Scene>, u32) {
    let document = built_in();
    let node = document.version().instances[0].node;
    let state = PanelState { selected: Some(Part::Node(node)), ..PanelState::default() };
    (scene_harness(document, state), node)
}

/// What a field shows, without its unit.
fn shown(harness: &Harness<'_, Scene>, name: &str) -> f64 {
    let text = harness.get_by_label(name).value().unwrap();
    text.trim_end_matches([' ', 'm', '°']).replace('\u{2212}', "-").parse().unwrap()
}

/// Clicks at a place, selects the text that is there and writes another, key by key.
fn write_at<State>(harness: &mut Harness<'_, State>, at: egui::Pos2, text: &str) {
    for pressed in [true, false] {
        let button = egui::PointerButton::Primary;
        harness.event(Event::PointerMoved(at));
        harness.event(Event::PointerButton { pos: at, button, pressed, modifiers: Modifiers::NONE });
        harness.run_steps(2);
    }
    harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    harness.run_steps(1);
    for letter in text.chars() {
        harness.event(Event::Text(letter.into()));
        harness.run_steps(2);
    }
}

fn write(harness: &mut Harness<'_, Scene>, name: &str, text: &str) {
    let at = harness.get_by_label(name).rect().center();
    write_at(harness, at, text);
}

fn press<State>(harness: &mut Harness<'_, State>, key: Key) {
    harness.key_press(key);
    harness.run_steps(3);
}

#[test]
fn a_typed_number_counts_as_it_is_typed_when_it_is_done_and_is_one_step() {
    for (name, text) in [("Scale X", "0.5"), ("Location Y", "-12.375"), ("Rotation Z", "33.25")] {
        for end in [Key::Enter, Key::Tab] {
            let (mut harness, node) = with_object();
            write(&mut harness, name, text);
            assert!(harness.state().document.edits().is_empty(), "{name}: not done yet");
            press(&mut harness, end);
            assert_eq!(shown(&harness, name), text.parse::<f64>().unwrap(), "{name}");
            let moved = harness.state().document.edits().nodes[&node].moved;
            assert!(name != "Scale X" || moved.scale == Vec3::new(0.5, 1.0, 1.0), "{moved:?}");
            harness.state_mut().document.undo();
            assert!(harness.state().document.edits().is_empty() && !harness.state().document.can_undo(), "{name}");
        }
    }
}

#[test]
fn sliders_and_strengths_are_typed_like_all_numbers() {
    let state = PanelState { tab: Tab::Materials, selected: Some(Part::Material(0)), ..PanelState::default() };
    let mut harness = scene_harness(built_in(), state);
    let slider = harness.get_by_role_and_label(Role::Slider, "Roughness").rect();
    let beside = |rect: &egui::Rect| rect.left() > slider.right() && slider.y_range().contains(rect.center().y);
    let field = harness.query_all_by_role(Role::SpinButton).map(|node| node.rect()).find(beside).unwrap();
    write_at(&mut harness, field.center(), "0.125");
    assert!(harness.state().document.edits().is_empty(), "not done yet");
    press(&mut harness, Key::Enter);
    write(&mut harness, "Strength", "2.5");
    press(&mut harness, Key::Enter);
    let material = &harness.state().document.version().materials[0];
    assert_eq!((material.roughness, material.emission.max_element()), (0.125, 2.5));
    (0..2).for_each(|_| harness.state_mut().document.undo());
    assert!(harness.state().document.edits().is_empty() && !harness.state().document.can_undo());
}

#[test]
fn a_colour_without_strength_is_the_same_when_it_is_strong_again() {
    let mut loaded = session::load(&Source::BuiltIn, &args().scene).unwrap();
    let scene = Arc::make_mut(&mut loaded.scene);
    Arc::make_mut(&mut scene.materials[0]).emission = Vec3::new(1.0, 0.5, 0.25);
    Arc::make_mut(&mut scene.materials[1]).emission = Vec3::ZERO;
    let state = PanelState { tab: Tab::Materials, selected: Some(Part::Material(0)), ..PanelState::default() };
    let mut harness = scene_harness(Document::new(&loaded), state);
    let strong = |harness: &mut Harness<'_, Scene>, strength: &str| {
        write(harness, "Strength", strength);
        press(harness, Key::Enter);
        [0, 1].map(|index| harness.state().document.version().materials[index].emission)
    };
    assert_eq!(strong(&mut harness, "0"), [Vec3::ZERO; 2]);
    // Another colour that has none is another.
    harness.state_mut().panel.selected = Some(Part::Material(1));
    harness.run_steps(2);
    assert_eq!(strong(&mut harness, "2"), [Vec3::ZERO, Vec3::splat(2.0)]);
    harness.state_mut().panel.selected = Some(Part::Material(0));
    harness.run_steps(2);
    assert_eq!(strong(&mut harness, "8"), [Vec3::new(8.0, 4.0, 2.0), Vec3::splat(2.0)]);
}

#[test]
fn what_is_selected_stays_as_the_file_has_it() {
    let mut loaded = session::load(&Source::BuiltIn, &args().scene).unwrap();
    let scene = Arc::make_mut(&mut loaded.scene);
    let material = Arc::make_mut(&mut scene.materials[0]);
    // More digits than are shown, and values that the sliders do not reach.
    (material.roughness, material.normal_scale, material.ior) = (0.123_456, -1.0, 0.0);
    let state = PanelState { tab: Tab::Materials, selected: Some(Part::Material(0)), ..PanelState::default() };
    let harness = scene_harness(Document::new(&loaded), state);
    assert_eq!(harness.state().asked, []);
}

#[test]
fn what_is_typed_comes_before_what_a_click_asks_for() {
    let (mut harness, node) = with_object();
    harness.state_mut().document.edit(&Edit::Hide(node, true), Gesture::Once);
    harness.run_steps(2);
    write(&mut harness, "Scale X", "3");
    harness.get_by_label("Undo").click();
    harness.run_steps(3);
    let edit = harness.state().document.edits().nodes[&node];
    assert_eq!((edit.hidden, edit.moved.scale), (Some(true), Vec3::ONE), "the typed number is what is undone");
}

#[test]
fn a_press_in_the_picture_ends_typing_before_something_else_is_selected() {
    let loaded = session::load(&Source::BuiltIn, &args().scene).unwrap();
    let nowhere = std::env::temp_dir().join(format!("fovea-no-such-scene-{}.glb", std::process::id()));
    let mut editor = Editor::open(&Source::File(nowhere), &loaded);
    let node = editor.document().version().instances[0].node;
    editor.panel.selected = Some(Part::Node(node));
    // Away from all: a click in the picture selects nothing.
    let standpoint = Standpoint { position: Vec3::Y * 1e4, view: View::along(Quat::from_rotation_x(1.0), 0.8, 1.8) };
    let draw = move |ui: &mut egui::Ui, editor: &mut Editor| {
        let rect = ui.max_rect();
        let response = ui.allocate_rect(rect, egui::Sense::click_and_drag());
        editor.point(ui, &response, &standpoint);
        editor.show_panel(ui.ctx(), &[], 0);
    };
    let mut harness = harness(draw, editor);
    let field = harness.get_by_label("Scale X").rect().center();
    write_at(&mut harness, field, "3");
    write_at(&mut harness, egui::pos2(300.0, 400.0), "");
    let editor = harness.state();
    assert_eq!(editor.panel.selected, None);
    assert_eq!(editor.document().edits().nodes[&node].moved.scale.x, 3.0);
}

#[test]
fn an_angle_is_dragged_past_ninety_degrees_and_the_others_stay() {
    let (mut harness, node) = with_object();
    let angles = |harness: &Harness<'_, Scene>| ["X", "Y", "Z"].map(|axis| shown(harness, &format!("Rotation {axis}")));
    let at_first = angles(&harness);
    let axes = |harness: &Harness<'_, Scene>| properties::own_axes(&harness.state().document, node).1;
    let axes_at_first = axes(&harness);
    let start = harness.get_by_label("Rotation Y").rect().center();
    harness.hover_at(start);
    harness.drag_at(start);
    harness.run_steps(2);
    for step in 1..=16 {
        harness.hover_at(start + egui::vec2(0.0, -20.0 * step as f32));
        harness.run_steps(2);
        let [x, y, z] = angles(&harness);
        assert_eq!([x, z], [at_first[0], at_first[2]], "at {y}");
        // Half a degree a point; round numbers are preferred.
        assert!((y - at_first[1] - 10.0 * f64::from(step)).abs() < 6.0, "{y} after {step} steps from {at_first:?}");
    }
    let dragged = angles(&harness);
    assert!(dragged[1] - at_first[1] > 150.0, "{dragged:?}");
    // The object follows: about Y of a rotation without Z, the world's Y.
    assert_eq!([at_first[0], at_first[2]], [0.0, 0.0], "the object lies along the world's axes");
    let turned = glam::Mat3A::from_rotation_y((dragged[1] - at_first[1]).to_radians() as f32) * axes_at_first;
    assert!(axes(&harness).abs_diff_eq(turned, 1e-4), "{dragged:?}");
    harness.drop_at(start - egui::vec2(0.0, 320.0));
    harness.run_steps(3);
    let [x, y, z] = angles(&harness);
    assert!((x.abs() - 180.0).abs() < 0.1 && y.abs() < 90.0 && (z.abs() - 180.0).abs() < 0.1, "{x} {y} {z}");
    assert!(axes(&harness).abs_diff_eq(turned, 1e-4));
}

#[test]
fn held_angles_give_way_to_a_rotation_from_elsewhere() {
    let (mut harness, node) = with_object();
    let at = harness.get_by_label("Rotation Y").rect().center();
    write_at(&mut harness, at, "");
    // Steps of half a degree, while the field is open.
    (0..3).for_each(|_| press(&mut harness, Key::ArrowUp));
    let before = shown(&harness, "Rotation Y");
    assert!(before != 0.0);
    let turned = Quat::from_rotation_y(0.5);
    let moved = fovea_app::document::edits::Move { rotation: turned, ..Default::default() };
    harness.state_mut().document.edit(&Edit::Move(node, moved), Gesture::Once);
    harness.run_steps(3);
    assert!(harness.state().panel.angles.is_some(), "the field is still open");
    let expected = properties::own_axes(&harness.state().document, node).1;
    let angles = ["X", "Y", "Z"].map(|axis| shown(&harness, &format!("Rotation {axis}")).to_radians() as f32);
    let found = Quat::from_euler(glam::EulerRot::ZYX, angles[2], angles[1], angles[0]);
    assert!(glam::Mat3A::from_quat(found).abs_diff_eq(expected, 1e-3), "{angles:?}");
}

/// A built-in scene with a group of so many copies of its first object.
fn with_group(count: u32) -> (Document, u32) {
    let mut loaded = session::load(&Source::BuiltIn, &args().scene).unwrap();
    let mut scene = (*loaded.scene).clone();
    let group = loaded.nodes.len() as u32;
    loaded.nodes.push(SceneNode { name: "group".into(), parent: None, world_from_node: Affine3A::IDENTITY });
    for node in group + 1..=group + count {
        loaded.nodes.push(SceneNode { name: String::new(), parent: Some(group), world_from_node: Affine3A::IDENTITY });
        let copy = Instance { node, ..scene.instances[0].clone() };
        scene.instances.push(copy);
    }
    loaded.scene = Arc::new(scene);
    (Document::new(&loaded), group)
}

/// Each frame looked for every object in a list of all of them.
#[test]
fn a_group_of_fifty_thousand_objects_is_shown_at_once() {
    let (document, group) = with_group(50_000);
    let material = document.version().materials[document.version().instances[0].material as usize].name.clone();
    let state = PanelState { selected: Some(Part::Node(group)), ..PanelState::default() };
    let mut harness = scene_harness(document, state);
    assert!(harness.query_by_label(&material).is_some());
    // The fastest of several: other programs take their share of a frame.
    let frame = |harness: &mut Harness<'_, Scene>| {
        let start = Instant::now();
        harness.run_steps(1);
        start.elapsed()
    };
    let fastest = (0..8).map(|_| frame(&mut harness)).min().unwrap();
    assert!(fastest < Duration::from_millis(50), "{fastest:?}");
    // Another version is another list.
    let node = harness.state().document.tree().children(group)[0];
    harness.state_mut().panel.selected = Some(Part::Node(node));
    harness.run_steps(2);
    assert!(harness.query_by_label(&material).is_some());
}
