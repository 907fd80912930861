//! Shader modules with something planted in them: a fault that a test must notice, or known values in place of paths.

use tracer::{
    kernels::ShaderSources,
    renderer::{Renderer, Schedule},
};

/// The module with one passage exchanged.
///
/// # Panics
/// When the passage does not occur exactly once: the shader has changed and the fault must be planted anew.
pub fn exchanged(sources: &ShaderSources, module: &str, passages: &[(&str, &str)]) -> ShaderSources {
    let mut text = sources.module(module).expect("the module exists").to_string();
    for (before, after) in passages {
        assert_eq!(text.matches(before).count(), 1, "module {module} no longer contains once: {before}");
        text = text.replacen(before, after, 1);
    }
    sources.clone().with_module(module, text)
}

/// Gives the renderer a kernel in place of the path tracer whose `body` sets `radiance`, `pixel`, `rays` and `index` of a
/// sample from its `invocation`; `imports` and `items` go before it, and `plant` may exchange more. It has no wavefront.
///
/// # Panics
/// When the modules do not compose.
pub fn instead_of_paths(
    renderer: &mut Renderer,
    plant: impl Fn(&ShaderSources) -> ShaderSources,
    [imports, items, body]: [&str; 3],
) {
    let text = format!(
        "// Kernel: known records in place of paths, for tests.
import package::path_bindings::{{batch, records}};
import package::constants::WORKGROUP_SIZE;
import package::types::{{SampleRecord, NONE}};
{imports}

{items}

@compute @workgroup_size(WORKGROUP_SIZE)
fn trace(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {{
    let invocation = id.y * groups.x * WORKGROUP_SIZE + id.x;
    if invocation >= batch.sample_count {{
        return;
    }}
    let index = batch.first_index_low + invocation;
    var radiance = vec3f(0.0);
    var pixel = NONE;
    var rays = 0u;
{body}
    records[invocation] = SampleRecord(radiance, pixel, rays, index);
}}
"
    );
    renderer.set_schedule(Schedule::Megakernel).expect("nothing is compiled yet");
    let sources = plant(&renderer.shaders().clone().with_module("path::trace", text));
    renderer.set_shaders(sources).expect("the modules compose");
}
