//! Environment images: equirectangular Radiance (`.hdr`) and OpenEXR (`.exr`) files.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use exr::prelude::{ReadChannels, ReadLayers};

use crate::scene::{ContentHash, EnvironmentImage};

/// Largest width or height, pixels.
const MAX_SIDE: usize = 32_768;
/// Largest area, pixels (1.5 GiB as stored here).
const MAX_PIXELS: usize = 1 << 27;

/// A loaded image and what had to be repaired.
#[derive(Clone, Debug)]
pub struct LoadedEnvironment {
    /// Finite and not negative everywhere.
    pub image: EnvironmentImage,
    /// Texels with a negative, NaN or infinite channel; such channels became 0.
    pub repaired_texels: usize,
}

/// Why an environment image could not be loaded. `Display` is one line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EnvironmentError {
    /// The file could not be read.
    #[error("{}: cannot be read: {source}", file.display())]
    Read {
        /// As given.
        file: PathBuf,
        /// The operating system's answer.
        source: std::io::Error,
    },
    /// The bytes are not an image of the formats above.
    #[error("{}: does not decode: {cause}", file.display())]
    Decode {
        /// As given.
        file: PathBuf,
        /// What the decoder says.
        cause: String,
    },
    /// More pixels than are sensible, or none.
    #[error("{}: {width}x{height} pixels are not within 1x1 to {MAX_SIDE} per side and {MAX_PIXELS} in all", file.display())]
    Size {
        /// As given.
        file: PathBuf,
        /// Pixels.
        width: usize,
        /// Pixels.
        height: usize,
    },
}

/// Loads an environment image. OpenEXR files may hold any layout with channels R, G and B; other channels are ignored.
///
/// # Errors
/// [`EnvironmentError`] when the file cannot be read or decoded, or is absurdly large.
pub fn load(path: &Path) -> Result<LoadedEnvironment, EnvironmentError> {
    let bytes = std::fs::read(path).map_err(|source| EnvironmentError::Read { file: path.to_owned(), source })?;
    decode(path, &bytes)
}

fn decode(file: &Path, bytes: &[u8]) -> Result<LoadedEnvironment, EnvironmentError> {
    const EXR_MAGIC: [u8; 4] = [0x76, 0x2F, 0x31, 0x01];
    let raw = if bytes.starts_with(&EXR_MAGIC) { decode_exr(file, bytes) } else { decode_hdr(file, bytes) }?;
    let Raw { width, height, mut pixels } = raw;
    let mut repaired_texels = 0;
    for pixel in &mut pixels {
        let is_fine = |c: &f32| c.is_finite() && *c >= 0.0;
        if !pixel.iter().all(is_fine) {
            repaired_texels += 1;
            *pixel = pixel.map(|c| if is_fine(&c) { c } else { 0.0 });
        }
    }
    let (width, height) = (width as u32, height as u32);
    let hash = ContentHash::of(&[bytemuck::bytes_of(&[width, height]), bytemuck::cast_slice(&pixels)]);
    Ok(LoadedEnvironment { image: EnvironmentImage { width, height, pixels, hash }, repaired_texels })
}

struct Raw {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
}

fn check_size(file: &Path, width: usize, height: usize) -> Result<(), EnvironmentError> {
    let is_fine = (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height) && width * height <= MAX_PIXELS;
    if is_fine { Ok(()) } else { Err(EnvironmentError::Size { file: file.to_owned(), width, height }) }
}

fn decode_hdr(file: &Path, bytes: &[u8]) -> Result<Raw, EnvironmentError> {
    let failed = |e: image::ImageError| {
        let cause = e.to_string().replace('\n', " ");
        EnvironmentError::Decode { file: file.to_owned(), cause }
    };
    let decoder = image::codecs::hdr::HdrDecoder::new(Cursor::new(bytes)).map_err(failed)?;
    let size = decoder.metadata();
    let (width, height) = (size.width as usize, size.height as usize);
    check_size(file, width, height)?;
    let decoded = image::DynamicImage::from_decoder(decoder).map_err(failed)?;
    Ok(Raw { width, height, pixels: decoded.into_rgb32f().as_raw().as_chunks().0.to_vec() })
}

