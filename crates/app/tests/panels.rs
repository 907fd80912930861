//! The panels without a window or graphics device: what they show, what they ask for, and that every control has a name
//! and can be reached by the keyboard.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Parser;
use egui::accesskit::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable};
use fovea_app::cli::choices::{Mode, ToneMapping};
use fovea_app::cli::{Cli, PreviewArgs};
use fovea_app::document::edits::{Edit, EnvironmentEdit, Part};
use fovea_app::document::parameters::{MaterialParameter, Value};
use fovea_app::document::{Document, Gesture};
use fovea_app::gaze::hub::GazeHub;
use fovea_app::preview::attention_tools::{Tool, ToolState};
use fovea_app::preview::compare::{self, Comparison};
use fovea_app::preview::controls::{Controls, Readout};
use fovea_app::preview::dialogs::Purpose;
use fovea_app::preview::editor::panel::{self, Action, PanelState, Tab};
use fovea_app::preview::gaze_control::GazeControl;
use fovea_app::preview::overlay::{self, Facts, Visibility};
use fovea_app::preview::seeing::{self, Seen};
use fovea_app::preview::split_panel::SplitTimes;
use fovea_app::preview::{file_menu, gaze_panel, legend, theme};
use fovea_app::recent::RecentFiles;
use fovea_app::session::{self, Source};
use tracer::scene::Backdrop;
use tracer::view::{DebugScale, DebugView, Histogram};

#[path = "panels/glyphs.rs"]
mod glyphs;
#[path = "panels/properties.rs"]
mod properties;
#[path = "panels/split.rs"]
mod split;

fn args() -> PreviewArgs {
    Cli::parse_from(["fovea"]).preview
}

fn built_in() -> Document {
    Document::new(&session::load(&Source::BuiltIn, &args().scene).unwrap())
}

/// A window of the usual size.
fn harness<'a, State>(draw: impl FnMut(&mut egui::Ui, &mut State) + 'a, state: State) -> Harness<'a, State> {
    let mut harness =
        Harness::builder().with_size([1280.0, 720.0]).with_context_setup(theme::apply).build_ui_state(draw, state);
    // Named controls everywhere: `run` panics where one has no name.
    harness.run_steps(3);
    harness
}

/// What can be operated and is enabled, by role and name.
fn controls<State>(harness: &Harness<'_, State>) -> BTreeSet<String> {
    let nodes = harness.root().children_recursive().map(|node| node.accesskit_node());
    let operable = nodes.filter(|node| {
        egui::accessibility::is_input(node.role())
            && !node.is_hidden()
            && !node.is_disabled()
            && !node.data().is_read_only()
    });
    operable.map(|node| format!("{:?} {}", node.role(), node.label().unwrap_or_default())).collect()
}

/// What the Tab key leads to.
fn tabbed<State>(harness: &mut Harness<'_, State>) -> BTreeSet<String> {
    let mut reached = BTreeSet::new();
    let most = 2 * controls(harness).len() + 40;
    for _ in 0..most {
        harness.key_press(egui::Key::Tab);
        harness.run_steps(1);
        let nodes = harness.root().children_recursive().map(|node| node.accesskit_node());
        let focused = nodes.filter(|node| node.is_focused());
        reached.extend(focused.map(|node| format!("{:?} {}", node.role(), node.label().unwrap_or_default())));
    }
    reached
}

fn assert_reachable<State>(harness: &mut Harness<'_, State>, what: &str) {
    harness.check_accessibility();
    let wanted = controls(harness);
    assert!(!wanted.is_empty(), "{what} has nothing to operate");
    let reached = tabbed(harness);
    let missed: Vec<_> = wanted.difference(&reached).collect();
    assert!(missed.is_empty(), "{what}: the Tab key does not reach {missed:?}");
}

/// The scene's panel on a document; what is asked for is done to the document and kept.
struct Scene {
    document: Document,
    panel: PanelState,
    asked: Vec<Action>,
}

