//! The report's tables, in Markdown.

use super::analysis::{Analysis, Sight, Sooner};
use super::observer::{PUBLISHED, Split};
use super::plan::{Method, RING_EDGES_DEG};
use super::statistics::{self, Estimate, Reached};

/// Columns of the film's error by ring of eccentricity, from the fovea outwards.
pub const RING_COLUMNS: [&str; 7] = ["film_fovea", "film_r1", "film_r2", "film_r3", "film_r4", "film_r5", "film_r6"];

/// Builds a Markdown table row by row.
pub struct Markdown(String);

impl Markdown {
    /// With these headings.
    pub fn new(headings: &[&str]) -> Self {
        Self(format!("| {} |\n|{}\n", headings.join(" | "), "---|".repeat(headings.len())))
    }

    /// One more row.
    pub fn row(&mut self, cells: &[String]) {
        self.0.push_str(&format!("| {} |\n", cells.join(" | ")));
    }

    /// The table.
    pub fn text(self) -> String {
        self.0
    }
}

/// Three digits, or a dash.
pub fn short(value: Option<f64>) -> String {
    let Some(value) = value.filter(|v| v.is_finite()) else { return "-".into() };
    match value.abs() {
        v if v >= 99.95 => format!("{value:.0}"),
        v if v >= 9.995 => format!("{value:.1}"),
        v if v >= 0.1 => format!("{value:.2}"),
        _ => format!("{value:.2e}"),
    }
}

fn with_interval(estimate: Option<Estimate>) -> String {
    let Some(Estimate { value, interval: [low, high] }) = estimate else { return "-".into() };
    format!("{} [{}, {}]", short(Some(value)), short(Some(low)), short(Some(high)))
}

fn samples_of(sooner: Option<Sooner>) -> Option<Estimate> {
    sooner.map(|sooner| sooner.samples)
}

fn calculated(sight: Sight<'_>, slow: Method, fast: Method) -> Option<f64> {
    Some(fast.density_over_od(sight.latitude_deg())? / slow.density_over_od(sight.latitude_deg())?)
}

const PAIRS: [(Method, Method); 3] = [(Method::Od, Method::Vp), (Method::Od, Method::Fv), (Method::Vp, Method::Fv)];

/// Samples at equal foveal error against the calculated ratios; a pooled row at the end.
pub fn samples(analysis: &Analysis, measure: &str) -> String {
    let mut table = Markdown::new(&[
        "scene",
        "gaze",
        "VP over OD",
        "calculated",
        "FV over OD",
        "calculated",
        "FV over VP",
        "calculated",
    ]);
    let mut relative = [const { Vec::new() }; PAIRS.len()];
    for sight in analysis.all_sights() {
        let mut cells = vec![sight.scene.to_owned(), sight.gaze_text()];
        for ((slow, fast), relative) in PAIRS.into_iter().zip(&mut relative) {
            let found = samples_of(analysis.sooner(sight, slow, fast, measure));
            let expected = calculated(sight, slow, fast);
            relative.extend(found.zip(expected).map(|(found, expected)| found.value / expected));
            cells.extend([with_interval(found), short(expected)]);
        }
        table.row(&cells);
    }
    let mut cells = vec!["all".into(), "measured / calculated".into()];
    for relative in relative {
        let spread = (relative.len() > 1).then(|| {
            let logs: Vec<f64> = relative.iter().map(|r: &f64| r.ln()).collect();
            let mean = logs.iter().sum::<f64>() / logs.len() as f64;
            let squares: f64 = logs.iter().map(|l| (l - mean).powi(2)).sum();
            (squares / (logs.len() - 1) as f64 / logs.len() as f64).sqrt()
        });
        let mean = statistics::geometric_mean(relative);
        cells.push(format!("**{}** ± {} %", short(mean), short(spread.map(|s| 100.0 * s))));
        cells.push(short(Some(1.0)));
    }
    table.row(&cells);
    table.text()
}

/// Samples a second and the ratios in time.
pub fn time(analysis: &Analysis) -> String {
    let mut table = Markdown::new(&[
        "scene",
        "gaze",
        "OD k samples/s",
        "VP",
        "FV",
        "best",
        "FV over OD a second",
        "by processor time",
        "FV over OD, time",
        "VP over OD, time",
        "best over OD, samples",
        "best over OD, time",
    ]);
    for sight in analysis.all_sights() {
        let rate = |method| analysis.rates.of(sight.scene, sight.gaze, method).map(|cost| 1e-3 / cost.wall);
        let sooner = |fast| analysis.sooner(sight, Method::Od, fast, "film_fovea");
        let (vp, fv, best) = (sooner(Method::Vp), sooner(Method::Fv), sooner(Method::FvBest));
        let rates = [Method::Od, Method::Vp, Method::Fv, Method::FvBest].map(|method| short(rate(method)));
        let mut cells = vec![sight.scene.to_owned(), sight.gaze_text()];
        cells.extend(rates);
        cells.extend([
            short(fv.and_then(|s| s.rate)),
            short(fv.and_then(|s| s.cpu_rate)),
            short(fv.and_then(|s| s.time())),
            short(vp.and_then(|s| s.time())),
            with_interval(samples_of(best)),
            short(best.and_then(|s| s.time())),
        ]);
        table.row(&cells);
    }
    table.text()
}

