#![expect(clippy::unwrap_used, reason = "a test may panic")]

use glam::{Quat, Vec3};
use tracer::scene::Backdrop;

use super::edits::{Edit, EnvironmentEdit, LightEdit, Move, Part};
use super::parameters::{MaterialParameter, Value};
use super::*;
use crate::cli::SceneArgs;
use crate::session::{self, Source};

fn built_in() -> Loaded {
    use clap::Parser;
    let args: SceneArgs = crate::cli::Cli::parse_from(["fovea"]).preview.scene;
    session::load(&Source::BuiltIn, &args).unwrap()
}

/// The vase, hung on a group whose origin is elsewhere.
fn family() -> (Loaded, u32, u32) {
    let mut loaded = built_in();
    let child = loaded.scene.instances.iter().find(|instance| instance.name == "vase").unwrap().node;
    let parent = loaded.nodes.len() as u32;
    loaded.nodes.push(SceneNode {
        name: "group".into(),
        parent: None,
        world_from_node: Affine3A::from_translation(Vec3::new(1.0, 2.0, 3.0)),
    });
    loaded.nodes[child as usize].parent = Some(parent);
    (loaded, parent, child)
}

fn rough(material: u32, value: f32) -> Edit {
    Edit::Material(material, MaterialParameter::Roughness, Value::Number(value))
}

#[test]
fn undo_and_redo_lead_through_every_version() {
    let mut document = Document::new(&built_in());
    let mut versions = vec![Arc::clone(document.version())];
    for (step, node) in (0..5).zip(document.tree().roots.clone()) {
        let moved = Move { translation: Vec3::X * (step as f32 + 1.0), ..Move::default() };
        document.edit(&Edit::Move(node, moved), Gesture::Once);
        versions.push(Arc::clone(document.version()));
    }
    for version in versions.iter().rev().skip(1) {
        document.undo();
        assert_eq!(document.version().instances, version.instances);
    }
    assert!(!document.can_undo() && !document.is_unsaved());
    for version in versions.iter().skip(1) {
        document.redo();
        assert_eq!(document.version().instances, version.instances);
    }
    assert!(!document.can_redo() && document.is_unsaved());
}

#[test]
fn a_slider_is_one_step_and_a_second_pull_another() {
    let mut document = Document::new(&built_in());
    for pull in [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]] {
        pull.into_iter().for_each(|value| document.edit(&rough(0, value), Gesture::GoesOn));
        document.end_gesture();
    }
    assert_eq!(document.version().materials[0].roughness, 0.6);
    document.undo();
    assert_eq!(document.version().materials[0].roughness, 0.3);
    document.undo();
    assert!(!document.can_undo());
    document.redo();
    document.edit(&rough(1, 0.7), Gesture::Once);
    assert!(!document.can_redo(), "a new step forgets what was undone");
}

#[test]
fn a_drag_that_begins_without_a_change_can_be_undone() {
    let mut document = Document::new(&built_in());
    let node = document.tree().roots[0];
    for x in [0.0, 0.1, 0.2] {
        let moved = Move { translation: Vec3::X * x, ..Move::default() };
        document.edit(&Edit::Move(node, moved), Gesture::GoesOn);
    }
    document.undo();
    assert!(document.edits().is_empty() && !document.can_undo());
}

#[test]
fn only_what_was_edited_is_a_new_part() {
    let mut document = Document::new(&built_in());
    let before = Arc::clone(document.version());
    document.edit(&rough(1, 0.123), Gesture::Once);
    let after = Arc::clone(document.version());
    let same = |index: usize| Arc::ptr_eq(&before.materials[index], &after.materials[index]);
    assert!((0..before.materials.len()).all(|index| same(index) == (index != 1)));
    assert!(before.meshes.iter().zip(&after.meshes).all(|(a, b)| Arc::ptr_eq(a, b)));
    // Another edit leaves the edited material the same part.
    document.edit(&rough(2, 0.321), Gesture::Once);
    assert!(Arc::ptr_eq(&after.materials[1], &document.version().materials[1]));
}