fn scene_harness(document: Document, panel: PanelState) -> Harness<'static, Scene> {
    let cameras = ["front".to_owned(), "above".to_owned()];
    let draw = move |ui: &mut egui::Ui, scene: &mut Scene| {
        let mut actions = Vec::new();
        panel::panel(ui.ctx(), &scene.document, &cameras, 0, &mut scene.panel, &mut actions);
        for action in actions {
            match &action {
                Action::Edit(edit, gesture) => scene.document.edit(edit, *gesture),
                Action::LoadEnvironment(path) => {
                    let edit = EnvironmentEdit { image: Some(path.clone()), ..EnvironmentEdit::default() };
                    scene.document.edit(&Edit::Environment(edit), Gesture::Once);
                }
                Action::Select(part) => scene.panel.selected = *part,
                Action::Undo => scene.document.undo(),
                Action::Redo => scene.document.redo(),
                Action::Solo(node) => scene.document.set_solo(*node),
                Action::Save | Action::Camera(_) => {}
            }
            scene.asked.push(action);
        }
    };
    harness(draw, Scene { document, panel, asked: Vec::new() })
}

#[test]
fn every_list_and_every_kind_of_part_can_be_operated_by_keyboard() {
    let document = built_in();
    let node = document.version().instances[0].node;
    let parts = [
        (Tab::Objects, Part::Node(node)),
        (Tab::Materials, Part::Material(0)),
        (Tab::Lights, Part::Environment),
        (Tab::Cameras, Part::Environment),
    ];
    let light = (!document.version().lights.is_empty()).then_some((Tab::Lights, Part::Light(0)));
    for (tab, part) in parts.into_iter().chain(light) {
        let state = PanelState { tab, selected: Some(part), search: "a".into(), ..PanelState::default() };
        let mut harness = scene_harness(document.clone(), state);
        assert_reachable(&mut harness, &format!("{tab:?} with {part:?}"));
    }
}

#[test]
fn an_object_is_found_hidden_shown_and_selected() {
    let document = built_in();
    let node = document.version().instances[0].node;
    let name = panel::node_name(&document, node);
    let mut harness = scene_harness(document, PanelState { search: name.to_uppercase(), ..PanelState::default() });
    harness.get_by_role_and_label(Role::CheckBox, &format!("Show {name}")).click();
    harness.run_steps(2);
    assert!(!harness.state().document.is_visible(node));
    harness.get_by_role_and_label(Role::CheckBox, &format!("Show {name}")).click();
    harness.run_steps(2);
    assert!(harness.state().document.is_visible(node));
    harness.get_by_role_and_label(Role::Button, &name).click();
    harness.run_steps(2);
    assert_eq!(harness.state().panel.selected, Some(Part::Node(node)));
    harness.get_by_label("Solo").click();
    harness.run_steps(2);
    assert_eq!(harness.state().document.solo(), Some(node));
    harness.state_mut().panel.search = "no such name".into();
    harness.run_steps(2);
    assert!(harness.query_by_label("No name contains that.").is_some());
}

#[test]
fn a_typed_location_moves_the_object_and_undo_takes_it_back() {
    let document = built_in();
    let node = document.version().instances[0].node;
    let before = document.version().instances[0].world_from_mesh;
    let state = PanelState { selected: Some(Part::Node(node)), ..PanelState::default() };
    let mut harness = scene_harness(document, state);
    let field = harness.get_by_label("Location X");
    let x: f64 = field.value().unwrap().trim_end_matches(" m").parse().unwrap();
    field.set_value_accesskit(x + 1.5);
    harness.run_steps(2);
    let moved = harness.state().document.version().instances[0].world_from_mesh;
    assert!((moved.translation - before.translation - glam::Vec3A::X * 1.5).length() < 1e-3, "{moved:?} {before:?}");
    harness.get_by_label("Undo").click();
    harness.run_steps(2);
    assert_eq!(harness.state().document.version().instances[0].world_from_mesh, before);
    harness.get_by_label("Redo").click();
    harness.run_steps(2);
    assert_eq!(harness.state().document.version().instances[0].world_from_mesh, moved);
}

