//! Kernels: WESL modules composed for a [`KernelKey`] into WGSL, and the pipelines made of them.

use std::{borrow::Cow, collections::BTreeMap, fmt, sync::Arc};

use fovea_sampler::Inverse;
use thiserror::Error;
use wesl::{CompileOptions, ModulePath, VirtualResolver, Wesl};

use crate::{
    coherence::ROULETTE_CELL_BITS,
    features::{Feature, SceneFeatures},
    guide::{GUIDE_COLUMNS_PER_ROW, GUIDE_POINTS},
    scene::ContentHash,
    view::{
        colors,
        histogram::{HISTOGRAM_BINS, HISTOGRAM_BINS_PER_STOP, HISTOGRAM_PIXELS_PER_THREAD, HISTOGRAM_WORDS},
    },
};

pub mod layout;
pub mod pipelines;

/// Threads of a workgroup in every one-dimensional kernel.
pub const WORKGROUP_SIZE: u32 = 64;
/// Hands that the workgroups of one dispatch are dealt to where an adapter's threads take runs; evenest where it is a multiple of the
/// threads.
pub const GROUP_HANDS: u32 = 16;
/// Threads of a workgroup along each axis of the view kernels.
pub const TILE_SIZE: u32 = 8;
/// 32-bit words of a film pixel: R, G, B (64 bits each), samples, sum of squared luminance (96 bits).
pub const FILM_WORDS: u32 = 10;
/// Texel pages are squares of this many bits a side.
pub const TEXEL_PAGE_BITS: u32 = 11;
/// Entries of the tables of rough lobes' albedos along the angle.
pub const ALBEDO_COLUMNS: u32 = 64;
/// Entries along the roughness.
pub const ALBEDO_ROWS: u32 = 61;
/// Entries of the tables of rough glass along angle and roughness.
pub const GLASS_SIZE: u32 = 20;
/// Entries along the index.
pub const GLASS_LAYERS: u32 = 33;
/// Russian roulette starts at this bounce.
pub const FIRST_ROULETTE_BOUNCE: u32 = 4;
/// Words of a path queue before its paths: their number, workgroups for them, two unused.
pub const QUEUE_HEADER_WORDS: u32 = 4;

