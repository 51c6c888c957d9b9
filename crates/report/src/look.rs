//! One actuator in one flight, drawn: what was measured, what the filter made of it, and where the flanks
//! were found.

use askama::Template;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use resvg::{tiny_skia, usvg};

use crate::Error;
use crate::chart::{GRID, INK};

const FAINT: RGBColor = RGBColor(0x9A, 0xA5, 0xB1);
const UPPER: RGBColor = RGBColor(0xC8, 0x52, 0x00);
const LOWER: RGBColor = RGBColor(0x1F, 0x6F, 0xB2);
const GAP: RGBColor = RGBColor(0x22, 0x22, 0x22);

/// Size of one actuator's picture, pixels, and of its heading.
const SIZE: (u32, u32) = (1280, 640);
/// See [`SIZE`].
const HEADING: u32 = 46;
/// Width of the part with time along it.
const TIMED: u32 = 800;
/// Points of a curve over time at most: two for each pixel it has.
const POINTS: usize = 1400;
/// Stretches drawn at most; beyond it every n-th.
const STRETCHES: usize = 3000;
/// A PNG has this many pixels for each of the picture, so that it may be looked at closely.
const ZOOM: f32 = 1.5;

/// What one estimate stands on.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Look {
    /// Which actuator of which log.
    pub title: String,
    /// Its numbers in words.
    pub words: String,
    /// Time between samples, s.
    pub step_s: f64,
    /// δX, m; NaN where missing.
    pub dx_m: Vec<f64>,
    /// Load, N; NaN where missing.
    pub load_n: Vec<f64>,
    /// S(t), m; NaN outside the segments.
    pub s_m: Vec<f64>,
    /// Means of S above and below its mid-range, m.
    pub bounds_m: Option<(f64, f64)>,
    /// Stretches in contact that the regression saw.
    pub stretches: Vec<Stretch>,
    /// Fitted flanks, upper and lower: force in the coupling, N, and δX, m.
    pub flanks: [Vec<(f64, f64)>; 2],
}

/// A stretch in contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// Its middle, s.
    pub time_s: f64,
    /// Whether the upper flank was pressed.
    pub is_upper: bool,
    /// Whether the straight fit used it.
    pub is_used: bool,
    /// Force in the coupling, N.
    pub force_n: f64,
    /// δX less drift, skew, transducer error and wrong friction, m.
    pub dx_m: f64,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Fault = DrawingAreaErrorKind<std::io::Error>;

/// All looks in one picture, one below the other.
///
/// # Errors
/// When the picture cannot be drawn.
pub fn look_svg(looks: &[Look]) -> Result<String, Error> {
    let mut svg = String::new();
    draw(&mut svg, looks).map_err(|e| Error::Picture(e.to_string()))?;
    Ok(svg)
}

/// The same as a PNG, with a font of its own, so that it looks alike on every machine.
///
/// # Errors
/// When the picture cannot be drawn.
pub fn look_png(looks: &[Look]) -> Result<Vec<u8>, Error> {
    let lift = |e: &dyn std::fmt::Display| Error::Picture(e.to_string());
    let mut options = usvg::Options { font_family: "DejaVu Sans".to_owned(), ..usvg::Options::default() };
    options.fontdb_mut().load_font_data(dejavu::sans::regular().to_vec());
    options.fontdb_mut().set_sans_serif_family("DejaVu Sans");
    let tree = usvg::Tree::from_str(&look_svg(looks)?, &options).map_err(|e| lift(&e))?;
    let side = |length: f32| (length * ZOOM).ceil() as u32;
    let mut pixels = tiny_skia::Pixmap::new(side(tree.size().width()), side(tree.size().height()))
        .ok_or_else(|| Error::Picture(format!("{} actuators are too many for one PNG", looks.len())))?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(ZOOM, ZOOM), &mut pixels.as_mut());
    pixels.encode_png().map_err(|e| lift(&e))
}

