//! Writes a screenshot as a JPEG small enough for the repository: `cargo run --example jpeg -- IN.png OUT.jpg`.

use anyhow::Context;
use image::codecs::jpeg::JpegEncoder;

/// Noise of unfinished pictures compresses badly; above this, files double for nothing to see.
const QUALITY: u8 = 70;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args_os().skip(1);
    let (from, to) = arguments.next().zip(arguments.next()).context("two file names are needed")?;
    let picture = image::open(&from).with_context(|| from.display().to_string())?.to_rgb8();
    let file = std::fs::File::create(&to).with_context(|| to.display().to_string())?;
    picture.write_with_encoder(JpegEncoder::new_with_quality(std::io::BufWriter::new(file), QUALITY))?;
    Ok(())
}
