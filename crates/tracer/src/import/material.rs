//! glTF materials and their KHR_materials extensions.

use glam::{Vec3, Vec4};

use super::document::Document;
use super::error::Fault;
use super::json::Object;
use super::report::{ImportWarning, ignore};
use super::texture::{TextureTable, TextureUse};
use crate::scene::{AlphaMode, Material, TextureRef};

/// Reflectance at normal incidence of a dielectric of index 1.5; KHR_materials_specular scales it.
const F0_DIELECTRIC: f32 = 0.04;

/// Stands for KHR_materials_ior's special value 0, which means F0 = 1: here F0 = 0.9996, and refraction stays finite.
const INFINITE_IOR: f32 = 1e4;

/// Largest radiance, and intensity of a light without extent: what a film can hold.
pub(super) const LARGEST_RADIANCE: f64 = 1e18;

/// Reads one material; its textures are added to `table`.
pub(super) fn parse(
    document: &Document<'_>,
    index: usize,
    table: &mut TextureTable,
    warnings: &mut Vec<ImportWarning>,
) -> Result<Material, Fault> {
    let object = document.materials[index].clone();
    let mut reader = Reader { document, table, warnings, place: object.place.clone() };
    let mut material = Material { name: object.name().to_owned(), ..Material::default() };
    reader.core(&object, &mut material)?;
    if let Some(o) = object.object("pbrMetallicRoughness")? {
        reader.metallic_roughness(&o, &mut material)?;
    }
    if let Some(o) = object.extension("KHR_materials_pbrSpecularGlossiness")? {
        reader.specular_glossiness(&o, &mut material)?;
    }
    reader.dielectric(&object, &mut material)?;
    reader.transmission(&object, &mut material)?;
    reader.layers(&object, &mut material)?;
    reader.thin_film(&object, &mut material)?;
    Ok(material)
}

struct Reader<'r, 'd> {
    document: &'r Document<'d>,
    table: &'r mut TextureTable,
    warnings: &'r mut Vec<ImportWarning>,
    place: String,
}

impl Reader<'_, '_> {
    fn core(&mut self, o: &Object<'_>, m: &mut Material) -> Result<(), Fault> {
        m.normal_texture = self.texture(o, "normalTexture", TextureUse::Normal)?;
        m.normal_scale = scalar(o.object("normalTexture")?.as_ref(), "scale", 1.0)?;
        m.emission = self.color(o, "emissiveFactor", Vec3::ZERO)?;
        m.emissive_texture = self.texture(o, "emissiveTexture", TextureUse::Emission)?;
        if m.emissive_texture.is_none() && o.map.contains_key("emissiveTexture") {
            // A texture that was left out must not light the room.
            m.emission = Vec3::ZERO;
        }
        let strength = match o.extension("KHR_materials_emissive_strength")? {
            Some(strength) => self.at_least(&strength, "emissiveStrength", 1.0, 0.0)?,
            None => 1.0,
        };
        let radiance = (m.emission.as_dvec3() * f64::from(strength)).to_array();
        m.emission = Vec3::from_array(radiance.map(|c| self.clamped(o, "emissiveFactor", c, 0.0, LARGEST_RADIANCE)));
        m.alpha_mode = match o.string("alphaMode")? {
            Some("MASK") => AlphaMode::Mask { cutoff: self.at_least(o, "alphaCutoff", 0.5, 0.0)? },
            Some("BLEND") => AlphaMode::Blend,
            None | Some("OPAQUE") => AlphaMode::Opaque,
            Some(other) => {
                let value = super::error::one_line(other);
                self.warnings.push(ImportWarning::UnknownKind { place: self.place.clone(), kind: "alpha mode", value });
                AlphaMode::Opaque
            }
        };
        m.double_sided = o.bool_or("doubleSided", false)?;
        m.unlit = o.extension("KHR_materials_unlit")?.is_some();
        Ok(())
    }

