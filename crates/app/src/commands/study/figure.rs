//! A picture in the form of the paper's first figure: film, view and the magnified gaze of OD, VP and FV after equal time.

use anyhow::Context;
use tracer::renderer::SequenceKind;

use super::bench::Bench;
use super::plan::Method;
use super::rates::Rates;
use crate::cli::study::StudyArgs;
use crate::output::png;

/// Rows of the picture.
const METHODS: [Method; 3] = [Method::Od, Method::Vp, Method::Fv];
/// Samples of OD a film pixel; the others have as many as take the same time.
const OD_SPP: f64 = 0.5;
/// Pixels between two pictures.
const GAP: usize = 4;
/// View pixels about the gaze that are magnified, across and up.
const MAGNIFIED: usize = 32;

/// An RGB picture.
struct Sheet {
    width: usize,
    texels: Vec<[u8; 4]>,
}

impl Sheet {
    fn new(width: usize, height: usize) -> Self {
        Self { width, texels: vec![[255; 4]; width * height] }
    }

    /// Puts a picture `across` pixels wide at a place, each of its pixels as a square.
    fn paste(&mut self, at: [usize; 2], picture: &[[u8; 3]], across: usize, square: usize) {
        let height = self.texels.len() / self.width;
        for (index, [r, g, b]) in picture.iter().enumerate() {
            for j in 0..square {
                for i in 0..square {
                    let [x, y] = [at[0] + index % across * square + i, at[1] + index / across * square + j];
                    if x < self.width && y < height {
                        self.texels[y * self.width + x] = [*r, *g, *b, 255];
                    }
                }
            }
        }
    }
}

/// Renders and writes `figure-SCENE.png` at the scene's first gaze; what is there is left.
///
/// # Errors
/// When a rate was not measured, the device is lost or the file cannot be written.
pub fn write(bench: &mut Bench, args: &StudyArgs, rates: &Rates) -> anyhow::Result<()> {
    let path = args.output.join(format!("figure-{}.png", bench.name));
    if path.exists() {
        return Ok(());
    }
    let place = bench.places.first().context("a scene needs a gaze")?.clone();
    let (film, side) = (bench.film, bench.film.height as usize);
    let zoom = (side / MAGNIFIED).max(1);
    let width = film.width as usize + side + MAGNIFIED * zoom + 2 * GAP;
    let mut sheet = Sheet::new(width, METHODS.len() * (side + GAP) - GAP);
    for (row, method) in METHODS.into_iter().enumerate() {
        let of_od = (Method::Od, OD_SPP * film.pixels() as f64);
        let samples = rates.in_equal_time((&bench.name, &place.name()), of_od, method)?;
        bench.begin(method, &place, 1, SequenceKind::Independent)?;
        bench.go_on((samples as u64).max(1))?;
        let top = row * (side + GAP);
        sheet.paste([0, top], &bench.panorama()?, film.width as usize, 1);
        let view = bench.view(&place, side as u32)?.encoded;
        let left = film.width as usize + GAP;
        sheet.paste([left, top], &view, side, 1);
        let first = (side - MAGNIFIED.min(side)) / 2;
        let rows = first..first + MAGNIFIED.min(side);
        let gaze: Vec<[u8; 3]> =
            rows.flat_map(|y| view[y * side + first..][..MAGNIFIED.min(side)].iter().copied()).collect();
        sheet.paste([left + side + GAP, top], &gaze, MAGNIFIED.min(side), zoom);
    }
    let height = sheet.texels.len() / sheet.width;
    Ok(png::write(&path, sheet.width as u32, height as u32, &sheet.texels)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_pasted_whole_and_magnified() {
        let mut sheet = Sheet::new(6, 4);
        sheet.paste([1, 1], &[[1, 2, 3], [4, 5, 6]], 2, 2);
        let red = |x: usize, y: usize| sheet.texels[y * 6 + x][0];
        assert_eq!([red(0, 1), red(1, 1), red(2, 2), red(3, 1), red(4, 2), red(5, 1)], [255, 1, 1, 4, 4, 255]);
        // What lies outside is cut off.
        sheet.paste([5, 3], &[[9; 3]; 4], 2, 3);
        assert_eq!(sheet.texels[3 * 6 + 5][0], 9);
    }
}
