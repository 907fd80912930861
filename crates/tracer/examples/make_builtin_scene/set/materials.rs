//! The materials of the set. Albedos lie between 0.04 and 0.85; radiances between 3 and 20.

use serde_json::{Value, json};

use super::glb::Builder;
use super::{paint, pattern};

/// What the materials below use.
pub(super) const EXTENSIONS: [&str; 4] =
    ["KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_transmission", "KHR_materials_volume"];

/// Indices of all materials.
pub(super) struct Palette {
    pub(super) plaster: usize,
    pub(super) terracotta_wall: usize,
    pub(super) sage_wall: usize,
    pub(super) ceiling: usize,
    pub(super) trim: usize,
    pub(super) parquet: usize,
    pub(super) rug: usize,
    pub(super) walnut: usize,
    pub(super) oak: usize,
    pub(super) tapestry: usize,
    pub(super) eye_chart: usize,
    pub(super) landscape: usize,
    pub(super) paper: usize,
    pub(super) curtain: usize,
    pub(super) armchair: usize,
    pub(super) leaf: usize,
    pub(super) soil: usize,
    pub(super) clay: usize,
    pub(super) glazed_red: usize,
    pub(super) porcelain: usize,
    pub(super) glass: usize,
    pub(super) green_glass: usize,
    pub(super) amber_glass: usize,
    pub(super) chrome: usize,
    pub(super) silver: usize,
    pub(super) gold: usize,
    pub(super) hammered_copper: usize,
    pub(super) worn_steel: usize,
    pub(super) iron: usize,
    /// Steel of roughness 0.02, 0.15, 0.3, 0.5 and 0.75.
    pub(super) steel_row: [usize; 5],
    pub(super) orange: usize,
    pub(super) apple: usize,
    pub(super) plum: usize,
    pub(super) globe: usize,
    pub(super) lamp_warm: usize,
    pub(super) lamp_ring: usize,
    pub(super) lamp_bulb: usize,
    pub(super) lamp_shade: usize,
    /// Book covers.
    pub(super) covers: [usize; 8],
}

fn diffuse(color: [f64; 3], roughness: f64) -> Value {
    let [r, g, b] = color;
    json!({"pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": roughness}})
}

fn textured(texture: usize, roughness: f64) -> Value {
    json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}, "metallicFactor": 0.0, "roughnessFactor": roughness}})
}