    fn metallic_roughness(&mut self, o: &Object<'_>, m: &mut Material) -> Result<(), Fault> {
        m.base_color = self.rgba(o, "baseColorFactor")?;
        m.base_color_texture = self.texture(o, "baseColorTexture", TextureUse::Color)?;
        m.metallic = self.unit(o, "metallicFactor", 1.0)?;
        m.roughness = self.unit(o, "roughnessFactor", 1.0)?;
        m.metallic_roughness_texture = self.texture(o, "metallicRoughnessTexture", TextureUse::Data)?;
        Ok(())
    }

    /// An exact conversion: a dielectric of the diffuse colour whose F0 is the specular one. KHR_materials_specular gives
    /// F0 = min(0.04 specularColor, 1), and both models weigh the diffuse part by 1 - max(F0).
    fn specular_glossiness(&mut self, o: &Object<'_>, m: &mut Material) -> Result<(), Fault> {
        m.base_color = self.rgba(o, "diffuseFactor")?;
        m.base_color_texture = self.texture(o, "diffuseTexture", TextureUse::Color)?;
        m.metallic = 0.0;
        m.specular_color = self.color(o, "specularFactor", Vec3::ONE)? / F0_DIELECTRIC;
        let glossiness = self.unit(o, "glossinessFactor", 1.0)?;
        m.roughness = 1.0 - glossiness;
        m.metallic_roughness_texture = None;
        m.specular_color_texture = self.texture(o, "specularGlossinessTexture", TextureUse::Color)?;
        if m.specular_color_texture.is_some() {
            let glossiness_bits = glossiness.to_bits();
            let roughness = TextureUse::RoughnessFromGlossiness { glossiness_bits };
            m.metallic_roughness_texture = self.texture(o, "specularGlossinessTexture", roughness)?;
            m.roughness = 1.0;
        }
        self.warnings.push(ImportWarning::SpecularGlossinessConverted { place: self.place.clone() });
        Ok(())
    }

    fn dielectric(&mut self, object: &Object<'_>, m: &mut Material) -> Result<(), Fault> {
        if let Some(o) = object.extension("KHR_materials_ior")? {
            let ior = scalar(Some(&o), "ior", 1.5)?;
            m.ior = if ior == 0.0 { INFINITE_IOR } else { self.at_least(&o, "ior", 1.5, 1.0)? };
        }
        if let Some(o) = object.extension("KHR_materials_specular")? {
            m.specular = self.unit(&o, "specularFactor", 1.0)?;
            m.specular_texture = self.texture(&o, "specularTexture", TextureUse::Color)?;
            m.specular_color = self.color(&o, "specularColorFactor", Vec3::ONE)?;
            m.specular_color_texture = self.texture(&o, "specularColorTexture", TextureUse::Color)?;
        }
        if let Some(o) = object.extension("KHR_materials_dispersion")? {
            m.dispersion = self.at_least(&o, "dispersion", 0.0, 0.0)?;
        }
        Ok(())
    }

    fn transmission(&mut self, object: &Object<'_>, m: &mut Material) -> Result<(), Fault> {
        if let Some(o) = object.extension("KHR_materials_transmission")? {
            m.transmission = self.unit(&o, "transmissionFactor", 0.0)?;
            m.transmission_texture = self.texture(&o, "transmissionTexture", TextureUse::Data)?;
        }
        if let Some(o) = object.extension("KHR_materials_volume")? {
            m.thickness = self.at_least(&o, "thicknessFactor", 0.0, 0.0)?;
            if m.thickness > 0.0 && o.map.contains_key("thicknessTexture") {
                ignore(self.warnings, "thicknessTexture", "a solid is as thick as its mesh");
            }
            let distance = scalar(Some(&o), "attenuationDistance", f32::INFINITY)?;
            // 0 is not allowed by the specification and some writers mean "none" by it.
            m.attenuation_distance = if distance > 0.0 { distance } else { f32::INFINITY };
            m.attenuation_color = self.unit_color(&o, "attenuationColor")?;
        }
        if let Some(o) = object.extension("KHR_materials_diffuse_transmission")? {
            m.diffuse_transmission = self.unit(&o, "diffuseTransmissionFactor", 0.0)?;
            m.diffuse_transmission_texture = self.texture(&o, "diffuseTransmissionTexture", TextureUse::Color)?;
            m.diffuse_transmission_color = self.unit_color(&o, "diffuseTransmissionColorFactor")?;
            m.diffuse_transmission_color_texture =
                self.texture(&o, "diffuseTransmissionColorTexture", TextureUse::Color)?;
        }
        Ok(())
    }