#[test]
fn a_node_turns_about_its_origin_and_takes_along_what_hangs_on_it() {
    let (loaded, parent, child) = family();
    let mut document = Document::new(&loaded);
    let instance = |document: &Document| {
        document.version().instances.iter().find(|instance| instance.node == child).unwrap().world_from_mesh
    };
    let before = instance(&document);
    let turn = Move { rotation: Quat::from_rotation_y(0.5), ..Move::default() };
    document.edit(&Edit::Move(parent, turn), Gesture::Once);
    let pivot = Vec3::from(document.nodes()[parent as usize].world_from_node.translation);
    let turned = |point: Vec3| pivot + turn.rotation * (point - pivot);
    for point in [Vec3::ZERO, Vec3::new(0.3, -0.2, 5.0)] {
        let expected = turned(before.transform_point3(point));
        assert!(instance(&document).transform_point3(point).distance(expected) < 1e-4);
    }
    // Its own scale is along its own axes, before the parent's turn.
    let scaled = Move { scale: Vec3::new(2.0, 1.0, 0.5), ..Move::default() };
    document.edit(&Edit::Move(child, scaled), Gesture::Once);
    let node = document.nodes()[child as usize].world_from_node;
    let in_node = |point: Vec3| node.inverse().transform_point3(point);
    for point in [Vec3::X, Vec3::new(0.3, -0.2, 5.0)] {
        let expected = turned(node.transform_point3(in_node(before.transform_point3(point)) * scaled.scale));
        assert!(instance(&document).transform_point3(point).distance(expected) < 1e-4);
    }
}

#[test]
fn one_takes_hold_of_an_object_where_it_is() {
    let (mut loaded, parent, child) = family();
    let document = Document::new(&loaded);
    let pivot =
        |document: &Document, node: u32| Vec3::from(document.nodes()[node as usize].world_from_node.translation);
    // The group has one child, and its own origin lies elsewhere.
    let alone = |instance: &&tracer::scene::Instance| instance.node != child;
    assert!(loaded.scene.instances.iter().filter(alone).count() + 1 == loaded.scene.instances.len());
    assert_eq!(pivot(&document, parent), pivot(&document, child));
    // An origin inside is kept.
    let inside = pivot(&document, child) + Vec3::splat(1e-4);
    loaded.nodes[parent as usize].world_from_node.translation = inside.into();
    assert!(pivot(&Document::new(&loaded), parent).distance(inside) < 1e-6);
}

#[test]
fn hiding_solo_and_showing_go_down_the_tree() {
    let (loaded, parent, child) = family();
    let mut document = Document::new(&loaded);
    let shown = |document: &Document| {
        let visible = document.version().instances.iter().filter(|instance| instance.visible);
        visible.map(|instance| instance.node).collect::<std::collections::BTreeSet<_>>()
    };
    let all = shown(&document);
    document.edit(&Edit::Hide(parent, true), Gesture::Once);
    assert!(!shown(&document).contains(&child) && shown(&document).len() == all.len() - 1);
    document.edit(&Edit::ShowAll, Gesture::Once);
    assert_eq!(shown(&document), all);
    document.set_solo(Some(parent));
    assert_eq!(shown(&document).into_iter().collect::<Vec<_>>(), [child]);
    document.set_solo(None);
    assert_eq!(shown(&document), all);
}

