//! What a scene needs of a kernel, computed from the scene's data.

use std::fmt;

use glam::Vec3;

use crate::scene::{AlphaMode, Environment, Material, PunctualLight, Scene};

macro_rules! features {
    ($($(#[$doc:meta])* $variant:ident = $name:literal,)*) => {
        /// A compile-time flag of the shaders. A kernel contains only what the scene needs.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr(u32)]
        pub enum Feature { $($(#[$doc])* $variant,)* }

        impl Feature {
            /// Every flag, in the order of their bits.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// The flag's name in the shaders' `@if`.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }
        }
    };
}

features! {
    /// Some mesh is placed often and has a hierarchy of its own below an upper level.
    Instances = "INSTANCES",
    /// Nodes of the hierarchies have two children instead of eight.
    BinaryNodes = "BINARY_NODES",
    /// The geometry's tables are texture pages instead of storage buffers: one is larger than a binding, or the driver reads
    /// textures faster.
    GeometryTextures = "GEOMETRY_TEXTURES",
    /// Workgroups are dealt to the adapter's threads, which would otherwise take runs of them.
    DealtGroups = "DEALT_GROUPS",
    /// Some instance has alpha mask or blend: candidates pass an alpha test.
    Alpha = "ALPHA",
    /// Some material has a texture.
    Textures = "TEXTURES",
    /// Some material has a normal map.
    NormalMaps = "NORMAL_MAPS",
    /// Some material has a texture of KHR_materials_specular.
    SpecularTextures = "SPECULAR_TEXTURES",
    /// Some material emits.
    Emission = "EMISSION",
    /// Some material that emits has alpha mask or blend: light samples count by what is there.
    EmissiveAlpha = "EMISSIVE_ALPHA",
    /// Some material that emits has a clearcoat: what it sends depends on the direction.
    CoatedEmission = "COATED_EMISSION",
    /// There are emissive triangles or punctual lights to sample.
    Lights = "LIGHTS",
    /// Some directional light has an angular size: rays that leave the scene may see it.
    SunDiscs = "SUN_DISCS",
    /// The environment is an image and is sampled; a constant one is left to BSDF sampling.
    EnvironmentImage = "ENVIRONMENT_IMAGE",
    /// Some material mirrors: metal, or a dielectric with a specular lobe.
    Specular = "SPECULAR",
    /// Some material has a clearcoat.
    Clearcoat = "CLEARCOAT",
    /// Some material has a sheen.
    Sheen = "SHEEN",
    /// Some material's highlights are stretched.
    Anisotropy = "ANISOTROPY",
    /// Some material is under a thin film.
    Iridescence = "IRIDESCENCE",
    /// Some material lets scattered light through.
    DiffuseTransmission = "DIFFUSE_TRANSMISSION",
    /// Some material transmits light.
    Transmission = "TRANSMISSION",
    /// Some material is a clear sheet, and there is light to sample behind it: shadow rays pass it.
    ClearSheets = "CLEAR_SHEETS",
    /// Some transmissive material is a solid that refracts.
    Solid = "SOLID",
    /// Some solid absorbs light.
    Absorption = "ABSORPTION",
    /// Some solid refracts red, green and blue differently.
    Dispersion = "DISPERSION",
    /// Some material is unlit.
    Unlit = "UNLIT",
    /// The film is a perspective image instead of a panorama.
    PerspectiveFilm = "PERSPECTIVE_FILM",
    /// The view is reconstructed with guides: second moments are gathered too.
    Guided = "GUIDED",
    /// For comparisons: what lights can be sampled is not left to BSDF sampling ([`SamplingTechnique::Lights`]).
    ///
    /// [`SamplingTechnique::Lights`]: crate::renderer::SamplingTechnique::Lights
    LightSamplingOnly = "LIGHT_SAMPLING_ONLY",
    /// For comparisons: what BSDF sampling can hit is not sampled as a light ([`SamplingTechnique::Bsdf`]).
    ///
    /// [`SamplingTechnique::Bsdf`]: crate::renderer::SamplingTechnique::Bsdf
    BsdfSamplingOnly = "BSDF_SAMPLING_ONLY",
}

impl Feature {
    /// True for what a kernel may contain without need: materials and lights. The others change what is bound or traced.
    pub const fn may_be_spare(self) -> bool {
        !matches!(
            self,
            Self::Instances
                | Self::BinaryNodes
                | Self::GeometryTextures
                | Self::DealtGroups
                | Self::EnvironmentImage
                | Self::PerspectiveFilm
                | Self::Guided
                | Self::LightSamplingOnly
                | Self::BsdfSamplingOnly
        )
    }
}

/// A set of [`Feature`]s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct SceneFeatures(u32);

impl SceneFeatures {
    /// The set that contains every feature that a scene or a film may need: all but those for comparisons.
    pub fn all() -> Self {
        let for_comparisons = [Feature::LightSamplingOnly, Feature::BsdfSamplingOnly];
        Feature::ALL.iter().copied().filter(|feature| !for_comparisons.contains(feature)).collect()
    }

    /// True when the set contains the feature.
    pub const fn contains(self, feature: Feature) -> bool {
        self.0 & (1 << feature as u32) != 0
    }

    /// The set with the feature added when `present`.
    #[must_use]
    pub const fn with(self, feature: Feature, present: bool) -> Self {
        if present { Self(self.0 | (1 << feature as u32)) } else { self }
    }

    /// The set with the feature left out when `absent`.
    #[must_use]
    pub const fn without(self, feature: Feature, absent: bool) -> Self {
        if absent { Self(self.0 & !(1 << feature as u32)) } else { self }
    }

    /// The features of both sets.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// What the visible part of a scene needs.
    pub fn of(scene: &Scene) -> Self {
        let used = used_materials(scene);
        let any = |test: fn(&Material) -> bool| used.iter().any(|m| test(m));
        let emits = any(Material::emits);
        let samples_light = emits || !scene.lights.is_empty() || matches!(scene.environment, Environment::Image { .. });
        Self::default()
            .with(Feature::Alpha, any(|m| m.alpha_mode != AlphaMode::Opaque))
            .with(Feature::Textures, any(|m| m.textures().next().is_some()))
            .with(
                Feature::NormalMaps,
                any(|m| m.normal_texture.is_some() || m.clearcoat > 0.0 && m.clearcoat_normal_texture.is_some()),
            )
            .with(
                Feature::SpecularTextures,
                any(|m| m.specular_texture.is_some() || m.specular_color_texture.is_some()),
            )
            .with(Feature::Emission, emits)
            .with(Feature::EmissiveAlpha, any(|m| m.emits() && m.alpha_mode != AlphaMode::Opaque))
            .with(Feature::CoatedEmission, any(|m| m.emits() && m.clearcoat > 0.0))
            .with(Feature::Lights, emits || !scene.lights.is_empty())
            .with(Feature::SunDiscs, scene.lights.iter().any(PunctualLight::is_disc))
            .with(Feature::EnvironmentImage, matches!(scene.environment, Environment::Image { .. }))
            .with(Feature::Specular, any(Material::is_specular))
            .with(Feature::Clearcoat, any(|m| m.clearcoat > 0.0))
            .with(Feature::Sheen, any(|m| m.sheen_color.max_element() > 0.0))
            .with(Feature::Anisotropy, any(|m| m.anisotropy > 0.0 && m.is_specular()))
            .with(Feature::Iridescence, any(|m| m.iridescence > 0.0))
            .with(Feature::DiffuseTransmission, any(|m| m.diffuse_transmission > 0.0))
            .with(Feature::Transmission, any(|m| m.transmission > 0.0))
            .with(Feature::ClearSheets, samples_light && any(Material::is_clear_sheet))
            .with(Feature::Solid, any(|m| m.transmission > 0.0 && m.is_solid()))
            .with(
                Feature::Absorption,
                any(|m| m.is_solid() && m.attenuation_distance.is_finite() && m.attenuation_color != Vec3::ONE),
            )
            .with(Feature::Dispersion, any(|m| m.dispersion > 0.0 && m.transmission > 0.0 && m.is_solid()))
            .with(Feature::Unlit, any(|m| m.unlit))
    }
}

impl FromIterator<Feature> for SceneFeatures {
    fn from_iter<I: IntoIterator<Item = Feature>>(features: I) -> Self {
        features.into_iter().fold(Self::default(), |set, feature| set.with(feature, true))
    }
}

impl fmt::Display for SceneFeatures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> = Feature::ALL.iter().filter(|&&x| self.contains(x)).map(|x| x.name()).collect();
        write!(f, "{}", if names.is_empty() { "plain".into() } else { names.join("+").to_lowercase() })
    }
}

fn used_materials(scene: &Scene) -> Vec<&Material> {
    let mut used = vec![false; scene.materials.len()];
    for instance in scene.instances.iter().filter(|i| i.visible) {
        if let Some(flag) = used.get_mut(instance.material as usize) {
            *flag = true;
        }
    }
    scene.materials.iter().zip(used).filter(|(_, used)| *used).map(|(material, _)| &**material).collect()
}
