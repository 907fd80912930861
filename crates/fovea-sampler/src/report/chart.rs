//! The plot of error against cost as a list of shapes: SVG text here, pixels wherever someone rasterises the shapes.

use core::fmt::Write;

use super::{Entry, Provenance, pareto_front};
use crate::Geometry;

/// Width and height of the plot in pixels.
const SIZE_PX: [f64; 2] = [960.0, 600.0];
/// Left, top, right, bottom edge of the axes.
const AXES_PX: [f64; 4] = [90.0, 50.0, 930.0, 510.0];

/// What a mark stands for; a rasteriser chooses colours by it, as the SVG does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// Axes, ticks and lettering.
    Ink,
    /// Grid lines.
    Grid,
    /// An inverse on the sphere.
    Sphere,
    /// An inverse on the plane.
    Plane,
    /// One of several curves, by its number; colours repeat after eight.
    Series(u8),
}

/// Colours of [`Mark::Series`], apart for most colour-blind eyes (Okabe and Ito 2008, yellow replaced by brown).
const SERIES: [[u8; 3]; 8] = [
    [0x00, 0x00, 0x00],
    [0xe6, 0x9f, 0x00],
    [0x8c, 0x56, 0x4b],
    [0x00, 0x72, 0xb2],
    [0xd5, 0x5e, 0x00],
    [0x00, 0x9e, 0x73],
    [0xcc, 0x79, 0xa7],
    [0x56, 0xb4, 0xe9],
];

impl Mark {
    /// Red, green, blue.
    #[must_use]
    pub const fn rgb(self) -> [u8; 3] {
        match self {
            Self::Ink => [0x22, 0x22, 0x22],
            Self::Grid => [0xdd, 0xdd, 0xdd],
            Self::Sphere => [0x00, 0x5f, 0xb8],
            Self::Plane => [0xc4, 0x4e, 0x00],
            Self::Series(number) => SERIES[number as usize % SERIES.len()],
        }
    }
}

/// A shape in pixels, the origin at the top left.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A straight line.
    Line {
        /// Ends.
        from: [f64; 2],
        /// Ends.
        to: [f64; 2],
        /// Kind.
        mark: Mark,
    },
    /// A disc of radius 5, or a ring for what is not on the front.
    Point {
        /// Centre.
        at: [f64; 2],
        /// Whether it is filled: on the front.
        filled: bool,
        /// Kind.
        mark: Mark,
    },
    /// A line of text.
    Text {
        /// Where its baseline starts, or its middle if `centred`.
        at: [f64; 2],
        /// What it says.
        text: String,
        /// Whether `at` is its middle.
        centred: bool,
        /// Kind.
        mark: Mark,
    },
}

/// A plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Width and height in pixels.
    pub size_px: [f64; 2],
    /// What to draw, in this order.
    pub shapes: Vec<Shape>,
}

/// A logarithmic axis over pixels.
struct LogAxis {
    decades: [f64; 2],
    pixels: [f64; 2],
}

impl LogAxis {
    /// Whole steps of `step` decades around the values.
    fn around(values: impl Iterator<Item = f64>, step: f64, pixels: [f64; 2]) -> Self {
        let logs = values.filter(|x| *x > 0.0).map(f64::log10);
        let (lo, hi) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), x| (lo.min(x), hi.max(x)));
        let (lo, hi) = if lo <= hi { (lo, hi) } else { (0.0, 1.0) };
        Self { decades: [((lo - 0.02) / step).floor() * step, ((hi + 0.02) / step).ceil() * step], pixels }
    }

    fn at(&self, value: f64) -> f64 {
        let t = (value.max(1e-300).log10() - self.decades[0]) / (self.decades[1] - self.decades[0]);
        self.pixels[0] + t * (self.pixels[1] - self.pixels[0])
    }
}

