//! Dragging a slider across a feature's edge: the kernel that the new feature needs takes the driver seconds, the window none.

use std::time::Duration;

use serde_json::Value;

use crate::glb::with_json;
use crate::{Display, ONE_AT_A_TIME, scratch};

/// A frame that a person notices as a stall. A quiet machine stays far below it (docs/reports/window.md), and tests run on
/// machines several times slower.
const STALL_MS: f64 = 400.0;

/// The built-in scene without anything that lets light through, so that the slider adds the first.
fn opaque_room() -> Vec<u8> {
    with_json(tracer::builtin::BYTES, |document| {
        for material in document["materials"].as_array_mut().unwrap() {
            if let Some(extensions) = material.get_mut("extensions") {
                extensions.as_object_mut().unwrap().retain(|name, _| name == "KHR_materials_emissive_strength");
            }
        }
    })
}

#[test]
fn a_slider_that_crosses_a_features_edge_never_stalls_the_window() {
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let Some(display) = Display::start() else {
        eprintln!("SKIP a_slider_that_crosses_a_features_edge_never_stalls_the_window: Xvfb or xdotool is missing");
        return;
    };
    let folder = scratch("slider");
    let scene = folder.join("room.glb");
    std::fs::write(&scene, opaque_room()).unwrap();
    let (vase, material) = ((340, 560), (1080, 513));
    // The handle of "Transmission" at 0, and at a tenth of the slider's width.
    let (left, right, y) = (1105, 1113, 566);
    let (_, figures) = display.session(40, &[scene.to_str().unwrap()], |display| {
        display.wait_for_title("room.glb");
        std::thread::sleep(Duration::from_millis(1500));
        let click = |(x, y): (u32, u32)| display.xdotool(&format!("mousemove {x} {y} sleep 0.8 click 1 sleep 1.2"));
        click(vase);
        display.xdotool("key n sleep 1.2");
        click(material);
        display.xdotool(&format!("mousemove {left} {y} sleep 0.8 mousedown 1 sleep 0.5"));
        for _ in 0..8 {
            let there = (left..=right).chain((left..right).rev());
            let steps: Vec<String> = there.map(|x| format!("mousemove {x} {y} sleep 0.06")).collect();
            display.xdotool(&steps.join(" "));
        }
        display.xdotool(&format!("mousemove {right} {y} sleep 0.5 mouseup 1"));
    });
    std::fs::remove_dir_all(folder).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let transmission = number(&figures["editor"]["edits"]["materials"][0]["transmission"]);
    assert!((0.02..0.3).contains(&transmission), "{figures}");
    let kernels_ms = |version: &Value| number(&version["kernels_ms"]);
    let versions = figures["versions"].as_array().unwrap();
    let compiled = versions.iter().skip(1).map(kernels_ms).fold(0.0, f64::max);
    assert!(compiled > 100.0, "no kernel was compiled: {figures}");
    let held = &figures["frames"]["held"];
    eprintln!("slider: frames {held}; the kernel took {compiled:.0} ms");
    let adapter = figures["adapter"].as_str().unwrap();
    crate::figures::keep("slider", adapter, serde_json::json!({ "frames": held, "kernel_ms": compiled }));
    assert!(number(&held["count"]) > 10.0, "{held}");
    assert!(number(&held["longest_ms"]) < STALL_MS, "the window stood still: {held}");
}
