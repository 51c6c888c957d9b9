//! Diagnostic plot of one estimate: measured channels, filter output and the fitted contact flanks.

use askama::Template;
use estimator::contact::{ContactPlot, Flank, Touch};

use crate::charts::frame::{Frame, PEER};
use crate::page::Error;

const FAINT: &str = "#9AA5B1";
const UPPER: &str = "#C85200";
const LOWER: &str = "#1F6FB2";
const GAP: &str = r##"fill="none" stroke="#222222" stroke-width="2""##;

const SIZE: [f64; 2] = [1280.0, 640.0];
const HEADING: f64 = 46.0;
const TIME_PLOTS_WIDTH: f64 = 800.0;
/// Maximum number of points of a curve over time: two per pixel.
const MAX_POINTS: usize = 1400;
/// Maximum number of contact intervals drawn; above it, every n-th.
const MAX_CONTACTS: usize = 3000;

/// Data behind one estimate.
#[derive(Debug, Clone, Default, PartialEq)]
#[expect(missing_docs, reason = "each field is named for what it holds, with its unit")]
pub struct EstimatePlot {
    pub title: String,
    pub summary: String,
    pub step_s: f64,
    /// The first sample after each break of the clock, and its time, s.
    pub breaks: Vec<(usize, f64)>,
    pub dx_m: Vec<f64>,
    pub load_n: Vec<f64>,
    /// S(t), m; NaN outside the segments.
    pub s_m: Vec<f64>,
    /// Mean of S above and below its mid-range, m.
    pub bounds_m: Option<(f64, f64)>,
    /// Stretches in contact and the flanks that the regression fitted; none where it rejects the flight.
    pub contact: Option<ContactPlot>,
}

impl EstimatePlot {
    /// Time of a position among the samples, s: the step within a segment, the log's own time after a break.
    pub fn time_s(&self, sample: f64) -> f64 {
        records::sample_time_s(sample, self.step_s, &self.breaks)
    }
}

/// Draws all estimates into one SVG, one below the other.
pub fn estimate_plot_svg(plots: &[EstimatePlot]) -> String {
    let (width, height) = (SIZE[0], SIZE[1] * plots.len().max(1) as f64);
    let all = plots.iter().enumerate().map(|(k, plot)| stacked(plot, SIZE[1] * k as f64));
    format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}"><rect width="{width}" height="{height}" fill="white"/>{}</svg>"#,
        all.collect::<String>()
    )
}

/// Writes a self-contained HTML page: each plot, and its curves as data to hover over and zoom into. `back` is the
/// address and the name of the page that leads here.
///
/// # Errors
/// If the page cannot be rendered.
pub fn estimate_plot_html(plots: &[EstimatePlot], back: Option<(&str, &str)>) -> Result<String, Error> {
    Ok(EstimatePlotPage { back, plots }.render()?)
}

const STYLE: &str = include_str!("../../assets/estimate_plot.css");
const CHART_STYLE: &str = include_str!("../../assets/uplot.css");
const CHART: &str = include_str!("../../assets/uplot.js");
const GLUE: &str = include_str!("../../assets/estimate_plot.js");

/// SHA-256 of `uplot.js` and `estimate_plot.js`: the only scripts that a browser executes in the page
/// (Content Security Policy Level 3, hash sources).
const SCRIPT_HASHES: &str = "'sha256-GcjUxq2Ikpp59K5J1vcWFWbf0Lo9FcxJXpdPeH63jx8=' \
                             'sha256-aAVJXf2ZzxaZUoMVB/ar/O2Ejss9TN/J1avh2i9WY5g='";

#[derive(Template)]
#[template(path = "estimate_plot.html")]
struct EstimatePlotPage<'a> {
    back: Option<(&'a str, &'a str)>,
    plots: &'a [EstimatePlot],
}

