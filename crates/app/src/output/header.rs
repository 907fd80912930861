//! What a film is of, as JSON: exact, so that a film read from a file goes on as it would have.

use std::str::FromStr;

use glam::{Quat, Vec3};
use serde_json::{Map, Value, json};
use tracer::film::{FilmHeader, FilmMapping, FilmOptions, SampleRange};
use tracer::renderer::{FilmPose, RenderStatistics, SequenceKind};
use tracer::scene::ContentHash;

/// The names of sequences in files, as the command line has them.
const SEQUENCES: [(SequenceKind, &str); 2] =
    [(SequenceKind::Sobol, "sobol"), (SequenceKind::Independent, "independent")];

/// Every field, by name.
pub fn to_json(header: &FilmHeader) -> Map<String, Value> {
    let FilmOptions { mapping, width, height } = header.options;
    let mapping = match mapping {
        FilmMapping::Equirect => json!({ "kind": "equirect" }),
        FilmMapping::Perspective { half_extent } => json!({ "kind": "perspective", "half_extent": half_extent }),
    };
    let mut seeds: Vec<u32> = header.ranges.iter().map(|range| range.seed).collect();
    seeds.dedup();
    let range = |range: &SampleRange| json!({ "seed": range.seed, "first": range.first, "count": range.count });
    let counts = header.statistics;
    let fields = [
        ("scene_hash", header.scene.to_string().into()),
        ("film", json!({ "width": width, "height": height, "mapping": mapping })),
        ("position_m", json!(header.pose.position.to_array())),
        ("world_from_film_xyzw", json!(header.pose.world_from_film.to_array())),
        ("max_bounces", header.max_bounces.into()),
        ("sequence", SEQUENCES.iter().find(|entry| entry.0 == header.sequence).map(|entry| entry.1).into()),
        ("seed", if let [seed] = seeds[..] { seed.into() } else { json!(seeds) }),
        ("samples", header.samples().into()),
        ("ranges", header.ranges.iter().map(range).collect()),
        ("quanta_per_radiance", header.radiance_scale.into()),
        ("quanta_per_luminance", header.luminance_scale.into()),
        ("segments", counts.segments.into()),
        ("shadow_rays", counts.shadow_rays.into()),
        ("non_finite_dropped", counts.non_finite.into()),
        ("clamped", counts.clamped.into()),
        ("adaptive_samples", counts.steered.into()),
    ];
    fields.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

/// Reads what [`to_json`] made, among other fields or not.
///
/// # Errors
/// The name of the first field that is missing or holds something else.
pub fn from_json(settings: &Value) -> Result<FilmHeader, String> {
    let film = &settings["film"];
    let mapping = match (film["mapping"]["kind"].as_str(), floats(&film["mapping"]["half_extent"])) {
        (Some("equirect"), _) => FilmMapping::Equirect,
        (Some("perspective"), Some(half_extent)) => FilmMapping::Perspective { half_extent },
        _ => return Err(bad("film.mapping")),
    };
    let number = |value: &Value, name: &str| value.as_u64().ok_or_else(|| bad(name));
    let small = |value: &Value, name: &str| u32::try_from(number(value, name)?).map_err(|_| bad(name));
    let range = |range: &Value| {
        let of = |name: &str| number(&range[name], "ranges");
        Ok(SampleRange { seed: small(&range["seed"], "ranges")?, first: of("first")?, count: of("count")? })
    };
    let ranges = settings["ranges"].as_array().ok_or_else(|| bad("ranges"))?;
    let ranges: Vec<SampleRange> = ranges.iter().map(range).collect::<Result<_, String>>()?;
    let scale =
        |name: &str| settings[name].as_f64().filter(|scale| scale.is_normal() && *scale > 0.0).ok_or_else(|| bad(name));
    let sequence = SEQUENCES.iter().find(|entry| settings["sequence"] == entry.1).ok_or_else(|| bad("sequence"))?.0;
    let scene = settings["scene_hash"].as_str().and_then(|text| ContentHash::from_str(text).ok());
    let mut header = FilmHeader {
        options: FilmOptions {
            mapping,
            width: small(&film["width"], "film.width")?,
            height: small(&film["height"], "film.height")?,
        },
        pose: FilmPose {
            position: floats(&settings["position_m"]).map(Vec3::from_array).ok_or_else(|| bad("position_m"))?,
            world_from_film: floats(&settings["world_from_film_xyzw"])
                .map(Quat::from_array)
                .ok_or_else(|| bad("world_from_film_xyzw"))?,
        },
        scene: scene.ok_or_else(|| bad("scene_hash"))?,
        max_bounces: small(&settings["max_bounces"], "max_bounces")?,
        sequence,
        radiance_scale: scale("quanta_per_radiance")?,
        luminance_scale: scale("quanta_per_luminance")?,
        ranges,
        statistics: RenderStatistics::default(),
    };
    header.statistics = RenderStatistics {
        samples: header.samples(),
        segments: number(&settings["segments"], "segments")?,
        shadow_rays: number(&settings["shadow_rays"], "shadow_rays")?,
        non_finite: small(&settings["non_finite_dropped"], "non_finite_dropped")?,
        clamped: small(&settings["clamped"], "clamped")?,
        // Films from before there was adaptive sampling do not say that they have none.
        steered: settings.get("adaptive_samples").map_or(Ok(0), |count| number(count, "adaptive_samples"))?,
    };
    Ok(header)
}

/// Settings of two films that became one: what differs holds both values, whichever film came first.
pub fn combined(mut ours: Map<String, Value>, theirs: &Map<String, Value>) -> Map<String, Value> {
    /// Name of the list of values in place of one value.
    const SEVERAL: &str = "one_of";
    let absent = Value::Null;
    let names: Vec<String> = ours.keys().chain(theirs.keys()).cloned().collect();
    for name in names {
        let (our, their) = (ours.get(&name).unwrap_or(&absent), theirs.get(&name).unwrap_or(&absent));
        if our == their {
            continue;
        }
        let list = |value: &Value| value[SEVERAL].as_array().cloned().unwrap_or_else(|| vec![value.clone()]);
        let mut values = [list(our), list(their)].concat();
        values.sort_by_key(Value::to_string);
        values.dedup();
        ours.insert(name, json!({ SEVERAL: values }));
    }
    ours
}

/// Finite floats as they were written.
fn floats<const N: usize>(value: &Value) -> Option<[f32; N]> {
    let values: Option<Vec<f32>> = value.as_array()?.iter().map(|value| Some(value.as_f64()? as f32)).collect();
    values.filter(|values| values.iter().all(|value| value.is_finite()))?.try_into().ok()
}

fn bad(name: &str) -> String {
    format!("`{name}` is missing or not what it should be")
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
pub(crate) mod tests {
    use super::*;

    /// A header whose floats have no short decimal form.
    pub fn header(mapping: FilmMapping) -> FilmHeader {
        let range = |seed, first, count| SampleRange { seed, first, count };
        let ranges = vec![range(3, 0, 1 << 40), range(3, 1 << 41, 7), range(u32::MAX, (1 << 61) + 1, 9)];
        let mut header = FilmHeader {
            options: FilmOptions { mapping, width: 37, height: 5 },
            pose: FilmPose { position: Vec3::new(0.1, -1e-30, f32::MAX), world_from_film: Quat::from_rotation_y(0.7) },
            scene: ContentHash(u128::MAX / 3),
            max_bounces: 4096,
            sequence: SequenceKind::Independent,
            radiance_scale: 2f64.powi(98),
            luminance_scale: 2f64.powi(-28),
            ranges,
            statistics: RenderStatistics {
                samples: 0,
                segments: u64::MAX,
                shadow_rays: 1 << 60,
                non_finite: u32::MAX,
                clamped: 3,
                steered: 1 << 30,
            },
        };
        header.statistics.samples = header.samples();
        header
    }

    #[test]
    fn headers_read_back_exactly_from_text() {
        for mapping in [FilmMapping::Equirect, FilmMapping::Perspective { half_extent: [1.0 / 3.0, 0.1] }] {
            let header = header(mapping);
            let text = Value::Object(to_json(&header)).to_string();
            assert_eq!(from_json(&serde_json::from_str(&text).unwrap()).unwrap(), header);
        }
    }

    #[test]
    fn every_missing_or_wrong_field_is_named() {
        let whole = Value::Object(to_json(&header(FilmMapping::Equirect)));
        // What is derived from the ranges is for people.
        let derived = ["seed", "samples"];
        for name in whole.as_object().unwrap().keys().filter(|name| !derived.contains(&name.as_str())) {
            for wrong in [Value::Null, json!("x"), json!([1, 2]), json!(-1), json!({ "width": 1e99 })] {
                let mut settings = whole.clone();
                settings[name] = wrong;
                let message = from_json(&settings).unwrap_err();
                assert!(message.contains(name.as_str()), "{name}: {message}");
            }
        }
    }

    #[test]
    fn differing_settings_are_listed_whichever_came_first() {
        let object = |value: Value| value.as_object().unwrap().clone();
        let parts = [
            object(json!({ "mode": "fv", "gaze": [0, 1], "seed": 1 })),
            object(json!({ "mode": "od", "gaze": [0, 1], "seed": 1, "trace": "a.csv" })),
            object(json!({ "mode": "fv", "gaze": [1, 0], "seed": 1 })),
        ];
        let merged = |order: [usize; 3]| {
            let two = combined(parts[order[0]].clone(), &parts[order[1]]);
            Value::Object(combined(two, &parts[order[2]]))
        };
        let expected = json!({
            "mode": { "one_of": ["fv", "od"] }, "gaze": { "one_of": [[0, 1], [1, 0]] }, "seed": 1,
            "trace": { "one_of": ["a.csv", null] },
        });
        for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2], [1, 2, 0], [0, 2, 1]] {
            assert_eq!(merged(order), expected, "{order:?}");
        }
        assert_eq!(combined(parts[0].clone(), &parts[0]), parts[0]);
    }
}
