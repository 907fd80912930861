//! The parameters of a material that can be edited, as a table: name, range, where the value lives.

use std::ops::RangeInclusive;

use glam::Vec3;
use tracer::scene::Material;

/// A number or a colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// One number.
    Number(f32),
    /// Linear Rec. 709; may exceed 1 for emission.
    Color(Vec3),
}

/// A material's parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum MaterialParameter {
    /// Base colour.
    BaseColor,
    /// 0: dielectric, 1: metal.
    Metallic,
    /// Perceptual roughness.
    Roughness,
    /// Emitted radiance.
    Emission,
    /// Index of refraction.
    Ior,
    /// Strength of the dielectric's mirror reflection.
    Specular,
    /// Share of the light that passes.
    Transmission,
    /// 0: thin sheet, above: solid glass. Metres.
    Thickness,
    /// What is left of white after the attenuation distance.
    AttenuationColor,
    /// Share of the diffuse light that passes.
    DiffuseTransmission,
    /// Strength of the coat.
    Clearcoat,
    /// Its perceptual roughness.
    ClearcoatRoughness,
    /// Colour of the sheen, black: none.
    SheenColor,
    /// Its perceptual roughness.
    SheenRoughness,
    /// How much longer highlights are along one direction.
    Anisotropy,
    /// Strength of the thin film.
    Iridescence,
    /// Strength of the normal map.
    NormalScale,
}

use MaterialParameter as P;

impl MaterialParameter {
    /// All of them, in the order in which they are shown.
    pub const ALL: [Self; 17] = [
        P::BaseColor,
        P::Metallic,
        P::Roughness,
        P::Emission,
        P::Ior,
        P::Specular,
        P::Transmission,
        P::Thickness,
        P::AttenuationColor,
        P::DiffuseTransmission,
        P::Clearcoat,
        P::ClearcoatRoughness,
        P::SheenColor,
        P::SheenRoughness,
        P::Anisotropy,
        P::Iridescence,
        P::NormalScale,
    ];