/// The shader modules, by their path below `shaders/`.
const MODULES: &[(&str, &str)] = &[
    ("maths", include_str!("../../../shaders/maths.wesl")),
    ("types", include_str!("../../../shaders/types.wesl")),
    ("path_bindings", include_str!("../../../shaders/path_bindings.wesl")),
    ("sampling::random", include_str!("../../../shaders/sampling/random.wesl")),
    ("sampling::distribution", include_str!("../../../shaders/sampling/distribution.wesl")),
    ("sampling::fovea", include_str!("../../../shaders/sampling/fovea.wesl")),
    ("sampling::guide", include_str!("../../../shaders/sampling/guide.wesl")),
    ("sampling::noise", include_str!("../../../shaders/sampling/noise.wesl")),
    ("film::mapping", include_str!("../../../shaders/film/mapping.wesl")),
    ("film::accumulate", include_str!("../../../shaders/film/accumulate.wesl")),
    ("scene::tables", include_str!("../../../shaders/scene/tables.wesl")),
    ("scene::traverse", include_str!("../../../shaders/scene/traverse.wesl")),
    ("scene::texture", include_str!("../../../shaders/scene/texture.wesl")),
    ("scene::alpha", include_str!("../../../shaders/scene/alpha.wesl")),
    ("scene::coverage", include_str!("../../../shaders/scene/coverage.wesl")),
    ("scene::query", include_str!("../../../shaders/scene/query.wesl")),
    ("scene::identify", include_str!("../../../shaders/scene/identify.wesl")),
    ("scene::surface", include_str!("../../../shaders/scene/surface.wesl")),
    ("shading::fresnel", include_str!("../../../shaders/shading/fresnel.wesl")),
    ("shading::layers", include_str!("../../../shaders/shading/layers.wesl")),
    ("shading::lobes", include_str!("../../../shaders/shading/lobes.wesl")),
    ("shading::local", include_str!("../../../shaders/shading/local.wesl")),
    ("shading::emission", include_str!("../../../shaders/shading/emission.wesl")),
    ("shading::microfacet", include_str!("../../../shaders/shading/microfacet.wesl")),
    ("shading::normal", include_str!("../../../shaders/shading/normal.wesl")),
    ("shading::sheen", include_str!("../../../shaders/shading/sheen.wesl")),
    ("shading::tables", include_str!("../../../shaders/shading/tables.wesl")),
    ("shading::bsdf", include_str!("../../../shaders/shading/bsdf.wesl")),
    ("light::choice", include_str!("../../../shaders/light/choice.wesl")),
    ("light::weights", include_str!("../../../shaders/light/weights.wesl")),
    ("light::environment", include_str!("../../../shaders/light/environment.wesl")),
    ("light::emitters", include_str!("../../../shaders/light/emitters.wesl")),
    ("path::invocation", include_str!("../../../shaders/path/invocation.wesl")),
    ("path::trace", include_str!("../../../shaders/path/trace.wesl")),
    ("path::shade", include_str!("../../../shaders/path/shade.wesl")),
    ("path::medium", include_str!("../../../shaders/path/medium.wesl")),
    ("path::start", include_str!("../../../shaders/path/start.wesl")),
    ("path::extend", include_str!("../../../shaders/path/extend.wesl")),
    ("wavefront::bindings", include_str!("../../../shaders/wavefront/bindings.wesl")),
    ("wavefront::queue", include_str!("../../../shaders/wavefront/queue.wesl")),
    ("wavefront::state", include_str!("../../../shaders/wavefront/state.wesl")),
    ("wavefront::start", include_str!("../../../shaders/wavefront/start.wesl")),
    ("wavefront::extend", include_str!("../../../shaders/wavefront/extend.wesl")),
    ("wavefront::shade", include_str!("../../../shaders/wavefront/shade.wesl")),
    ("path::generate", include_str!("../../../shaders/path/generate.wesl")),
    ("view::bindings", include_str!("../../../shaders/view/bindings.wesl")),
    ("view::gather", include_str!("../../../shaders/view/gather.wesl")),
    ("view::pull", include_str!("../../../shaders/view/pull.wesl")),
    ("view::guide", include_str!("../../../shaders/view/guide.wesl")),
    ("view::tie_pull", include_str!("../../../shaders/view/tie_pull.wesl")),
    ("view::tie_push", include_str!("../../../shaders/view/tie_push.wesl")),
    ("view::ties", include_str!("../../../shaders/view/ties.wesl")),
    ("view::demodulate", include_str!("../../../shaders/view/demodulate.wesl")),
    ("view::guided_pull", include_str!("../../../shaders/view/guided_pull.wesl")),
    ("view::guided_push", include_str!("../../../shaders/view/guided_push.wesl")),
    ("view::guides", include_str!("../../../shaders/view/guides.wesl")),
    ("view::stale", include_str!("../../../shaders/view/stale.wesl")),
    ("view::tint", include_str!("../../../shaders/view/tint.wesl")),
    ("view::push", include_str!("../../../shaders/view/push.wesl")),
    ("view::footprint", include_str!("../../../shaders/view/footprint.wesl")),
    ("view::error", include_str!("../../../shaders/view/error.wesl")),
    ("view::first_hit", include_str!("../../../shaders/view/first_hit.wesl")),
    ("view::sketch", include_str!("../../../shaders/view/sketch.wesl")),
    ("view::histogram", include_str!("../../../shaders/view/histogram.wesl")),
    ("view::colors", include_str!("../../../shaders/view/colors.wesl")),
    ("view::ring", include_str!("../../../shaders/view/ring.wesl")),
    ("view::inspect", include_str!("../../../shaders/view/inspect.wesl")),
    ("view::tonemap", include_str!("../../../shaders/view/tonemap.wesl")),
    ("view::present", include_str!("../../../shaders/view/present.wesl")),
    ("vr::bindings", include_str!("../../../shaders/vr/bindings.wesl")),
    ("vr::resolve", include_str!("../../../shaders/vr/resolve.wesl")),
    ("vr::pull", include_str!("../../../shaders/vr/pull.wesl")),
    ("vr::push", include_str!("../../../shaders/vr/push.wesl")),
    ("vr::eye", include_str!("../../../shaders/vr/eye.wesl")),
];

