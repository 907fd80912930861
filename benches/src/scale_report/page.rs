//! Tables and plot of the raw numbers.

use fovea_app::commands::study::{
    plot::{Axis, Scale, Series, lines},
    statistics,
};
use fovea_sampler::report::{Chart, Mark};
use serde_json::Value;

const SIDES: [&str; 2] = ["buffers", "textures"];

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn median(values: &Value) -> f64 {
    statistics::median(list(values).map(number).collect()).unwrap_or(f64::NAN)
}

/// Nanoseconds a ray of a set: on the device on both sides, and of obvhs on all cores.
fn ns_per_ray(set: &Value) -> [f64; 3] {
    let per_ray = |seconds: &Value| median(seconds) / number(&set["count"]) * 1e9;
    [per_ray(&set["device_s"]["buffers"]), per_ray(&set["device_s"]["textures"]), per_ray(&set["obvhs_s"])]
}

/// Least squares of `y = a + b log10 n`: b, and the share of the variance that it explains.
fn against_logarithm(points: &[[f64; 2]]) -> (f64, f64) {
    let count = points.len() as f64;
    let usable = points.iter().map(|[n, y]| [n.log10(), *y]);
    let [mean_x, mean_y] = [0, 1].map(|i| usable.clone().map(|p| p[i]).sum::<f64>() / count);
    let [xx, xy, yy] = usable.fold([0.0; 3], |[xx, xy, yy], [x, y]| {
        let (x, y) = (x - mean_x, y - mean_y);
        [xx + x * x, xy + x * y, yy + y * y]
    });
    (xy / xx, xy * xy / (xx * yy))
}

/// A column of the table of rays, as values over the number of triangles; where there is no number the point is left out.
fn series(raw: &Value, rays: &str, value: impl Fn(&Value) -> f64) -> Vec<[f64; 2]> {
    list(&raw["triangles"])
        .filter_map(|row| {
            let set = list(&row["sets"]).find(|set| set["rays"] == rays)?;
            let y = value(set);
            y.is_finite().then(|| [number(&row["triangles"]), y])
        })
        .collect()
}

fn cell(value: f64, digits: usize) -> String {
    if value.is_finite() { format!("{value:.digits$}") } else { "-".into() }
}

/// The page.
pub fn text(raw: &Value) -> String {
    let mut text = String::from("# Scale: cost against the number of triangles and of instances\n\n");
    for (name, value) in raw["machine"].as_object().into_iter().flatten() {
        text += &format!("- {name}: {}\n", value.as_str().unwrap_or(""));
    }
    text += &format!(
        "- largest storage binding: {} MiB; rounds: {}, medians\n\n![Time of a ray against the number of triangles](scale.svg)\n\n",
        number(&raw["largest_binding_bytes"]) / 1_048_576.0,
        number(&raw["rounds"])
    );
    text += include_str!("page.md");
    text += "\n## Triangles\n\n| triangles | rays | steps a ray | ns a ray, buffers | textures | obvhs, all cores | obvhs / textures |\n|---|---|---|---|---|---|---|\n";
    for row in list(&raw["triangles"]) {
        for set in list(&row["sets"]) {
            let [buffers, textures, obvhs] = ns_per_ray(set);
            text += &format!(
                "| {} | {} | {:.1} | {} | {} | {:.0} | {:.2} |\n",
                row["triangles"],
                set["rays"].as_str().unwrap_or(""),
                number(&set["steps_per_ray"]),
                cell(buffers, 0),
                cell(textures, 0),
                obvhs,
                obvhs / textures
            );
        }
    }
    text += "\nGrowth with each factor of ten, and the share of the variance that a straight line over the logarithm explains:\n\n| rays | steps | device, textures | obvhs |\n|---|---|---|---|\n";
    for rays in ["primary", "diffuse"] {
        let steps = against_logarithm(&series(raw, rays, |set| number(&set["steps_per_ray"])));
        let device = against_logarithm(&series(raw, rays, |set| ns_per_ray(set)[1]));
        let obvhs = against_logarithm(&series(raw, rays, |set| ns_per_ray(set)[2]));
        text += &format!(
            "| {rays} | {:+.1}, {:.2} | {:+.0} ns, {:.2} | {:+.0} ns, {:.2} |\n",
            steps.0, steps.1, device.0, device.1, obvhs.0, obvhs.1
        );
    }
    text += "\n| triangles | file, MB | import, s | hierarchy alone (obvhs), s | hierarchy and tables, s | device bytes a triangle, buffers | textures |\n|---|---|---|---|---|---|---|\n";
    for row in list(&raw["triangles"]) {
        let triangles = number(&row["triangles"]);
        let bytes = SIDES.map(|side| cell(number(&row["uploads"][side]["device_bytes"]) / triangles, 1));
        text += &format!(
            "| {} | {:.1} | {:.3} | {:.3} | {:.3} | {} | {} |\n",
            row["triangles"],
            number(&row["file_bytes"]) * 1e-6,
            number(&row["import_s"]),
            number(&row["obvhs_build_s"]),
            number(&row["uploads"]["textures"]["bvh_and_tables_s"]),
            bytes[0],
            bytes[1]
        );
    }
    text += "\n## Instances of one mesh\n\n| instances | file, MB | import, s | scene to device without kernels, s | MB on the device | primary, ns a ray | steps a ray | move one, s |\n|---|---|---|---|---|---|---|---|\n";
    for row in list(&raw["instances"]) {
        let primary = &row["primary"];
        text += &format!(
            "| {} | {:.1} | {:.3} | {:.3} | {:.1} | {:.0} | {:.1} | {:.3} |\n",
            row["instances"],
            number(&row["file_bytes"]) * 1e-6,
            number(&row["import_s"]),
            number(&row["set_scene_s"]) - number(&row["kernels_s"]),
            number(&row["device_bytes"]) * 1e-6,
            median(&primary["device_s"]) / number(&primary["count"]) * 1e9,
            number(&primary["steps_per_ray"]),
            median(&row["move_one_s"])
        );
    }
    text
}

/// Nanoseconds a ray over the logarithm of the number of triangles: what grows with the logarithm is a straight line.
pub fn plot(raw: &Value) -> Chart {
    let mut curves = Vec::new();
    for rays in ["primary", "diffuse"] {
        for (side, name) in ["buffer", "texture", "obvhs"].into_iter().enumerate() {
            let points = series(raw, rays, |set| ns_per_ray(set)[side]);
            curves.push(Series { name: format!("{rays} {name}"), mark: Mark::Series(curves.len() as u8), points });
        }
    }
    let adapter = raw["machine"]["adapter"].as_str().unwrap_or("unknown");
    let across = Axis { title: "triangles", scale: Scale::Logarithmic };
    let up = Axis { title: "ns a ray, all cores", scale: Scale::Linear };
    lines("Time of a ray", adapter, across, up, &curves)
}