/// A page that stands alone: each picture, and its curves once more to hover over and zoom into.
///
/// # Errors
/// When a picture cannot be drawn or the page not be filled.
pub fn look_html(looks: &[Look]) -> Result<String, Error> {
    let sections = looks
        .iter()
        .map(|look| {
            let picture = look_svg(std::slice::from_ref(look))?;
            Ok(Section { title: &look.title, words: &look.words, picture, data: data(look)? })
        })
        .collect::<Result<_, Error>>()?;
    let page = LookPage {
        sections,
        style: include_str!("../assets/look.css"),
        chart_style: include_str!("../assets/uplot.css"),
        chart: include_str!("../assets/uplot.js"),
        glue: include_str!("../assets/look.js"),
    };
    Ok(page.render()?)
}

#[derive(Template)]
#[template(path = "look.html")]
struct LookPage<'a> {
    sections: Vec<Section<'a>>,
    style: &'static str,
    chart_style: &'static str,
    chart: &'static str,
    glue: &'static str,
}

struct Section<'a> {
    title: &'a str,
    words: &'a str,
    picture: String,
    data: String,
}

/// The curves as the script wants them: µm and kN, thinned alike. `<` never stands in it, so it can stand
/// in a script element.
fn data(look: &Look) -> Result<String, Error> {
    let origin_m = origin_m(look);
    let um = |v: f64| (!v.is_nan()).then(|| ((v - origin_m) * 1e9).round() / 1e3);
    let buckets = buckets(look.s_m.len());
    let pick = |values: &[f64], scale: &dyn Fn(f64) -> Option<f64>| -> Vec<Option<f64>> {
        extremes(values, buckets).into_iter().map(|(_, v)| scale(v)).collect()
    };
    let time: Vec<f64> = moments(look.s_m.len(), buckets).map(|k| k * look.step_s).collect();
    let kn = |v: f64| (!v.is_nan()).then(|| v.round() / 1e3);
    Ok(serde_json::to_string(&serde_json::json!({
        "time_s": time,
        "dx_um": pick(&look.dx_m, &um),
        "s_um": pick(&look.s_m, &um),
        "load_kn": pick(&look.load_n, &kn),
        "bounds_um": look.bounds_m.map(|(upper, lower)| [um(upper), um(lower)]),
    }))?)
}

fn draw(svg: &mut String, looks: &[Look]) -> Result<(), Fault> {
    let height = SIZE.1 * looks.len().max(1) as u32;
    let root = SVGBackend::with_string(svg, (SIZE.0, height)).into_drawing_area();
    root.fill(&WHITE)?;
    for (area, look) in root.split_evenly((looks.len().max(1), 1)).iter().zip(looks) {
        draw_one(area, look)?;
    }
    root.present()
}

fn draw_one(area: &Area<'_>, look: &Look) -> Result<(), Fault> {
    let (heading, body) = area.split_vertically(HEADING);
    let line = |text: &str, size: u32, y: i32| {
        heading.draw(&Text::new(text.to_owned(), (14, y), ("sans-serif", size).into_font().color(&INK)))
    };
    line(&look.title, 17, 8)?;
    line(&look.words, 13, 30)?;
    let (timed, flanks) = body.split_horizontally(TIMED);
    let (positions, load) = timed.split_vertically((SIZE.1 - HEADING) * 2 / 3);
    let end_s = (look.s_m.len() as f64 * look.step_s).max(1.0);
    draw_positions(&positions, look, end_s)?;
    draw_load(&load, look, end_s)?;
    draw_flanks(&flanks, look)
}

/// δX, S(t) with both means, and the stretches in contact as marks at the lower edge.
fn draw_positions(area: &Area<'_>, look: &Look, end_s: f64) -> Result<(), Fault> {
    let um = |v: f64| (v - origin_m(look)) * 1e6;
    let (low, high) = span(look.dx_m.iter().chain(&look.s_m).map(|v| um(*v)));
    let floor = low - 0.06 * (high - low);
    let mut chart =
        axes(area, (0.0, end_s), (floor - 0.04 * (high - low), high), ("", "µm from the middle"))?;
    let curve = |values: &[f64]| curve(values, look.step_s, um);
    for piece in curve(&look.dx_m) {
        chart.draw_series(LineSeries::new(piece, FAINT))?;
    }
    for piece in curve(&look.s_m) {
        chart.draw_series(LineSeries::new(piece, GAP.stroke_width(2)))?;
    }
    if let Some((upper, lower)) = look.bounds_m {
        for (bound, colour) in [(upper, UPPER), (lower, LOWER)] {
            let ends = [(0.0, um(bound)), (end_s, um(bound))];
            chart.draw_series(DashedLineSeries::new(ends, 8, 4, colour.stroke_width(2)))?;
        }
    }
    let marks = thinned(&look.stretches).map(|s| {
        let y = if s.is_upper { floor } else { floor - 0.025 * (high - low) };
        Circle::new((s.time_s, y), 1, colour(s).filled())
    });
    chart.draw_series(marks)?;
    legend(
        area,
        &[("δX", FAINT), ("S(t)", GAP), ("upper mean, contact", UPPER), ("lower mean, contact", LOWER)],
    )
}