fn decode_exr(file: &Path, bytes: &[u8]) -> Result<Raw, EnvironmentError> {
    let failed = |cause: String| EnvironmentError::Decode { file: file.to_owned(), cause: cause.replace('\n', " ") };
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|e| failed(e.to_string()))?;
    for header in &meta.headers {
        check_size(file, header.layer_size.width(), header.layer_size.height())?;
    }
    let read = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| vec![vec![[0.0f32; 3]; size.width()]; size.height()],
            |rows: &mut Vec<Vec<[f32; 3]>>, at, (r, g, b): (f32, f32, f32)| rows[at.y()][at.x()] = [r, g, b],
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| failed(e.to_string()))?;
    let (width, height) = (read.layer_data.size.width(), read.layer_data.size.height());
    Ok(Raw { width, height, pixels: read.layer_data.channel_data.pixels.concat() })
}

#[cfg(test)]
mod tests {
    use exr::prelude::{Image, SpecificChannels, WritableImage};

    use super::*;

    const FILE: &str = "sky";

    fn hdr(width: usize, height: usize, pixels: &[[f32; 3]]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let pixels: Vec<_> = pixels.iter().map(|&p| image::Rgb(p)).collect();
        image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&pixels, width, height).expect("memory has room");
        bytes
    }

    fn exr(pixels: [[f32; 4]; 2]) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        let channels = SpecificChannels::build()
            .with_channel("R")
            .with_channel("G")
            .with_channel("B")
            .with_channel("depth")
            .with_pixel_fn(|at| {
                let [r, g, b, depth] = pixels[at.x()];
                (r, g, b, depth)
            });
        Image::from_channels((2, 1), channels).write().to_buffered(&mut bytes).expect("memory has room");
        bytes.into_inner()
    }

    #[test]
    fn radiance_files_keep_their_values() {
        let pixels = [[1.0, 0.5, 0.25], [1024.0, 0.0, 4.0]];
        let loaded = decode(FILE.as_ref(), &hdr(2, 1, &pixels)).expect("it is a valid file");
        assert_eq!((loaded.image.width, loaded.image.height, loaded.repaired_texels), (2, 1, 0));
        // Radiance has 8 bits of mantissa, shared by the channels.
        for (found, expected) in loaded.image.pixels.iter().zip(pixels) {
            let tolerance = expected[0] / 128.0;
            assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() <= tolerance), "{found:?} {expected:?}");
        }
    }

    #[test]
    fn openexr_files_with_more_channels_load_and_bad_texels_become_black() {
        let bytes = exr([[0.1, 1e6, 3.0, 7.0], [f32::NAN, -1.0, 2.0, 7.0]]);
        let loaded = decode(FILE.as_ref(), &bytes).expect("it is a valid file");
        assert_eq!(loaded.image.pixels, [[0.1, 1e6, 3.0], [0.0, 0.0, 2.0]]);
        assert_eq!(loaded.repaired_texels, 1);
        let other = decode(FILE.as_ref(), &exr([[0.1, 1e6, 3.0, 7.0], [0.0, 0.0, 2.5, 7.0]])).expect("valid");
        assert_ne!(loaded.image.hash, other.image.hash);
    }

    #[test]
    fn broken_files_give_one_line_that_names_them() {
        let missing = load("no/such sky.hdr".as_ref()).expect_err("there is no such file").to_string();
        assert!(missing.starts_with("no/such sky.hdr: cannot be read: "), "{missing}");
        let whole = exr([[1.0; 4]; 2]);
        let hdr = hdr(64, 64, &[[1.0, 2.0, 3.0]; 64 * 64]);
        let absurd = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2000000000 +X 2000000000\n".as_slice();
        for (bytes, expected) in [
            (b"".as_slice(), "does not decode"),
            (b"not an image", "does not decode"),
            (&whole[..whole.len() / 2], "does not decode"),
            (&hdr[..hdr.len() / 2], "does not decode"),
            (absurd, "2000000000x2000000000 pixels are not within"),
        ] {
            let message = decode(FILE.as_ref(), bytes).expect_err("it is broken").to_string();
            assert!(message.starts_with("sky: ") && message.contains(expected), "{message}");
            assert!(!message.contains('\n'), "{message}");
        }
    }
}
