//! Options that are one of a few names.

use clap::ValueEnum;
use tracer::gpu::Gpu;
use tracer::renderer::Schedule;

/// How samples are distributed over the film.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Mode {
    /// Omnidirectional: uniform over the film's pixels
    Od,
    /// Viewport: uniform over the image plane of the view
    Vp,
    /// Viewport: uniform over the film's pixels inside the view
    VpRegion,
    /// Foveated: by visual acuity about the gaze
    Fv,
}

/// Whether foveated samples are clipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Clip {
    /// Everywhere by the model
    None,
    /// 95 % inside the view and a margin, 5 % by the unclipped model
    View,
}

/// Where eccentricity is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum EccentricityAt {
    /// Angles in the scene
    Scene,
    /// Angles at the eye before a flat screen
    Eye,
}

/// What the film's centre points at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Orient {
    /// The world's -Z, +Y up
    World,
    /// The camera's axis, with its roll
    Camera,
}

/// The point set that samples are drawn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Sequence {
    /// Owen-scrambled Sobol points
    Sobol,
    /// Independent points
    Independent,
}

/// How kernels share the work of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ScheduleChoice {
    /// What measured faster on most adapters of this kind
    Auto,
    /// One kernel traces each path to its end
    Megakernel,
    /// Paths advance together, a segment a round: small kernels, queues between them
    Wavefront,
}

impl ScheduleChoice {
    /// What is meant on an adapter.
    pub fn on(self, gpu: &Gpu) -> Schedule {
        match self {
            Self::Auto => Schedule::preferred_on(gpu),
            Self::Megakernel => Schedule::Megakernel,
            Self::Wavefront => Schedule::Wavefront,
        }
    }
}

/// Visual acuity models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, ValueEnum)]
pub enum Model {
    /// Reddy 2001
    Reddy,
    /// The square of Reddy's: two-dimensional Nyquist density
    ReddySquared,
    /// Linear minimum angle of resolution, Guenter 2012
    LinearMar,
    /// Linear fall-off, Vaidyanathan 2014, Stengel 2016, Weier 2016
    LinearFalloff,
    /// Static disc, Pohl 2016
    StaticDisc,
    /// Geisler and Perry 1998
    GeislerPerry,
}

impl Model {
    /// Every model with its name on screen.
    pub const LIST: [(Self, &'static str); 6] = [
        (Self::Reddy, "Reddy 2001"),
        (Self::ReddySquared, "Reddy squared"),
        (Self::LinearMar, "Linear MAR"),
        (Self::LinearFalloff, "Linear fall-off"),
        (Self::StaticDisc, "Static disc"),
        (Self::GeislerPerry, "Geisler & Perry"),
    ];

    /// The sampler crate's name of it.
    pub fn sampler_name(self) -> &'static str {
        match self {
            Self::Reddy => "reddy",
            Self::ReddySquared => "reddy-squared",
            Self::LinearMar => "linear-mar",
            Self::LinearFalloff => "linear-falloff",
            Self::StaticDisc => "static-disc",
            Self::GeislerPerry => "geisler-perry",
        }
    }
}

/// What the density is a density of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Geometry {
    /// Per solid angle
    Sphere,
    /// Azimuthal equidistant about the gaze, as published
    Plane,
}

/// Forms of the radius' inverse distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum InverseForm {
    /// The published polynomial (planar only)
    Eq6,
    /// Minimax polynomial of degree 5
    Poly5,
    /// Minimax rational
    Rational,
    /// Cubic Hermite table
    Table,
}

/// From radiance to display values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ToneMapping {
    /// AgX: strong lights fade to white
    Agx,
    /// Khronos PBR Neutral: base colours stay what they are
    PbrNeutral,
    /// Clipped at 1
    Linear,
    /// A colour for each stop of luminance about middle grey
    FalseColor,
}

/// Whether something is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Switch {
    /// It is
    On,
    /// It is not
    Off,
}

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Show {
    /// The picture
    Picture,
    /// Samples per pixel
    Density,
    /// Standard error of the film's pixels over their brightness
    Noise,
    /// Base colour of what is seen first
    Albedo,
    /// Its shading normal
    Normals,
    /// Its distance
    Depth,
    /// Nodes and triangles that the ray to it visits
    Steps,
}