fn draw_load(area: &Area<'_>, look: &Look, end_s: f64) -> Result<(), Fault> {
    let kn = |v: f64| v / 1e3;
    let (low, high) = span(look.load_n.iter().map(|v| kn(*v)));
    let mut chart = axes(area, (0.0, end_s), (low, high), ("time s", "load kN"))?;
    for piece in curve(&look.load_n, look.step_s, kn) {
        chart.draw_series(LineSeries::new(piece, INK))?;
    }
    Ok(())
}

/// δX against the force in the coupling, with the flanks as fitted; what the fit did not use is faint.
fn draw_flanks(area: &Area<'_>, look: &Look) -> Result<(), Fault> {
    let um = |v: f64| (v - origin_m(look)) * 1e6;
    let (low, high) = span(look.stretches.iter().map(|s| um(s.dx_m)));
    let (left, right) = span(look.stretches.iter().map(|s| s.force_n / 1e3));
    let mut chart =
        axes(area, (left, right), (low, high), ("force in the coupling kN", "δX, corrected, µm"))?;
    let marks = |is_used: bool| {
        let which = thinned(&look.stretches).filter(move |s| s.is_used == is_used);
        which.map(move |s| {
            let style = if s.is_used { colour(s).mix(0.55) } else { FAINT.mix(0.6) };
            Circle::new((s.force_n / 1e3, um(s.dx_m)), 2, style.filled())
        })
    };
    chart.draw_series(marks(false))?;
    chart.draw_series(marks(true))?;
    for flank in &look.flanks {
        let line = flank.iter().map(|(force_n, dx_m)| (force_n / 1e3, um(*dx_m)));
        chart.draw_series(LineSeries::new(line, GAP.stroke_width(2)))?;
    }
    if look.stretches.is_empty() {
        let style = ("sans-serif", 14).into_font().color(&INK);
        area.draw(&Text::new("no contact was found", (150, 240), style))?;
    }
    Ok(())
}

fn axes<'a>(area: &Area<'a>, x: (f64, f64), y: (f64, f64), names: (&str, &str)) -> Result<Chart<'a>, Fault> {
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .margin_top(22)
        .x_label_area_size(36)
        .y_label_area_size(62)
        .build_cartesian_2d(x.0..x.1, y.0..y.1)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .label_style(("sans-serif", 12).into_font().color(&INK))
        .x_desc(names.0)
        .y_desc(names.1)
        .draw()?;
    Ok(chart)
}

/// Names beside their colours, above the chart.
fn legend(area: &Area<'_>, entries: &[(&str, RGBColor)]) -> Result<(), Fault> {
    let mut x = 76;
    for (name, colour) in entries {
        area.draw(&Rectangle::new([(x, 9), (x + 14, 13)], colour.filled()))?;
        area.draw(&Text::new((*name).to_owned(), (x + 19, 4), ("sans-serif", 12).into_font().color(&INK)))?;
        x += 40 + 7 * name.chars().count() as i32;
    }
    Ok(())
}

fn colour(stretch: &Stretch) -> RGBColor {
    if stretch.is_upper { UPPER } else { LOWER }
}

fn thinned(stretches: &[Stretch]) -> impl Iterator<Item = &Stretch> {
    stretches.iter().step_by(stretches.len().div_ceil(STRETCHES).max(1))
}

