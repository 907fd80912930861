//! The study's outputs: one page of Markdown, plots, all raw rows as one CSV, and the numbers of the page as JSON.

use std::path::Path;

use anyhow::bail;
use fovea_sampler::report::Mark;
use serde_json::{Value, json};
use tracer::gpu::Gpu;
use tracer::provenance::Provenance;

use super::analysis::{Analysis, SUMMARY, Sight};
use super::observer::Split;
use super::plan::{Method, RING_EDGES_DEG};
use super::plot::{self, Axis, Bars, Scale, Series};
use super::record::ALL_RUNS;
use super::tables;
use crate::cli::study::{Part, StudyArgs};
use crate::output::write_text;

/// Where and with what the parts were measured.
const PROVENANCE: &str = "provenance.json";

/// Notes with what a part of the study is measured that begins now: curves or rates. Curves say where the first of them were
/// measured, and where later ones were if that is elsewhere, of which a line tells; rates where the last; the command lines of all
/// are kept.
///
/// # Errors
/// When the file cannot be written.
pub fn write_provenance(args: &StudyArgs, gpu: &Gpu, part: Part) -> anyhow::Result<()> {
    let here: Value = Provenance::on(gpu).fields().into_iter().map(|(name, value)| (name, value.to_owned())).collect();
    let mut all = read_provenance(&args.output);
    let name = if part == Part::Rates { "rates" } else { "curves" };
    let commands = with_command(all[name]["command"].as_str(), command());
    let is_elsewhere =
        |known: &Value| ["machine", "adapter", "commit"].iter().any(|field| known[*field] != here[*field]);
    if part == Part::Rates || all[name].is_null() {
        all[name] = here;
    } else if is_elsewhere(&all[name]) {
        eprintln!("note: the folder's first curves are of another machine, adapter or revision: {PROVENANCE} has both");
        let mut later = all[name]["later"].as_array().cloned().unwrap_or_default();
        if later.iter().all(is_elsewhere) {
            later.push(here);
            all[name]["later"] = later.into();
        }
    }
    all[name]["command"] = commands.into();
    Ok(write_text(&args.output.join(PROVENANCE), &format!("{all:#}\n"))?)
}

/// Command lines that measured something, each once.
fn with_command(earlier: Option<&str>, command: String) -> String {
    match earlier {
        Some(earlier) if earlier.split("; ").any(|one| one == command) => earlier.to_owned(),
        Some(earlier) => format!("{earlier}; {command}"),
        None => command,
    }
}

/// The command line, of paths the last part alone.
fn command() -> String {
    let name = |word: String| word.rsplit(['/', '\\']).next().unwrap_or_default().to_owned();
    std::env::args().map(name).collect::<Vec<_>>().join(" ")
}

fn read_provenance(folder: &Path) -> Value {
    let text = std::fs::read_to_string(folder.join(PROVENANCE)).ok();
    text.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_else(|| json!({}))
}

/// Writes `study.md`, `study.json`, `curves.csv` and the plots from what is in the folder.
///
/// # Errors
/// When the folder holds no study or a file cannot be written.
pub fn write(args: &StudyArgs) -> anyhow::Result<()> {
    let analysis = Analysis::read(&args.output)?;
    if args.only == Part::Report && analysis.scenes().is_empty() {
        bail!("{}: holds no study", args.output.display());
    }
    let provenance = read_provenance(&args.output);
    write_text(&args.output.join(ALL_RUNS), &super::record::to_csv(&analysis.table))?;
    write_text(&args.output.join(SUMMARY), &format!("{:#}\n", summary(&analysis, &provenance)))?;
    write_text(&args.output.join("study.md"), &page(&analysis, &provenance))?;
    let caption = caption(&provenance);
    for scene in analysis.scenes() {
        let Some(sight) = analysis.sights(scene).first().copied() else { continue };
        for (name, chart) in charts(&analysis, sight, &caption) {
            plot::write(&args.output, &format!("{name}-{scene}"), &chart)?;
        }
    }
    plot::write(&args.output, "splits", &splits_chart(&analysis, &caption))
}

fn caption(provenance: &Value) -> String {
    let field = |name: &str| provenance["curves"][name].as_str().unwrap_or("unknown").to_owned();
    format!("{} / {} / {}", field("machine"), field("adapter"), field("commit"))
}