/// The kernels, each the entry module of its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kernel {
    /// Path tracing: one sample an invocation.
    Trace,
    /// Wavefront schedule: pixels and primary rays of a batch's samples.
    Start,
    /// Wavefront schedule: what the rays of the queued paths meet.
    Extend,
    /// Wavefront schedule: shading of what was met, and the next rays.
    Shade,
    /// Only the choice of the pixel and the primary ray, for the bench of ray generation.
    Generate,
    /// How noisy the film is where the samples of each cell of the unit square fall.
    Noise,
    /// What a list of rays meets.
    Query,
    /// Which part of the scene the answers to a list of rays are.
    Identify,
    /// Records to film.
    Accumulate,
    /// Film to view.
    Gather,
    /// One level of the view's pyramid from the finer one.
    Pull,
    /// One level filled from the coarser one.
    Push,
    /// Guides of a view's pixels from their first hits.
    Guide,
    /// One level of guides from the finer one, and how alike they are.
    TiePull,
    /// How alike the guides of one level are to those of the coarser one.
    TiePush,
    /// Level 0 of a guided view: light without the surfaces' colour.
    Demodulate,
    /// One level of a guided view from the finer one.
    GuidedPull,
    /// One level of a guided view finished from the coarser one.
    GuidedPush,
    /// Tone mapping to the target.
    Present,
    /// A debug view to the target.
    Inspect,
    /// How noisy the film's pixels in each pixel of the view are.
    Error,
    /// What the pixels of the view show first.
    FirstHit,
    /// What the pixels of a view show first, without materials.
    Sketch,
    /// Pixels of the view by luminance.
    Histogram,
    /// Film to the finest level of the panorama.
    PanoramaResolve,
    /// One level of the panorama from the finer one.
    PanoramaPull,
    /// One level of the panorama filled from the coarser one.
    PanoramaPush,
    /// What an eye sees of the panorama.
    Eye,
}

impl Kernel {
    /// Every kernel.
    pub const ALL: [Self; 28] = [
        Self::Trace,
        Self::Start,
        Self::Extend,
        Self::Shade,
        Self::Generate,
        Self::Noise,
        Self::Query,
        Self::Identify,
        Self::Accumulate,
        Self::Gather,
        Self::Pull,
        Self::Push,
        Self::Guide,
        Self::TiePull,
        Self::TiePush,
        Self::Demodulate,
        Self::GuidedPull,
        Self::GuidedPush,
        Self::Present,
        Self::Inspect,
        Self::Error,
        Self::FirstHit,
        Self::Sketch,
        Self::Histogram,
        Self::PanoramaResolve,
        Self::PanoramaPull,
        Self::PanoramaPush,
        Self::Eye,
    ];