/// The middle between both means of S, or of δX where there are none, m: pictures show what moves.
fn origin_m(look: &Look) -> f64 {
    match look.bounds_m {
        Some((upper, lower)) => f64::midpoint(upper, lower),
        None => {
            let (low, high) = span(look.dx_m.iter().copied());
            f64::midpoint(low, high)
        }
    }
}

/// Smallest and largest, a little apart where they are equal or there are none.
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
    (POINTS / 2).min(samples.max(1))
}

/// Smallest and largest of each bucket in the order of time, so that no excursion is lost; with the sample
/// at which each stands. NaN for a bucket without a value.
fn extremes(values: &[f64], buckets: usize) -> Vec<(f64, f64)> {
    let mut points = Vec::with_capacity(2 * buckets);
    for (bucket, at) in (0..buckets).zip(moments(values.len(), buckets).step_by(2)) {
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

/// Where the two points of each bucket stand, in samples.
fn moments(samples: usize, buckets: usize) -> impl Iterator<Item = f64> {
    let half = 0.5 * samples as f64 / buckets as f64;
    (0..2 * buckets).map(move |k| (k as f64 + 0.5) * half)
}

/// Unbroken pieces of a thinned curve, against time in s.
fn curve(values: &[f64], step_s: f64, scale: impl Fn(f64) -> f64) -> Vec<Vec<(f64, f64)>> {
    let points = extremes(values, buckets(values.len()));
    points
        .split(|(_, v)| v.is_nan())
        .filter(|piece| !piece.is_empty())
        .map(|piece| piece.iter().map(|(at, v)| (at * step_s, scale(*v))).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look() -> Look {
        let wave = |k: usize| (k as f64 * 0.01).sin();
        let samples = 5000;
        let mut dx_m: Vec<f64> = (0..samples).map(|k| 1e-4 * wave(k)).collect();
        dx_m[2500] = 3e-3;
        dx_m[100..200].fill(f64::NAN);
        let stretch = |k: usize| Stretch {
            time_s: k as f64,
            is_upper: k.is_multiple_of(2),
            is_used: k > 3,
            force_n: 100.0 * k as f64,
            dx_m: 1e-6 * k as f64,
        };
        Look {
            title: "<script>alert(1)</script> & co".to_owned(),
            words: "gap 100.0 µm".to_owned(),
            step_s: 0.01,
            load_n: (0..samples).map(|k| 5e3 * wave(k)).collect(),
            s_m: (0..samples).map(|k| 5e-5 * wave(k).signum()).collect(),
            bounds_m: Some((5e-5, -5e-5)),
            stretches: (0..20).map(stretch).collect(),
            flanks: [vec![(0.0, 5e-5), (5e3, 1.5e-4)], vec![(0.0, -5e-5), (-5e3, -1.5e-4)]],
            dx_m,
        }
    }

    #[test]
    fn no_excursion_is_lost_to_thinning() {
        let points = extremes(&look().dx_m, 100);
        assert_eq!(points.len(), 200);
        assert!(points.iter().any(|p| p.1.to_bits() == 3e-3_f64.to_bits()));
        assert!(points[4].1.is_nan(), "a bucket without a sample stays empty");
        assert!(points.windows(2).all(|w| w[0].0 < w[1].0));
    }

    #[test]
    fn foreign_text_is_never_markup() {
        for text in [look_svg(&[look()]).unwrap(), look_html(&[look()]).unwrap()] {
            assert!(!text.contains("<script>alert"), "escaped");
            assert!(text.contains("&#60;script&#62;alert") || text.contains("&lt;script&gt;alert"));
        }
    }

    #[test]
    fn a_png_has_the_picture_in_it() {
        let png = look_png(&[look(), Look::default()]).unwrap();
        assert_eq!(&png[1..4], b"PNG");
        let side = |at: usize| u32::from_be_bytes([png[at], png[at + 1], png[at + 2], png[at + 3]]);
        assert_eq!((side(16), side(20)), (SIZE.0 * 3 / 2, SIZE.1 * 3));
        assert!(png.len() > 30_000, "{} bytes hold no curves", png.len());
    }

    #[test]
    fn the_page_needs_nothing_beside_it() {
        let page = look_html(&[look()]).unwrap();
        assert!(!page.contains("src=\"") && !page.contains("<link rel=\"stylesheet\""));
    }
}
