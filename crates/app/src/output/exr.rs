//! OpenEXR files of a film: what a pixel's samples say, and the sums themselves, so that a render can go on.
//!
//! Channels for viewers and compositors: `R`, `G`, `B` (mean radiance, linear Rec. 709, 32-bit float), `variance` (of the
//! mean's luminance, 32-bit float) and `samples` (32-bit unsigned). A pixel without a sample holds zeros.
//!
//! Channels for resuming and merging, 32-bit unsigned: `sum.R.0`, `sum.R.1` and so on are the words of the film's integer
//! sums in quanta, the lowest first; `sum.squares.0` to `.2` those of squared luminance. They are lossless; the floats are
//! what follows from them.
//!
//! The header attribute [`SETTINGS_ATTRIBUTE`] is a JSON object with the ranges of samples, the settings and the scene's
//! hash. It is one attribute because OpenEXR's custom attributes have no order here, and equal films must give equal bytes.

use std::path::Path;

use ::exr::block::lines::LineRefMut;
use ::exr::image::write::samples::{SamplesWriter, WritableSamples};
use ::exr::math::RoundingMode;
use ::exr::meta::attribute::LevelMode;
use ::exr::meta::header::Header;
use ::exr::prelude::*;
use serde_json::{Map, Value};
use tracer::film::{FilmSnapshot, MergeError};
use tracer::kernels::FILM_WORDS;

use super::{OutputError, header, write_atomically};

/// The header attribute that holds the settings as JSON text.
pub const SETTINGS_ATTRIBUTE: &str = "fovea";

/// Channels of a film's words, in their order.
const WORDS: [&str; FILM_WORDS as usize] = [
    "sum.R.0",
    "sum.R.1",
    "sum.G.0",
    "sum.G.1",
    "sum.B.0",
    "sum.B.1",
    "samples",
    "sum.squares.0",
    "sum.squares.1",
    "sum.squares.2",
];

/// A film and how it was made.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmFile {
    /// The sums, and what they are of.
    pub film: FilmSnapshot,
    /// Scene, mode, gaze and what else there is to say, with the film's own fields.
    pub settings: Map<String, Value>,
}

impl FilmFile {
    /// A film with what there is to say about it.
    pub fn new(film: FilmSnapshot, mut settings: Map<String, Value>) -> Self {
        settings.extend(header::to_json(&film.header));
        Self { film, settings }
    }

    /// A film that went on from a file with the settings `before`; the samples since were placed by `settings`.
    pub fn gone_on(before: Map<String, Value>, film: FilmSnapshot, settings: &Map<String, Value>) -> Self {
        Self::new(film, header::combined(before, settings))
    }

    /// Adds the samples of another film of the same picture.
    ///
    /// # Errors
    /// As [`FilmSnapshot::merge`].
    pub fn merge(&mut self, other: &Self) -> std::result::Result<(), MergeError> {
        self.film.merge(&other.film)?;
        self.settings = header::combined(std::mem::take(&mut self.settings), &other.settings);
        self.settings.extend(header::to_json(&self.film.header));
        Ok(())
    }
}

