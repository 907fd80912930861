//! Images: which ones are needed in which form, and their decoding.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::PathBuf;
use std::sync::Arc;

use image::{DynamicImage, ImageReader};
use rayon::prelude::*;

use super::accessor::Data;
use super::container::Folder;
use super::document::Image;
use super::error::{ContentError, Fault, one_line};
use super::report::ImportWarning;
use crate::scene::{ContentHash, TexelEncoding, Texture};

/// Largest width or height of an image, pixels.
const MAX_SIDE: u32 = 16_384;
/// Largest area of an image, pixels.
const MAX_PIXELS: u64 = 1 << 27;
/// Longest part of an image file that is read: more than as many pixels take without compression, 16 bits a channel.
const MAX_FILE_BYTES: u64 = 10 * MAX_PIXELS;

/// What a texture is for: decides its encoding and what stands in for it when it is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum TextureUse {
    /// sRGB colour that multiplies a factor; also alpha-only data, since alpha is linear either way.
    Color,
    /// Emitted colour. Unlike the others its neutral value is black: a missing texture must not light the room.
    Emission,
    /// Linear channels that multiply factors.
    Data,
    /// A tangent-space normal map.
    Normal,
    /// Green = 1 - glossiness * alpha, blue = 0, from a specular-glossiness texture.
    RoughnessFromGlossiness {
        /// Bits of the glossiness factor.
        glossiness_bits: u32,
    },
}

impl TextureUse {
    fn encoding(self) -> TexelEncoding {
        match self {
            Self::Color | Self::Emission => TexelEncoding::Srgb,
            Self::Data | Self::Normal | Self::RoughnessFromGlossiness { .. } => TexelEncoding::Linear,
        }
    }

    fn neutral(self) -> [u8; 4] {
        match self {
            Self::Color | Self::Data => [255; 4],
            Self::Emission => [0, 0, 0, 255],
            Self::Normal => [128, 128, 255, 255],
            Self::RoughnessFromGlossiness { .. } => [255, 255, 0, 255],
        }
    }

    /// Uses of an image that give the same texels, where it can be decoded, share them.
    fn texels_as(self) -> Self {
        match self {
            Self::Emission => Self::Color,
            Self::Normal => Self::Data,
            other => other,
        }
    }
}

/// The textures of a scene and what their making met.
pub(super) struct Decoded {
    pub(super) textures: Vec<Arc<Texture>>,
    pub(super) warnings: Vec<ImportWarning>,
    /// The image files that were read.
    pub(super) files: Vec<PathBuf>,
}

/// The textures that the materials ask for, in order of request.
#[derive(Default)]
pub(super) struct TextureTable {
    requests: Vec<(usize, TextureUse)>,
    by_key: HashMap<(usize, TextureUse), u32>,
}

impl TextureTable {
    /// The index in [`crate::scene::Scene::textures`] that image `image` will have in this use.
    pub(super) fn request(&mut self, image: usize, usage: TextureUse) -> u32 {
        *self.by_key.entry((image, usage)).or_insert_with(|| {
            self.requests.push((image, usage));
            u32::try_from(self.requests.len() - 1).expect("a file has fewer than 2^32 textures")
        })
    }

    /// A texel for each of what was asked for, until it is decoded: grey where colours will be.
    pub(super) fn stand_ins(&self) -> Vec<Arc<Texture>> {
        let stand_in = |&(_, usage): &(usize, TextureUse)| {
            let texel = if usage == TextureUse::Color { [188, 188, 188, 255] } else { usage.neutral() };
            Arc::new(texture(String::new(), [1, 1], vec![texel], usage.encoding()))
        };
        self.requests.iter().map(stand_in).collect()
    }

    /// Decodes what was asked for, in parallel. Missing and undecodable images become neutral texels and warnings.
    pub(super) fn decode(&self, data: &Data<'_>, folder: &Folder) -> Result<Decoded, Fault> {
        let mut uses_of_image: Vec<(usize, Vec<usize>)> = Vec::new();
        let mut slot_of_image = HashMap::new();
        for (index, &(image, _)) in self.requests.iter().enumerate() {
            let slot = *slot_of_image.entry(image).or_insert_with(|| {
                uses_of_image.push((image, Vec::new()));
                uses_of_image.len() - 1
            });
            uses_of_image[slot].1.push(index);
        }
        // One image at a time per task: images differ in size by orders of magnitude.
        let decoded: Vec<_> = uses_of_image
            .par_iter()
            .with_max_len(1)
            .map(|(image, uses)| self.decode_image(data, folder, *image, uses))
            .collect::<Result<_, _>>()?;

        let mut textures: Vec<Option<Arc<Texture>>> = vec![None; self.requests.len()];
        let (mut warnings, mut files) = (Vec::new(), Vec::new());
        let mut rounded = 0;
        for (image, (image_textures, image_warnings)) in uses_of_image.iter().zip(decoded) {
            for (&index, texture) in image.1.iter().zip(image_textures) {
                textures[index] = Some(texture);
            }
            let (of_kind, others): (Vec<_>, Vec<_>) =
                image_warnings.into_iter().partition(|w| matches!(w, ImportWarning::ImagesRounded { .. }));
            rounded += of_kind.len();
            warnings.extend(others);
            files.extend(data.document.images[image.0].uri.and_then(|uri| folder.companion(uri)));
        }
        if rounded > 0 {
            warnings.push(ImportWarning::ImagesRounded { count: rounded });
        }
        Ok(Decoded { textures: textures.into_iter().flatten().collect(), warnings, files })
    }

