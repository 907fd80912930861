//! What directions cost on the graphics adapter: a launch of 2^16 and of 2^24 rays, foveated and uniform.

use std::fmt::Write;
use std::time::Instant;

use anyhow::Context;
use fovea_sampler::report::Entry;
use fovea_sampler::{Inverse, wgsl};
use tracer::gpu::Gpu;

/// Rays a launch, and launches in a round.
const LAUNCHES: [(u32, u32); 2] = [(1 << 16, 10), (1 << 24, 1)];
/// Rounds over all inverses, of which the fastest launch counts; one more before them, which may compile, is not timed.
const ROUNDS: u32 = 5;
const WORKGROUP: u32 = 64;
/// Workgroups in a row of the dispatch: below every adapter's limit.
const ROW: u32 = 1 << 15;

/// Uniform numbers by hash, a direction, and a store that never happens but that no compiler can drop.
const MAIN: &str = "
@group(0) @binding(0) var<storage, read_write> sink: array<f32>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.y * (32768u * 64u) + id.x;
    let u = vec2<f32>(to_unit(hash_u32(index)), to_unit(hash_u32(index ^ 0x55555555u)));
    let d = ray(u);
    if d.x + d.y > 4.0f { sink[0] = d.z; }
}
";

const FOVEATED: &str = "
fn ray(u: vec2<f32>) -> vec3<f32> {
    return gaze_frame(normalize(vec3<f32>(0.3f, 0.2f, -0.9f))) * warp_local(u);
}
";

/// Uniform over an equirectangular film: what mode od draws.
const UNIFORM: &str = "
fn ray(u: vec2<f32>) -> vec3<f32> {
    let longitude = warp_cos_sin_turn(u.x);
    let latitude = warp_cos_sin_turn(0.5f * u.y);
    return vec3<f32>(latitude.y * longitude.y, latitude.x, -latitude.y * longitude.x);
}
";

/// Milliseconds a launch of 2^16 and of 2^24 rays.
pub(super) struct Launches {
    /// In the order of the inverses.
    pub(super) foveated_ms: Vec<[f64; 2]>,
    uniform_ms: [f64; 2],
    on_software: bool,
}

impl Launches {
    pub(super) fn measure(gpu: &Gpu, inverses: &[&Inverse]) -> anyhow::Result<Self> {
        let uniform = Launch::new(gpu, &Inverse::eq6(), UNIFORM);
        let foveated = inverses.iter().map(|inverse| Launch::new(gpu, inverse, FOVEATED));
        let launches: Vec<Launch> = std::iter::once(uniform).chain(foveated).collect();
        let mut fastest = vec![[f64::INFINITY; 2]; launches.len()];
        for round in 0..=ROUNDS {
            for (launch, fastest) in launches.iter().zip(&mut fastest) {
                for ((rays, runs), fastest) in LAUNCHES.iter().zip(fastest) {
                    for _ in 0..*runs {
                        let seconds = launch.seconds(gpu, *rays)?;
                        if round > 0 {
                            *fastest = fastest.min(seconds * 1e3);
                        }
                    }
                }
            }
        }
        let (uniform_ms, foveated_ms) = (fastest[0], fastest.split_off(1));
        Ok(Self { foveated_ms, uniform_ms, on_software: gpu.is_software() })
    }

    /// The uniform launches, and the default inverses' ratio to them.
    pub(super) fn text(&self, entries: &[Entry]) -> String {
        let od = self.uniform_ms;
        let mut text = format!("\nuniform rays (od): {:.3} ms for 2^16, {:.3} ms for 2^24\n", od[0], od[1]);
        for entry in entries.iter().filter(|e| e.name == "rational3/3" || e.name == "poly5") {
            if let Some([small, large]) = entry.gpu_ms {
                // Writing to a string does not fail.
                let _ = writeln!(
                    text,
                    "fv/od on the {}: {:.3} for 2^16 rays, {:.3} for 2^24",
                    entry.geometry.name(),
                    small / od[0],
                    large / od[1]
                );
            }
        }
        if self.on_software {
            text.push_str("(a software adapter: every instruction costs, nothing hides the warp behind memory)\n");
        }
        text
    }
}

struct Launch {
    pipeline: wgpu::ComputePipeline,
    bind_group: wgpu::BindGroup,
}

impl Launch {
    fn new(gpu: &Gpu, inverse: &Inverse, ray: &str) -> Self {
        let device = &gpu.device;
        let text = [&wgsl::radial_module(inverse), wgsl::sequence_module().as_str(), ray, MAIN].concat();
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("sampler cost"),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("sampler cost"),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: Default::default(),
            cache: None,
        });
        let sink = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("sampler cost sink"),
            size: 16,
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        });
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("sampler cost"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: sink.as_entire_binding() }],
        });
        Self { pipeline, bind_group }
    }

    fn seconds(&self, gpu: &Gpu, rays: u32) -> anyhow::Result<f64> {
        let groups = rays / WORKGROUP;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.bind_group, &[]);
            pass.dispatch_workgroups(groups.min(ROW), groups.div_ceil(ROW), 1);
        }
        let start = Instant::now();
        gpu.queue.submit([encoder.finish()]);
        gpu.wait().context("the adapter was lost")?;
        Ok(start.elapsed().as_secs_f64())
    }
}
