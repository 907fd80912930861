//! OpenEXR files of a film: what a pixel's samples say, unaltered.
//!
//! Channels: `R`, `G`, `B` (mean radiance, linear Rec. 709, 32-bit float), `variance` (of the mean's luminance, 32-bit
//! float) and `samples` (32-bit unsigned). A pixel without a sample holds zeros.
//!
//! The header attribute [`SETTINGS_ATTRIBUTE`] is a JSON object with the seed, the range of samples, the settings and
//! the scene's hash. It is one attribute because OpenEXR's custom attributes have no order here, and equal films must
//! give equal bytes.

use std::path::Path;

use ::exr::prelude::*;
use serde_json::Value;
use tracer::film::FilmSnapshot;

use super::{OutputError, write_atomically};

/// The header attribute that holds the settings as JSON text.
pub const SETTINGS_ATTRIBUTE: &str = "fovea";

/// A film and how it was made.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmFile {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Mean radiance a pixel, row by row from the top; zero without samples.
    pub rgb: Vec<[f32; 3]>,
    /// Variance of the mean's luminance; zero below two samples.
    pub variance: Vec<f32>,
    /// Samples a pixel.
    pub samples: Vec<u32>,
    /// Seed, sample range, settings and scene hash.
    pub settings: Value,
}

impl FilmFile {
    /// The estimates of a film with the settings that made them.
    pub fn new(snapshot: &FilmSnapshot, settings: Value) -> Self {
        let pixels: Vec<_> = snapshot.pixels().collect();
        Self {
            width: snapshot.header.options.width as usize,
            height: snapshot.header.options.height as usize,
            rgb: pixels.iter().map(|pixel| pixel.mean.map(|component| component as f32)).collect(),
            variance: pixels.iter().map(|pixel| pixel.variance_of_mean as f32).collect(),
            samples: pixels.iter().map(|pixel| pixel.samples).collect(),
            settings,
        }
    }
}

/// Writes a film; an existing file is replaced whole or not at all.
pub fn write(path: &Path, film: FilmFile) -> std::result::Result<(), OutputError> {
    let pixels = film.width * film.height;
    for found in [film.rgb.len(), film.variance.len(), film.samples.len()] {
        if found != pixels || pixels == 0 {
            return Err(OutputError::WrongSize {
                path: path.to_owned(),
                found,
                width: film.width,
                height: film.height,
            });
        }
    }
    let component = |index: usize| FlatSamples::F32(film.rgb.iter().map(|pixel| pixel[index]).collect());
    let channels = AnyChannels::sort(
        [
            AnyChannel::new("R", component(0)),
            AnyChannel::new("G", component(1)),
            AnyChannel::new("B", component(2)),
            AnyChannel::new("variance", FlatSamples::F32(film.variance)),
            AnyChannel::new("samples", FlatSamples::U32(film.samples)),
        ]
        .into_iter()
        .collect(),
    );
    let mut attributes = LayerAttributes {
        software_name: Text::new_or_none(concat!("fovea ", env!("CARGO_PKG_VERSION"))),
        ..LayerAttributes::default()
    };
    // Text is bytes to OpenEXR; UTF-8 is what readers expect, and a scene's name may need it.
    let settings = Text::from_slice_unchecked(film.settings.to_string().as_bytes());
    attributes.other.insert(Text::from(SETTINGS_ATTRIBUTE), AttributeValue::Text(settings));
    let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::FAST_LOSSLESS };
    let layer = Layer::new((film.width, film.height), attributes, encoding, channels);
    let image = Image::from_layer(layer);
    write_atomically(path, |writer| image.write().to_buffered(writer).map_err(|error| error.to_string()))
}

/// Reads a file that [`write()`] made. Files of other programs are refused with what they lack.
pub fn read(path: &Path) -> std::result::Result<FilmFile, OutputError> {
    let unreadable = |reason: String| OutputError::Unreadable { path: path.to_owned(), reason };
    let file = std::fs::File::open(path).map_err(|error| unreadable(error.to_string()))?;
    let image = ::exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(std::io::BufReader::new(file))
        .map_err(|error| unreadable(format!("not a readable OpenEXR file: {error}")))?;
    let layer = image.layer_data;
    let channel = |name: &str| {
        let found = layer.channel_data.list.iter().find(|channel| channel.name == *name);
        found.map(|channel| &channel.sample_data).ok_or_else(|| unreadable(format!("has no channel `{name}`")))
    };
    let floats = |name: &str| match channel(name)? {
        FlatSamples::F32(values) => Ok(values),
        _ => Err(unreadable(format!("channel `{name}` is not 32-bit float"))),
    };
    let (red, green, blue) = (floats("R")?, floats("G")?, floats("B")?);
    let FlatSamples::U32(samples) = channel("samples")? else {
        return Err(unreadable("channel `samples` is not 32-bit unsigned".into()));
    };
    let settings = match layer.attributes.other.get(&Text::from(SETTINGS_ATTRIBUTE)) {
        Some(AttributeValue::Text(text)) => serde_json::from_slice(text.as_slice())
            .map_err(|error| unreadable(format!("header attribute `{SETTINGS_ATTRIBUTE}`: {error}")))?,
        _ => return Err(unreadable(format!("has no header attribute `{SETTINGS_ATTRIBUTE}`"))),
    };
    Ok(FilmFile {
        width: layer.size.width(),
        height: layer.size.height(),
        rgb: red.iter().zip(green).zip(blue).map(|((&r, &g), &b)| [r, g, b]).collect(),
        variance: floats("variance")?.clone(),
        samples: samples.clone(),
        settings,
    })
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn film() -> FilmFile {
        let pixels = 37 * 5;
        FilmFile {
            width: 37,
            height: 5,
            rgb: (0..pixels).map(|i| [i as f32 * 1e-3, 1e6 / (i + 1) as f32, f32::MIN_POSITIVE]).collect(),
            variance: (0..pixels).map(|i| (i * i) as f32).collect(),
            samples: (0..pixels).map(|i| u32::MAX - i as u32).collect(),
            settings: serde_json::json!({ "seed": 7, "scene": "Kapelle übers Tal 桜.glb", "samples": [0, 12] }),
        }
    }

    fn scratch(name: &str) -> std::path::PathBuf {
        std::env::temp_dir().join(format!("fovea-exr-{name}-{}.exr", std::process::id()))
    }

    #[test]
    fn a_film_reads_back_bit_for_bit() {
        let path = scratch("round-trip");
        write(&path, film()).unwrap();
        assert_eq!(read(&path).unwrap(), film());
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn equal_films_give_equal_bytes() {
        let paths = [scratch("equal-a"), scratch("equal-b")];
        for path in &paths {
            write(path, film()).unwrap();
        }
        assert_eq!(std::fs::read(&paths[0]).unwrap(), std::fs::read(&paths[1]).unwrap());
        paths.iter().for_each(|path| std::fs::remove_file(path).unwrap());
    }

    #[test]
    fn too_few_pixels_and_foreign_files_are_refused_in_one_line() {
        let path = scratch("refused");
        let mut short = film();
        short.variance.pop();
        assert!(write(&path, short).unwrap_err().to_string().contains("37x5"));
        assert!(!path.exists());

        std::fs::write(&path, "not an image").unwrap();
        let message = read(&path).unwrap_err().to_string();
        assert!(message.contains("refused") && !message.contains('\n'), "{message}");

        write_rgb_file(&path, 2, 2, |_, _| (0.0_f32, 0.0_f32, 0.0_f32)).unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("`samples`"));
        std::fs::remove_file(path).unwrap();
    }
}
