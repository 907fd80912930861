//! `fovea info`: what a scene holds, and what of it is not supported.

use std::sync::Arc;

use serde_json::{Value, json};
use tracer::import::ImportReport;
use tracer::scene::{Environment, Projection, PunctualKind, Scene};

use super::{edits, print_json, print_text};
use crate::cli::InfoArgs;
use crate::session::{self, Loaded, Source};

/// Prints what the scene holds.
///
/// # Errors
/// When the scene cannot be loaded.
pub fn run(args: &InfoArgs) -> anyhow::Result<()> {
    let source = Source::from(args.scene.as_deref());
    let (scene, report) = session::import(&source, &args.file)?;
    let mut loaded = Loaded {
        scene: Arc::new(scene),
        notes: report.warnings.iter().map(ToString::to_string).collect(),
        nodes: report.nodes.clone(),
        files: Vec::new(),
        replaced_images: Vec::new(),
        camera: None,
    };
    edits::apply(args.edits.as_ref(), &source, &mut loaded)?;
    let Loaded { scene, notes, .. } = loaded;
    if args.json { print_json(&describe(&scene, &report, &notes)) } else { print_text(&text(&scene, &report, &notes)) }
}

fn describe(scene: &Scene, report: &ImportReport, notes: &[String]) -> Value {
    let (low, high) = scene.bounds().unwrap_or_default();
    json!({
        "scene": scene.name,
        "scene_hash": scene.content_hash().to_string(),
        "generator": report.generator,
        "triangles": session::triangles(scene),
        "meshes": scene.meshes.len(),
        "instances": scene.instances.len(),
        "materials": scene.materials.len(),
        "textures": scene.distinct_textures().iter().map(|t| json!({ "name": t.name, "size": [t.width, t.height] })).collect::<Vec<_>>(),
        "lights": scene.lights.iter().map(|l| json!({ "name": l.name, "kind": kind(&l.kind) })).collect::<Vec<_>>(),
        "emissive_materials": emissive(scene),
        "cameras": scene.cameras.iter().map(|c| json!({ "name": c.name, "position_m": c.position.to_array() })).collect::<Vec<_>>(),
        "environment": environment(scene),
        "bounds_m": [low.to_array(), high.to_array()],
        "extensions_used": report.extensions_used,
        "extensions_unsupported": report.extensions_unsupported,
        "variants": report.variants,
        "scenes": report.scenes,
        "warnings": notes,
        "import_seconds": report.stage_seconds.total,
    })
}

fn text(scene: &Scene, report: &ImportReport, notes: &[String]) -> String {
    let (low, high) = scene.bounds().unwrap_or_default();
    let size = high - low;
    let list = |names: &[String]| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let cameras: Vec<String> = scene
        .cameras
        .iter()
        .map(|camera| match camera.projection {
            Projection::Perspective { yfov, .. } => format!("{} ({:.0} degrees high)", camera.name, yfov.to_degrees()),
            Projection::Orthographic { .. } => format!("{} (orthographic)", camera.name),
        })
        .collect();
    let lights: Vec<String> =
        scene.lights.iter().map(|light| format!("{} ({})", light.name, kind(&light.kind))).collect();
    let textures = scene.distinct_textures();
    let texels: u64 = textures.iter().map(|t| u64::from(t.width) * u64::from(t.height)).sum();
    let rows = [
        ("triangles", session::triangles(scene).to_string()),
        ("meshes", format!("{} in {} places", scene.meshes.len(), scene.instances.len())),
        ("materials", format!("{}, {} of them emissive", scene.materials.len(), emissive(scene))),
        ("textures", format!("{}, {:.1} Mpixel", textures.len(), texels as f64 * 1e-6)),
        ("lights", list(&lights)),
        ("cameras", list(&cameras)),
        ("environment", environment(scene)),
        ("size", format!("{:.3} x {:.3} x {:.3} m", size.x, size.y, size.z)),
        ("extensions", list(&report.extensions_used)),
        ("not supported", list(&report.extensions_unsupported)),
    ];
    let mut text = format!("{}\n", scene.name);
    text.extend(rows.iter().map(|(name, value)| format!("  {name:<14} {value}\n")));
    text.extend(notes.iter().map(|note| format!("  note: {note}\n")));
    text
}

fn emissive(scene: &Scene) -> usize {
    scene.materials.iter().filter(|material| material.emits()).count()
}

fn kind(kind: &PunctualKind) -> &'static str {
    match kind {
        PunctualKind::Point => "point",
        PunctualKind::Spot { .. } => "spot",
        PunctualKind::Directional { .. } => "directional",
    }
}

fn environment(scene: &Scene) -> String {
    match &scene.environment {
        Environment::Constant(radiance) => format!("constant {} {} {}", radiance.x, radiance.y, radiance.z),
        Environment::Image { image, rotation_deg, .. } => {
            format!("image {}x{}, turned by {rotation_deg} degrees", image.width, image.height)
        }
    }
}