fn charts(analysis: &Analysis, sight: Sight<'_>, caption: &str) -> Vec<(&'static str, fovea_sampler::report::Chart)> {
    let pixels = analysis.film_pixels(sight.scene);
    let log = |title| Axis { title, scale: Scale::Logarithmic };
    let error = "relative squared error";
    let curves = |measure: &str, across: &dyn Fn(Method) -> Option<f64>| -> Vec<Series> {
        let one = |method: Method| {
            let (curve, scale) = (analysis.curve(sight, method, measure)?, across(method)?);
            let points = curve.samples.iter().zip(curve.mean()).map(|(n, e)| [n * scale, e]).collect();
            Some(Series { name: method.name().into(), mark: method.mark(), points })
        };
        Method::ALL.into_iter().filter_map(one).collect()
    };
    let rings: Vec<Series> = [Method::Od, Method::Vp, Method::Fv, Method::FvEq6]
        .into_iter()
        .map(|method| {
            let inner = [0.0].into_iter().chain(RING_EDGES_DEG);
            let middles = inner.zip(RING_EDGES_DEG).map(|(a, b)| 0.5 * (a + b));
            let errors = tables::ring_errors(analysis, sight, method);
            let points = middles.zip(errors).filter_map(|(middle, error)| Some([middle, error?.value])).collect();
            Series { name: method.name().into(), mark: method.mark(), points }
        })
        .collect();
    let secs = |method| analysis.rates.of(sight.scene, sight.gaze, method).map(|cost| cost.wall);
    let title = |what: &str| format!("{}: {what}", sight.scene);
    vec![
        (
            "samples",
            plot::lines(
                &title("error in the fovea, film"),
                caption,
                log("samples a film pixel"),
                log(error),
                &curves("film_fovea", &|_| Some(1.0 / pixels)),
            ),
        ),
        (
            "time",
            plot::lines(
                &title("error in the fovea, reconstructed picture"),
                caption,
                log("seconds of tracing"),
                log(error),
                &curves("view_fovea", &secs),
            ),
        ),
        (
            "whole",
            plot::lines(
                &title("error over the whole sphere, pixels with samples"),
                caption,
                log("samples a film pixel"),
                log(error),
                &curves("film_sphere", &|method| (method != Method::Vp).then_some(1.0 / pixels)),
            ),
        ),
        (
            "rings",
            plot::lines(
                &title("error by eccentricity after equal time, film"),
                caption,
                Axis { title: "degrees from the gaze", scale: Scale::Linear },
                log(error),
                &rings,
            ),
        ),
    ]
}

fn splits_chart(analysis: &Analysis, caption: &str) -> fovea_sampler::report::Chart {
    let groups: Vec<Bars> = Split::ALL
        .into_iter()
        .flat_map(|split| {
            [(0, "measured"), (1, "published")].map(|(k, whose)| {
                let value = |method: Method| {
                    let percent = if method == Method::Od {
                        Some(100.0)
                    } else {
                        tables::geometric_percent(analysis, method, split)[k]
                    };
                    (method.mark(), percent.unwrap_or(f64::NAN))
                };
                let methods = [Method::Od, Method::Vp, Method::Fv, Method::FvBest];
                Bars { name: format!("{}, {whose}", split.name()), values: methods.map(value).to_vec() }
            })
        })
        .collect();
    let legend: Vec<(&str, Mark)> = [Method::Od, Method::Vp, Method::Fv, Method::FvBest]
        .into_iter()
        .map(|method| (method.name(), method.mark()))
        .collect();
    plot::bars("split times, geometric means over scenes", caption, "% of OD", &groups, &legend)
}