/// Writes a film; an existing file is replaced whole or not at all.
pub fn write(path: &Path, file: &FilmFile) -> std::result::Result<(), OutputError> {
    let FilmFile { film, settings } = file;
    let size = (film.header.options.width as usize, film.header.options.height as usize);
    film.check().map_err(|error| OutputError::Unwritable { path: path.to_owned(), reason: error.to_string() })?;
    let floats = [("R", Part::Mean(0)), ("G", Part::Mean(1)), ("B", Part::Mean(2)), ("variance", Part::Variance)];
    let words = WORDS.iter().enumerate().map(|(word, name)| (*name, Part::Word(word)));
    let channel = |(name, part)| AnyChannel::new(name, ChannelOfFilm { film, part });
    let channels = AnyChannels::sort(floats.into_iter().chain(words).map(channel).collect());
    let mut attributes = LayerAttributes {
        software_name: Text::new_or_none(concat!("fovea ", env!("CARGO_PKG_VERSION"))),
        ..LayerAttributes::default()
    };
    // Text is bytes to OpenEXR; UTF-8 is what readers expect, and a scene's name may need it.
    let settings = Text::from_slice_unchecked(Value::Object(settings.clone()).to_string().as_bytes());
    attributes.other.insert(Text::from(SETTINGS_ATTRIBUTE), AttributeValue::Text(settings));
    // In order: otherwise blocks are written as they get ready, and equal films give other bytes.
    let line_order = LineOrder::Increasing;
    let encoding = Encoding { compression: Compression::ZIP16, line_order, ..Encoding::FAST_LOSSLESS };
    let image = Image::from_layer(Layer::new(size, attributes, encoding, channels));
    write_atomically(path, |writer| image.write().to_buffered(writer).map_err(|error| error.to_string()))
}

/// What a channel holds of a pixel.
#[derive(Clone, Copy, Debug)]
enum Part {
    /// A component of the mean radiance.
    Mean(usize),
    /// Variance of the mean's luminance.
    Variance,
    /// One of the film's words.
    Word(usize),
}

/// A channel that is made of the film line by line as it is written: all channels at once would be larger than the film, and the
/// largest films fill much of the memory as they are.
#[derive(Clone, Copy, Debug)]
struct ChannelOfFilm<'film> {
    film: &'film FilmSnapshot,
    part: Part,
}

impl WritableSamples<'_> for ChannelOfFilm<'_> {
    type Writer = Self;

    fn sample_type(&self) -> SampleType {
        if matches!(self.part, Part::Word(_)) { SampleType::U32 } else { SampleType::F32 }
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    fn create_samples_writer(&self, _header: &Header) -> Self {
        *self
    }
}

impl SamplesWriter for ChannelOfFilm<'_> {
    fn extract_line(&self, line: LineRefMut<'_>) {
        let film = self.film;
        let position = line.location.position;
        let first = position.y() * film.header.options.width as usize + position.x();
        let written = match self.part {
            Part::Mean(component) => line.write_samples(|i| film.pixel(first + i).mean[component] as f32),
            Part::Variance => line.write_samples(|i| film.pixel(first + i).variance_of_mean as f32),
            Part::Word(word) => line.write_samples(|i| film.words[(first + i) * WORDS.len() + word]),
        };
        written.expect("a line has room for its samples");
    }
}

/// Whether a file says that it is a film, by its header.
pub fn is_film(path: &Path) -> bool {
    let header = MetaData::read_from_file(path, false).ok().and_then(|found| found.headers.into_iter().next());
    header.is_some_and(|header| header.own_attributes.other.contains_key(&Text::from(SETTINGS_ATTRIBUTE)))
}

