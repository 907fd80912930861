//! Frames about a gaze direction.

/// A direction; a unit vector, x, y, z.
pub type Direction = [f64; 3];

/// The right-handed orthonormal frame `[b1, b2, n]` whose third axis is the unit vector `n`.
///
/// Safe for every unit vector, poles and negative zero included (orthonormal to 2e-7 in f32).
///
/// # Reference
/// T. Duff et al., *Building an Orthonormal Basis, Revisited*, JCGT 6(1), 2017.
#[must_use]
pub fn gaze_frame(n: Direction) -> [Direction; 3] {
    let [x, y, z] = n;
    let sign = 1f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y], n]
}

/// As [`gaze_frame`] in f32, operation by operation as the shader's `gaze_frame`.
#[must_use]
pub fn gaze_frame_f32(n: [f32; 3]) -> [[f32; 3]; 3] {
    let [x, y, z] = n;
    let sign = 1f32.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y], n]
}
