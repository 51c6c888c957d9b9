//! Frame of a chart: scales, grid and labels of its SVG picture, shared by all charts.

use std::fmt::{Display, Write as _};
use std::ops::Range;

use askama::filters::{Html, escape};
use jiff::Timestamp;
use records::time::DAY_S;

use crate::format::month;

/// Pens and fills. The style sheet replaces exactly these colours in dark mode.
pub(crate) const INK: &str = r##"fill="none" stroke="#1C2530" stroke-width="2""##;
pub(crate) const THIN: &str = r##"fill="none" stroke="#1C2530" stroke-dasharray="2 3""##;
pub(crate) const PEER: &str = r##"fill="none" stroke="#9AA5B1""##;
pub(crate) const GRID: &str = r##"stroke="#E1E6EB""##;
pub(crate) const DATA: &str = r##"fill="#5B8FB9""##;
pub(crate) const BAR: &str = r##"stroke="#5B8FB9""##;
pub(crate) const WATCH: &str = r##"stroke="#D9A900" stroke-width="2""##;
pub(crate) const LIMIT: &str = r##"stroke="#7A0044" stroke-width="2""##;
pub(crate) const PLAN: &str = r##"fill="none" stroke="#C85200" stroke-width="2""##;

/// Scales of a chart, and the picture drawn so far.
pub struct Frame {
    pub(crate) x: Range<f64>,
    pub(crate) y: Range<f64>,
    size: [f64; 2],
    /// Margins above, right, below and left of the plotted area, px.
    margins: [f64; 4],
    svg: String,
}

impl Frame {
    /// An empty picture of a size, px, whose plotted area shows the two ranges.
    pub fn new(size: [f64; 2], margins: [f64; 4], x: Range<f64>, y: Range<f64>) -> Self {
        Self { x, y, size, margins, svg: String::new() }
    }

