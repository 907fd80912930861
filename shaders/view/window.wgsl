// The finished picture onto the window: one fetch a pixel and nothing else. The toolkit's own shader, which serves text and
// pictures alike, keeps branches that a CPU adapter runs under a mask: 100 ns a pixel on lavapipe.

@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var bilinear: sampler;

struct Corner {
    @builtin(position) position: vec4f,
    @location(0) uv: vec2f,
}

// One triangle that covers the viewport.
@vertex
fn corner(@builtin(vertex_index) index: u32) -> Corner {
    let uv = vec2f(f32(index & 1u), f32(index >> 1u)) * 2.0;
    return Corner(vec4f(uv.x * 2.0 - 1.0, 1.0 - uv.y * 2.0, 0.0, 1.0), uv);
}

@fragment
fn encoded(in: Corner) -> @location(0) vec4f {
    return vec4f(textureSampleLevel(picture, bilinear, in.uv, 0.0).rgb, 1.0);
}

// For a window whose format encodes what is written to it (IEC 61966-2-1).
@fragment
fn decoded(in: Corner) -> @location(0) vec4f {
    let encoded = textureSampleLevel(picture, bilinear, in.uv, 0.0).rgb;
    let curve = pow((encoded + 0.055) / 1.055, vec3f(2.4));
    return vec4f(select(curve, encoded / 12.92, encoded <= vec3f(0.04045)), 1.0);
}
