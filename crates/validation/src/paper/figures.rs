//! The figures as SVG drawings.

use plotters::chart::ChartContext;
use plotters::prelude::*;

use crate::drawing::{
    Area, Axes, BLUE, Drawn, Failure, GREEN, GREY, GRID, INK, ORANGE, builder, chart, drawing, mesh, text,
};
use crate::paper::claims::{Change, Claims, Convergence};
use crate::paper::{GAP_M, STEP_S, backlash_m};

const PURPLE: RGBColor = RGBColor(0x7B, 0x4F, 0x9E);
const COLOURS: [RGBColor; 5] = [BLUE, ORANGE, GREEN, GREY, PURPLE];
/// Width and height of a figure of one or two panels.
const SIZE: (u32, u32) = (840, 300);
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

/// A curve: its name, colour and points.
type Curve = (String, RGBColor, Vec<(f64, f64)>);

/// Every figure with the name of its file.
pub fn pictures(claims: &Claims) -> Vec<(&'static str, Drawn)> {
    vec![
        ("paper-2-positions.svg", positions(claims)),
        ("paper-3-load.svg", load(claims)),
        ("paper-4-relative.svg", relative(claims)),
        ("paper-5-backlash.svg", backlash(claims)),
        ("paper-6-speed.svg", against_speed(claims)),
        ("paper-7-load.svg", against_load(claims)),
        ("paper-convergence.svg", convergences(claims)),
        ("paper-noise.svg", noises(claims)),
        ("paper-parameters.svg", parameters(claims)),
        ("paper-varying.svg", varying(claims)),
    ]
}

/// A figure of panels side by side.
fn figure(panels: usize, draw: impl FnOnce(&[Area<'_>]) -> Result<(), Failure>) -> Drawn {
    drawing(SIZE, |root| draw(&root.split_evenly((1, panels))))
}

fn lines<'r, 's: 'r, X, Y>(
    chart: &mut ChartContext<'r, SVGBackend<'s>, Cartesian2d<X, Y>>,
    curves: Vec<Curve>,
) -> Result<(), Failure>
where
    X: Ranged<ValueType = f64>,
    Y: Ranged<ValueType = f64>,
{
    let is_named = curves.iter().any(|(name, ..)| !name.is_empty());
    for (name, colour, points) in curves {
        let drawn = chart.draw_series(LineSeries::new(points, colour.stroke_width(1)))?;
        if !name.is_empty() {
            drawn
                .label(name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], colour.stroke_width(2)));
        }
    }
    if !is_named {
        return Ok(());
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .border_style(GRID)
        .label_font(text(12))
        .draw()
}

/// Least and greatest with a margin.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (least, most) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    let margin = 0.06 * (most - least).max(f64::MIN_POSITIVE);
    (least - margin, most + margin)
}

/// A series against time, with the least and the greatest value of each column.
fn over_time(values: &[f64], scale: f64) -> Vec<(f64, f64)> {
    let width = values.len().div_ceil(COLUMNS);
    let column = |(k, part): (usize, &[f64])| {
        let at = |place: usize| ((k * width + place) as f64 * STEP_S, part[place] * scale);
        let by = |a: &usize, b: &usize| part[*a].total_cmp(&part[*b]);
        let (least, most) = ((0..part.len()).min_by(by), (0..part.len()).max_by(by));
        let mut places: Vec<usize> = least.into_iter().chain(most).collect();
        places.sort_unstable();
        places.dedup();
        places.into_iter().map(at).collect::<Vec<_>>()
    };
    values.chunks(width).enumerate().flat_map(column).collect()
}

/// The samples of the zoom.
fn zoomed(values: &[f64], scale: f64) -> Vec<(f64, f64)> {
    let samples = (ZOOM_S.0 / STEP_S) as usize..(ZOOM_S.1 / STEP_S) as usize;
    samples.map(|k| (k as f64 * STEP_S, values[k] * scale)).collect()
}

fn spread(points: &[Curve]) -> (f64, f64) {
    range(points.iter().flat_map(|(_, _, points)| points.iter().map(|(_, y)| *y)))
}

/// Points of a series, scaled.
type Thin = fn(&[f64], f64) -> Vec<(f64, f64)>;

/// Curves over the whole flight on the left, and over two seconds on the right.
fn whole_and_zoom(series: [(&str, RGBColor, &[f64]); 2], name: &str, scale: f64) -> Drawn {
    let curves = |points: Thin| -> Vec<Curve> {
        series
            .iter()
            .map(|(name, colour, values)| ((*name).to_owned(), *colour, points(values, scale)))
            .collect()
    };
    figure(2, |areas| {
        for (area, curves) in areas.iter().zip([curves(over_time), curves(zoomed)]) {
            let (low, high) = spread(&curves);
            let (from_s, to_s) = range(curves[0].2.iter().map(|(x, _)| *x));
            let axes = Axes { x: ("time [s]", from_s, to_s), y: (name, low, high) };
            lines(&mut chart(area, &axes)?, curves)?;
        }
        Ok(())
    })
}

