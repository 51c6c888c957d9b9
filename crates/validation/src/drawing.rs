//! Pictures of the study and of the paper: panels with series on linear or logarithmic axes.

use std::ops::Range;

use report::Frame;

pub(crate) const INK: &str = "#1C2530";
pub(crate) const GRID: &str = r##"stroke="#E1E6EB""##;
pub(crate) const BLUE: &str = "#1F6FB2";
pub(crate) const ORANGE: &str = "#C85200";
pub(crate) const GREEN: &str = "#5A8F3C";
pub(crate) const GREY: &str = "#9AA5B1";

/// Width of a character of the legend, px.
const CHAR_PX: f64 = 7.2;
/// Margins of a panel: above, right, below and left, px.
const MARGINS: [f64; 4] = [36.0, 14.0, 34.0, 46.0];

pub(crate) struct Axis {
    pub(crate) name: String,
    pub(crate) range: Range<f64>,
    pub(crate) is_log: bool,
    /// Names at values, instead of numbers; only of a vertical axis.
    pub(crate) labels: Vec<(f64, String)>,
}

impl Axis {
    pub(crate) fn new(name: &str, range: Range<f64>) -> Self {
        Self { name: name.to_owned(), range, is_log: false, labels: Vec::new() }
    }

    pub(crate) fn log(name: &str, range: Range<f64>) -> Self {
        Self { is_log: true, ..Self::new(name, range) }
    }

    /// A linear axis that holds all values, with a margin.
    pub(crate) fn around(name: &str, values: impl Iterator<Item = f64>) -> Self {
        let (least, most) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        let margin = 0.06 * (most - least).max(f64::MIN_POSITIVE);
        Self::new(name, least - margin..most + margin)
    }

    fn place(&self, value: f64) -> f64 {
        if self.is_log { value.log10() } else { value }
    }

    /// Whole decades within a logarithmic axis, with their names.
    fn decades(&self) -> impl Iterator<Item = (f64, String)> {
        let all = self.place(self.range.start).ceil() as i32..=self.place(self.range.end).floor() as i32;
        all.map(|power| (f64::from(power), format!("{}", 10_f64.powi(power))))
    }
}

/// How the points of a series are drawn.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Shape {
    /// A line of a width, px, through the points.
    Line(f64),
    Dashed,
    /// Discs of a radius, px.
    Dots(f64),
    /// A line of a width, px, for each pair of points.
    Bars(f64),
}

/// Points of one colour; its name is in the legend.
pub(crate) struct Series {
    pub(crate) name: String,
    pub(crate) colour: &'static str,
    pub(crate) shape: Shape,
    pub(crate) points: Vec<(f64, f64)>,
}

impl Series {
    pub(crate) fn new(colour: &'static str, shape: Shape, points: Vec<(f64, f64)>) -> Self {
        Self { name: String::new(), colour, shape, points }
    }

    pub(crate) fn named(self, name: &str) -> Self {
        Self { name: name.to_owned(), ..self }
    }
}

pub(crate) struct Panel {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) series: Vec<Series>,
}

impl Panel {
    pub(crate) fn new(x: Axis, y: Axis, series: Vec<Series>) -> Self {
        Self { title: String::new(), x, y, series }
    }

    fn draw(&self, size: [f64; 2]) -> String {
        let [above, right, below, left] = MARGINS;
        let names = self.y.labels.iter().map(|(_, name)| CHAR_PX * name.chars().count() as f64);
        let margins = [above, right, below, names.fold(left, f64::max)];
        let range = |axis: &Axis| axis.place(axis.range.start)..axis.place(axis.range.end);
        let mut frame = Frame::new(size, margins, range(&self.x), range(&self.y));
        self.draw_axes(&mut frame, margins);
        for series in &self.series {
            let points: Vec<(f64, f64)> =
                series.points.iter().map(|(x, y)| (self.x.place(*x), self.y.place(*y))).collect();
            let colour = series.colour;
            let pen = |width: f64| format!(r#"fill="none" stroke="{colour}" stroke-width="{width}""#);
            match series.shape {
                Shape::Line(width) => frame.line(points, &pen(width)),
                Shape::Dashed => frame.line(points, &format!(r#"{} stroke-dasharray="6 4""#, pen(1.0))),
                Shape::Bars(width) => {
                    points.chunks(2).for_each(|pair| frame.line(pair.iter().copied(), &pen(width)));
                }
                Shape::Dots(radius) => {
                    let fill = format!(r#"fill="{colour}" fill-opacity="0.7""#);
                    points.into_iter().for_each(|point| frame.dot(point, radius, &fill, ""));
                }
            }
        }
        for (k, series) in self.series.iter().filter(|series| !series.name.is_empty()).enumerate() {
            let x = size[0] - right - CHAR_PX * series.name.chars().count() as f64;
            frame.coloured_text([x, above + 14.0 + 15.0 * k as f64], series.colour, &series.name);
        }
        frame.finish("")
    }

    fn draw_axes(&self, frame: &mut Frame, [_, _, below, left]: [f64; 4]) {
        let (x, y) = (&self.x, &self.y);
        let heading = [self.title.as_str(), &y.name].into_iter().filter(|text| !text.is_empty());
        frame.coloured_text([6.0, 14.0], INK, &heading.collect::<Vec<_>>().join(", "));
        let decades = y.decades().filter(|_| y.is_log);
        let (bottom, start) = (y.place(y.range.start), x.place(x.range.start));
        if y.is_log || !y.labels.is_empty() {
            for (at, name) in y.labels.iter().cloned().chain(decades) {
                frame.horizontal(at, GRID);
                frame.text((start, at), [2.0 - left, 4.0], "start", name);
            }
        } else {
            frame.grid(6);
        }
        if x.is_log {
            for (at, name) in x.decades() {
                frame.vertical(at, GRID);
                frame.text((at, bottom), [0.0, below - 18.0], "middle", name);
            }
            frame.text((x.place(x.range.end), bottom), [0.0, -5.0], "end", &x.name);
        } else {
            frame.numbers(7, &x.name);
        }
    }
}

/// Panels of a size, px, in rows of some columns.
pub(crate) fn picture(panels: &[Panel], columns: usize, panel_px: [f64; 2]) -> String {
    let [width, height] = panel_px;
    let rows = panels.len().div_ceil(columns);
    let size = [width * columns as f64, height * rows as f64];
    let mut whole = Frame::new(size, [0.0; 4], 0.0..1.0, 0.0..1.0);
    for (k, panel) in panels.iter().enumerate() {
        whole.put(width * (k % columns) as f64, height * (k / columns) as f64, &panel.draw(panel_px));
    }
    whole.finish(r#"style="background: white""#)
}