    fn decode_image(
        &self,
        data: &Data<'_>,
        folder: &Folder,
        image: usize,
        uses: &[usize],
    ) -> Result<(Vec<Arc<Texture>>, Vec<ImportWarning>), Fault> {
        let source = &data.document.images[image];
        let place = shown_place(source);
        let name = texture_name(source, image);
        let mut warnings = Vec::new();
        let pixels = match read_image(data, folder, source, &place)? {
            Ok(pixels) => Some(pixels),
            Err(cause) => {
                warnings.push(ImportWarning::ImageReplaced { place: place.clone(), cause: one_line(&cause) });
                None
            }
        };
        if pixels.as_ref().is_some_and(|p| p.was_16_bit) {
            let is_normal_map = uses.iter().any(|&index| self.requests[index].1 == TextureUse::Normal);
            let rounded = ImportWarning::ImagesRounded { count: 1 };
            warnings.push(if is_normal_map { ImportWarning::NormalMapRounded { place } } else { rounded });
        }
        let (width, height) = pixels.as_ref().map_or((1, 1), |p| (p.width, p.height));
        let mut shared = pixels.map(|p| p.texels);
        let is_decoded = shared.is_some();
        let mut made: HashMap<TextureUse, Arc<Texture>> = HashMap::new();
        let textures = uses.iter().enumerate().map(|(i, &index)| {
            let usage = self.requests[index].1;
            if let Some(same) = made.get(&usage.texels_as()).filter(|_| is_decoded) {
                return Arc::clone(same);
            }
            let own = if i + 1 == uses.len() { shared.take() } else { shared.clone() };
            let texels = own.map_or_else(|| vec![usage.neutral()], |texels| texels_for(usage, texels));
            let texture = Arc::new(texture(name.clone(), [width, height], texels, usage.encoding()));
            made.insert(usage.texels_as(), Arc::clone(&texture));
            texture
        });
        Ok((textures.collect(), warnings))
    }
}

fn texture(name: String, [width, height]: [u32; 2], texels: Vec<[u8; 4]>, encoding: TexelEncoding) -> Texture {
    let header = [width, height, u32::from(encoding == TexelEncoding::Linear)];
    let hash = ContentHash::of(&[bytemuck::bytes_of(&header), bytemuck::cast_slice(&texels)]);
    Texture { name, width, height, texels, encoding, hash }
}

fn texels_for(usage: TextureUse, mut texels: Vec<[u8; 4]>) -> Vec<[u8; 4]> {
    if let TextureUse::RoughnessFromGlossiness { glossiness_bits } = usage {
        let glossiness = f32::from_bits(glossiness_bits);
        for texel in &mut texels {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..=255")]
            let roughness = (255.0 - glossiness * f32::from(texel[3])).round() as u8;
            *texel = [255, roughness, 0, 255];
        }
    }
    texels
}

fn shown_place(image: &Image<'_>) -> String {
    match image.uri.filter(|uri| image.name.is_empty() && !uri.starts_with("data:")) {
        Some(uri) => format!("{} '{}'", image.place, one_line(uri)),
        None => image.place.clone(),
    }
}

fn texture_name(image: &Image<'_>, index: usize) -> String {
    match image.uri.filter(|uri| !uri.starts_with("data:")) {
        _ if !image.name.is_empty() => image.name.clone(),
        Some(uri) => uri.to_owned(),
        None => format!("image {index}"),
    }
}

struct Pixels {
    width: u32,
    height: u32,
    texels: Vec<[u8; 4]>,
    was_16_bit: bool,
}

/// The outer error ends the import, the inner one is a warning.
fn read_image(
    data: &Data<'_>,
    folder: &Folder,
    image: &Image<'_>,
    place: &str,
) -> Result<Result<Pixels, String>, Fault> {
    let owned;
    let bytes: &[u8] = match (image.view, image.uri) {
        (Some(view), _) => data.view(view)?,
        (None, Some(uri)) => match folder.read(uri, MAX_FILE_BYTES) {
            Ok(bytes) => {
                owned = bytes;
                &owned
            }
            Err(cause) => return Ok(Err(cause)),
        },
        (None, None) => return Ok(Err("it has neither a URI nor a buffer view".to_owned())),
    };
    // The bytes tell the format; declared media types are often wrong.
    let reader = || ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string());
    let header = reader().and_then(|mut reader| {
        // The size is checked below, with an error that says so.
        reader.no_limits();
        reader.into_dimensions().map_err(|e| e.to_string())
    });
    let (width, height) = match header {
        Ok(size) => size,
        Err(cause) => return Ok(Err(cause)),
    };
    if width > MAX_SIDE || height > MAX_SIDE || u64::from(width) * u64::from(height) > MAX_PIXELS {
        let (limit_side, limit_pixels) = (MAX_SIDE, MAX_PIXELS);
        return Err(Fault::new(place, ContentError::ImageTooLarge { width, height, limit_side, limit_pixels }));
    }
    if width == 0 || height == 0 {
        return Ok(Err("it has no pixels".to_owned()));
    }
    Ok(reader().and_then(|r| r.decode().map_err(|e| e.to_string())).map(to_pixels))
}

fn to_pixels(decoded: DynamicImage) -> Pixels {
    let (width, height) = (decoded.width(), decoded.height());
    let was_16_bit = matches!(
        decoded,
        DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)
            | DynamicImage::ImageRgb16(_)
            | DynamicImage::ImageRgba16(_)
    );
    let texels = match decoded {
        DynamicImage::ImageRgb8(rgb) => rgb.as_raw().as_chunks().0.iter().map(|&[r, g, b]| [r, g, b, 255]).collect(),
        other => other.into_rgba8().as_raw().as_chunks::<4>().0.to_vec(),
    };
    Pixels { width, height, texels, was_16_bit }
}
