//! Charts with two axes as lists of shapes; SVG and pixels come from there.

use std::path::Path;

use fovea_sampler::report::{Chart, Mark, Shape};

use crate::commands::sampler::raster;
use crate::output::{png, write_text};

const SIZE_PX: [f64; 2] = [960.0, 600.0];
/// Left, top, right, bottom edge of the axes.
const AXES_PX: [f64; 4] = [90.0, 60.0, 830.0, 510.0];
/// Left edge of the legend.
const LEGEND_PX: f64 = 845.0;
/// From one line of the legend to the next.
const LEGEND_STEP_PX: f64 = 18.0;

/// How an axis maps values to its length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// In proportion.
    Linear,
    /// By the logarithm.
    Logarithmic,
}

/// Title and scale of an axis.
#[derive(Clone, Copy, Debug)]
pub struct Axis<'a> {
    /// What it shows, with its unit.
    pub title: &'a str,
    /// How.
    pub scale: Scale,
}

/// Points joined by lines.
#[derive(Clone, Debug)]
pub struct Series {
    /// In the legend.
    pub name: String,
    /// Colour.
    pub mark: Mark,
    /// Values on both axes.
    pub points: Vec<[f64; 2]>,
}

/// An axis with its range.
struct Ruler {
    scale: Scale,
    range: [f64; 2],
    pixels: [f64; 2],
}

impl Ruler {
    fn around(scale: Scale, values: impl Iterator<Item = f64>, pixels: [f64; 2]) -> Self {
        let usable = values.filter(|v| v.is_finite() && (scale == Scale::Linear || *v > 0.0));
        let mapped = usable.map(|v| if scale == Scale::Linear { v } else { v.log10() });
        let (low, high) = mapped.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        let range = match scale {
            Scale::Linear if low <= high => [low.min(0.0), high.max(low.min(0.0) + 1e-9) * 1.05],
            Scale::Logarithmic if low <= high => [low - 0.06, (high + 0.06).max(low + 0.5)],
            _ => [0.0, 1.0],
        };
        Self { scale, range, pixels }
    }

    fn at(&self, value: f64) -> f64 {
        let mapped = if self.scale == Scale::Linear { value } else { value.max(1e-300).log10() };
        let t = (mapped - self.range[0]) / (self.range[1] - self.range[0]);
        self.pixels[0] + t * (self.pixels[1] - self.pixels[0])
    }

    /// Values that get a line, with their lettering.
    fn ticks(&self) -> Vec<(f64, String)> {
        if self.scale == Scale::Linear {
            let span = self.range[1] - self.range[0];
            let power = 10f64.powf((span / 5.0).log10().floor());
            let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| span / s <= 8.0).unwrap_or(span);
            let first = (self.range[0] / step).ceil() as i64;
            let last = (self.range[1] / step).floor() as i64;
            return (first..=last).map(|k| (k as f64 * step, number(k as f64 * step))).collect();
        }
        let decades = self.range[0].floor() as i32..=self.range[1].ceil() as i32;
        let fine: &[f64] = if self.range[1] - self.range[0] < 2.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let values = decades.flat_map(|decade| fine.iter().map(move |digit| digit * 10f64.powi(decade)));
        let inside = |v: &f64| (self.range[0]..=self.range[1]).contains(&v.log10());
        values.filter(inside).map(|v| (v, number(v))).collect()
    }
}

fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        v if !(1e-3..1e5).contains(&v) => format!("{value:.0e}"),
        v if v >= 1.0 && value.fract() == 0.0 => format!("{value:.0}"),
        _ => format!("{value:.3}").trim_end_matches('0').trim_end_matches('.').to_owned(),
    }
}

struct Canvas(Vec<Shape>);

impl Canvas {
    fn text(&mut self, at: [f64; 2], text: &str, centred: bool, mark: Mark) {
        self.0.push(Shape::Text { at, text: text.to_owned(), centred, mark });
    }

    fn line(&mut self, from: [f64; 2], to: [f64; 2], mark: Mark) {
        self.0.push(Shape::Line { from, to, mark });
    }

    fn frame(&mut self, title: &str, caption: &str) {
        let [left, top, right, bottom] = AXES_PX;
        self.line([left, bottom], [right, bottom], Mark::Ink);
        self.line([left, top], [left, bottom], Mark::Ink);
        self.text([0.5 * (left + right), 26.0], title, true, Mark::Ink);
        self.text([left, SIZE_PX[1] - 14.0], caption, false, Mark::Ink);
    }

    fn finish(self) -> Chart {
        Chart { size_px: SIZE_PX, shapes: self.0 }
    }
}

/// Lines over two axes.
pub fn lines(title: &str, caption: &str, x: Axis<'_>, y: Axis<'_>, series: &[Series]) -> Chart {
    let [left, top, right, bottom] = AXES_PX;
    let values = |k: usize| series.iter().flat_map(move |s| s.points.iter().map(move |p| p[k]));
    let across = Ruler::around(x.scale, values(0), [left, right]);
    let up = Ruler::around(y.scale, values(1), [bottom, top]);
    let mut canvas = Canvas(Vec::new());
    for (value, text) in across.ticks() {
        let at = across.at(value);
        canvas.line([at, top], [at, bottom], Mark::Grid);
        canvas.text([at, bottom + 20.0], &text, true, Mark::Ink);
    }
    for (value, text) in up.ticks() {
        let at = up.at(value);
        canvas.line([left, at], [right, at], Mark::Grid);
        canvas.text([left - 34.0, at + 5.0], &text, true, Mark::Ink);
    }
    canvas.frame(title, caption);
    canvas.text([0.5 * (left + right), bottom + 44.0], x.title, true, Mark::Ink);
    canvas.text([12.0, top - 14.0], y.title, false, Mark::Ink);
    for (index, one) in series.iter().enumerate() {
        let drawable = |p: &&[f64; 2]| p[0].is_finite() && p[1].is_finite() && (y.scale == Scale::Linear || p[1] > 0.0);
        let places: Vec<[f64; 2]> =
            one.points.iter().filter(drawable).map(|p| [across.at(p[0]), up.at(p[1])]).collect();
        for pair in places.windows(2) {
            canvas.line(pair[0], pair[1], one.mark);
        }
        for at in places {
            canvas.0.push(Shape::Point { at, filled: true, mark: one.mark });
        }
        let at = [LEGEND_PX, top + 18.0 + LEGEND_STEP_PX * index as f64];
        canvas.text(at, &one.name, false, one.mark);
    }
    canvas.finish()
}

