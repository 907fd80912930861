//! A session from its beginning to its end.

use std::path::Path;
use std::process::Command;

use crate::monado::{Monado, said};

/// Turns on the validation layers of Vulkan and OpenXR, which write into `folder`.
fn validate(command: &mut Command, folder: &Path) {
    let settings = folder.join("vk_layer_settings.txt");
    let text = format!(
        "khronos_validation.debug_action = VK_DBG_LAYER_ACTION_LOG_MSG\n\
         khronos_validation.report_flags = error,warn,info\n\
         khronos_validation.log_filename = {}\n",
        folder.join("vulkan.txt").display()
    );
    std::fs::write(&settings, text).unwrap();
    command
        .env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation")
        .env("VK_LAYER_SETTINGS_PATH", &settings)
        .env("XR_ENABLE_API_LAYERS", "XR_APILAYER_LUNARG_core_validation")
        .env("XR_CORE_VALIDATION_EXPORT_TYPE", "text")
        .env("XR_CORE_VALIDATION_FILE_NAME", folder.join("openxr.txt"));
}

#[test]
fn a_session_shows_three_hundred_frames() {
    let name = "a_session_shows_three_hundred_frames";
    let Some(mut monado) = Monado::find(name) else { return };
    monado.start(None);
    let mut command = monado.inner(name);
    validate(&mut command, monado.place());
    let output = command.output().unwrap();
    let text = said(&output);
    let read = |file: &str| std::fs::read_to_string(monado.place().join(file)).unwrap_or_default();
    let (vulkan, openxr) = (read("vulkan.txt"), read("openxr.txt"));
    // Silence counts only where the layers were there.
    assert!(vulkan.contains("Khronos Validation Layer Active"), "{vulkan}");
    assert!(openxr.contains("Core Validation Layer is initialized"), "{openxr}");
    let vulkan: Vec<&str> = vulkan.lines().filter(|line| line.starts_with("Validation")).collect();
    let wrong: Vec<&&str> = vulkan.iter().filter(|line| !line.starts_with("Validation Information")).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    let wrong: Vec<&str> =
        openxr.lines().filter(|line| !line.contains("[VALID_DEBUG") && line.contains("[VALID_")).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    let figures = text.lines().find(|line| line.contains("frames drawn")).unwrap_or_default();
    eprintln!("{figures}, no validation message");
}