/// The other ways to spread samples, in samples at equal foveal error.
pub fn others(analysis: &Analysis) -> String {
    let mut table = Markdown::new(&[
        "scene",
        "gaze",
        "vp-region over OD",
        "FV by Eq. 6 over OD",
        "calculated",
        "FV clipped over FV",
        "best over FV",
        "FV wandering over FV",
    ]);
    for sight in analysis.all_sights() {
        let of = |slow, fast| with_interval(samples_of(analysis.sooner(sight, slow, fast, "film_fovea")));
        table.row(&[
            sight.scene.to_owned(),
            sight.gaze_text(),
            of(Method::Od, Method::VpRegion),
            of(Method::Od, Method::FvEq6),
            short(calculated(sight, Method::Od, Method::FvEq6)),
            of(Method::Fv, Method::FvClip),
            of(Method::Fv, Method::FvBest),
            of(Method::Fv, Method::FvWander),
        ]);
    }
    table.text()
}

/// Samples at which thresholds are reached.
pub fn crossings(analysis: &Analysis) -> String {
    let methods = [Method::Od, Method::Vp, Method::Fv, Method::FvBest];
    let mut table =
        Markdown::new(&["scene", "gaze", "question", "OD", "VP", "FV", "best", "FV over OD", "best over OD"]);
    for sight in analysis.all_sights() {
        for split in Split::ALL {
            let found = methods.map(|method| analysis.crossing(sight, method, split));
            let mut cells = vec![sight.scene.to_owned(), sight.gaze_text(), split.name().to_owned()];
            cells.extend(found.map(|crossing| {
                crossing.map_or_else(
                    || "not reached".to_owned(),
                    |c| {
                        let mark = match c.reached {
                            Reached::Earlier => "<= ",
                            Reached::Measured => "",
                            Reached::Extrapolated => "extrapolated ",
                        };
                        let thousands = |n: f64| n / 1000.0;
                        let Estimate { value, interval } = c.samples;
                        let interval = interval.map(thousands);
                        format!("{mark}{}", with_interval(Some(Estimate { value: thousands(value), interval })))
                    },
                )
            }));
            let ratio = |k: usize| Some(found[0]?.samples.value / found[k]?.samples.value);
            cells.extend([short(ratio(2)), short(ratio(3))]);
            table.row(&cells);
        }
    }
    table.text()
}

/// Split times in the form of the authors' table, at each scene's first gaze, beside theirs.
pub fn splits(analysis: &Analysis) -> String {
    let mut table = Markdown::new(&[
        "scene",
        "question",
        "OD s",
        "VP %",
        "FV %",
        "best %",
        "published OD s",
        "VP %",
        "FV %",
        "s, from the published row",
        "VP % that s gives",
    ]);
    for scene in analysis.scenes() {
        let Some(sight) = analysis.sights(scene).first().copied() else { continue };
        for split in Split::ALL {
            let secs = |method| analysis.split_secs(sight, method, split);
            let percent = |method| Some(100.0 * secs(method)? / secs(Method::Od)?);
            let published = PUBLISHED.iter().find(|row| row.scene == scene && row.split == split);
            let [fv, vp] = [Method::Fv, Method::Vp].map(|method| method.density_over_od(0.0).unwrap_or(1.0));
            table.row(&[
                scene.to_owned(),
                split.name().to_owned(),
                short(secs(Method::Od)),
                short(percent(Method::Vp)),
                short(percent(Method::Fv)),
                short(percent(Method::FvBest)),
                short(published.map(|row| row.od_secs)),
                short(published.map(|row| row.vp_percent)),
                short(published.map(|row| row.fv_percent)),
                short(published.map(|row| row.fixed_secs(fv))),
                short(published.map(|row| row.predicted_vp_percent(fv, vp))),
            ]);
        }
    }
    table.text()
}

/// Geometric mean over scenes of a method's split time in percent of OD's, ours and the authors' (over the same scenes).
pub fn geometric_percent(analysis: &Analysis, method: Method, split: Split) -> [Option<f64>; 2] {
    let scenes = analysis.scenes();
    let ours = scenes.iter().filter_map(|scene| {
        let sight = *analysis.sights(scene).first()?;
        let secs = |method| analysis.split_secs(sight, method, split);
        Some(100.0 * secs(method)? / secs(Method::Od)?)
    });
    let rows = PUBLISHED.iter().filter(|row| row.split == split && scenes.contains(&row.scene));
    let theirs = rows.filter_map(|row| match method {
        Method::Od => Some(100.0),
        Method::Vp => Some(row.vp_percent),
        Method::Fv => Some(row.fv_percent),
        _ => None,
    });
    [statistics::geometric_mean(ours), statistics::geometric_mean(theirs)]
}