/// A group of bars.
#[derive(Clone, Debug)]
pub struct Bars {
    /// Below the group.
    pub name: String,
    /// Values, with their names' colours.
    pub values: Vec<(Mark, f64)>,
}

/// Groups of bars from zero, each with its value written above.
pub fn bars(title: &str, caption: &str, y: &str, groups: &[Bars], legend: &[(&str, Mark)]) -> Chart {
    let [left, top, right, bottom] = AXES_PX;
    let all = groups.iter().flat_map(|group| group.values.iter().map(|(_, value)| *value));
    let up = Ruler::around(Scale::Linear, all, [bottom, top]);
    let mut canvas = Canvas(Vec::new());
    for (value, text) in up.ticks() {
        let at = up.at(value);
        canvas.line([left, at], [right, at], Mark::Grid);
        canvas.text([left - 34.0, at + 5.0], &text, true, Mark::Ink);
    }
    let width = (right - left) / groups.len().max(1) as f64;
    for (index, group) in groups.iter().enumerate() {
        let start = left + width * (index as f64 + 0.15);
        let step = width * 0.7 / group.values.len().max(1) as f64;
        for (k, (mark, value)) in group.values.iter().enumerate().filter(|(_, (_, value))| value.is_finite()) {
            let (from, to) = (start + step * (k as f64 + 0.1), start + step * (k as f64 + 0.9));
            let mut x = from;
            while x <= to {
                canvas.line([x, bottom], [x, up.at(*value)], *mark);
                x += 0.5;
            }
            canvas.text([0.5 * (from + to), up.at(*value) - 6.0], &format!("{value:.1}"), true, Mark::Ink);
        }
        canvas.text([left + width * (index as f64 + 0.5), bottom + 20.0], &group.name, true, Mark::Ink);
    }
    canvas.frame(title, caption);
    canvas.text([12.0, top - 14.0], y, false, Mark::Ink);
    for (index, (name, mark)) in legend.iter().enumerate() {
        canvas.text([LEGEND_PX, top + 18.0 + LEGEND_STEP_PX * index as f64], name, false, *mark);
    }
    canvas.finish()
}

/// Writes a chart as `name.svg` and `name.png`.
///
/// # Errors
/// When a file cannot be written.
pub fn write(folder: &Path, name: &str, chart: &Chart) -> anyhow::Result<()> {
    write_text(&folder.join(format!("{name}.svg")), &chart.svg())?;
    let ([width, height], texels) = raster::draw(chart);
    Ok(png::write(&folder.join(format!("{name}.png")), width, height, &texels)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXIS: Axis<'_> = Axis { title: "samples", scale: Scale::Logarithmic };

    #[test]
    fn points_lie_in_the_axes_in_the_order_of_their_values() {
        let points = vec![[1e2, 5.0], [1e4, 0.5], [1e6, 0.01], [1e7, -1.0], [f64::NAN, 1.0]];
        let series = Series { name: "od".into(), mark: Mark::Series(0), points };
        let chart = lines("t", "c", AXIS, AXIS, &[series]);
        let places: Vec<[f64; 2]> = chart
            .shapes
            .iter()
            .filter_map(|shape| if let Shape::Point { at, .. } = shape { Some(*at) } else { None })
            .collect();
        assert_eq!(places.len(), 3, "what has no logarithm is left out");
        assert!(places.windows(2).all(|pair| pair[0][0] < pair[1][0] && pair[0][1] < pair[1][1]));
        let [left, top, right, bottom] = AXES_PX;
        assert!(places.iter().all(|[x, y]| (left..=right).contains(x) && (top..=bottom).contains(y)));
        assert!(chart.svg().contains(">od<"));
    }

    #[test]
    fn bars_begin_at_zero() {
        let groups = [Bars { name: "a".into(), values: vec![(Mark::Series(0), 100.0), (Mark::Series(1), 25.0)] }];
        let chart = bars("t", "c", "%", &groups, &[("od", Mark::Series(0))]);
        let height = |mark: Mark| {
            chart.shapes.iter().find_map(|shape| match shape {
                Shape::Line { from, to, mark: m } if *m == mark => Some(from[1] - to[1]),
                _ => None,
            })
        };
        let ratio = height(Mark::Series(0)).zip(height(Mark::Series(1))).map(|(a, b)| a / b);
        assert!(ratio.is_some_and(|ratio| (ratio - 4.0).abs() < 1e-9));
    }

    #[test]
    fn numbers_are_short() {
        for (value, text) in [(0.0, "0"), (0.05, "0.05"), (2.0, "2"), (1e6, "1e6"), (1e-5, "1e-5"), (0.5, "0.5")] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn nothing_to_draw_is_an_empty_chart() {
        assert!(!lines("t", "c", AXIS, AXIS, &[]).shapes.is_empty());
        assert!(!bars("t", "c", "y", &[], &[]).shapes.is_empty());
    }
}
