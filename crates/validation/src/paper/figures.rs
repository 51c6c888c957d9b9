//! The figures as SVG pictures.

use crate::drawing::{Axis, BLUE, GREEN, GREY, INK, ORANGE, Panel, Series, Shape, picture};
use crate::paper::claims::{Change, Claims, Convergence};
use crate::paper::{GAP_M, STEP_S, backlash_m, relative_position_m};

const COLOURS: [&str; 5] = [BLUE, ORANGE, GREEN, GREY, "#7B4F9E"];
/// Width and height of a figure, px.
const SIZE: [f64; 2] = [840.0, 300.0];
/// Columns of a line over a whole flight: each has its least and its greatest value.
const COLUMNS: usize = 600;
/// Dots of a scatter plot.
const DOTS: usize = 1200;
/// The zoom of figures 2 and 4, s.
const ZOOM_S: (f64, f64) = (60.0, 62.0);
/// S is drawn after the first second.
const SETTLED: usize = 250;
/// Differences below this are drawn at the edge, µm.
const LEAST_UM: f64 = 1e-4;
const THIN: Shape = Shape::Line(1.0);

/// Every figure with the name of its file: one panel, or two side by side.
pub(crate) fn pictures(claims: &Claims) -> Vec<(&'static str, String)> {
    let flight = &claims.flight;
    let positions = [("motor", ORANGE, &flight.motor_m[..]), ("screw", BLUE, &flight.screw_m)];
    let measured_m = relative_position_m(flight);
    let estimated_m: Vec<f64> = claims.states.iter().map(|state| state.x[0]).collect();
    let relative = [("measured", GREY, &measured_m[..]), ("estimated", BLUE, &estimated_m)];
    let load = Series::new(BLUE, THIN, over_time(&flight.load_n, 1e-3));
    let loads_kn: Vec<f64> = flight.load_n.iter().map(|f| 1e-3 * f).collect();
    let figures = [
        ("paper-2-positions.svg", whole_and_zoom(positions, "position [mm]", 1e3)),
        ("paper-3-load.svg", vec![fitted(time(claims), "load [kN]", vec![load])]),
        ("paper-4-relative.svg", whole_and_zoom(relative, "relative position [µm]", 1e6)),
        ("paper-5-backlash.svg", vec![backlash(claims)]),
        ("paper-6-speed.svg", vec![against_speed(claims)]),
        ("paper-7-load.svg", vec![scatter(claims, "load [kN]", &loads_kn)]),
        ("paper-convergence.svg", [&claims.starts, &claims.spreads].map(|all| convergence(all)).into()),
        ("paper-noise.svg", noises(claims)),
        ("paper-parameters.svg", parameters(claims)),
        ("paper-varying.svg", vec![varying(claims)]),
    ];
    let draw = |panels: Vec<Panel>| picture(&panels, panels.len(), [SIZE[0] / panels.len() as f64, SIZE[1]]);
    figures.into_iter().map(|(name, panels)| (name, draw(panels))).collect()
}

/// A panel whose vertical axis holds all its series.
fn fitted(x: Axis, y: &str, series: Vec<Series>) -> Panel {
    let y = Axis::around(y, series.iter().flat_map(|series| series.points.iter().map(|(_, y)| *y)));
    Panel::new(x, y, series)
}

/// The axis of time over the whole flight.
fn time(claims: &Claims) -> Axis {
    Axis::new("time [s]", 0.0..end_s(claims))
}

/// A series against time, with the least and the greatest value of each column.
fn over_time(values: &[f64], scale: f64) -> Vec<(f64, f64)> {
    let points = report::min_max_buckets(values, COLUMNS);
    points.into_iter().map(|(at, value)| (at * STEP_S, value * scale)).collect()
}

fn zoomed(values: &[f64], scale: f64) -> Vec<(f64, f64)> {
    let samples = (ZOOM_S.0 / STEP_S) as usize..(ZOOM_S.1 / STEP_S) as usize;
    samples.map(|k| (k as f64 * STEP_S, values[k] * scale)).collect()
}

type Thin = fn(&[f64], f64) -> Vec<(f64, f64)>;

