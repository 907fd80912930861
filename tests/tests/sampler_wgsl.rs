//! The sampler's WGSL against its Rust twins on the adapter at hand, the software adapter first: bit for bit where the
//! adapter neither contracts multiply-adds nor approximates division and square root, else within `ULPS`.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use fovea_sampler::{Angle, Form, GazeWarp, Geometry, Inverse, RadialDistribution, Reddy2001, model, sequence, wgsl};
use tracer::gpu::{AdapterSelect, Gpu};

/// Numbers per inverse: adversarial ones first, then 24-bit fractions.
const POINTS: usize = 1 << 15;

/// Largest difference on an adapter that contracts or approximates, in units of f32's epsilon (1.2e-7) relative to the
/// radius, or absolute for directions: division alone may be off by 2.5 ulp, and rationals have terms that cancel by a factor
/// of about ten.
const ULPS: f32 = 64.0;

/// What the kernel writes for a point.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct Row {
    local: [f32; 3],
    radius: f32,
}

fn software_or_default() -> Gpu {
    let llvmpipe = AdapterSelect::Named("llvmpipe".into());
    let gpu = Gpu::headless(&llvmpipe).or_else(|_| Gpu::headless(&AdapterSelect::Auto)).unwrap();
    eprintln!("adapter: {} ({:?}, {})", gpu.info().name, gpu.info().backend, gpu.info().driver_info);
    gpu
}

fn points() -> Vec<[f32; 2]> {
    let corners =
        [0.0, 2f32.powi(-24), 0.09645932, 0.09645933, 0.102_951_06, 0.0965, 0.5, 0.95477, 1.0 - 2f32.powi(-24), 1.0];
    let mut all: Vec<[f32; 2]> = corners.iter().flat_map(|a| corners.map(|b| [*a, b])).collect();
    let number = |i, dimension| sequence::to_unit_f32(sequence::sobol_owen(i, dimension, 3));
    all.extend((0..(POINTS - all.len()) as u32).map(|i| [number(i, 0), number(i, 1)]));
    all
}

/// Runs `entry` of `text` over `input`, one invocation a row, and reads `T`s back.
fn run<T: bytemuck::Pod>(gpu: &Gpu, text: &str, input: &[u8], rows: usize) -> Vec<T> {
    let device = &gpu.device;
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("sampler twin"),
        source: wgpu::ShaderSource::Wgsl(text.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("sampler twin"),
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: Default::default(),
        cache: None,
    });
    let size = (rows * size_of::<T>()) as u64;
    let buffer = |label, size, usage| {
        device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
    };
    let source = buffer("points", input.len() as u64, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST);
    let result = buffer("rows", size, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
    let staging = buffer("staging", size, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
    gpu.queue.write_buffer(&source, 0, input);
    let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("sampler twin"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: source.as_entire_binding() },
            wgpu::BindGroupEntry { binding: 1, resource: result.as_entire_binding() },
        ],
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        pass.dispatch_workgroups(rows.div_ceil(64) as u32, 1, 1);
    }
    encoder.copy_buffer_to_buffer(&result, 0, &staging, 0, size);
    gpu.queue.submit([encoder.finish()]);
    staging.slice(..).map_async(wgpu::MapMode::Read, |mapped| mapped.unwrap());
    gpu.wait().unwrap();
    let mapped = staging.slice(..).get_mapped_range().unwrap();
    mapped.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect()
}

const WARP_MAIN: &str = "
struct Row { local: vec3<f32>, radius: f32 }
@group(0) @binding(0) var<storage, read> points: array<vec2<f32>>;
@group(0) @binding(1) var<storage, read_write> rows: array<Row>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&points) {
        rows[id.x].local = warp_local(points[id.x]);
        rows[id.x].radius = warp_radius(points[id.x].x);
    }
}
";

/// Every model, geometry and floor with its default, and every form of Reddy's acuity.
fn warps() -> Vec<(String, GazeWarp)> {
    let mut all = Vec::new();
    let cap = Angle::from_degrees(80.0);
    for geometry in Geometry::ALL {
        for floor in [0.0, 0.002] {
            for model in model::built_in() {
                let name = format!("{} {geometry:?} floor {floor}", model.name());
                all.push((name, GazeWarp::new(RadialDistribution::new(model, geometry, cap, floor).unwrap())));
            }
        }
        // Up to the antipode, where a fit's error would go on.
        let whole = RadialDistribution::new(Reddy2001, geometry, Angle::from_degrees(180.0), 0.0).unwrap();
        let inverse = Inverse::with_form(&whole, Form::Rational(3, 3)).unwrap();
        all.push((format!("reddy {geometry:?} cap 180"), GazeWarp::with_inverse(whole, inverse)));
        let distribution = RadialDistribution::new(Reddy2001, geometry, cap, 0.002).unwrap();
        for form in [
            Form::Eq6,
            Form::SquaredPolynomial(7),
            Form::Polynomial(7),
            Form::Rational(4, 3),
            Form::Piecewise(3, 5),
            Form::Table(64),
        ] {
            if let Ok(inverse) = Inverse::with_form(&distribution, form) {
                all.push((format!("reddy {geometry:?}"), GazeWarp::with_inverse(distribution.clone(), inverse)));
            }
        }
    }
    all
}