    /// Picture of a value, px from the left and from the top.
    pub(crate) fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let [above, right, below, left] = self.margins;
        let share = |value: f64, range: &Range<f64>| (value - range.start) / (range.end - range.start);
        let [width, height] = self.size;
        let across = left + share(x, &self.x) * (width - left - right);
        (across, height - below - share(y, &self.y) * (height - above - below))
    }

    /// Draws a line through points.
    pub fn line(&mut self, points: impl IntoIterator<Item = (f64, f64)>, pen: &str) {
        let mut path = String::new();
        for point in points {
            let (x, y) = self.at(point);
            let _ = write!(path, "{x:.1},{y:.1} ");
        }
        let _ = write!(self.svg, r#"<polyline points="{}" {pen}/>"#, path.trim_end());
    }

    /// Draws the area between the lower and the upper value at each place.
    pub(crate) fn band(&mut self, points: &[[f64; 3]], fill: &str) {
        let there = points.iter().map(|[x, _, high]| (*x, *high));
        let back = points.iter().rev().map(|[x, low, _]| (*x, *low));
        self.line(there.chain(back), &format!(r#"{fill} fill-opacity="0.18""#));
    }

    /// Draws a vertical line through the plotted area.
    pub fn vertical(&mut self, x: f64, pen: &str) {
        self.line([(x, self.y.start), (x, self.y.end)], pen);
    }

    /// Draws a horizontal line through the plotted area.
    pub fn horizontal(&mut self, y: f64, pen: &str) {
        self.line([(self.x.start, y), (self.x.end, y)], pen);
    }

    /// Draws a disc, with a text for readers who point at it.
    pub fn dot(&mut self, point: (f64, f64), radius: f64, fill: &str, title: &str) {
        let (x, y) = self.at(point);
        let title = if title.is_empty() { String::new() } else { format!("<title>{}</title>", safe(title)) };
        let _ = write!(self.svg, r#"<circle cx="{x:.1}" cy="{y:.1}" r="{radius}" {fill}>{title}</circle>"#);
    }

    /// Draws a square, with a text for readers who point at it.
    pub(crate) fn square(&mut self, point: (f64, f64), title: &str) {
        let ((x, y), title) = (self.at(point), safe(title));
        let _ = write!(
            self.svg,
            r##"<rect x="{:.1}" y="{:.1}" width="11" height="11" fill="#1C2530"><title>{title}</title></rect>"##,
            x - 5.5,
            y - 5.5
        );
    }

    /// Writes a text that starts, or ends (`anchor`), some pixels from a point.
    pub fn text(&mut self, point: (f64, f64), offset: [f64; 2], anchor: &str, text: impl Display) {
        let ((x, y), text) = (self.at(point), safe(text));
        let (x, y) = (x + offset[0], y + offset[1]);
        let _ = write!(
            self.svg,
            r##"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}" fill="#1C2530">{text}</text>"##
        );
    }

    /// Writes a text of a colour at a place of the picture, px.
    pub fn coloured_text(&mut self, [x, y]: [f64; 2], colour: &str, text: &str) {
        let _ = write!(self.svg, r#"<text x="{x}" y="{y}" fill="{colour}">{}</text>"#, safe(text));
    }

    /// Puts a picture into this one, `x` and `y` px from its upper left corner.
    pub fn put(&mut self, x: f64, y: f64, picture: &str) {
        let _ = write!(self.svg, r#"<svg x="{x}" y="{y}">{picture}</svg>"#);
    }

    /// Draws at most `most` horizontal grid lines, with their values above them at the left edge.
    pub fn grid(&mut self, most: usize) {
        for value in ticks(&self.y, most) {
            self.horizontal(value, GRID);
            let at_edge = [2.0 - self.margins[3], -3.0];
            self.text((self.x.start, value), at_edge, "start", (value * 1e6).round() / 1e6);
        }
    }

    /// Labels a horizontal axis of numbers, with its name at the right.
    pub fn numbers(&mut self, most: usize, name: &str) {
        let below = self.margins[2] - 6.0;
        self.horizontal(self.y.start, r##"stroke="#1C2530""##);
        for value in ticks(&self.x, most) {
            self.text((value, self.y.start), [0.0, below], "middle", (value * 1e6).round() / 1e6);
        }
        self.text((self.x.end, self.y.start), [0.0, -5.0], "end", name);
    }

    /// Labels a horizontal axis of days since 1970 with at most `most` dates below the plotted area.
    pub(crate) fn dates(&mut self, most: usize) {
        self.horizontal(self.y.start, r##"stroke="#1C2530""##);
        let edge = 0.04 * (self.x.end - self.x.start);
        let inner = self.x.start + edge..self.x.end - edge;
        for (at, text) in dates(&self.x, most).into_iter().filter(|(at, _)| inner.contains(at)) {
            self.text((at, self.y.start), [0.0, self.margins[2] - 6.0], "middle", text);
        }
    }

    /// Draws within the plotted area; what lies outside is cut.
    pub(crate) fn clipped(&mut self, draw: impl FnOnce(&mut Self)) {
        let ([above, right, below, left], [width, height]) = (self.margins, self.size);
        let (width, height) = (width - left - right, height - above - below);
        let _ = write!(
            self.svg,
            r#"<svg x="{left}" y="{above}" width="{width}" height="{height}" viewBox="{left} {above} {width} {height}">"#
        );
        draw(self);
        self.svg.push_str("</svg>");
    }

    /// The SVG picture; further attributes are those of its root.
    pub fn finish(self, attributes: &str) -> String {
        let [width, height] = self.size;
        format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13" {attributes}>{}</svg>"#,
            self.svg
        )
    }
}

fn safe(text: impl Display) -> String {
    let Ok(safe) = escape(text, Html);
    safe.to_string()
}

/// Multiples of 1, 2 or 5 times a power of ten within a range, at most `most`.
fn ticks(range: &Range<f64>, most: usize) -> Vec<f64> {
    let least = (range.end - range.start) / most.max(1) as f64;
    let power = 10_f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|k| k * power).into_iter().find(|step| *step >= least);
    let step = step.unwrap_or(10.0 * power);
    let first = (range.start / step).ceil();
    let all = (0..=most).map(|k| (first + k as f64) * step);
    all.filter(|value| *value <= range.end).collect()
}

/// Days within a range with their names, at most `most`: weeks in a short range, months in a long one.
fn dates(range: &Range<f64>, most: usize) -> Vec<(f64, String)> {
    let at = |day: f64| Timestamp::from_second((day * DAY_S) as i64).ok();
    let days = (range.end - range.start) / most.max(1) as f64;
    if days < 20.0 {
        let step = [1.0, 2.0, 7.0, 14.0].into_iter().find(|step| *step >= days).unwrap_or(21.0);
        let first = (range.start / step).ceil();
        let all = (0..=most).map(|k| (first + k as f64) * step).filter(|day| *day <= range.end);
        return all.filter_map(|day| Some((day, at(day)?.strftime("%-d %b").to_string()))).collect();
    }
    let months = days / 30.5;
    let step = [1, 2, 3, 6, 12, 24, 60].into_iter().find(|step| f64::from(*step) >= months).unwrap_or(120);
    let Some(from) = at(range.start) else { return Vec::new() };
    let all = (1..=12 * 300).filter_map(|k| month(from, k)).take_while(|t| day(*t) <= range.end);
    let is_tick = |t: &Timestamp| {
        let date = t.to_zoned(jiff::tz::TimeZone::UTC).date();
        (12 * i32::from(date.year()) + i32::from(date.month()) - 1) % step == 0
    };
    let name = |t: Timestamp| {
        let month = t.strftime("%b").to_string();
        t.strftime(if month == "Jan" || step >= 12 { "%b %Y" } else { "%b" }).to_string()
    };
    all.filter(is_tick).map(|t| (day(t), name(t))).collect()
}

pub(crate) fn day(t: Timestamp) -> f64 {
    t.as_second() as f64 / DAY_S
}

/// Means of groups of neighbouring points, at most `most` of them.
pub(crate) fn thinned<const N: usize>(points: &[[f64; N]], most: usize) -> Vec<[f64; N]> {
    let mean = |group: &[[f64; N]]| {
        std::array::from_fn(|k| group.iter().map(|point| point[k]).sum::<f64>() / group.len() as f64)
    };
    points.chunks(points.len().div_ceil(most).max(1)).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps of 1, 2 and 5, by hand.
    #[test]
    fn ticks_are_round_and_dates_begin_months() {
        let rounded: Vec<i64> = ticks(&(3.0..157.0), 4).into_iter().map(|tick| tick as i64).collect();
        assert_eq!(rounded, [50, 100, 150]);
        let of = |text: &str| day(text.parse().unwrap());
        let named = dates(&(of("2026-08-24T00:00:00Z")..of("2027-01-20T00:00:00Z")), 3);
        let names: Vec<&str> = named.iter().map(|(_, name)| name.as_str()).collect();
        assert_eq!(names, ["Sep", "Nov", "Jan 2027"]);
        assert!((named[1].0 - of("2026-11-01T00:00:00Z")).abs() < 1e-9);
        assert_eq!(dates(&(of("2026-11-02T00:00:00Z")..of("2026-11-16T00:00:00Z")), 3).len(), 2);
    }

    #[test]
    fn a_name_in_a_picture_is_no_markup() {
        let mut frame = Frame::new([10.0, 10.0], [0.0; 4], 0.0..1.0, 0.0..1.0);
        frame.dot((0.5, 0.5), 1.0, DATA, "<script>");
        assert!(frame.finish("").contains("<title>&#60;script&#62;</title>"));
    }
}