    /// Module below `shaders/`, which is also the label of pipeline, timer and dump.
    pub const fn module(self) -> &'static str {
        match self {
            Self::Trace => "path::trace",
            Self::Start => "wavefront::start",
            Self::Extend => "wavefront::extend",
            Self::Shade => "wavefront::shade",
            Self::Generate => "path::generate",
            Self::Noise => "sampling::noise",
            Self::Query => "scene::query",
            Self::Identify => "scene::identify",
            Self::Accumulate => "film::accumulate",
            Self::Gather => "view::gather",
            Self::Pull => "view::pull",
            Self::Push => "view::push",
            Self::Guide => "view::guide",
            Self::TiePull => "view::tie_pull",
            Self::TiePush => "view::tie_push",
            Self::Demodulate => "view::demodulate",
            Self::GuidedPull => "view::guided_pull",
            Self::GuidedPush => "view::guided_push",
            Self::Present => "view::present",
            Self::Inspect => "view::inspect",
            Self::Error => "view::error",
            Self::FirstHit => "view::first_hit",
            Self::Sketch => "view::sketch",
            Self::Histogram => "view::histogram",
            Self::PanoramaResolve => "vr::resolve",
            Self::PanoramaPull => "vr::pull",
            Self::PanoramaPush => "vr::push",
            Self::Eye => "vr::eye",
        }
    }

    /// Whether this is a render pipeline, which draws to a target; the others compute.
    pub const fn draws(self) -> bool {
        matches!(
            self,
            Self::Present
                | Self::Inspect
                | Self::Sketch
                | Self::PanoramaResolve
                | Self::PanoramaPull
                | Self::PanoramaPush
                | Self::Eye
        )
    }

    /// Whether the scene's features are flags of this kernel.
    pub const fn reads_scene(self) -> bool {
        self.traces_paths()
            || matches!(
                self,
                Self::Start | Self::Generate | Self::Query | Self::Identify | Self::FirstHit | Self::Sketch
            )
    }

    /// Whether this extends or shades paths, by what the scene and the technique need.
    pub const fn traces_paths(self) -> bool {
        matches!(self, Self::Trace | Self::Extend | Self::Shade)
    }

    /// Whether workgroups are one after the other over rays or samples, of which some take far longer than others.
    pub const fn has_uneven_workgroups(self) -> bool {
        matches!(self, Self::Trace | Self::Query | Self::Generate)
    }

    /// Name of the entry point (the fragment entry where the kernel draws).
    pub const fn entry_point(self) -> &'static str {
        match self {
            Self::Trace => "trace",
            Self::Start => "start",
            Self::Extend => "extend_queued",
            Self::Shade => "shade_queued",
            Self::Generate => "generate",
            Self::Noise => "noise",
            Self::Query => "query",
            Self::Identify => "identify",
            Self::Accumulate => "accumulate",
            Self::Gather => "gather",
            Self::Pull => "pull",
            Self::Push => "push",
            Self::Guide => "guide",
            Self::TiePull => "tie_pull",
            Self::TiePush => "tie_push",
            Self::Demodulate => "demodulate",
            Self::GuidedPull => "guided_pull",
            Self::GuidedPush => "guided_push",
            Self::Present => "present",
            Self::Inspect => "inspect",
            Self::Error => "error",
            Self::FirstHit => "trace_first_hits",
            Self::Sketch => "sketch",
            Self::Histogram => "histogram",
            Self::PanoramaResolve => "resolve",
            Self::PanoramaPull => "pull",
            Self::PanoramaPush => "push",
            Self::Eye => "eye_picture",
        }
    }
}

/// All that decides the text of a kernel, readable in logs and dumps.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct KernelKey {
    /// Which kernel.
    pub kernel: Kernel,
    /// Compile-time flags.
    pub features: SceneFeatures,
    /// Numbers that the text contains.
    pub constants: KernelConstants,
    /// What the kernel is composed of.
    pub sources: Arc<ShaderSources>,
}

/// Numbers that a kernel's text contains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct KernelConstants {
    /// Entries of the traversal stack: enough for the depth of the hierarchies.
    pub stack_size: u32,
    /// Cells of the environment's importance grid.
    pub environment_cells: [u32; 2],
}

/// The texts that kernels are composed of: the embedded modules, and the sampler's for one radial inverse.
///
/// Tests plant faults and developers try changes by [`ShaderSources::with_module`]; everything else uses the embedded
/// texts.
#[derive(Clone)]
pub struct ShaderSources {
    sampler_name: String,
    modules: BTreeMap<String, Cow<'static, str>>,
    hash: ContentHash,
}

impl ShaderSources {
    /// The embedded modules with the sampler of an inverse.
    pub fn new(inverse: &Inverse) -> Self {
        let modules = MODULES.iter().map(|&(name, text)| (name.to_string(), Cow::Borrowed(text))).collect();
        Self { sampler_name: String::new(), modules, hash: ContentHash::default() }.with_inverse(inverse)
    }

    /// These modules with the sampler of another inverse.
    #[must_use]
    pub fn with_inverse(mut self, inverse: &Inverse) -> Self {
        self.sampler_name = inverse.name().replace(|c: char| !c.is_ascii_alphanumeric(), "-");
        let radial = fovea_sampler::wgsl::radial_module(inverse);
        self.with_module("sampler", radial + "\n" + &fovea_sampler::wgsl::sequence_module())
    }

    /// The text of a module named by its path below `shaders/`, such as `path::trace`.
    pub fn module(&self, name: &str) -> Option<&str> {
        self.modules.get(name).map(AsRef::as_ref)
    }

    /// These modules with one replaced.
    #[must_use]
    pub fn with_module(mut self, name: &str, text: String) -> Self {
        self.modules.insert(name.to_string(), Cow::Owned(text));
        let parts: Vec<&[u8]> = self.modules.iter().flat_map(|(n, t)| [n.as_bytes(), t.as_bytes()]).collect();
        self.hash = ContentHash::of(&parts);
        self
    }
}