#[test]
fn warp_equals_its_f32_twin() {
    let gpu = software_or_default();
    let points = points();
    let (mut compared, mut different, mut worst) = (0_usize, 0_usize, 0.0_f32);
    for (name, warp) in warps() {
        let text = wgsl::radial_module(warp.inverse()) + WARP_MAIN;
        let rows: Vec<Row> = run(&gpu, &text, bytemuck::cast_slice(&points), points.len());
        for (u, row) in points.iter().zip(rows) {
            let twin = Row { local: warp.sample_local_f32(*u), radius: warp.inverse().eval_versine(u[0]) };
            compared += 1;
            if row == twin {
                continue;
            }
            different += 1;
            let radius = (row.radius - twin.radius).abs() / twin.radius.max(f32::MIN_POSITIVE);
            let direction = (0..3).map(|k| (row.local[k] - twin.local[k]).abs()).fold(0.0, f32::max);
            let ulps = radius.max(direction) / f32::EPSILON;
            worst = worst.max(ulps);
            assert!(ulps <= ULPS, "{name} {} at {u:?}: {row:?} against {twin:?}", warp.inverse().name());
        }
    }
    eprintln!("{compared} points, {different} not bit-identical, the worst {worst} epsilon off");
    assert!(compared > 25 * POINTS);
    if gpu.info().name.contains("llvmpipe") {
        assert_eq!(different, 0, "llvmpipe neither contracts nor approximates");
    }
}

#[test]
fn frames_equal_their_f32_twin() {
    let gpu = software_or_default();
    let warp = GazeWarp::new(RadialDistribution::koskela_2017());
    let main = "
@group(0) @binding(0) var<storage, read> gazes: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> frames: array<mat3x3<f32>>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&gazes) { frames[id.x] = gaze_frame(gazes[id.x].xyz); }
}
";
    let number = |i, d| sequence::to_unit_f32(sequence::independent(i, d, 1)) - 0.5;
    let mut gazes: Vec<[f32; 4]> = vec![
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, -1.0, 0.0],
        [-0.0, 0.0, -1.0, 0.0],
        [1.0, 0.0, 0.0, 0.0],
        [1.0, 0.0, -0.0, 0.0],
        [0.0, -1.0, -0.0, 0.0],
    ];
    gazes.extend((0..2000).map(|i| {
        let v = [number(i, 0), number(i, 1), number(i, 2)];
        let length = v.iter().map(|x| x * x).sum::<f32>().sqrt();
        [v[0] / length, v[1] / length, v[2] / length, 0.0]
    }));
    // A mat3x3 is three vec3 of 16 bytes each.
    let text = wgsl::radial_module(warp.inverse()) + main;
    let frames: Vec<[[f32; 4]; 3]> = run(&gpu, &text, bytemuck::cast_slice(&gazes), gazes.len());
    for (gaze, frame) in gazes.iter().zip(frames) {
        let twin = fovea_sampler::gaze_frame_f32([gaze[0], gaze[1], gaze[2]]);
        for (column, expected) in frame.iter().zip(twin) {
            for k in 0..3 {
                let error = (column[k] - expected[k]).abs();
                // A gaze at z = -1e-7 divides by a rounded 1: one epsilon of contraction is all that is allowed.
                assert!(error <= 4.0 * f32::EPSILON, "{gaze:?}: {frame:?} against {twin:?}");
            }
        }
    }
}

#[test]
fn sequences_equal_their_twins() {
    let gpu = software_or_default();
    let main = "
struct Word { x: u32, y: u32, low: vec2<u32>, high: vec2<u32> }
@group(0) @binding(0) var<storage, read> words: array<Word>;
struct Row { words: vec4<u32>, pair: vec2<u32>, shuffled: vec2<u32>, vertex: vec4<u32>, between: vec4<u32> }
@group(0) @binding(1) var<storage, read_write> rows: array<Row>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&words) {
        let w = words[id.x];
        let scrambled = owen_scramble(w.x, hash_combine(w.y, id.x));
        let numbers = vec4<u32>(scrambled, independent_u32(w.x, id.x, w.y), bitcast<u32>(to_unit(w.x)), strata_order(w.x & 1023u, 10u));
        let vertex = vertex_numbers(w.x, id.x, w.y);
        let between = vec4<u32>(count_between(w.x, w.low, w.high, w.y), 0u, 0u, 0u);
        rows[id.x] = Row(numbers, sobol_pair(w.x), shuffled_pair(w.x, id.x, w.y), vertex, between);
    }
}
";
    // Intervals of all widths from 2^-24 on.
    let ends = |i: u32| {
        let low = sequence::hash(i ^ 0x5a5a);
        [low, low.saturating_add(u32::MAX >> (i % 24))].map(sequence::IntervalEnd::new)
    };
    let words: Vec<[u32; 6]> = (0..4096)
        .map(|i| {
            let [low, high] = ends(i);
            [sequence::hash(i), sequence::hash(!i), low.value, low.root, high.value, high.root]
        })
        .collect();
    let text = wgsl::sequence_module() + main;
    let rows: Vec<[u32; 16]> = run(&gpu, &text, bytemuck::cast_slice(&words), words.len());
    for (i, ([x, seed, ..], row)) in (0_u32..).zip(words.iter().zip(rows)) {
        let ([a, b], [c, d]) = (sequence::sobol_pair(*x), sequence::shuffled_pair(*x, i, *seed));
        let [e, f, g, h] = sequence::vertex_numbers(*x, i, *seed);
        let [low, high] = ends(i);
        let expected = [
            sequence::owen_scramble(*x, sequence::hash_combine(*seed, i)),
            sequence::independent(*x, i, *seed),
            sequence::to_unit_f32(*x).to_bits(),
            sequence::strata_order(x & 1023, 10),
            a,
            b,
            c,
            d,
            e,
            f,
            g,
            h,
            sequence::count_between(*x, low, high, *seed),
            0,
            0,
            0,
        ];
        assert_eq!(row, expected, "{x:x} {seed:x}");
    }
}