impl Chart {
    /// Error in eccentricity against CPU cost, both logarithmic, with the Pareto front of each geometry; the fitted inverses
    /// only.
    #[must_use]
    pub fn error_against_cost(entries: &[Entry], provenance: &Provenance) -> Self {
        let [left, top, right, bottom] = AXES_PX;
        // Root finding costs a hundred times as much: it would squeeze all others into a corner.
        let entries: Vec<Entry> = entries.iter().filter(|entry| entry.errors.is_some()).cloned().collect();
        let entries = entries.as_slice();
        let cost = LogAxis::around(entries.iter().map(|e| e.cpu_ns), 0.1, [left, right]);
        let error = LogAxis::around(entries.iter().map(Entry::relative_e), 1.0, [bottom, top]);
        let mut chart = Self { size_px: SIZE_PX, shapes: Vec::new() };
        chart.grid(&cost, &error);
        let front = pareto_front(entries);
        for (geometry, mark) in [(Geometry::Sphere, Mark::Sphere), (Geometry::Plane, Mark::Plane)] {
            let place = |e: &Entry| [cost.at(e.cpu_ns), error.at(e.relative_e())];
            let mut on_front: Vec<[f64; 2]> = entries
                .iter()
                .zip(&front)
                .filter(|(e, f)| **f && e.geometry == geometry)
                .map(|(e, _)| place(e))
                .collect();
            on_front.sort_by(|a, b| a[0].total_cmp(&b[0]));
            for pair in on_front.windows(2) {
                chart.shapes.push(Shape::Line { from: pair[0], to: pair[1], mark });
            }
            for (entry, filled) in entries.iter().zip(&front).filter(|(e, _)| e.geometry == geometry) {
                let at = place(entry);
                chart.shapes.push(Shape::Point { at, filled: *filled, mark });
                // The geometries' points lie close together: their names are on different sides.
                let start = match geometry {
                    Geometry::Sphere => at[0] - 10.0 - 7.2 * entry.name.len() as f64,
                    Geometry::Plane => at[0] + 10.0,
                };
                chart.text([start, at[1] + 4.0], &entry.name, false, mark);
            }
        }
        chart.text([0.5 * (left + right), 24.0], "Inverses of Reddy's acuity: error against cost", true, Mark::Ink);
        chart.text([left + 12.0, top + 18.0], "sphere", false, Mark::Sphere);
        chart.text([left + 92.0, top + 18.0], "plane", false, Mark::Plane);
        chart.text([left + 162.0, top + 18.0], "filled: on the Pareto front", false, Mark::Ink);
        chart.text([0.5 * (left + right), bottom + 44.0], "CPU cost of a direction, ns", true, Mark::Ink);
        chart.text([12.0, top - 14.0], "largest relative error in e (f32)", false, Mark::Ink);
        let caption = format!("{} / {} / {}", provenance.machine, provenance.adapter, provenance.commit);
        chart.text([left, SIZE_PX[1] - 14.0], &caption, false, Mark::Ink);
        chart
    }

    fn text(&mut self, at: [f64; 2], text: &str, centred: bool, mark: Mark) {
        self.shapes.push(Shape::Text { at, text: text.to_owned(), centred, mark });
    }

    fn line(&mut self, from: [f64; 2], to: [f64; 2], mark: Mark) {
        self.shapes.push(Shape::Line { from, to, mark });
    }

    fn grid(&mut self, cost: &LogAxis, error: &LogAxis) {
        let [left, top, right, bottom] = AXES_PX;
        // Costs span about a decade.
        for decade in cost.decades[0].floor() as i32..=cost.decades[1].ceil() as i32 {
            for digit in [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0] {
                let value = digit * 10f64.powi(decade);
                let x = cost.at(value);
                if (left - 0.5..=right + 0.5).contains(&x) {
                    self.line([x, top], [x, bottom], Mark::Grid);
                    self.text([x, bottom + 20.0], &format!("{value}"), true, Mark::Ink);
                }
            }
        }
        for decade in error.decades[0].round() as i32..=error.decades[1].round() as i32 {
            let y = error.at(10f64.powi(decade));
            self.line([left, y], [right, y], Mark::Grid);
            self.text([left - 30.0, y + 5.0], &format!("1e{decade}"), true, Mark::Ink);
        }
        self.line([left, bottom], [right, bottom], Mark::Ink);
        self.line([left, top], [left, bottom], Mark::Ink);
    }

    /// The plot as an SVG document.
    #[must_use]
    pub fn svg(&self) -> String {
        let [width, height] = self.size_px;
        let mut text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\" font-family=\"monospace\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" \
             fill=\"white\"/>\n"
        );
        for shape in &self.shapes {
            // Writing to a string does not fail.
            let _ = match shape {
                Shape::Line { from: [x1, y1], to: [x2, y2], mark } => writeln!(
                    text,
                    "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{}\"/>",
                    colour(*mark)
                ),
                Shape::Point { at: [x, y], filled, mark } => writeln!(
                    text,
                    "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\" stroke=\"{0}\" fill=\"{1}\"/>",
                    colour(*mark),
                    if *filled { colour(*mark) } else { "white".into() }
                ),
                Shape::Text { at: [x, y], text: words, centred, mark } => writeln!(
                    text,
                    "<text x=\"{x:.1}\" y=\"{y:.1}\" fill=\"{}\" text-anchor=\"{}\">{}</text>",
                    colour(*mark),
                    if *centred { "middle" } else { "start" },
                    words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
                ),
            };
        }
        text.push_str("</svg>\n");
        text
    }
}

fn colour(mark: Mark) -> String {
    let [r, g, b] = mark.rgb();
    format!("#{r:02x}{g:02x}{b:02x}")
}