fn positions(claims: &Claims) -> Drawn {
    let flight = &claims.flight;
    whole_and_zoom(
        [("motor", ORANGE, &flight.motor_m), ("screw", BLUE, &flight.screw_m)],
        "position [mm]",
        1e3,
    )
}

fn load(claims: &Claims) -> Drawn {
    let points = over_time(&claims.flight.load_n, 1e-3);
    let (low, high) = range(points.iter().map(|(_, y)| *y));
    figure(1, |areas| {
        let axes = Axes { x: ("time [s]", 0.0, end_s(claims)), y: ("load [kN]", low, high) };
        lines(&mut chart(&areas[0], &axes)?, vec![(String::new(), BLUE, points)])
    })
}

fn relative(claims: &Claims) -> Drawn {
    let measured = crate::paper::relative_position_m(&claims.flight);
    let estimated: Vec<f64> = claims.states.iter().map(|state| state.x[0]).collect();
    whole_and_zoom(
        [("measured", GREY, &measured), ("estimated", BLUE, &estimated)],
        "relative position [µm]",
        1e6,
    )
}

fn end_s(claims: &Claims) -> f64 {
    claims.states.len() as f64 * STEP_S
}

fn backlash(claims: &Claims) -> Drawn {
    let points = over_time(&backlash_m(&claims.states), 1e6);
    let (low, high) = range(points.iter().map(|(_, y)| *y));
    let end = end_s(claims);
    let level = |name: &str, colour, level_m: f64| -> Curve {
        (format!("{name} {:.1} µm", 1e6 * level_m), colour, vec![(0.0, 1e6 * level_m), (end, 1e6 * level_m)])
    };
    let gap = &claims.gap;
    let curves = vec![
        ("S(t)".to_owned(), GREY, points),
        level("upper mean", ORANGE, gap.upper_m),
        level("lower mean", GREEN, gap.lower_m),
    ];
    figure(1, |areas| {
        let axes =
            Axes { x: ("time [s]", 0.0, end), y: ("backlash S [µm]", low, high + 0.25 * (high - low)) };
        lines(&mut chart(&areas[0], &axes)?, curves)
    })
}

/// S against another quantity: dots above the mid-range in one colour, those below in another.
fn scatter(claims: &Claims, name: &str, x: &[f64]) -> Drawn {
    let s_um: Vec<f64> = backlash_m(&claims.states).iter().map(|s| 1e6 * s).collect();
    let every = (s_um.len() / DOTS).max(1);
    let picked: Vec<usize> = (SETTLED..s_um.len() - 1).step_by(every).collect();
    let (left, right) = range(picked.iter().map(|k| x[*k]));
    let (low, high) = range(picked.iter().map(|k| s_um[*k]));
    figure(1, |areas| {
        let axes = Axes { x: (name, left, right), y: ("backlash S [µm]", low, high) };
        let mut chart = chart(&areas[0], &axes)?;
        let middle_um = 1e6 * claims.gap.mid_range_m;
        let dot = |&k: &usize| {
            let colour = if s_um[k] >= middle_um { ORANGE } else { GREEN };
            Circle::new((x[k], s_um[k]), 1, colour.filled())
        };
        chart.draw_series(picked.iter().map(dot))?;
        Ok(())
    })
}

fn against_speed(claims: &Claims) -> Drawn {
    let motor_m = &claims.flight.motor_m;
    let speed = |k: usize| {
        let (before, after) = (k.saturating_sub(2), (k + 2).min(motor_m.len() - 1));
        1e3 * (motor_m[after] - motor_m[before]) / ((after - before) as f64 * STEP_S)
    };
    scatter(claims, "motor speed [mm/s]", &(0..motor_m.len()).map(speed).collect::<Vec<_>>())
}

fn against_load(claims: &Claims) -> Drawn {
    scatter(claims, "load [kN]", &claims.flight.load_n.iter().map(|f| 1e-3 * f).collect::<Vec<_>>())
}