#[test]
fn a_materials_slider_sets_its_parameter() {
    let state = PanelState { tab: Tab::Materials, selected: Some(Part::Material(0)), ..PanelState::default() };
    let mut harness = scene_harness(built_in(), state);
    for (name, parameter) in [("Roughness", MaterialParameter::Roughness), ("Metallic", MaterialParameter::Metallic)] {
        harness.get_by_role_and_label(Role::Slider, name).set_value_accesskit(0.625);
        harness.run_steps(2);
        let material = &harness.state().document.version().materials[0];
        assert_eq!(parameter.get(material), Value::Number(0.625), "{name}");
    }
    assert_eq!(harness.state().document.edits().materials[&0].len(), 2);
    harness.get_by_label("As in the file").click();
    harness.run_steps(2);
    assert!(harness.state().document.edits().is_empty());
}

#[test]
fn the_environment_is_turned_lit_and_loaded() {
    let state = PanelState {
        tab: Tab::Lights,
        selected: Some(Part::Environment),
        environment: " sky.hdr ".into(),
        ..PanelState::default()
    };
    let mut harness = scene_harness(built_in(), state);
    harness.get_by_label("Load").click();
    harness.run_steps(2);
    let wanted = harness.state().document.wanted_environment().map(ToOwned::to_owned);
    assert_eq!(wanted, Some("sky.hdr".into()));
    let image =
        tracer::scene::EnvironmentImage { width: 1, height: 1, pixels: vec![[1.0; 3]], hash: Default::default() };
    harness.state_mut().document.add_environment("sky.hdr".into(), Arc::new(image));
    harness.run_steps(2);
    harness.get_by_role_and_label(Role::Slider, "Rotation").set_value_accesskit(45.0);
    harness.run_steps(2);
    harness.get_by_role_and_label(Role::Slider, "Intensity").set_value_accesskit(2.0);
    harness.run_steps(2);
    match &harness.state().document.version().environment {
        tracer::scene::Environment::Image { rotation_deg, intensity, .. } => {
            assert_eq!((*rotation_deg, *intensity), (45.0, 2.0));
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_environment_is_hidden_from_the_camera() {
    let state = PanelState { tab: Tab::Lights, selected: Some(Part::Environment), ..PanelState::default() };
    let mut harness = scene_harness(built_in(), state);
    harness.get_by_label("Visible to the camera").click();
    harness.run_steps(2);
    let hidden = harness.state().document.version().backdrop;
    assert!(matches!(hidden, Backdrop::Color(_)), "{hidden:?}");
    assert_reachable(&mut harness, "the backdrop");
    harness.get_by_label("Undo").click();
    harness.run_steps(2);
    assert_eq!(harness.state().document.version().backdrop, Backdrop::Environment);
}

#[test]
fn a_camera_is_jumped_to() {
    let mut harness = scene_harness(built_in(), PanelState { tab: Tab::Cameras, ..PanelState::default() });
    harness.get_by_label("above").click();
    harness.run_steps(2);
    assert_eq!(harness.state().asked, [Action::Camera(1)]);
}

#[test]
fn without_changes_there_is_nothing_to_undo_or_save() {
    let mut harness = scene_harness(built_in(), PanelState::default());
    for name in ["Undo", "Redo", "Save edits"] {
        assert!(harness.get_by_label(name).accesskit_node().is_disabled(), "{name}");
    }
    harness.state_mut().document.edit(&Edit::Hide(0, true), Gesture::Once);
    harness.run_steps(2);
    assert!(!harness.get_by_label("Save edits").accesskit_node().is_disabled());
    harness.get_by_label("Save edits").click();
    harness.run_steps(2);
    assert_eq!(harness.state().asked, [Action::Save]);
}

#[test]
fn the_settings_can_be_operated_by_keyboard() {
    let notes = ["something was not supported".to_owned()];
    let cameras = ["front".to_owned(), "above".to_owned()];
    let mut split = SplitTimes::default();
    let mut tools = ToolState { tool: Tool::Brush, ..ToolState::default() };
    let mut controls = Controls::from(&args());
    controls.exposure_ev = 12.5;
    let state = (controls, Visibility::default(), Vec::new());
    let draw = move |ui: &mut egui::Ui, (controls, visibility, asked): &mut (Controls, Visibility, Vec<_>)| {
        let facts = Facts {
            scene: "room.glb",
            contents: "12 k triangles",
            adapter: "an adapter",
            film: "4096x2048",
            cameras: &cameras,
            notes: &notes,
            deg_per_px: 0.02,
            gaze: Some(glam::Vec3::Z),
            ..Facts::default()
        };
        asked.extend(overlay::panel(ui.ctx(), &facts, controls, &mut tools, &mut split, visibility));
    };
    let mut harness = harness(draw, state);
    assert_reachable(&mut harness, "settings");
    for section in ["Sampling and screen", "Attention", "Split times", "Pixel at the gaze"] {
        harness.get_by_label(section).click();
        harness.run_steps(10);
        assert_reachable(&mut harness, section);
        if section == "Sampling and screen" {
            harness.get_by_role_and_label(Role::CheckBox, "Adaptive sampling").click();
            harness.run_steps(2);
            assert!(harness.state().0.adaptive);
        }
        if section == "Attention" {
            harness.get_by_label("Gaze locked").click();
            harness.get_by_role_and_label(Role::Slider, "Share").set_value_accesskit(80.0);
            harness.run_steps(2);
            let attention = &harness.state().0.attention;
            assert_eq!((attention.locked_gaze, attention.share), (Some(glam::Vec3::Z), 0.8));
        }
        harness.get_by_label(section).click();
        harness.run_steps(10);
    }
    assert_eq!(harness.state().0.exposure_ev, 12.5, "as the command line asks for it");
    harness.get_by_role_and_label(Role::Slider, "Exposure").set_value_accesskit(1.5);
    harness.get_by_label("Viewport").click();
    harness.run_steps(2);
    assert_eq!(harness.state().0.exposure_ev, 1.5);
    assert_eq!(harness.state().0.mode, Mode::Vp);
    harness.get_by_label("Restart").click();
    harness.run_steps(2);
    assert_eq!(harness.state().2, [overlay::Action::Restart]);
}

/// A panel's state with what it was told about the picture.
fn settings_harness<'a>(readout: Readout, controls: Controls) -> Harness<'a, Controls> {
    let (mut tools, mut split, mut visibility) = (ToolState::default(), SplitTimes::default(), Visibility::default());
    let draw = move |ui: &mut egui::Ui, controls: &mut Controls| {
        let facts = Facts { scene: "room.glb", readout, ..Facts::default() };
        overlay::panel(ui.ctx(), &facts, controls, &mut tools, &mut split, &mut visibility);
        seeing::keys(ui.ctx(), controls);
        legend::draw(ui.ctx(), controls, readout.seen.scale, 0.0);
        if let Some(comparison) = &mut controls.comparison {
            let rect = ui.max_rect();
            compare::wipe(ui, rect, controls.mode, comparison, &readout);
        }
    };
    harness(draw, controls)
}

#[test]
fn what_is_shown_is_chosen_in_the_panel_and_by_keys_and_has_its_legend() {
    let scale = DebugScale { low: 0.5, high: 8.0, is_logarithmic: true };
    let readout = Readout { seen: Seen { scale: Some(scale), ..Seen::default() }, ..Readout::default() };
    let mut harness = settings_harness(readout, Controls::from(&args()));
    for (view, name, _) in seeing::VIEWS {
        harness.get_by_role_and_label(Role::ComboBox, "Show").click();
        harness.run_steps(5);
        harness.get_by_role_and_label(Role::Button, name).click();
        harness.run_steps(5);
        assert_eq!(harness.state().shown, view, "{name}");
        assert_reachable(&mut harness, name);
    }
    // The last one was the picture again, or is left by the key; the key then goes back to it.
    harness.state_mut().shown = DebugView::Depth;
    harness.state_mut().inspected = DebugView::Depth;
    harness.run_steps(2);
    assert!(harness.query_by_label("Distance; black: nothing").is_some());
    for shown in [DebugView::Beauty, DebugView::Depth, DebugView::Beauty] {
        harness.key_press(egui::Key::X);
        harness.run_steps(2);
        assert_eq!(harness.state().shown, shown);
    }
    assert!(harness.query_by_label("Distance; black: nothing").is_none());
    harness.key_press_modifiers(egui::Modifiers::SHIFT, egui::Key::X);
    harness.run_steps(2);
    assert_eq!(harness.state().shown, seeing::VIEWS[1].0);
    harness.state_mut().shown = DebugView::Beauty;
    harness.state_mut().tone_map = ToneMapping::Linear;
    for tone_map in [ToneMapping::FalseColor, ToneMapping::Linear] {
        harness.key_press(egui::Key::K);
        harness.run_steps(2);
        assert_eq!(harness.state().tone_map, tone_map);
        let legend = harness.query_by_label("Stops about middle grey");
        assert_eq!(legend.is_some(), tone_map == ToneMapping::FalseColor);
    }
}

#[test]
fn denoising_is_switched_in_the_panel_and_rests_while_modes_are_compared() {
    let mut harness = settings_harness(Readout::default(), Controls::from(&args()));
    assert!(harness.state().denoise);
    for expected in [false, true] {
        harness.get_by_role_and_label(Role::CheckBox, "Denoise").click();
        harness.run_steps(3);
        assert_eq!(harness.state().denoise, expected);
        assert_reachable(&mut harness, "denoising");
    }
    harness.state_mut().comparison = Some(Comparison::default());
    harness.run_steps(3);
    assert!(harness.get_by_role_and_label(Role::CheckBox, "Denoise").accesskit_node().is_disabled());
    assert!(harness.state().denoise, "it comes back with the single picture");
}

#[test]
fn the_histogram_is_counted_while_it_is_open_and_says_its_shares() {
    let mut histogram = Histogram { pixels: 1000, black: 125, clipped: 20, ..Histogram::default() };
    (histogram.bins[0], histogram.bins[40]) = (125, 875);
    let readout = Readout { seen: Seen { histogram: Some(histogram), ..Seen::default() }, ..Readout::default() };
    let mut harness = settings_harness(readout, Controls::from(&args()));
    assert!(!harness.state().histogram);
    harness.get_by_label("Histogram").click();
    harness.run_steps(10);
    assert!(harness.state().histogram);
    for said in ["Histogram of the luminance", "12.5 %", "2.0 %"] {
        assert!(harness.query_by_label(said).is_some(), "{said}");
    }
    assert_reachable(&mut harness, "histogram");
    harness.get_by_label("Histogram").click();
    harness.run_steps(10);
    assert!(!harness.state().histogram);
}

#[test]
fn two_modes_are_compared_by_panel_keys_and_pointer() {
    let mut harness = settings_harness(Readout::default(), Controls::from(&args()));
    harness.get_by_role_and_label(Role::ComboBox, "Compare").click();
    harness.run_steps(5);
    // The modes' own buttons have the same names; the list comes after them.
    harness.query_all_by_role_and_label(Role::Button, "Panorama").last().unwrap().click();
    harness.run_steps(5);
    assert_eq!(harness.state().comparison, Some(Comparison { mode: Mode::Od, wipe: 0.5 }));
    assert_reachable(&mut harness, "comparison");
    harness.get_by_role_and_label(Role::Slider, "Wipe").set_value_accesskit(25.0);
    harness.run_steps(2);
    assert_eq!(harness.state().comparison, Some(Comparison { mode: Mode::Od, wipe: 0.25 }));
    let from = egui::pos2(0.25 * 1280.0, 600.0);
    harness.drag_at(from);
    harness.run_steps(2);
    harness.hover_at(egui::pos2(960.0, 610.0));
    harness.run_steps(2);
    harness.drop_at(egui::pos2(960.0, 610.0));
    harness.run_steps(2);
    let wipe = harness.state().comparison.unwrap().wipe;
    assert!((wipe - 0.75).abs() < 0.01, "{wipe}");
    harness.key_press_modifiers(egui::Modifiers::SHIFT, egui::Key::C);
    harness.run_steps(2);
    assert_eq!(harness.state().comparison.unwrap().mode, Mode::Fv);
    harness.key_press(egui::Key::C);
    harness.run_steps(2);
    assert_eq!(harness.state().comparison, None);
}

/// The menu of files, open, with one file that is there and one that is gone.
#[test]
fn the_menu_of_files_opens_saves_and_changes_the_theme() {
    let here = std::env::current_exe().unwrap();
    let gone = here.with_file_name("no such scene.glb");
    let recent = RecentFiles::new([here.clone(), gone.clone()]);
    recent.look().unwrap().join().unwrap();
    let draw = move |ui: &mut egui::Ui, asked: &mut Vec<file_menu::Action>| {
        asked.extend(file_menu::show(ui, Some(&recent)));
    };
    let mut harness = harness(draw, Vec::new());
    assert_reachable(&mut harness, "the closed menu");
    let open = |harness: &mut Harness<'_, Vec<file_menu::Action>>| {
        harness.get_by_label("File").click();
        harness.run_steps(4);
    };
    open(&mut harness);
    assert_reachable(&mut harness, "the menu");
    let item = |path: &std::path::Path| {
        let part = |part: Option<&std::ffi::OsStr>| part.unwrap().to_string_lossy().into_owned();
        format!("{}/{}", part(path.parent().and_then(std::path::Path::file_name)), part(path.file_name()))
    };
    assert!(harness.get_by_label(&item(&gone)).accesskit_node().is_disabled());
    harness.get_by_label(&item(&here)).click();
    harness.run_steps(4);
    for (name, purpose) in [
        ("Open scene…", Purpose::Scene),
        ("Open environment…", Purpose::Environment),
        ("Go on with a film…", Purpose::Film),
        ("Open edits…", Purpose::Edits),
        ("Save picture as…", Purpose::SavePicture),
        ("Save film as…", Purpose::SaveFilm),
        ("Save edits as…", Purpose::SaveEdits),
    ] {
        open(&mut harness);
        // A shortcut is part of the label.
        harness.get_by_label_contains(name).click();
        harness.run_steps(4);
        assert_eq!(harness.state().last(), Some(&file_menu::Action::Choose(purpose)), "{name}");
    }
    assert_eq!(harness.state()[0], file_menu::Action::Open(here));
    for (name, theme) in [("Light", egui::Theme::Light), ("Dark", egui::Theme::Dark)] {
        open(&mut harness);
        harness.get_by_label(name).click();
        harness.run_steps(4);
        assert_eq!(harness.ctx.theme(), theme);
        assert_eq!(harness.ctx.global_style().visuals.dark_mode, theme == egui::Theme::Dark);
    }
}

#[test]
fn the_gaze_panel_can_be_operated_by_keyboard() {
    let args = args();
    let hub = Arc::new(GazeHub::new(&args.gaze.sources, args.gaze.accuracy_deg).unwrap());
    let control = GazeControl::new(hub, &args);
    let draw = |ui: &mut egui::Ui, gaze: &mut GazeControl| gaze_panel::panel(ui.ctx(), gaze, 0.0, Instant::now());
    let mut harness = harness(draw, control);
    assert_reachable(&mut harness, "gaze");
}

#[test]
fn notes_say_what_they_are_told() {
    let draw = |ui: &mut egui::Ui, cancelled: &mut bool| {
        overlay::keys(ui.ctx());
        overlay::broken(ui.ctx(), "room.glb: cannot be read");
        *cancelled |= overlay::loading(ui.ctx(), "room.glb", Duration::from_secs(3), true);
    };
    let mut harness = harness(draw, false);
    assert!(harness.query_by_label("room.glb: cannot be read").is_some());
    assert!(harness.query_by_label("loading room.glb, 3.0 s").is_some());
    for (key, does) in overlay::KEYS {
        assert!(harness.query_all_by_label(key).next().is_some(), "{key}");
        assert!(harness.query_all_by_label(does).next().is_some(), "{does}");
    }
    harness.get_by_label("Cancel").click();
    harness.run_steps(2);
    assert!(*harness.state());
}