    fn layers(&mut self, object: &Object<'_>, m: &mut Material) -> Result<(), Fault> {
        if let Some(o) = object.extension("KHR_materials_clearcoat")? {
            m.clearcoat = self.unit(&o, "clearcoatFactor", 0.0)?;
            m.clearcoat_texture = self.texture(&o, "clearcoatTexture", TextureUse::Data)?;
            m.clearcoat_roughness = self.unit(&o, "clearcoatRoughnessFactor", 0.0)?;
            m.clearcoat_roughness_texture = self.texture(&o, "clearcoatRoughnessTexture", TextureUse::Data)?;
            m.clearcoat_normal_texture = self.texture(&o, "clearcoatNormalTexture", TextureUse::Normal)?;
            m.clearcoat_normal_scale = scalar(o.object("clearcoatNormalTexture")?.as_ref(), "scale", 1.0)?;
        }
        if let Some(o) = object.extension("KHR_materials_sheen")? {
            m.sheen_color = self.color(&o, "sheenColorFactor", Vec3::ZERO)?;
            m.sheen_color_texture = self.texture(&o, "sheenColorTexture", TextureUse::Color)?;
            m.sheen_roughness = self.unit(&o, "sheenRoughnessFactor", 0.0)?;
            m.sheen_roughness_texture = self.texture(&o, "sheenRoughnessTexture", TextureUse::Color)?;
        }
        Ok(())
    }

    fn thin_film(&mut self, object: &Object<'_>, m: &mut Material) -> Result<(), Fault> {
        if let Some(o) = object.extension("KHR_materials_anisotropy")? {
            m.anisotropy = self.unit(&o, "anisotropyStrength", 0.0)?;
            m.anisotropy_rotation = scalar(Some(&o), "anisotropyRotation", 0.0)?;
            m.anisotropy_texture = self.texture(&o, "anisotropyTexture", TextureUse::Data)?;
        }
        if let Some(o) = object.extension("KHR_materials_iridescence")? {
            m.iridescence = self.unit(&o, "iridescenceFactor", 0.0)?;
            m.iridescence_texture = self.texture(&o, "iridescenceTexture", TextureUse::Data)?;
            m.iridescence_ior = self.at_least(&o, "iridescenceIor", 1.3, 1.0)?;
            m.iridescence_thickness_nm = [
                self.at_least(&o, "iridescenceThicknessMinimum", 100.0, 0.0)?,
                self.at_least(&o, "iridescenceThicknessMaximum", 400.0, 0.0)?,
            ];
            m.iridescence_thickness_texture = self.texture(&o, "iridescenceThicknessTexture", TextureUse::Data)?;
        }
        Ok(())
    }

    fn texture(&mut self, o: &Object<'_>, key: &str, usage: TextureUse) -> Result<Option<TextureRef>, Fault> {
        let Some(info) = o.object(key)? else { return Ok(None) };
        let index = info.required_index("index", "texture", self.document.textures.len())?;
        let mut uv_set = info.uint("texCoord")?.unwrap_or(0);
        let mut texture_from_uv = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        if let Some(transform) = info.extension("KHR_texture_transform")? {
            uv_set = transform.uint("texCoord")?.unwrap_or(uv_set);
            texture_from_uv = texture_transform(&transform)?;
        }
        if uv_set > 1 {
            let cause = format!("it uses TEXCOORD_{uv_set}; sets 0 and 1 are supported");
            let place = self.place.clone();
            self.warnings.push(ImportWarning::TextureDropped { place, slot: key.to_owned(), cause });
            return Ok(None);
        }
        let texture = &self.document.textures[index];
        let Some(image) = texture.image else {
            let cause = match texture.other_source {
                Some(name) => format!("its image is stored by {name}, which is not supported"),
                None => "it has no image".to_owned(),
            };
            self.warnings.push(ImportWarning::TextureDropped {
                place: self.place.clone(),
                slot: key.to_owned(),
                cause,
            });
            return Ok(None);
        };
        let sampler = texture.sampler.map(|s| self.document.samplers[s]).unwrap_or_default();
        Ok(Some(TextureRef {
            texture: self.table.request(image, usage),
            uv_set: u32::from(uv_set == 1),
            texture_from_uv,
            wrap: sampler.wrap,
            linear_filter: !sampler.nearest,
        }))
    }