/// Curves over the whole flight on the left, and over two seconds on the right.
fn whole_and_zoom(series: [(&str, &'static str, &[f64]); 2], name: &str, scale: f64) -> Vec<Panel> {
    let panel = |points: Thin| {
        let curves =
            series.map(|(name, colour, values)| Series::new(colour, THIN, points(values, scale)).named(name));
        let time = Axis::around("time [s]", curves[0].points.iter().map(|(x, _)| *x));
        fitted(time, name, curves.into())
    };
    vec![panel(over_time), panel(zoomed)]
}

fn end_s(claims: &Claims) -> f64 {
    claims.states.len() as f64 * STEP_S
}

fn backlash(claims: &Claims) -> Panel {
    let level = |name: &str, colour, level_m: f64| {
        let um = 1e6 * level_m;
        Series::new(colour, THIN, vec![(0.0, um), (end_s(claims), um)]).named(&format!("{name} {um:.1} µm"))
    };
    let series = vec![
        Series::new(GREY, THIN, over_time(&backlash_m(&claims.states), 1e6)).named("S(t)"),
        level("upper mean", ORANGE, claims.gap.upper_m),
        level("lower mean", GREEN, claims.gap.lower_m),
    ];
    let mut panel = fitted(time(claims), "backlash S [µm]", series);
    // Room for the names.
    panel.y.range.end += 0.25 * (panel.y.range.end - panel.y.range.start);
    panel
}

/// S against another quantity: dots above the mid-range in one colour, those below in another.
fn scatter(claims: &Claims, name: &str, x: &[f64]) -> Panel {
    let s_um: Vec<f64> = backlash_m(&claims.states).iter().map(|s| 1e6 * s).collect();
    let every = (s_um.len() / DOTS).max(1);
    let picked = || (SETTLED..s_um.len() - 1).step_by(every).map(|k| (x[k], s_um[k]));
    let middle_um = 1e6 * claims.gap.mid_range_m;
    let (upper, lower) = picked().partition(|(_, s_um)| *s_um >= middle_um);
    let series = [(ORANGE, upper), (GREEN, lower)];
    let series = series.map(|(colour, points)| Series::new(colour, Shape::Dots(1.0), points));
    fitted(Axis::around(name, picked().map(|(x, _)| x)), "backlash S [µm]", series.into())
}

fn against_speed(claims: &Claims) -> Panel {
    let motor_m = &claims.flight.motor_m;
    let speed = |k: usize| {
        let (before, after) = (k.saturating_sub(2), (k + 2).min(motor_m.len() - 1));
        1e3 * (motor_m[after] - motor_m[before]) / ((after - before) as f64 * STEP_S)
    };
    scatter(claims, "motor speed [mm/s]", &(0..motor_m.len()).map(speed).collect::<Vec<_>>())
}

fn convergence(all: &[Convergence]) -> Panel {
    const SHOWN_S: f64 = 0.6;
    let curve = |(one, colour): (&Convergence, &'static str)| {
        let error = one.error_m.iter().take((SHOWN_S / STEP_S) as usize).enumerate();
        let points = error.map(|(k, e)| (k as f64 * STEP_S, (1e6 * e).max(LEAST_UM)));
        Series::new(colour, THIN, points.collect()).named(&one.name)
    };
    let level_um = 1e4 * GAP_M;
    let level = Series::new(INK, THIN, vec![(0.0, level_um), (SHOWN_S, level_um)]).named("1 % of the gap");
    let series = all.iter().zip(COLOURS).map(curve).chain([level]).collect();
    Panel::new(Axis::new("time [s]", 0.0..SHOWN_S), Axis::log("error of S [µm]", LEAST_UM..3e4), series)
}

/// The range over the flights as a bar and the mean as a line, against what is made of the factor.
fn changes(x: Axis, y: Axis, place: fn(f64) -> f64, all: &[(&str, &[Change])]) -> Panel {
    let cut = |percent: f64| percent.clamp(y.range.start, y.range.end);
    let of = |((name, changes), colour): (&(&str, &[Change]), &'static str)| {
        let at = |change: &Change, k: usize| (place(change.factor), cut(change.percent[k]));
        let bars = changes.iter().flat_map(|change| [at(change, 0), at(change, 2)]).collect();
        let means = changes.iter().map(|change| at(change, 1)).collect();
        [Series::new(colour, Shape::Bars(3.0), bars), Series::new(colour, THIN, means).named(name)]
    };
    let series = all.iter().zip(COLOURS).flat_map(of).collect();
    Panel::new(x, y, series)
}

/// The changes against the factor itself, on a logarithmic axis.
fn by_factor(name: &str, y: Axis, all: &[(&str, &[Change])]) -> Panel {
    let factors = || all.iter().flat_map(|(_, changes)| changes.iter().map(|change| change.factor));
    let (left, right) = (factors().fold(f64::INFINITY, f64::min), factors().fold(0.0, f64::max));
    changes(Axis::log(name, left / 1.2..right * 1.2), y, |factor| factor, all)
}

fn noises(claims: &Claims) -> Vec<Panel> {
    let y = || Axis::new("error of ΔS [%]", -30.0..30.0);
    vec![
        by_factor("noise of both positions, factor", y(), &[("", &claims.noise)]),
        by_factor("W_d/V_d, factor", y(), &[("", &claims.tuning)]),
    ]
}

fn parameters(claims: &Claims) -> Vec<Panel> {
    let y = |most: f64| Axis::new("change of ΔS [%]", -most..most);
    let both: [(&str, &[Change]); 2] = [("damping", &claims.damping), ("mass", &claims.mass)];
    let error = Axis::new("error of the stiffness [%]", -12.0..12.0);
    let percent = |factor: f64| 100.0 * (factor - 1.0);
    vec![
        by_factor("assumed damping or mass, factor", y(1.0), &both),
        changes(error, y(16.0), percent, &[("", &claims.stiffness)]),
    ]
}

fn varying(claims: &Claims) -> Panel {
    let windows = claims.varying.iter();
    let truth = windows.clone().map(|window| (window.time_s, 1e6 * window.true_m)).collect();
    let found = windows.map(|window| (window.time_s, 1e6 * window.gap_m)).collect();
    let series =
        vec![Series::new(INK, THIN, truth).named("true gap"), Series::new(BLUE, Shape::Dots(4.0), found)];
    Panel::new(time(claims), Axis::new("gap [µm]", 0.0..260.0), series)
}
