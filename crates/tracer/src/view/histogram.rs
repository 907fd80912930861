//! How bright the pixels of a view are. Twin: `shaders/view/histogram.wesl`.

/// Bins of a histogram.
pub const HISTOGRAM_BINS: usize = 80;
/// Bins a stop.
pub const HISTOGRAM_BINS_PER_STOP: usize = 4;
/// Counts that the kernel makes: the bins, black pixels, clipped pixels.
pub(crate) const HISTOGRAM_WORDS: usize = HISTOGRAM_BINS + 2;
/// Pixels that one thread counts.
pub(crate) const HISTOGRAM_PIXELS_PER_THREAD: u32 = 32;

/// Pixels of a view by the luminance of their radiance after exposure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Histogram {
    /// Pixels in each quarter of a stop, from ten stops below middle grey to ten above; the ends also hold what lies beyond.
    pub bins: [u32; HISTOGRAM_BINS],
    /// Pixels that the tone map shows as black: all channels round to 0 of 255.
    pub black: u32,
    /// Pixels that the tone map clips: some channel rounds to 255 of 255. In false colour, which shows neither, black and
    /// clipped are those of the linear tone map.
    pub clipped: u32,
    /// All pixels.
    pub pixels: u32,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { bins: [0; HISTOGRAM_BINS], black: 0, clipped: 0, pixels: 0 }
    }
}

impl Histogram {
    pub(crate) fn from_words(words: &[u32], pixels: u32) -> Self {
        let mut histogram = Self { pixels, ..Self::default() };
        for (bin, count) in histogram.bins.iter_mut().zip(words) {
            *bin = *count;
        }
        let rest = |index: usize| words.get(HISTOGRAM_BINS + index).copied().unwrap_or(0);
        (histogram.black, histogram.clipped) = (rest(0), rest(1));
        histogram
    }

    /// Stops about middle grey at which a bin begins.
    pub fn stops_at(bin: usize) -> f32 {
        (bin as f32 - HISTOGRAM_BINS as f32 / 2.0) / HISTOGRAM_BINS_PER_STOP as f32
    }

    /// Part of all pixels that is shown as black, 0..1.
    pub fn black_share(&self) -> f32 {
        self.share(self.black)
    }

    /// Part of all pixels that is clipped, 0..1.
    pub fn clipped_share(&self) -> f32 {
        self.share(self.clipped)
    }

    fn share(&self, count: u32) -> f32 {
        count as f32 / self.pixels.max(1) as f32
    }
}