#[test]
fn what_the_file_hides_is_shown_as_hidden_and_hiding_and_showing_leaves_no_trace() {
    let (mut loaded, parent, child) = family();
    let mut scene = (*loaded.scene).clone();
    let other = scene.instances.iter().find(|instance| instance.node != child).unwrap().node;
    loaded.nodes[other as usize].parent = Some(parent);
    scene.instances.iter_mut().filter(|instance| instance.node == child).for_each(|hidden| hidden.visible = false);
    loaded.scene = Arc::new(scene);
    let mut document = Document::new(&loaded);
    let shown = |document: &Document| {
        let placed = document.version().instances.iter().find(|instance| instance.node == child).unwrap();
        assert_eq!(placed.visible, document.is_visible(child), "the box says what is seen");
        [parent, child, other].map(|node| document.is_visible(node))
    };
    assert_eq!(shown(&document), [true, false, true]);
    // Each box off and on, or on and off, is as in the file again.
    for node in [parent, child, other] {
        let visible = document.is_visible(node);
        document.edit(&Edit::Hide(node, visible), Gesture::Once);
        assert_eq!(document.is_visible(node), !visible);
        shown(&document);
        document.edit(&Edit::Hide(node, !visible), Gesture::Once);
        assert_eq!(shown(&document), [true, false, true]);
        assert!(document.edits().is_empty(), "{:?}", document.edits());
    }
    document.edit(&Edit::Hide(child, true), Gesture::Once);
    assert!(document.edits().is_empty(), "it is hidden already");
    // What a group shows can be hidden below it, and shown again.
    document.edit(&Edit::Hide(child, false), Gesture::Once);
    document.edit(&Edit::Hide(parent, true), Gesture::Once);
    assert_eq!(shown(&document), [false; 3]);
    document.edit(&Edit::ShowAll, Gesture::Once);
    assert_eq!(shown(&document), [true; 3]);

    // A group of which the file shows nothing.
    let mut scene = (*loaded.scene).clone();
    scene.instances.iter_mut().for_each(|instance| instance.visible = false);
    let mut document = Document::new(&Loaded { scene: Arc::new(scene), ..loaded });
    assert_eq!(shown(&document), [false; 3]);
    document.edit(&Edit::Hide(parent, false), Gesture::Once);
    assert_eq!(shown(&document), [true; 3]);
    document.edit(&Edit::Hide(child, true), Gesture::Once);
    assert_eq!(shown(&document), [true, false, true]);
    document.edit(&Edit::Hide(child, false), Gesture::Once);
    document.edit(&Edit::Hide(parent, true), Gesture::Once);
    assert_eq!((shown(&document), document.edits().is_empty()), ([false; 3], true));
}

#[test]
fn nonsense_leaves_a_scene_that_can_be_traced() {
    let (loaded, parent, child) = family();
    let mut document = Document::new(&loaded);
    let numbers = [f32::NAN, f32::INFINITY, 0.0, 1e30, -1e-30];
    for (a, b) in numbers.into_iter().flat_map(|a| numbers.map(|b| (a, b))) {
        let moved = Move {
            translation: Vec3::new(a, b, 0.0),
            rotation: Quat::from_xyzw(a, b, 0.0, 1.0),
            scale: Vec3::new(b, a, 1.0),
        };
        document.edit(&Edit::Move(parent, moved), Gesture::Once);
        document.edit(&Edit::Move(child, moved), Gesture::Once);
        let light = LightEdit { intensity: Some(Vec3::splat(a)), angle: Some(b), translation: Vec3::splat(a) };
        document.edit(&Edit::Light(0, light), Gesture::Once);
        let environment = EnvironmentEdit { radiance: Some(Vec3::new(a, b, -1.0)), ..Default::default() };
        document.edit(&Edit::Environment(environment), Gesture::Once);
        for instance in &document.version().instances {
            let world = instance.world_from_mesh;
            assert!(world.is_finite() && world.matrix3.determinant() != 0.0, "{a} {b}: {world:?}");
        }
        assert!(document.version().lights.iter().all(|light| light.position.is_finite()));
    }
    // Parts that do not exist are nobody's business.
    document.edit(&rough(u32::MAX, 0.5), Gesture::Once);
    document.edit(&Edit::Hide(u32::MAX, true), Gesture::Once);
}