/// Samples of a method in the time that FV's curve takes at a scene's first gaze; `None` where a rate is missing.
pub fn samples_in_equal_time(analysis: &Analysis, sight: Sight<'_>, method: Method) -> Option<f64> {
    let end = *analysis.curve(sight, Method::Fv, "film_sphere")?.samples.last()?;
    analysis.rates.in_equal_time((sight.scene, sight.gaze), (Method::Fv, end), method).ok()
}

/// A measure at a number of samples, and whether the curve ends before that.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// The measure.
    pub value: f64,
    is_beyond_the_end: bool,
}

impl Found {
    fn times(self, factor: f64) -> Self {
        Self { value: self.value * factor, ..self }
    }
}

/// Three digits, with a star where the curve ends before, or a dash.
fn starred(found: Option<Found>) -> String {
    let star = if found.is_some_and(|found| found.is_beyond_the_end) { "*" } else { "" };
    format!("{}{star}", short(found.map(|found| found.value)))
}

fn film_error_in_equal_time(analysis: &Analysis, sight: Sight<'_>, method: Method, measure: &str) -> Option<Found> {
    let samples = samples_in_equal_time(analysis, sight, method)?;
    let curve = analysis.curve(sight, method, measure)?;
    let value = statistics::at_samples(&curve, samples)?;
    Some(Found { value, is_beyond_the_end: curve.ends_before(samples) })
}

/// A method's film error by ring in the time that FV's curve takes.
pub fn ring_errors(analysis: &Analysis, sight: Sight<'_>, method: Method) -> [Option<Found>; RING_COLUMNS.len()] {
    RING_COLUMNS.map(|measure| {
        let beyond_the_view = method == Method::Vp && measure == "film_r6";
        if beyond_the_view { None } else { film_error_in_equal_time(analysis, sight, method, measure) }
    })
}

/// Film error by ring at equal time, and where FV loses.
pub fn rings(analysis: &Analysis) -> String {
    let mut edges = vec!["0".to_owned()];
    edges.extend(RING_EDGES_DEG.iter().map(ToString::to_string));
    let rings: Vec<String> = edges.windows(2).map(|pair| format!("{} - {}", pair[0], pair[1])).collect();
    let mut headings = vec!["scene", "method", "samples a film pixel"];
    headings.extend(rings.iter().map(String::as_str));
    headings.extend(["view", "sphere"]);
    let mut table = Markdown::new(&headings);
    for scene in analysis.scenes() {
        let Some(sight) = analysis.sights(scene).first().copied() else { continue };
        for method in [Method::Od, Method::Vp, Method::Fv, Method::FvEq6] {
            let samples = samples_in_equal_time(analysis, sight, method);
            let all = |measure: &str| starred(film_error_in_equal_time(analysis, sight, method, measure));
            // VP never reaches what lies outside its view: an error over the pixels that it has says nothing there.
            let sphere = if method == Method::Vp { "never".into() } else { all("film_sphere") };
            let mut cells = vec![
                scene.to_owned(),
                method.name().to_owned(),
                short(samples.map(|n| n / analysis.film_pixels(scene))),
            ];
            cells.extend(ring_errors(analysis, sight, method).map(starred));
            cells.extend([all("film_view"), sphere]);
            table.row(&cells);
        }
    }
    table.text()
}

/// What the artist sees in the fovea after equal time.
pub fn pictures(analysis: &Analysis) -> String {
    let mut table = Markdown::new(&[
        "scene",
        "method",
        "error, film",
        "error, picture",
        "pixels without sample, %",
        "outline",
        "colour",
        "FLIP",
    ]);
    for scene in analysis.scenes() {
        let Some(sight) = analysis.sights(scene).first().copied() else { continue };
        let Some(od) = analysis.curve(sight, Method::Od, "empty") else { continue };
        // A quarter of OD's curve: all have something to show and none is done.
        let end = od.samples.last().copied().unwrap_or(0.0) / 4.0;
        for method in [Method::Od, Method::Vp, Method::VpRegion, Method::Fv, Method::FvBest] {
            let samples = analysis.rates.in_equal_time((sight.scene, sight.gaze), (Method::Od, end), method).ok();
            let at = |measure: &str| {
                let (curve, samples) = (analysis.curve(sight, method, measure)?, samples?);
                let value = statistics::within_curve(&curve, samples)?;
                Some(Found { value, is_beyond_the_end: curve.ends_before(samples) })
            };
            table.row(&[
                scene.to_owned(),
                method.name().to_owned(),
                starred(at("film_fovea")),
                starred(at("view_fovea")),
                starred(at("empty").map(|share| share.times(100.0))),
                starred(at("outline")),
                starred(at("colour")),
                starred(at("flip")),
            ]);
        }
    }
    table.text()
}