/// Curves as JSON for the script, in µm and kN, all downsampled to the same times. It contains no `<`, so it
/// can be embedded in a script element.
fn data(plot: &EstimatePlot) -> String {
    let origin_m = origin_m(plot);
    let to_um = |v: f64| (!v.is_nan()).then(|| ((v - origin_m) * 1e9).round() / 1e3);
    let buckets = buckets(plot.s_m.len());
    let pick = |values: &[f64], scale: &dyn Fn(f64) -> Option<f64>| -> Vec<Option<f64>> {
        min_max_buckets(values, buckets).into_iter().map(|(_, v)| scale(v)).collect()
    };
    let time: Vec<f64> = bucket_positions(plot.s_m.len(), buckets).map(|k| plot.time_s(k)).collect();
    let kn = |v: f64| (!v.is_nan()).then(|| v.round() / 1e3);
    let curves = serde_json::json!({
        "time_s": time,
        "dx_um": pick(&plot.dx_m, &to_um),
        "s_um": pick(&plot.s_m, &to_um),
        "load_kn": pick(&plot.load_n, &kn),
        "bounds_um": plot.bounds_m.map(|(upper, lower)| [to_um(upper), to_um(lower)]),
    });
    curves.to_string()
}

/// Heading, curves over time and flanks of a plot, `top` px below the upper edge of the picture.
fn stacked(plot: &EstimatePlot, top: f64) -> String {
    let mut heading = Frame::new([SIZE[0], SIZE[1]], [HEADING, 0.0, 0.0, 0.0], 0.0..1.0, 0.0..1.0);
    heading.text((0.0, 1.0), [14.0, -26.0], "start", &plot.title);
    heading.text((0.0, 1.0), [14.0, -6.0], "start", &plot.summary);
    heading.put(0.0, HEADING, &over_time(plot));
    heading.put(TIME_PLOTS_WIDTH, HEADING, &flanks(plot));
    heading.finish(&format!(r#"y="{top}""#))
}

fn over_time(plot: &EstimatePlot) -> String {
    let height = SIZE[1] - HEADING;
    let end_s = plot.time_s(plot.s_m.len() as f64).max(1.0);
    let mut both = Frame::new([TIME_PLOTS_WIDTH, height], [0.0; 4], 0.0..1.0, 0.0..1.0);
    both.put(0.0, 0.0, &positions(plot, end_s, [TIME_PLOTS_WIDTH, height * 2.0 / 3.0]));
    both.put(0.0, height * 2.0 / 3.0, &load(plot, end_s, [TIME_PLOTS_WIDTH, height / 3.0]));
    both.finish("")
}

/// Draws δX, S(t) with both means, and the contact intervals as marks at the lower edge.
fn positions(plot: &EstimatePlot, end_s: f64, size: [f64; 2]) -> String {
    let origin_m = origin_m(plot);
    let to_um = |v: f64| (v - origin_m) * 1e6;
    let (low, high) = span(plot.dx_m.iter().chain(&plot.s_m).map(|v| to_um(*v)));
    let floor = low - 0.06 * (high - low);
    let mut frame = axes(size, (0.0, end_s), (floor - 0.04 * (high - low), high));
    frame.numbers(8, "");
    draw_curve(&mut frame, plot, &plot.dx_m, to_um, PEER);
    draw_curve(&mut frame, plot, &plot.s_m, to_um, GAP);
    if let Some((upper, lower)) = plot.bounds_m {
        for (bound, colour) in [(upper, UPPER), (lower, LOWER)] {
            let pen = format!(r#"stroke="{colour}" stroke-width="2" stroke-dasharray="8 4""#);
            frame.line([(0.0, to_um(bound)), (end_s, to_um(bound))], &pen);
        }
    }
    for contact in downsampled(touches(plot)) {
        let y = if contact.flank == Flank::Upper { floor } else { floor - 0.025 * (high - low) };
        let fill = format!(r#"fill="{}""#, colour(contact));
        frame.dot((plot.time_s(contact.time_s / plot.step_s), y), 1.0, &fill, "");
    }
    let legend = [
        ("backlash S, δX [µm]:", "#1C2530"),
        ("δX", FAINT),
        ("S(t)", "#222222"),
        ("upper mean, contact", UPPER),
        ("lower mean, contact", LOWER),
    ];
    let mut x = 62.0;
    for (name, colour) in legend {
        frame.coloured_text([x, 14.0], colour, name);
        x += 20.0 + 7.0 * name.chars().count() as f64;
    }
    frame.finish("")
}

fn load(plot: &EstimatePlot, end_s: f64, size: [f64; 2]) -> String {
    let kn = |v: f64| v / 1e3;
    let (low, high) = span(plot.load_n.iter().map(|v| kn(*v)));
    let mut frame = axes(size, (0.0, end_s), (low, high));
    frame.numbers(8, "time [s]");
    draw_curve(&mut frame, plot, &plot.load_n, kn, r##"fill="none" stroke="#1C2530""##);
    frame.coloured_text([62.0, 14.0], "#1C2530", "load [kN]");
    frame.finish("")
}

/// Draws δX against the coupling force with the fitted flanks; samples that the fit did not use are faint.
fn flanks(plot: &EstimatePlot) -> String {
    let origin_m = origin_m(plot);
    let to_um = |v: f64| (v - origin_m) * 1e6;
    let (low, high) = span(touches(plot).iter().map(|s| to_um(s.dx_m)));
    let (left, right) = span(touches(plot).iter().map(|s| s.force_n / 1e3));
    let mut frame = axes([SIZE[0] - TIME_PLOTS_WIDTH, SIZE[1] - HEADING], (left, right), (low, high));
    frame.numbers(6, "coupling force [kN]");
    for is_used in [false, true] {
        let is_drawn = |contact: &&Touch| contact.trust.is_some_and(|trust| trust > 0.0) == is_used;
        for contact in downsampled(touches(plot)).filter(is_drawn) {
            let fill = if is_used { colour(contact) } else { FAINT };
            let fill = format!(r#"fill="{fill}" fill-opacity="0.55""#);
            frame.dot((contact.force_n / 1e3, to_um(contact.dx_m)), 2.0, &fill, "");
        }
    }
    for flank in plot.contact.iter().flat_map(|contact| [&contact.upper, &contact.lower]) {
        frame.line(flank.iter().map(|(force_n, dx_m)| (force_n / 1e3, to_um(*dx_m))), GAP);
    }
    let heading = if touches(plot).is_empty() { "no contact found" } else { "corrected δX [µm]" };
    frame.coloured_text([62.0, 14.0], "#1C2530", heading);
    frame.finish("")
}

fn axes(size: [f64; 2], x: (f64, f64), y: (f64, f64)) -> Frame {
    let mut frame = Frame::new(size, [22.0, 10.0, 26.0, 62.0], x.0..x.1, y.0..y.1);
    frame.grid(6);
    frame
}

fn colour(contact: &Touch) -> &'static str {
    if contact.flank == Flank::Upper { UPPER } else { LOWER }
}

fn touches(plot: &EstimatePlot) -> &[Touch] {
    plot.contact.as_ref().map_or(&[], |contact| &contact.touches)
}

fn downsampled(contacts: &[Touch]) -> impl Iterator<Item = &Touch> {
    contacts.iter().step_by(contacts.len().div_ceil(MAX_CONTACTS).max(1))
}

/// Zero of the position axis, m: the middle between both means of S, or of δX if there are none.
fn origin_m(plot: &EstimatePlot) -> f64 {
    match plot.bounds_m {
        Some((upper, lower)) => f64::midpoint(upper, lower),
        None => {
            let (low, high) = span(plot.dx_m.iter().copied());
            f64::midpoint(low, high)
        }
    }
}

/// Minimum and maximum with a margin; a default range if there are no values.
fn span(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|v| !v.is_nan())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if low < high {
        let air = 0.04 * (high - low);
        (low - air, high + air)
    } else if low > high {
        (-1.0, 1.0)
    } else {
        (low - 1e-3 * low.abs().max(1.0), high + 1e-3 * high.abs().max(1.0))
    }
}

fn buckets(samples: usize) -> usize {
    (MAX_POINTS / 2).min(samples.max(1))
}

/// Minimum and maximum of each bucket in time order, at 1/4 and 3/4 of it, so that no excursion is lost.
/// NaN for a bucket without a value.
pub fn min_max_buckets(values: &[f64], buckets: usize) -> Vec<(f64, f64)> {
    let mut points = Vec::with_capacity(2 * buckets);
    for (bucket, at) in (0..buckets).zip(bucket_positions(values.len(), buckets).step_by(2)) {
        let part = &values[bucket * values.len() / buckets..(bucket + 1) * values.len() / buckets];
        let present = || part.iter().enumerate().filter(|(_, v)| !v.is_nan());
        let low = present().min_by(|a, b| a.1.total_cmp(b.1));
        let high = present().max_by(|a, b| a.1.total_cmp(b.1));
        let half = 0.5 * values.len() as f64 / buckets as f64;
        let pair = match (low, high) {
            (Some((i, low)), Some((j, high))) if i <= j => [*low, *high],
            (Some((_, low)), Some((_, high))) => [*high, *low],
            _ => [f64::NAN; 2],
        };
        points.extend([(at, pair[0]), (at + half, pair[1])]);
    }
    points
}

/// Positions of the two points of each bucket, in samples.
fn bucket_positions(samples: usize, buckets: usize) -> impl Iterator<Item = f64> {
    let half = 0.5 * samples as f64 / buckets as f64;
    (0..2 * buckets).map(move |k| (k as f64 + 0.5) * half)
}

/// Draws a downsampled curve against time, s, in pieces without missing values.
fn draw_curve(frame: &mut Frame, plot: &EstimatePlot, values: &[f64], scale: impl Fn(f64) -> f64, pen: &str) {
    let points = min_max_buckets(values, buckets(values.len()));
    for piece in points.split(|(_, v)| v.is_nan()).filter(|piece| !piece.is_empty()) {
        frame.line(piece.iter().map(|(at, v)| (plot.time_s(*at), scale(*v))), pen);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot() -> EstimatePlot {
        let wave = |k: usize| (k as f64 * 0.01).sin();
        let samples = 5000;
        let mut dx_m: Vec<f64> = (0..samples).map(|k| 1e-4 * wave(k)).collect();
        dx_m[2500] = 3e-3;
        dx_m[100..200].fill(f64::NAN);
        let touch = |k: usize| Touch {
            time_s: k as f64,
            duration_s: 1.0,
            flank: if k.is_multiple_of(2) { Flank::Upper } else { Flank::Lower },
            trust: (k > 3).then_some(1.0),
            force_n: 100.0 * k as f64,
            dx_m: 1e-6 * k as f64,
        };
        let contact = ContactPlot {
            touches: (0..20).map(touch).collect(),
            upper: [(0.0, 5e-5), (5e3, 1.5e-4)],
            lower: [(0.0, -5e-5), (-5e3, -1.5e-4)],
        };
        EstimatePlot {
            title: "<script>alert(1)</script> & co".to_owned(),
            summary: "gap 100.0 µm".to_owned(),
            step_s: 0.01,
            breaks: Vec::new(),
            load_n: (0..samples).map(|k| 5e3 * wave(k)).collect(),
            s_m: (0..samples).map(|k| 5e-5 * wave(k).signum()).collect(),
            bounds_m: Some((5e-5, -5e-5)),
            contact: Some(contact),
            dx_m,
        }
    }

    #[test]
    fn the_page_names_the_digests_of_its_scripts() {
        use base64::Engine;
        use sha2::Digest;
        for script in [CHART, GLUE] {
            let digest = base64::prelude::BASE64_STANDARD.encode(sha2::Sha256::digest(script));
            assert!(SCRIPT_HASHES.contains(&format!("'sha256-{digest}'")), "it is now {digest}");
        }
    }

    #[test]
    fn no_excursion_is_lost_to_thinning() {
        let points = min_max_buckets(&plot().dx_m, 100);
        assert_eq!(points.len(), 200);
        assert!(points.iter().any(|p| p.1.to_bits() == 3e-3_f64.to_bits()));
        assert!(points[4].1.is_nan(), "a bucket without a sample stays empty");
        assert!(points.windows(2).all(|w| w[0].0 < w[1].0));
    }

    #[test]
    fn foreign_text_is_never_markup_and_the_page_needs_no_other_file() {
        let page = estimate_plot_html(&[plot()], None).unwrap();
        assert!(!page.contains("src=\"") && !page.contains("<link rel=\"stylesheet\""));
        for text in [estimate_plot_svg(&[plot()]), page] {
            assert!(!text.contains("<script>alert"), "escaped");
            assert!(text.contains("&#60;script&#62;alert") || text.contains("&lt;script&gt;alert"));
        }
    }
}