#[test]
fn edits_follow_their_parts_into_another_version_of_the_file() {
    let loaded = built_in();
    let mut document = Document::new(&loaded);
    let node = loaded.scene.instances[1].node;
    document.edit(&Edit::Hide(node, true), Gesture::Once);
    document.edit(&rough(2, 0.25), Gesture::Once);
    document.edit(&rough(0, 0.75), Gesture::Once);
    let name = loaded.scene.materials[2].name.clone();

    // The first material is gone, the others move up; a node is new at the front.
    let mut newer = loaded.clone();
    let mut scene = (*loaded.scene).clone();
    scene.materials.remove(0);
    newer.nodes.insert(0, SceneNode { name: "new".into(), parent: None, world_from_node: Affine3A::IDENTITY });
    newer.nodes.iter_mut().for_each(|node| node.parent = node.parent.map(|parent| parent + 1));
    for instance in &mut scene.instances {
        instance.material = instance.material.saturating_sub(1);
        instance.node += 1;
    }
    newer.scene = Arc::new(scene);
    let (selected, dropped) = document.follow_file(&newer, Some(Part::Material(2)));
    assert_eq!(selected, Some(Part::Material(1)));
    assert_eq!(dropped, [format!("material '{}'", loaded.scene.materials[0].name)]);
    assert_eq!(document.version().materials[1].roughness, 0.25);
    assert_eq!(document.version().materials[1].name, name);
    let hidden: Vec<u32> =
        document.version().instances.iter().filter(|instance| !instance.visible).map(|i| i.node).collect();
    assert_eq!(hidden, [node + 1]);
    // The history goes along.
    document.undo();
    document.undo();
    assert_ne!(document.version().materials[1].roughness, 0.25);
}