/// Two panels of convergence on a logarithmic scale.
fn convergences(claims: &Claims) -> Drawn {
    figure(2, |areas| {
        for (area, curves) in areas.iter().zip([&claims.starts, &claims.spreads]) {
            let axes = Axes { x: ("time [s]", 0.0, 0.6), y: ("error of S [µm]", LEAST_UM, 3e4) };
            let mut chart =
                builder(area).build_cartesian_2d(axes.x.1..axes.x.2, (axes.y.1..axes.y.2).log_scale())?;
            mesh(&mut chart, &axes)?;
            let samples = (axes.x.2 / STEP_S) as usize;
            let points = |curve: &Convergence| {
                let error = curve.error_m.iter().take(samples).enumerate();
                error.map(|(k, e)| (k as f64 * STEP_S, (1e6 * e).max(LEAST_UM))).collect()
            };
            let curves = curves.iter().zip(COLOURS).map(|(c, colour)| (c.name.clone(), colour, points(c)));
            let mut curves: Vec<Curve> = curves.collect();
            let level_um = 1e4 * GAP_M;
            curves.push(("1 % of the gap".to_owned(), INK, vec![(axes.x.1, level_um), (axes.x.2, level_um)]));
            lines(&mut chart, curves)?;
        }
        Ok(())
    })
}

/// The range over the flights as a bar and the mean as a line, against a factor on a logarithmic scale.
fn changes(
    area: &Area<'_>,
    name: &str,
    y: (&str, f64, f64),
    all: &[(&str, &[Change])],
) -> Result<(), Failure> {
    let factors = || all.iter().flat_map(|(_, changes)| changes.iter().map(|change| change.factor));
    let (left, right) = (factors().fold(f64::INFINITY, f64::min), factors().fold(0.0, f64::max));
    let axes = Axes { x: (name, left / 1.2, right * 1.2), y };
    let mut chart = builder(area).build_cartesian_2d((axes.x.1..axes.x.2).log_scale(), axes.y.1..axes.y.2)?;
    mesh(&mut chart, &axes)?;
    let curve = |((name, changes), colour): (&(&str, &[Change]), RGBColor)| -> Curve {
        let points = changes.iter().map(|change| (change.factor, change.percent[1].clamp(y.1, y.2)));
        ((*name).to_owned(), colour, points.collect())
    };
    for ((_, changes), colour) in all.iter().zip(COLOURS) {
        let bar = |change: &Change| {
            let [least, _, most] = change.percent.map(|percent| percent.clamp(y.1, y.2));
            PathElement::new(vec![(change.factor, least), (change.factor, most)], colour.stroke_width(3))
        };
        chart.draw_series(changes.iter().map(bar))?;
    }
    lines(&mut chart, all.iter().zip(COLOURS).map(curve).collect())
}

fn noises(claims: &Claims) -> Drawn {
    figure(2, |areas| {
        let y = ("error of ΔS [%]", -30.0, 30.0);
        changes(&areas[0], "noise of both positions, factor", y, &[("", &claims.noise)])?;
        changes(&areas[1], "W_d/V_d, factor", y, &[("", &claims.tuning)])
    })
}

fn parameters(claims: &Claims) -> Drawn {
    figure(2, |areas| {
        let both: [(&str, &[Change]); 2] = [("damping", &claims.damping), ("mass", &claims.mass)];
        changes(&areas[0], "assumed damping or mass, factor", ("change of ΔS [%]", -1.0, 1.0), &both)?;
        let axes =
            Axes { x: ("error of the stiffness [%]", -12.0, 12.0), y: ("change of ΔS [%]", -16.0, 16.0) };
        let mut chart = chart(&areas[1], &axes)?;
        let place = |change: &Change| 100.0 * (change.factor - 1.0);
        let bar = |change: &Change| {
            let ends = [change.percent[0], change.percent[2]].map(|percent| (place(change), percent));
            PathElement::new(ends.to_vec(), BLUE.stroke_width(3))
        };
        chart.draw_series(claims.stiffness.iter().map(bar))?;
        let means = claims.stiffness.iter().map(|change| (place(change), change.percent[1]));
        lines(&mut chart, vec![(String::new(), BLUE, means.collect())])
    })
}

fn varying(claims: &Claims) -> Drawn {
    figure(1, |areas| {
        let axes = Axes { x: ("time [s]", 0.0, end_s(claims)), y: ("gap [µm]", 0.0, 260.0) };
        let mut chart = chart(&areas[0], &axes)?;
        let truth = claims.varying.iter().map(|window| (window.time_s, 1e6 * window.true_m)).collect();
        lines(&mut chart, vec![("true gap".to_owned(), INK, truth)])?;
        let dot = |window: &crate::paper::claims::Window| {
            Circle::new((window.time_s, 1e6 * window.gap_m), 4, BLUE.filled())
        };
        chart.draw_series(claims.varying.iter().map(dot))?;
        Ok(())
    })
}
