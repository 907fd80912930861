//! Views of what is known about the picture's pixels, instead of their colour. Twin: `shaders/view/inspect.wesl`.

/// What is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DebugView {
    /// The picture.
    #[default]
    Beauty,
    /// Samples per pixel of the view.
    SampleDensity,
    /// Root mean square of the standard errors of the film's pixels in a pixel of the view, over their mean luminance. Black
    /// where no film pixel has two samples, or all is black.
    Error,
    /// What still shows the picture from before the last change, over a grey picture.
    Stale,
    /// Base colour of what the pixel's centre shows first.
    Albedo,
    /// Its shading normal in the world, on the side of the viewer: X, Y, Z of -1 to 1 as red, green, blue.
    Normal,
    /// Its distance.
    Depth,
    /// Nodes and triangles that the ray to it visited.
    TraversalSteps,
}

impl DebugView {
    /// Whether [`Renderer::trace_first_hits`](crate::renderer::Renderer::trace_first_hits) finds what it shows.
    pub const fn shows_first_hits(self) -> bool {
        matches!(self, Self::Albedo | Self::Normal | Self::Depth | Self::TraversalSteps)
    }
}

/// What the ends of the [ramp](super::colors::RAMP) stand for in a debug view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DebugScale {
    /// The darkest colour's value.
    pub low: f32,
    /// The lightest colour's value, above `low`.
    pub high: f32,
    /// Equal steps of the ramp are equal ratios; `low` is then above 0.
    pub is_logarithmic: bool,
}

impl DebugScale {
    /// Samples a pixel.
    pub(super) const DENSITY: Self = Self { low: 1.0 / 16.0, high: 4096.0, is_logarithmic: true };
    /// Relative standard error.
    pub(super) const ERROR: Self = Self { low: 1e-3, high: 1.0, is_logarithmic: true };

    /// Place of a value on the ramp, 0..1.
    pub fn place(&self, value: f32) -> f32 {
        let place = if self.is_logarithmic {
            (value / self.low).log2() / (self.high / self.low).log2()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        place.clamp(0.0, 1.0)
    }

    /// The value at a place of the ramp.
    pub fn value(&self, place: f32) -> f32 {
        if self.is_logarithmic {
            self.low * (self.high / self.low).powf(place)
        } else {
            self.low + (self.high - self.low) * place
        }
    }
}