/// Reads a film that [`write()`] made. Files of other programs are refused with what they lack.
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
    let settings: Map<String, Value> = match layer.attributes.other.get(&Text::from(SETTINGS_ATTRIBUTE)) {
        Some(AttributeValue::Text(text)) => serde_json::from_slice(text.as_slice())
            .map_err(|error| unreadable(format!("header attribute `{SETTINGS_ATTRIBUTE}`: {error}")))?,
        _ => return Err(unreadable(format!("no film of fovea: it has no header attribute `{SETTINGS_ATTRIBUTE}`"))),
    };
    let header = header::from_json(&Value::Object(settings.clone()))
        .map_err(|reason| unreadable(format!("header attribute `{SETTINGS_ATTRIBUTE}`: {reason}")))?;
    let (width, height) = (header.options.width as usize, header.options.height as usize);
    if (layer.size.width(), layer.size.height()) != (width, height) {
        let found = (layer.size.width(), layer.size.height());
        return Err(unreadable(format!("{}x{} pixels for a film of {width}x{height}", found.0, found.1)));
    }
    let channel = |name: &&str| {
        let found = layer.channel_data.list.iter().find(|channel| channel.name == **name);
        match found.map(|channel| &channel.sample_data) {
            Some(FlatSamples::U32(values)) => Ok(values),
            Some(_) => Err(unreadable(format!("channel `{name}` is not 32-bit unsigned"))),
            None => Err(unreadable(format!("has no channel `{name}`"))),
        }
    };
    let channels: Vec<&Vec<u32>> = WORDS.iter().map(channel).collect::<std::result::Result<_, _>>()?;
    let words = (0..layer.size.area()).flat_map(|pixel| channels.iter().map(move |values| values[pixel])).collect();
    let film = FilmSnapshot { header, words };
    film.check().map_err(|error| unreadable(error.to_string()))?;
    Ok(FilmFile { film, settings })
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use tracer::film::FilmMapping;

    use super::*;

    fn file() -> FilmFile {
        let header = header::tests::header(FilmMapping::Equirect);
        let words = (0..37 * 5 * FILM_WORDS).map(|i| i.wrapping_mul(0x9e37_79b9)).collect();
        let settings = serde_json::json!({ "scene": "Kapelle übers Tal 桜.glb", "gaze": [0.5, 12] });
        FilmFile::new(FilmSnapshot { header, words }, settings.as_object().unwrap().clone())
    }

    fn scratch(name: &str) -> std::path::PathBuf {
        std::env::temp_dir().join(format!("fovea-exr-{name}-{}.exr", std::process::id()))
    }

    #[test]
    fn a_film_reads_back_bit_for_bit() {
        let path = scratch("round-trip");
        write(&path, &file()).unwrap();
        assert_eq!(read(&path).unwrap(), file());
        assert!(is_film(&path));
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn other_programs_see_the_mean() {
        let path = scratch("mean");
        write(&path, &file()).unwrap();
        let image = read_first_rgba_layer_from_file(
            &path,
            |size, _| vec![[0.0; 3]; size.area()],
            |pixels: &mut Vec<[f32; 3]>, at, (r, g, b, _): (f32, f32, f32, f32)| {
                pixels[at.flat_index_for_size(Vec2(37, 5))] = [r, g, b];
            },
        );
        let expected: Vec<_> = file().film.pixels().map(|pixel| pixel.mean.map(|value| value as f32)).collect();
        assert_eq!(image.unwrap().layer_data.channel_data.pixels, expected);
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn equal_films_give_equal_bytes() {
        let paths = [scratch("equal-a"), scratch("equal-b")];
        // Hundreds of blocks, which threads compress as they come.
        let mut header = file().film.header;
        header.options.height = 4096;
        let words = (0..37 * 4096 * FILM_WORDS).map(|i| if i % 9000 < 4000 { i.wrapping_mul(0x9e37_79b9) } else { 0 });
        let film = FilmFile::new(FilmSnapshot { header, words: words.collect() }, file().settings);
        for path in &paths {
            write(path, &film).unwrap();
        }
        assert_eq!(std::fs::read(&paths[0]).unwrap(), std::fs::read(&paths[1]).unwrap());
        paths.iter().for_each(|path| std::fs::remove_file(path).unwrap());
    }

    #[test]
    fn too_few_pixels_and_foreign_files_are_refused_in_one_line() {
        let path = scratch("refused");
        let mut short = file();
        short.film.words.pop();
        assert!(write(&path, &short).unwrap_err().to_string().contains("37x5"));
        assert!(!path.exists());

        std::fs::write(&path, "not an image").unwrap();
        let message = read(&path).unwrap_err().to_string();
        assert!(message.contains("refused") && !message.contains('\n'), "{message}");

        write_rgb_file(&path, 2, 2, |_, _| (0.0_f32, 0.0_f32, 0.0_f32)).unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("no film of fovea"));
        assert!(!is_film(&path) && !is_film(&path.with_extension("missing")));

        let mut other_size = file();
        other_size.settings["film"]["width"] = 36.into();
        write(&path, &other_size).unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("36x5"));
        std::fs::remove_file(path).unwrap();
    }
}
