//! The film as a value: taken from the device, and put into another renderer that goes on from there.

use thiserror::Error;

use super::{RenderError, RenderStatistics, Renderer};
use crate::{
    film::{DamagedFilm, FilmDifference, FilmHeader, FilmSnapshot, SampleRange, joined},
    kernels::layout::FilmCounters,
};

/// Why a renderer does not take a film over; its own film is then as it was.
#[derive(Debug, Error)]
pub enum RestoreError {
    /// The snapshot is of another picture.
    #[error("the film does not belong to this renderer; {0}")]
    Differs(#[from] FilmDifference),
    /// None of the snapshot's samples are of the renderer's seed, so the sequence cannot go on.
    #[error("the film does not belong to this renderer; seed: {found} instead of {expected}")]
    OtherSeed {
        /// The renderer's.
        expected: u32,
        /// The snapshot's, or several.
        found: String,
    },
    /// The snapshot is no film.
    #[error(transparent)]
    Damaged(#[from] DamagedFilm),
    /// No scene is set, so nothing says what the film is to show.
    #[error("no scene to go on with")]
    NoScene,
}

impl Renderer {
    /// Reads the film back, waiting for the device.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn snapshot(&self) -> Result<FilmSnapshot, RenderError> {
        Ok(FilmSnapshot { header: self.film_header()?, words: self.film.read(&self.gpu)? })
    }

    /// What the film is of, with the samples that are in it; waits for the device.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn film_header(&self) -> Result<FilmHeader, RenderError> {
        Ok(FilmHeader { statistics: self.statistics()?, ranges: self.ranges(), ..self.empty_header() })
    }

    /// Puts the sums of a snapshot into the film and goes on after its last sample of this renderer's seed: the film then
    /// becomes the same, bit by bit, as the one that the snapshot was taken from. Scene and pose must be set before.
    ///
    /// # Errors
    /// When the snapshot's film differs in size, mapping, scene, pose, bounces, sequence or seed; the error names which.
    pub fn restore(&mut self, snapshot: &FilmSnapshot) -> Result<(), RestoreError> {
        if self.scene.is_none() {
            return Err(RestoreError::NoScene);
        }
        self.empty_header().matches(&snapshot.header)?;
        snapshot.check()?;
        let (seed, ranges) = (self.options.seed, &snapshot.header.ranges);
        let own = ranges.iter().filter(|range| range.seed == seed);
        let next = own.map(SampleRange::end).max();
        if next.is_none() && !ranges.is_empty() {
            let mut seeds: Vec<String> = ranges.iter().map(|range| range.seed.to_string()).collect();
            seeds.dedup();
            return Err(RestoreError::OtherSeed { expected: seed, found: seeds.join(", ") });
        }
        let counts = snapshot.header.statistics;
        let halves = |count: u64| (count as u32, (count >> 32) as u32);
        let (segments_low, segments_high) = halves(counts.segments);
        let (shadow_rays_low, shadow_rays_high) = halves(counts.shadow_rays);
        let counters = FilmCounters {
            segments_low,
            segments_high,
            shadow_rays_low,
            shadow_rays_high,
            non_finite: counts.non_finite,
            clamped: counts.clamped,
        };
        self.film.write(&self.gpu, &snapshot.words, counters);
        self.samples = snapshot.header.samples();
        self.next_sample = next.unwrap_or(self.first_sample);
        self.restored.clone_from(ranges);
        self.adaptive.steered = counts.steered;
        self.drop_guide();
        Ok(())
    }

    /// What is in the film, counted; waiting for the device.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn statistics(&self) -> Result<RenderStatistics, RenderError> {
        let c = self.film.read_counters(&self.gpu)?;
        Ok(RenderStatistics {
            samples: self.samples,
            segments: u64::from(c.segments_low) | u64::from(c.segments_high) << 32,
            shadow_rays: u64::from(c.shadow_rays_low) | u64::from(c.shadow_rays_high) << 32,
            non_finite: c.non_finite,
            clamped: c.clamped,
            steered: self.adaptive.steered,
        })
    }

    /// The linear radiance of the view that was presented last, row by row, with its size in pixels; empty before. The
    /// fourth value of a pixel is the weight, in samples, that it was found with; in the debug view of what is stale it is the
    /// share of the old picture. Waits for the device.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn presented_radiance(&self) -> Result<([u32; 2], Vec<[f32; 4]>), RenderError> {
        Ok(self.view.finished(&self.gpu)?)
    }

    /// Which samples are in the film.
    fn ranges(&self) -> Vec<SampleRange> {
        let before: u64 = self.restored.iter().map(|range| range.count).sum();
        let count = self.samples - before;
        let traced = SampleRange { seed: self.options.seed, first: self.next_sample - count, count };
        joined(self.restored.iter().copied().chain([traced]).collect())
    }

    /// What an empty film is of.
    fn empty_header(&self) -> FilmHeader {
        let (radiance_scale, luminance_scale) = self.film_scales();
        FilmHeader {
            options: self.options.film,
            pose: self.pose,
            scene: self.scene_hash,
            max_bounces: self.options.max_bounces,
            sequence: self.options.sequence,
            radiance_scale: f64::from(radiance_scale),
            luminance_scale: f64::from(luminance_scale),
            ranges: Vec::new(),
            statistics: RenderStatistics::default(),
        }
    }
}