    /// What a person calls it.
    pub fn name(self) -> &'static str {
        match self {
            P::BaseColor => "Base colour",
            P::Metallic => "Metallic",
            P::Roughness => "Roughness",
            P::Emission => "Emission",
            P::Ior => "Index of refraction",
            P::Specular => "Specular",
            P::Transmission => "Transmission",
            P::Thickness => "Thickness",
            P::AttenuationColor => "Glass colour",
            P::DiffuseTransmission => "Translucency",
            P::Clearcoat => "Clearcoat",
            P::ClearcoatRoughness => "Coat roughness",
            P::SheenColor => "Sheen",
            P::SheenRoughness => "Sheen roughness",
            P::Anisotropy => "Anisotropy",
            P::Iridescence => "Iridescence",
            P::NormalScale => "Normal map",
        }
    }

    /// What a file of edits calls it.
    pub fn key(self) -> &'static str {
        match self {
            P::BaseColor => "base_color",
            P::Metallic => "metallic",
            P::Roughness => "roughness",
            P::Emission => "emission",
            P::Ior => "ior",
            P::Specular => "specular",
            P::Transmission => "transmission",
            P::Thickness => "thickness_m",
            P::AttenuationColor => "attenuation_color",
            P::DiffuseTransmission => "diffuse_transmission",
            P::Clearcoat => "clearcoat",
            P::ClearcoatRoughness => "clearcoat_roughness",
            P::SheenColor => "sheen_color",
            P::SheenRoughness => "sheen_roughness",
            P::Anisotropy => "anisotropy",
            P::Iridescence => "iridescence",
            P::NormalScale => "normal_scale",
        }
    }

    /// What values make sense, for each channel of a colour too.
    pub fn range(self) -> RangeInclusive<f32> {
        match self {
            P::Emission => 0.0..=1e6,
            P::Ior => 1.0..=3.0,
            P::Thickness => 0.0..=100.0,
            P::NormalScale => 0.0..=4.0,
            _ => 0.0..=1.0,
        }
    }

    /// A material's value.
    pub fn get(self, material: &Material) -> Value {
        let number = Value::Number;
        match self {
            P::BaseColor => Value::Color(material.base_color.truncate()),
            P::Metallic => number(material.metallic),
            P::Roughness => number(material.roughness),
            P::Emission => Value::Color(material.emission),
            P::Ior => number(material.ior),
            P::Specular => number(material.specular),
            P::Transmission => number(material.transmission),
            P::Thickness => number(material.thickness),
            P::AttenuationColor => Value::Color(material.attenuation_color),
            P::DiffuseTransmission => number(material.diffuse_transmission),
            P::Clearcoat => number(material.clearcoat),
            P::ClearcoatRoughness => number(material.clearcoat_roughness),
            P::SheenColor => Value::Color(material.sheen_color),
            P::SheenRoughness => number(material.sheen_roughness),
            P::Anisotropy => number(material.anisotropy),
            P::Iridescence => number(material.iridescence),
            P::NormalScale => number(material.normal_scale),
        }
    }

    /// Sets a material's value, moved into the range. A number for a colour is a grey; a colour for a number does nothing.
    pub fn set(self, material: &mut Material, value: Value) {
        let (low, high) = (*self.range().start(), *self.range().end());
        let clamp = |x: f32| if x.is_finite() { x.clamp(low, high) } else { low };
        let color = match value {
            Value::Number(x) => Vec3::splat(clamp(x)),
            Value::Color(color) => Vec3::from_array(color.to_array().map(clamp)),
        };
        let color_slot = match self {
            P::BaseColor => {
                material.base_color = color.extend(material.base_color.w);
                return;
            }
            P::Emission => Some(&mut material.emission),
            P::AttenuationColor => Some(&mut material.attenuation_color),
            P::SheenColor => Some(&mut material.sheen_color),
            _ => None,
        };
        if let Some(slot) = color_slot {
            *slot = color;
            return;
        }
        let Value::Number(x) = value else { return };
        let slot = match self {
            P::Metallic => &mut material.metallic,
            P::Roughness => &mut material.roughness,
            P::Ior => &mut material.ior,
            P::Specular => &mut material.specular,
            P::Transmission => &mut material.transmission,
            P::Thickness => &mut material.thickness,
            P::DiffuseTransmission => &mut material.diffuse_transmission,
            P::Clearcoat => &mut material.clearcoat,
            P::ClearcoatRoughness => &mut material.clearcoat_roughness,
            P::SheenRoughness => &mut material.sheen_roughness,
            P::Anisotropy => &mut material.anisotropy,
            P::Iridescence => &mut material.iridescence,
            P::NormalScale => &mut material.normal_scale,
            P::BaseColor | P::Emission | P::AttenuationColor | P::SheenColor => return,
        };
        *slot = clamp(x);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_set_is_found_and_nothing_else_changes() {
        for parameter in MaterialParameter::ALL {
            let mut material = Material::default();
            let value = match parameter.get(&material) {
                Value::Number(_) => Value::Number(0.5 * (parameter.range().start() + parameter.range().end())),
                Value::Color(_) => Value::Color(Vec3::new(0.25, 0.5, 0.75)),
            };
            parameter.set(&mut material, value);
            assert_eq!(parameter.get(&material), value, "{parameter:?}");
            let others = MaterialParameter::ALL.into_iter().filter(|other| *other != parameter);
            for other in others {
                assert_eq!(other.get(&material), other.get(&Material::default()), "{parameter:?} set {other:?}");
            }
        }
    }

    #[test]
    fn nonsense_is_moved_into_the_range() {
        for parameter in MaterialParameter::ALL {
            for nonsense in [f32::NAN, f32::INFINITY, -7.0, 1e30] {
                let mut material = Material::default();
                parameter.set(&mut material, Value::Number(nonsense));
                parameter.set(&mut material, Value::Color(Vec3::splat(nonsense)));
                let channels = match parameter.get(&material) {
                    Value::Number(x) => vec![x],
                    Value::Color(color) => color.to_array().to_vec(),
                };
                assert!(channels.iter().all(|x| parameter.range().contains(x)), "{parameter:?} {channels:?}");
            }
        }
    }

    #[test]
    fn names_and_keys_are_unique() {
        let unique = |texts: Vec<&str>| texts.iter().collect::<std::collections::BTreeSet<_>>().len() == texts.len();
        assert!(unique(MaterialParameter::ALL.map(MaterialParameter::name).to_vec()));
        assert!(unique(MaterialParameter::ALL.map(MaterialParameter::key).to_vec()));
    }
}