fn summary(analysis: &Analysis, provenance: &Value) -> Value {
    let estimate = |e: super::statistics::Estimate| json!({ "value": e.value, "interval_95": e.interval });
    let sights: Vec<Value> = analysis
        .all_sights()
        .into_iter()
        .map(|sight| {
            let pairs = [
                ("vp_over_od", Method::Od, Method::Vp),
                ("fv_over_od", Method::Od, Method::Fv),
                ("fv_over_vp", Method::Vp, Method::Fv),
                ("best_over_od", Method::Od, Method::FvBest),
            ];
            let ratios: Value = pairs
                .into_iter()
                .map(|(name, slow, fast)| {
                    let found = analysis.sooner(sight, slow, fast, "film_fovea");
                    let value =
                        found.map(|s| json!({ "samples": estimate(s.samples), "rate": s.rate, "time": s.time() }));
                    (name.to_owned(), value.unwrap_or(Value::Null))
                })
                .collect();
            let splits: Value = Split::ALL
                .into_iter()
                .map(|split| {
                    let of = |method: Method| {
                        let crossing = analysis.crossing(sight, method, split);
                        let value = crossing.map(|c| {
                            json!({
                                "samples": estimate(c.samples),
                                "reached": format!("{:?}", c.reached).to_lowercase(),
                                "split_s": analysis.split_secs(sight, method, split),
                            })
                        });
                        (method.name().to_owned(), value.unwrap_or(Value::Null))
                    };
                    (split.name().to_owned(), Method::ALL.into_iter().map(of).collect::<Value>())
                })
                .collect();
            json!({ "scene": sight.scene, "gaze": sight.gaze, "ratios": ratios, "splits": splits })
        })
        .collect();
    json!({ "provenance": provenance, "settings": analysis.settings, "sights": sights })
}

fn page(analysis: &Analysis, provenance: &Value) -> String {
    let seeds = analysis.all_sights().iter().map(|sight| analysis.seeds(*sight, Method::Fv)).min().unwrap_or(0);
    let list = |part: &str| {
        let fields = provenance[part].as_object().into_iter().flatten();
        let field = |(name, value): (&String, &Value)| format!("{name} {}", value.as_str().unwrap_or("?"));
        fields.map(field).collect::<Vec<_>>().join("; ")
    };
    let setting = |name: &str| {
        let value = analysis.settings.values().next().map(|settings| settings[name].to_string());
        value.unwrap_or_else(|| "?".into())
    };
    let figures: String =
        analysis.scenes().iter().map(|scene| format!("![{scene}](study/figure-{scene}.png)\n\n")).collect();
    let plots: String = analysis
        .scenes()
        .iter()
        .map(|scene| {
            ["samples", "time", "rings", "whole"].map(|name| format!("![](study/{name}-{scene}.svg)\n")).concat()
        })
        .collect();
    TEMPLATE
        .replace("{seeds}", &seeds.to_string())
        .replace("{film}", &setting("film"))
        .replace("{bounces}", &setting("max_bounces"))
        .replace("{reference_spp}", &setting("reference_spp"))
        .replace("{spp}", &setting("spp"))
        .replace("{curves}", &list("curves"))
        .replace("{rates}", &list("rates"))
        .replace("{samples}", &tables::samples(analysis, "film_fovea"))
        .replace("{variance}", &tables::samples(analysis, "variance"))
        .replace("{time}", &tables::time(analysis))
        .replace("{splits}", &tables::splits(analysis))
        .replace("{crossings}", &tables::crossings(analysis))
        .replace("{rings}", &tables::rings(analysis))
        .replace("{others}", &tables::others(analysis))
        .replace("{pictures}", &tables::pictures(analysis))
        .replace("{figures}", &figures)
        .replace("{plots}", &plots)
}

/// The page around the tables.
const TEMPLATE: &str = include_str!("page.md");

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn the_page_in_the_documents_is_what_the_rows_beside_it_give() {
        let reports = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reports");
        let folder = reports.join("study");
        let made = page(&Analysis::read(&folder).unwrap(), &read_provenance(&folder));
        let kept = std::fs::read_to_string(reports.join("study.md")).unwrap();
        for (made, kept) in made.lines().zip(kept.lines()) {
            assert_eq!(made, kept);
        }
        assert_eq!(made.len(), kept.len());
    }

    #[test]
    fn commands_that_measured_are_kept_each_once() {
        let first = with_command(None, "fovea study a.glb".into());
        let both = with_command(Some(&first), "fovea study b.glb".into());
        assert_eq!(both, "fovea study a.glb; fovea study b.glb");
        assert_eq!(with_command(Some(&both), "fovea study a.glb".into()), both);
    }
}