fn metal(color: [f64; 3], roughness: f64) -> Value {
    let [r, g, b] = color;
    json!({"pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 1.0, "roughnessFactor": roughness}})
}

fn with(mut material: Value, extension: &str, value: Value) -> Value {
    material["extensions"][extension] = value;
    material
}

fn double_sided(mut material: Value) -> Value {
    material["doubleSided"] = json!(true);
    material
}

/// Glazed, waxed or varnished: the surface is as smooth as its finish.
fn coated(mut material: Value, roughness: f64) -> Value {
    material["pbrMetallicRoughness"]["roughnessFactor"] = json!(roughness);
    material
}

fn solid_glass(ior: f64, attenuation: [f64; 3], distance: f64) -> Value {
    let glass = diffuse([1.0, 1.0, 1.0], 0.0);
    let glass = with(glass, "KHR_materials_transmission", json!({"transmissionFactor": 1.0}));
    let glass = with(glass, "KHR_materials_ior", json!({"ior": ior}));
    let volume = json!({"attenuationColor": attenuation, "attenuationDistance": distance, "thicknessFactor": 0.1});
    with(glass, "KHR_materials_volume", volume)
}

fn emitter(color: [f64; 3], radiance: f64) -> Value {
    let mut material = diffuse([0.05, 0.05, 0.05], 1.0);
    material["emissiveFactor"] = json!(color);
    with(material, "KHR_materials_emissive_strength", json!({"emissiveStrength": radiance}))
}

fn cloth(color: [f64; 3]) -> Value {
    double_sided(diffuse(color, 0.95))
}

impl Palette {
    pub(super) fn new(b: &mut Builder) -> Self {
        let parquet = b.texture("parquet", &paint::parquet());
        let walnut = b.texture("walnut", &paint::wood(256, 2, 256, [112, 74, 48]));
        let rug = b.texture("rug", &pattern::rug());
        let tapestry = b.texture("tapestry", &pattern::tapestry());
        let chart = b.texture("eye chart", &pattern::eye_chart());
        let landscape = b.texture("landscape", &paint::landscape());
        let hammered = b.texture("hammered", &paint::hammered());
        let worn = b.texture("worn", &paint::worn());
        let globe = b.texture("globe", &pattern::globe());

        let mut sky = emitter([1.0, 1.0, 1.0], 20.0);
        sky["emissiveTexture"] = json!({"index": landscape});
        let mut copper = metal([0.85, 0.50, 0.36], 0.22);
        copper["normalTexture"] = json!({"index": hammered, "scale": 0.7});
        let mut worn_steel = metal([0.62, 0.60, 0.58], 1.0);
        worn_steel["pbrMetallicRoughness"]["metallicRoughnessTexture"] = json!({"index": worn});
        let steel = [0.02, 0.15, 0.3, 0.5, 0.75];
        let covers = [
            ("oxblood", [0.30, 0.06, 0.05]),
            ("navy", [0.05, 0.08, 0.22]),
            ("bottle green", [0.05, 0.18, 0.10]),
            ("ochre", [0.55, 0.36, 0.10]),
            ("cream", [0.72, 0.66, 0.52]),
            ("slate", [0.16, 0.18, 0.20]),
            ("brick", [0.48, 0.18, 0.10]),
            ("teal", [0.06, 0.26, 0.28]),
        ];
        Self {
            plaster: b.material("plaster", diffuse([0.66, 0.63, 0.57], 0.9)),
            terracotta_wall: b.material("terracotta wall", diffuse([0.50, 0.25, 0.17], 0.9)),
            sage_wall: b.material("sage wall", diffuse([0.36, 0.42, 0.32], 0.9)),
            ceiling: b.material("ceiling", diffuse([0.80, 0.79, 0.76], 0.95)),
            trim: b.material("trim", diffuse([0.76, 0.74, 0.70], 0.45)),
            parquet: b.material("parquet", coated(textured(parquet, 0.5), 0.12)),
            rug: b.material("rug", textured(rug, 1.0)),
            walnut: b.material("walnut", coated(textured(walnut, 0.55), 0.2)),
            oak: b.material("oak", diffuse([0.42, 0.27, 0.15], 0.55)),
            tapestry: b.material("tapestry", textured(tapestry, 1.0)),
            eye_chart: b.material("eye chart", textured(chart, 0.8)),
            landscape: b.material("landscape", sky),
            paper: b.material("paper", diffuse([0.80, 0.77, 0.68], 0.9)),
            curtain: b.material("curtain", cloth([0.62, 0.50, 0.34])),
            armchair: b.material("armchair", cloth([0.10, 0.20, 0.24])),
            leaf: b.material("leaf", double_sided(diffuse([0.10, 0.26, 0.06], 0.5))),
            soil: b.material("soil", diffuse([0.07, 0.05, 0.04], 1.0)),
            clay: b.material("clay", diffuse([0.52, 0.26, 0.16], 0.85)),
            glazed_red: b.material("glazed red", coated(diffuse([0.50, 0.04, 0.04], 0.4), 0.02)),
            porcelain: b.material("porcelain", coated(diffuse([0.78, 0.78, 0.76], 0.5), 0.03)),
            glass: b.material("glass", solid_glass(1.5, [0.97, 0.99, 0.98], 0.3)),
            green_glass: b.material("green glass", solid_glass(1.52, [0.25, 0.70, 0.40], 0.02)),
            amber_glass: b.material("amber glass", solid_glass(1.52, [0.90, 0.50, 0.12], 0.03)),
            chrome: b.material("chrome", metal([0.66, 0.67, 0.68], 0.03)),
            silver: b.material("silver", metal([0.85, 0.84, 0.82], 0.0)),
            gold: b.material("gold", metal([0.85, 0.64, 0.30], 0.12)),
            hammered_copper: b.material("hammered copper", copper),
            worn_steel: b.material("worn steel", worn_steel),
            iron: b.material("iron", metal([0.20, 0.20, 0.21], 0.5)),
            steel_row: steel.map(|r| b.material(&format!("steel {r}"), metal([0.62, 0.61, 0.59], r))),
            orange: b.material("orange", diffuse([0.78, 0.32, 0.04], 0.5)),
            apple: b.material("apple", coated(diffuse([0.42, 0.46, 0.06], 0.4), 0.15)),
            plum: b.material("plum", diffuse([0.12, 0.05, 0.16], 0.4)),
            globe: b.material("globe", coated(textured(globe, 0.6), 0.1)),
            lamp_warm: b.material("lamp, warm", emitter([1.0, 0.78, 0.52], 20.0)),
            lamp_ring: b.material("lamp, ring", emitter([1.0, 0.88, 0.72], 16.0)),
            lamp_bulb: b.material("lamp, bulb", emitter([1.0, 0.72, 0.42], 20.0)),
            lamp_shade: b.material("lamp shade", double_sided(diffuse([0.76, 0.68, 0.52], 0.9))),
            covers: covers.map(|(name, color)| b.material(&format!("cover, {name}"), diffuse(color, 0.6))),
        }
    }
}