impl PartialEq for ShaderSources {
    fn eq(&self, other: &Self) -> bool {
        self.hash == other.hash
    }
}

impl Eq for ShaderSources {}

impl std::hash::Hash for ShaderSources {
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        self.hash.hash(state);
    }
}

impl fmt::Debug for ShaderSources {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ShaderSources({}, {})", self.sampler_name, self.hash)
    }
}

impl fmt::Display for KernelKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.kernel.module().replace("::", "-");
        if self.kernel.reads_scene() {
            write!(f, "{name}.{}.{}.stack{}", self.features, self.sources.sampler_name, self.constants.stack_size)
        } else {
            write!(f, "{name}")
        }
    }
}

/// A shader that does not compose: a bug in this crate or in a hand-made module.
#[derive(Debug, Error)]
#[error("kernel {kernel} does not compose: {cause}")]
pub struct ComposeError {
    kernel: String,
    cause: String,
}

/// Composes the WGSL text of a kernel. Declarations that it does not use are stripped.
///
/// # Errors
/// When a module does not parse or a flag is unknown.
pub fn compose(key: &KernelKey) -> Result<String, ComposeError> {
    let fail = |cause: String| ComposeError { kernel: key.to_string(), cause };
    let path = |module: &str| -> Result<ModulePath, ComposeError> {
        format!("package::{module}").parse().map_err(|error| fail(format!("{error}")))
    };
    let mut resolver = VirtualResolver::new();
    for (module, text) in &key.sources.modules {
        resolver.add_module(path(module)?, Cow::Borrowed(text));
    }
    resolver.add_module(path("constants")?, Cow::Owned(constants_module(&key.constants)));
    let mut wesl = Wesl::new_barebones().set_custom_resolver(resolver);
    wesl.set_options(CompileOptions { validate: false, lazy: true, strip: true, ..Default::default() });
    wesl.set_missing_feature_behavior(wesl::Feature::Error);
    wesl.set_custom_mangler(wesl::EscapeMangler);
    for &feature in Feature::ALL {
        wesl.set_feature(feature.name(), key.features.contains(feature));
    }
    let compiled = wesl.compile(&path(key.kernel.module())?).map_err(|error| fail(format!("{error}")))?;
    Ok(compiled.to_string())
}

fn constants_module(c: &KernelConstants) -> String {
    let numbers = [
        ("WORKGROUP_SIZE", WORKGROUP_SIZE),
        ("TILE_SIZE", TILE_SIZE),
        ("GROUP_HANDS", GROUP_HANDS),
        ("FILM_WORDS", FILM_WORDS),
        ("TEXEL_PAGE_BITS", TEXEL_PAGE_BITS),
        ("ALBEDO_COLUMNS", ALBEDO_COLUMNS),
        ("ALBEDO_ROWS", ALBEDO_ROWS),
        ("GLASS_SIZE", GLASS_SIZE),
        ("GLASS_LAYERS", GLASS_LAYERS),
        ("FIRST_ROULETTE_BOUNCE", FIRST_ROULETTE_BOUNCE),
        ("ROULETTE_COLUMN_BITS", ROULETTE_CELL_BITS[0]),
        ("ROULETTE_ROW_BITS", ROULETTE_CELL_BITS[1]),
        ("QUEUE_HEADER_WORDS", QUEUE_HEADER_WORDS),
        ("GUIDE_COLUMNS_PER_ROW", GUIDE_COLUMNS_PER_ROW),
        ("GUIDE_POINTS", GUIDE_POINTS),
        ("HISTOGRAM_BINS", HISTOGRAM_BINS as u32),
        ("HISTOGRAM_BINS_PER_STOP", HISTOGRAM_BINS_PER_STOP as u32),
        ("HISTOGRAM_WORDS", HISTOGRAM_WORDS as u32),
        ("HISTOGRAM_PIXELS_PER_THREAD", HISTOGRAM_PIXELS_PER_THREAD),
        ("STACK_SIZE", c.stack_size.max(1)),
        ("ENVIRONMENT_CELLS_X", c.environment_cells[0].max(1)),
        ("ENVIRONMENT_CELLS_Y", c.environment_cells[1].max(1)),
    ];
    let numbers: String = numbers.iter().map(|(name, value)| format!("const {name}: u32 = {value}u;\n")).collect();
    numbers + &colors::constants()
}
