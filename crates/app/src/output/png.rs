//! PNG files of the tone-mapped picture.

use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::{OutputError, write_atomically};

/// Writes 8-bit RGBA texels (sRGB, row by row from the top) as an opaque RGB file; alpha is dropped.
///
/// An existing file is replaced whole or not at all.
pub fn write(path: &Path, width: u32, height: u32, texels: &[[u8; 4]]) -> Result<(), OutputError> {
    if texels.is_empty() || texels.len() as u64 != u64::from(width) * u64::from(height) {
        return Err(OutputError::WrongSize {
            path: path.to_owned(),
            found: texels.len(),
            width: width as usize,
            height: height as usize,
        });
    }
    let rgb: Vec<u8> = texels.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
    write_atomically(path, |writer| {
        PngEncoder::new(writer)
            .write_image(&rgb, width, height, ExtendedColorType::Rgb8)
            .map_err(|error| error.to_string())
    })
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn texels_read_back_without_alpha() {
        let path = std::env::temp_dir().join(format!("fovea-png-{}.png", std::process::id()));
        let texels: Vec<[u8; 4]> = (0..6).map(|i| [i, 10 * i, 255 - i, 3]).collect();
        write(&path, 3, 2, &texels).unwrap();
        let read = image::open(&path).unwrap();
        assert_eq!(read.color(), image::ColorType::Rgb8);
        let expected: Vec<[u8; 3]> = texels.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
        assert_eq!(read.to_rgb8().pixels().map(|pixel| pixel.0).collect::<Vec<_>>(), expected);
        assert!(write(&path, 3, 3, &texels).is_err());
        std::fs::remove_file(path).unwrap();
    }
}
