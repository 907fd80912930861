//! Shader modules with something planted in them: a fault that a test must notice, or known values in place of paths.

use tracer::kernels::ShaderSources;

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

/// These modules with a kernel in place of the path tracer whose `body` sets `radiance`, `pixel`, `rays` and `index` of a
/// sample from its `invocation`; `imports` and `items` go before it.
pub fn instead_of_paths(sources: &ShaderSources, imports: &str, items: &str, body: &str) -> ShaderSources {
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
    sources.clone().with_module("path::trace", text)
}