#[test]
fn saved_edits_are_read_back_the_same() {
    let (loaded, parent, child) = family();
    let mut document = Document::new(&loaded);
    let moved = Move {
        translation: Vec3::new(0.1, -2.0, 1e-3),
        rotation: Quat::from_rotation_x(0.3),
        scale: Vec3::new(1.5, 1.0, 0.25),
    };
    let environment = EnvironmentEdit {
        image: Some(std::env::temp_dir().join("sky of mine.hdr")),
        rotation_deg: Some(33.0),
        intensity: Some(2.0),
        radiance: None,
        backdrop: Some(Backdrop::Color(Vec3::new(0.25, 0.5, 1.0))),
    };
    for edit in [
        Edit::Move(parent, moved),
        Edit::Hide(child, true),
        rough(1, 0.37),
        Edit::Material(1, MaterialParameter::BaseColor, Value::Color(Vec3::new(0.2, 0.4, 0.6))),
        Edit::Environment(environment.clone()),
    ] {
        document.edit(&edit, Gesture::Once);
    }
    let path = std::env::temp_dir().join(format!("fovea-edits-{}.json", std::process::id()));
    document.save_edits(&path).unwrap();
    assert!(!document.is_unsaved());
    let mut other = Document::new(&loaded);
    assert_eq!(other.load_edits(&path).unwrap(), Vec::<String>::new());
    assert_eq!(other.edits(), document.edits());
    assert!(!other.is_unsaved() && !other.can_undo());
    let shown = EnvironmentEdit { backdrop: Some(Backdrop::Environment), ..environment };
    document.edit(&Edit::Environment(shown), Gesture::Once);
    document.save_edits(&path).unwrap();
    other.load_edits(&path).unwrap();
    assert_eq!(other.edits(), document.edits());
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_folder_with_edits_and_their_environment_can_be_moved() {
    let loaded = built_in();
    let here = std::env::temp_dir().join(format!("fovea-moved-{}", std::process::id()));
    let there = here.with_extension("there");
    for folder in [&here, &there] {
        let _ = std::fs::remove_dir_all(folder);
    }
    std::fs::create_dir_all(here.join("skies")).unwrap();
    let with = |image: PathBuf| {
        let mut document = Document::new(&loaded);
        document.edit(
            &Edit::Environment(EnvironmentEdit { image: Some(image), ..EnvironmentEdit::default() }),
            Gesture::Once,
        );
        document
    };
    let named = |folder: &Path, name: &str| {
        let mut document = Document::new(&loaded);
        document.load_edits(&folder.join(name)).unwrap();
        document.edits().environment.image.clone().unwrap()
    };
    let elsewhere = std::env::temp_dir().join("sky.hdr");
    with(here.join("skies/noon.hdr")).save_edits(&here.join("below.json")).unwrap();
    with(here.join("skies/../dusk.hdr")).save_edits(&here.join("beside.json")).unwrap();
    with(elsewhere.clone()).save_edits(&here.join("elsewhere.json")).unwrap();
    std::fs::rename(&here, &there).unwrap();
    assert_eq!(named(&there, "below.json"), there.join("skies/noon.hdr"));
    assert_eq!(named(&there, "beside.json"), there.join("dusk.hdr"));
    assert_eq!(named(&there, "elsewhere.json"), elsewhere);
    std::fs::remove_dir_all(there).unwrap();
}

#[test]
fn edits_of_parts_that_are_gone_are_saved_and_wait_for_them() {
    let loaded = built_in();
    let mut document = Document::new(&loaded);
    document.edit(&Edit::Hide(document.tree().roots[0], true), Gesture::Once);
    document.edit(&rough(0, 0.75), Gesture::Once);
    let edits = document.edits().clone();

    // The first material has another name for a while.
    let mut other = loaded.clone();
    let mut scene = (*loaded.scene).clone();
    scene.materials[0] = Arc::new(tracer::scene::Material { name: "new".into(), ..(*scene.materials[0]).clone() });
    other.scene = Arc::new(scene);
    document.follow_file(&other, None);
    assert!(document.edits().materials.is_empty() && document.is_unsaved());
    let path = std::env::temp_dir().join(format!("fovea-absent-{}.json", std::process::id()));
    document.save_edits(&path).unwrap();
    document.edit(&rough(1, 0.5), Gesture::Once);
    document.undo();
    assert!(document.follow_file(&loaded, None).1.is_empty());
    assert_eq!((document.edits(), document.is_unsaved()), (&edits, false));
    assert_eq!(document.version().materials[0].roughness, 0.75);

    // The same by way of the file: read with the part missing, and saved again.
    let mut document = Document::new(&other);
    let name = &loaded.scene.materials[0].name;
    assert_eq!(document.load_edits(&path).unwrap(), [format!("material '{name}'")]);
    document.save_edits(&path).unwrap();
    let mut document = Document::new(&loaded);
    assert_eq!(document.load_edits(&path).unwrap(), Vec::<String>::new());
    assert_eq!(document.edits(), &edits);
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_backdrop_hides_the_environment_and_undo_shows_it_again() {
    let loaded = built_in();
    let mut document = Document::new(&loaded);
    let hash = document.version().content_hash();
    let edit = |backdrop| Edit::Environment(EnvironmentEdit { backdrop, ..EnvironmentEdit::default() });
    document.edit(&edit(Some(Backdrop::Color(Vec3::new(0.5, f32::NAN, -1.0)))), Gesture::Once);
    assert_eq!(document.version().backdrop.color(), Some(Vec3::new(0.5, 0.0, 0.0)), "nonsense becomes 0");
    assert_ne!(document.version().content_hash(), hash, "films of it are others");
    document.undo();
    assert_eq!(document.version().backdrop, Backdrop::Environment);
    // An edit says more than the command line.
    let mut scene = (*loaded.scene).clone();
    scene.backdrop = Backdrop::Color(Vec3::ONE);
    let mut document = Document::new(&Loaded { scene: scene.into(), ..loaded });
    document.edit(&edit(Some(Backdrop::Environment)), Gesture::Once);
    assert_eq!((document.version().backdrop, document.version().content_hash()), (Backdrop::Environment, hash));
}

#[test]
fn files_that_are_no_edits_are_refused_in_one_line() {
    let mut document = Document::new(&built_in());
    let path = std::env::temp_dir().join(format!("fovea-no-edits-{}.json", std::process::id()));
    for text in ["", "[]", "{\"format\": 7}", "{\"format\": \"fovea-edits\", \"version\": 99}", "\u{1}\n{"] {
        std::fs::write(&path, text).unwrap();
        let reason = document.load_edits(&path).unwrap_err();
        assert!(reason.contains("edits") && !reason.contains('\n'), "{reason}");
    }
    let strange = r#"{"format": "fovea-edits", "version": 1, "nodes": [{"name": "nobody"}, 7, {"scale": "big"}],
        "materials": {"a": 1}, "lights": [null], "environment": []}"#;
    std::fs::write(&path, strange).unwrap();
    let left_out = document.load_edits(&path).unwrap();
    assert!(left_out.iter().any(|part| part.contains("nobody")), "{left_out:?}");
    assert!(document.version().instances.iter().all(|instance| instance.visible));
    std::fs::remove_file(path).unwrap();
}