    fn clamped(&mut self, o: &Object<'_>, key: &str, value: f64, low: f64, high: f64) -> f32 {
        if !(low..=high).contains(&value) {
            let place = self.place.clone();
            self.warnings.push(ImportWarning::ValueClamped { place, key: key.to_owned(), value });
        }
        debug_assert!(o.map.contains_key(key) || (low..=high).contains(&value), "defaults are in range");
        narrow(value.clamp(low, high))
    }

    fn unit(&mut self, o: &Object<'_>, key: &str, default: f64) -> Result<f32, Fault> {
        let value = o.number(key)?.unwrap_or(default);
        Ok(self.clamped(o, key, value, 0.0, 1.0))
    }

    fn at_least(&mut self, o: &Object<'_>, key: &str, default: f64, low: f64) -> Result<f32, Fault> {
        let value = o.number(key)?.unwrap_or(default);
        Ok(self.clamped(o, key, value, low, f64::from(f32::MAX)))
    }

    fn color(&mut self, o: &Object<'_>, key: &str, default: Vec3) -> Result<Vec3, Fault> {
        let Some(rgb) = o.numbers::<3>(key)? else { return Ok(default) };
        Ok(Vec3::from_array(rgb.map(|c| self.clamped(o, key, c, 0.0, f64::from(f32::MAX)))))
    }

    fn unit_color(&mut self, o: &Object<'_>, key: &str) -> Result<Vec3, Fault> {
        let Some(rgb) = o.numbers::<3>(key)? else { return Ok(Vec3::ONE) };
        Ok(Vec3::from_array(rgb.map(|c| self.clamped(o, key, c, 0.0, 1.0))))
    }

    fn rgba(&mut self, o: &Object<'_>, key: &str) -> Result<Vec4, Fault> {
        let Some(rgba) = o.numbers::<4>(key)? else { return Ok(Vec4::ONE) };
        Ok(Vec4::from_array(rgba.map(|c| self.clamped(o, key, c, 0.0, 1.0))))
    }
}

#[expect(clippy::cast_possible_truncation, reason = "scene data is f32")]
fn narrow(value: f64) -> f32 {
    value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
}

fn scalar(o: Option<&Object<'_>>, key: &str, default: f32) -> Result<f32, Fault> {
    Ok(o.map(|o| o.number(key)).transpose()?.flatten().map_or(default, narrow))
}

/// Rows of translation * rotation * scale. Rotation is counter-clockwise as seen in the image, whose v axis points down
/// (KHR_texture_transform, whose example of the lower left quadrant fixes the sign).
fn texture_transform(o: &Object<'_>) -> Result<[[f32; 3]; 2], Fault> {
    let [offset_u, offset_v] = o.numbers::<2>("offset")?.unwrap_or([0.0; 2]);
    let [scale_u, scale_v] = o.numbers::<2>("scale")?.unwrap_or([1.0; 2]);
    let (sin, cos) = o.number("rotation")?.unwrap_or(0.0).sin_cos();
    let rows = [[cos * scale_u, sin * scale_v, offset_u], [-sin * scale_u, cos * scale_v, offset_v]];
    Ok(rows.map(|row| row.map(narrow)))
}

/// The texture coordinates along which a material's tangents run; `None` when it needs no tangents.
pub(super) fn tangent_uv_set(m: &Material) -> Option<u32> {
    let texture = m.normal_texture.or(m.clearcoat_normal_texture).or(m.anisotropy_texture);
    texture.map(|t| t.uv_set).or((m.anisotropy > 0.0).then_some(0))
}
