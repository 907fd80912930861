//! Colours that stand for numbers, in pictures and in their legends. Twin: `shaders/view/colors.wesl`, which gets the tables
//! from here.

use std::fmt::Write;

/// Luminance, after exposure, of a grey card.
pub const MIDDLE_GREY: f32 = 0.18;

/// False colour: one display-encoded colour a stop, from six stops below middle grey to six above. The first and the last also
/// stand for what lies beyond.
pub const FALSE_COLORS: [[u8; 3]; 13] = [
    [24, 10, 44],
    [58, 24, 108],
    [48, 58, 172],
    [34, 108, 208],
    [46, 160, 196],
    [52, 152, 110],
    [128, 128, 128],
    [116, 178, 62],
    [190, 206, 58],
    [246, 214, 70],
    [246, 152, 48],
    [222, 62, 44],
    [255, 222, 232],
];

/// Display-encoded colours at equal distances of the ramp that debug views show numbers by; lighter is more.
pub const RAMP: [[u8; 3]; 6] =
    [[12, 14, 58], [38, 66, 148], [38, 138, 148], [110, 188, 84], [246, 214, 72], [255, 255, 246]];

/// Display-encoded colour of what is out of date.
pub const STALE_COLOR: [u8; 3] = [255, 96, 24];

/// The colour of a luminance after exposure.
pub fn false_color(luminance: f32) -> [u8; 3] {
    let stops = (luminance.max(1e-10) / MIDDLE_GREY).log2();
    let middle = (FALSE_COLORS.len() / 2) as f32;
    // The clamp leaves a valid index.
    FALSE_COLORS[((stops + 0.5).floor() + middle).clamp(0.0, 2.0 * middle) as usize]
}

/// The ramp's colour at a place in 0..1.
pub fn ramp(t: f32) -> [u8; 3] {
    let last = RAMP.len() - 1;
    let x = t.clamp(0.0, 1.0) * last as f32;
    let first = (x as usize).min(last - 1);
    let fraction = x - first as f32;
    [0, 1, 2].map(|channel| {
        let [low, high] = [first, first + 1].map(|corner| f32::from(RAMP[corner][channel]));
        (low + (high - low) * fraction).round() as u8
    })
}

/// The tables as constants of the shaders.
pub(crate) fn constants() -> String {
    let color = |[r, g, b]: [u8; 3]| {
        let [r, g, b] = [r, g, b].map(|channel| f32::from(channel) / 255.0);
        format!("vec3f({r:?}, {g:?}, {b:?})")
    };
    let mut text = format!("const MIDDLE_GREY: f32 = {MIDDLE_GREY:?};\n");
    for (name, colors) in [("FALSE_COLORS", &FALSE_COLORS[..]), ("RAMP", &RAMP)] {
        let list: Vec<String> = colors.iter().map(|c| color(*c)).collect();
        // Writing to a string does not fail.
        let _ = writeln!(text, "const {name}_COUNT: u32 = {}u;", colors.len());
        let _ =
            writeln!(text, "const {name}: array<vec3f, {}> = array<vec3f, {0}>({});", colors.len(), list.join(", "));
    }
    text + &format!("const STALE_COLOR: vec3f = {};\n", color(STALE_COLOR))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn middle_grey_is_grey_and_each_stop_has_its_colour() {
        for (luminance, color) in [
            (0.18, [128, 128, 128]),
            (0.25, [128, 128, 128]),
            (0.36, [116, 178, 62]),
            (0.09, [52, 152, 110]),
            (0.18 * 64.0, [255, 222, 232]),
            (1e9, [255, 222, 232]),
            (0.18 / 64.0, [24, 10, 44]),
            (0.0, [24, 10, 44]),
        ] {
            assert_eq!(false_color(luminance), color, "{luminance}");
        }
    }

    #[test]
    fn the_ramp_grows_lighter() {
        let light = |t: f32| {
            let [r, g, b] = ramp(t).map(f32::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        for step in 0..100_u8 {
            let t = f32::from(step) / 100.0;
            assert!(light(t + 0.01) > light(t), "{t}");
        }
        assert_eq!([ramp(-1.0), ramp(0.5), ramp(2.0)], [RAMP[0], [74, 163, 116], RAMP[5]]);
    }
}
