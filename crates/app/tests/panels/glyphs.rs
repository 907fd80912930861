//! What the panels draw has a glyph in the fonts that the program brings along.

use std::path::Path;

use egui::{FontFamily, FontId};

use super::*;

/// Characters of a source's code beyond ASCII, as they are or by number.
fn beyond_ascii(source: &str) -> BTreeSet<char> {
    let code = source.lines().filter(|line| !line.trim_start().starts_with("//"));
    let written = code.clone().flat_map(str::chars).filter(|letter| !letter.is_ascii());
    let numbers = code.flat_map(|line| line.split("\\u{").skip(1)).filter_map(|rest| rest.split('}').next());
    let numbered = numbers.filter_map(|hex| char::from_u32(u32::from_str_radix(hex, 16).ok()?));
    written.chain(numbered).collect()
}

fn sources(folder: &Path, found: &mut BTreeSet<char>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else {
            found.extend(beyond_ascii(&std::fs::read_to_string(path).unwrap()));
        }
    }
}

#[test]
fn every_character_of_the_panels_has_a_glyph() {
    let mut drawn = BTreeSet::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src/preview"), &mut drawn);
    assert!(drawn.contains(&'°') && drawn.contains(&'…'), "the sources are looked through: {drawn:?}");
    let harness = harness(|_, ()| (), ());
    for family in [FontFamily::Proportional, FontFamily::Monospace] {
        let font = FontId::new(12.0, family);
        let missing: Vec<_> =
            harness.ctx.fonts_mut(|fonts| drawn.iter().filter(|letter| !fonts.has_glyph(&font, **letter)).collect());
        assert!(missing.is_empty(), "{:?} has no glyph for {missing:?}", font.family);
    }
}
