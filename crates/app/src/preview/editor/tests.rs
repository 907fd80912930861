#![expect(clippy::unwrap_used, reason = "a test may panic")]

use tracer::scene::ContentHash;

use super::*;

/// The built-in scene as a file of a new folder.
fn room(name: &str) -> (PathBuf, Source, Loaded) {
    let folder = std::env::temp_dir().join(format!("fovea-editor-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let args = crate::cli::parse(["fovea".into()]).unwrap().preview;
    let source = Source::File(folder.join("room.glb"));
    (folder, source, crate::session::load(&Source::BuiltIn, &args.scene).unwrap())
}

#[test]
fn a_file_of_edits_that_cannot_be_read_is_put_aside_before_another_is_written() {
    let (folder, source, loaded) = room("unreadable");
    let sidecar = folder.join("room.glb.fovea.json");
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    for (text, aside) in [("{ \"format\"", "room.glb.fovea.broken.json"), ("[]", "room.glb.fovea.broken-2.json")] {
        std::fs::write(&sidecar, text).unwrap();
        let mut editor = Editor::open(&source, &loaded);
        editor.act(Action::Save);
        assert_eq!(read("room.glb.fovea.json"), text, "there is nothing to save");
        for (node, message) in [(0, aside), (1, "saved")] {
            let hide = Edit::Hide(editor.document.tree().roots[node], true);
            editor.act(Action::Edit(hide, Gesture::Once));
            editor.act(Action::Save);
            assert!(editor.message().unwrap().text.contains(message), "{:?}", editor.message());
            assert_eq!(read(aside), text, "the edits of another file stay where they are");
        }
        assert_eq!(Editor::open(&source, &loaded).document.edits(), editor.document.edits());
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn edits_of_another_file_are_opened_in_one_step() {
    let (folder, source, loaded) = room("opened");
    let mut editor = Editor::open(&source, &loaded);
    let roots = editor.document.tree().roots.clone();
    let hide = |editor: &mut Editor, place: usize| {
        editor.act(Action::Edit(Edit::Hide(roots[place], true), Gesture::Once));
    };
    (0..2).for_each(|place| hide(&mut editor, place));
    let copy = folder.join("other.fovea.json");
    assert!(editor.save_as(&copy) && editor.document.is_unsaved(), "a copy is not read again");
    let copied = editor.document.edits().clone();
    let mut editor = Editor::open(&source, &loaded);
    hide(&mut editor, 2);
    let before = editor.document.edits().clone();
    editor.open_edits(&copy);
    assert_eq!((editor.document.edits(), editor.document.is_unsaved()), (&copied, true));
    editor.act(Action::Undo);
    assert_eq!(editor.document.edits(), &before);
    editor.act(Action::Redo);
    assert_eq!(editor.document.edits(), &copied);
    std::fs::write(&copy, "{").unwrap();
    editor.open_edits(&copy);
    assert!(editor.message().unwrap().wrong);
    assert_eq!(editor.document.edits(), &copied, "what is no file of edits changes nothing");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn an_environment_that_failed_is_tried_again_when_it_is_named_again() {
    let loaded =
        crate::session::load(&Source::BuiltIn, &crate::cli::parse(["fovea".into()]).unwrap().preview.scene).unwrap();
    let mut editor = Editor::open(&Source::BuiltIn, &loaded);
    let path = std::path::absolute("sky.hdr").unwrap();
    let fails = |editor: &mut Editor| editor.take_environment(path.clone(), Err("no such file".into()));
    assert_eq!(editor.ask_for_environment(), None);
    for name in [Action::LoadEnvironment("sky.hdr".into()), Action::LoadEnvironment(path.clone())] {
        editor.act(name);
        assert_eq!(editor.ask_for_environment().as_ref(), Some(&path));
        fails(&mut editor);
        assert_eq!(editor.ask_for_environment(), None, "not at every frame");
    }
    // Another property of the environment is none of the image's.
    let dimmed = EnvironmentEdit { intensity: Some(0.5), ..editor.document.edits().environment.clone() };
    editor.act(Action::Edit(Edit::Environment(dimmed), Gesture::GoesOn));
    assert_eq!(editor.ask_for_environment(), None);
    // A drop and the dialog.
    editor.set_environment("sky.hdr".into());
    assert_eq!(editor.ask_for_environment(), Some(path));
}

#[test]
fn an_environment_that_is_exported_again_is_read_again_and_only_the_named_one_is_kept() {
    let args = crate::cli::parse(["fovea".into()]).unwrap().preview;
    let mut editor = Editor::open(&Source::BuiltIn, &crate::session::load(&Source::BuiltIn, &args.scene).unwrap());
    let image = |level: f32| {
        let hash = ContentHash::of(&[&level.to_le_bytes()]);
        Arc::new(EnvironmentImage { width: 1, height: 1, pixels: vec![[level; 3]], hash })
    };
    let path = |number: u32| std::path::absolute(format!("sky-{number}.hdr")).unwrap();
    let mut given = Vec::new();
    let mut give = |editor: &mut Editor, number: u32| {
        assert!(editor.awaits_environment());
        assert_eq!(editor.ask_for_environment(), Some(path(number)));
        assert!(editor.awaits_environment(), "it is under way");
        let image = image(number as f32);
        given.push(Arc::downgrade(&image));
        editor.take_environment(path(number), Ok(image));
        assert!(!editor.awaits_environment() && editor.ask_for_environment().is_none());
        given.iter().filter(|image| image.strong_count() > 0).count()
    };
    let left = (0..20).map(|number| {
        editor.set_environment(path(number));
        give(&mut editor, number)
    });
    assert_eq!(left.last(), Some(1), "images that nothing shows any more are let go");

    // The same name, another image: it stays until the new one is there.
    let hash = editor.document.version().content_hash();
    editor.set_environment(path(19));
    assert_eq!(editor.ask_for_environment(), Some(path(19)));
    assert!(!editor.awaits_environment() && editor.document.version().content_hash() == hash);
    editor.take_environment(path(19), Ok(image(0.5)));
    assert_ne!(editor.document.version().content_hash(), hash);

    // Undo names an earlier one, which is read again; what comes of another is not taken.
    editor.act(Action::Undo);
    assert_eq!(editor.ask_for_environment(), Some(path(18)));
    editor.take_environment(path(19), Ok(image(0.5)));
    assert!(editor.awaits_environment());
    editor.take_environment(path(18), Ok(image(18.0)));
    // And back within a frame.
    editor.act(Action::Redo);
    editor.act(Action::Undo);
    assert_eq!(editor.ask_for_environment(), Some(path(18)));
    editor.take_environment(path(18), Err("no such file".into()));
    assert!(!editor.awaits_environment() && editor.ask_for_environment().is_none(), "it does not come");
}

#[test]
fn edits_of_a_window_that_ends_are_kept_and_named_until_others_are_saved() {
    let (folder, source, loaded) = room("rescued");
    let mut editor = Editor::open(&source, &loaded);
    assert!(editor.rescue().is_none(), "there is nothing to lose");
    let hide = |editor: &mut Editor, place: usize| {
        let node = editor.document.tree().roots[place];
        editor.act(Action::Edit(Edit::Hide(node, true), Gesture::Once));
    };
    for (place, name) in ["room.glb.fovea.recovered.json", "room.glb.fovea.recovered-2.json"].iter().enumerate() {
        hide(&mut editor, place);
        assert_eq!(editor.rescue().unwrap().unwrap(), folder.join(name), "an earlier one is not lost");
    }
    let sidecar = folder.join("room.glb.fovea.json");
    std::fs::write(&sidecar, "{").unwrap();
    let file = std::fs::File::options().append(true).open(&sidecar).unwrap();
    file.set_modified(std::time::SystemTime::UNIX_EPOCH).unwrap();
    let broken = Editor::open(&source, &loaded).message().unwrap().text.clone();
    assert!(broken.contains("room.glb.fovea.json:") && broken.contains("recovered-2.json"), "{broken}");
    std::fs::remove_file(&sidecar).unwrap();
    let mut again = Editor::open(&source, &loaded);
    assert!(again.message().unwrap().text.contains("recovered-2.json"), "{:?}", again.message());
    assert!(again.document.edits().is_empty());
    again.open_edits(&folder.join("room.glb.fovea.recovered-2.json"));
    assert_eq!(again.document.edits(), editor.document.edits());
    // File systems count time in ticks.
    std::thread::sleep(std::time::Duration::from_millis(20));
    assert!(again.save());
    assert!(!Editor::open(&source, &loaded).message().unwrap().text.contains("recovered"));
    std::fs::remove_dir_all(folder).unwrap();
}
