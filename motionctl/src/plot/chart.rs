//! Position, velocity, acceleration and following error over time, one below the other, as SVG.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::recording::Sample;

/// Units of the drawing in a pixel of its picture: the library draws in whole units.
const SCALE: u32 = 8;
const WIDTH: u32 = 1100 * SCALE;
const PANEL: u32 = 260 * SCALE;
const TITLE: u32 = 46 * SCALE;
/// Columns in which a long recording keeps its least and greatest value.
const COLUMNS: usize = 2000;

/// A line to draw: its name and where it is in a sample.
type Line = (&'static str, fn(&Sample) -> Option<f64>);

struct Panel {
    title: &'static str,
    unit: &'static str,
    lines: &'static [Line],
}

const PANELS: [Panel; 4] = [
    Panel {
        title: "position",
        unit: "units",
        lines: &[("nominal", |s| s.nominal_position), ("actual", |s| s.position)],
    },
    Panel {
        title: "velocity",
        unit: "units/s",
        lines: &[("nominal", |s| s.nominal_velocity), ("actual", |s| s.velocity)],
    },
    Panel {
        title: "acceleration",
        unit: "units/s²",
        lines: &[("nominal", |s| s.nominal_acceleration), ("actual", |s| s.acceleration)],
    },
    Panel {
        title: "following error", unit: "units", lines: &[("nominal − actual", |s| s.following_error)]
    },
];

/// One curve of a panel.
struct Curve {
    name: String,
    points: Vec<(f64, f64)>,
}

fn curves(panel: &Panel, axes: &[u8], samples: &[Sample]) -> Vec<Curve> {
    let mut curves = Vec::new();
    for &axis in axes {
        for (name, value) in panel.lines {
            let points = samples.iter().filter(|sample| sample.axis == axis);
            let points: Vec<_> = points.filter_map(|sample| Some((sample.t, value(sample)?))).collect();
            if !points.is_empty() {
                let name = if axes.len() > 1 { format!("axis {axis}, {name}") } else { (*name).to_string() };
                curves.push(Curve { name, points: thin(points) });
            }
        }
    }
    curves
}

/// Keeps the least and the greatest value of each of [`COLUMNS`], so that nothing is lost to the eye.
fn thin(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    if points.len() <= 2 * COLUMNS {
        return points;
    }
    let column = points.len().div_ceil(COLUMNS);
    let mut kept = Vec::with_capacity(2 * COLUMNS);
    for part in points.chunks(column) {
        let least = part.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        let greatest = part.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        if let (Some(&least), Some(&greatest)) = (least, greatest) {
            let (first, second) = if least.0 <= greatest.0 { (least, greatest) } else { (greatest, least) };
            kept.push(first);
            if first != second {
                kept.push(second);
            }
        }
    }
    kept
}

/// From the least to the greatest value with so much room below and above, in shares; never empty.
fn range(values: impl Iterator<Item = f64>, below: f64, above: f64) -> core::ops::Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let span = high - low;
    if span > 0.0 { low - below * span..high + above * span } else { low - 1.0..high + 1.0 }
}

/// `1234567` as `1 234 567`: digits in threes, and as few decimals as tell the steps apart.
fn number(value: &f64) -> String {
    // A rounding error about zero is zero.
    let rounded = (value * 1e6).round() / 1e6;
    if rounded.abs() < 1000.0 {
        return format!("{rounded}");
    }
    let digits = format!("{:.0}", rounded.abs());
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push('\u{2009}');
        }
        text.push(digit);
    }
    if rounded < 0.0 { format!("−{text}") } else { text }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Failure<'a> = DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>;

/// The whole drawing.
pub(crate) fn svg(title: &str, samples: &[Sample]) -> Result<String, String> {
    let mut axes: Vec<u8> = samples.iter().map(|sample| sample.axis).collect();
    axes.sort_unstable();
    axes.dedup();
    let panels: Vec<_> = PANELS
        .iter()
        .map(|panel| (panel, curves(panel, &axes, samples)))
        .filter(|(_, curves)| !curves.is_empty())
        .collect();
    let time = range(samples.iter().map(|sample| sample.t), 0.0, 0.0);
    let mut text = String::new();
    let height = TITLE + PANEL * panels.len() as u32;
    draw(title, &panels, &time, height, &mut text).map_err(|error| error.to_string())?;
    let size = |scale: u32| format!("width=\"{}\" height=\"{}\"", WIDTH / scale, height / scale);
    Ok(text.replacen(&size(1), &size(SCALE), 1))
}

fn draw<'a>(
    title: &str,
    panels: &[(&Panel, Vec<Curve>)],
    time: &core::ops::Range<f64>,
    height: u32,
    text: &'a mut String,
) -> Result<(), Failure<'a>> {
    let font = 20 * SCALE;
    let root = SVGBackend::with_string(text, (WIDTH, height)).into_drawing_area();
    root.fill(&WHITE)?;
    let rest = root.margin(8 * SCALE, 0, 0, 0).titled(title, ("sans-serif", font))?;
    for (area, (panel, curves)) in rest.split_evenly((panels.len(), 1)).iter().zip(panels) {
        draw_panel(area, panel, curves, time)?;
    }
    root.present()
}

fn draw_panel<'a>(
    area: &Area<'a>,
    panel: &Panel,
    curves: &[Curve],
    time: &core::ops::Range<f64>,
) -> Result<(), Failure<'a>> {
    let values = curves.iter().flat_map(|curve| curve.points.iter().map(|point| point.1));
    // The names of the curves stand above them, over no curve.
    let values = range(values, 0.06, 0.06 + 0.16 * curves.len() as f64);
    let mut chart = ChartBuilder::on(area)
        .margin_left(16 * SCALE)
        .margin_right(24 * SCALE)
        .margin_top(6 * SCALE)
        .x_label_area_size(42 * SCALE)
        .y_label_area_size(104 * SCALE)
        .build_cartesian_2d(time.clone(), values)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.2).stroke_width(SCALE))
        .axis_style(BLACK.stroke_width(SCALE))
        .set_all_tick_mark_size(5 * SCALE)
        .x_desc("time in s")
        .y_desc(format!("{} in {}", panel.title, panel.unit))
        .x_label_formatter(&number)
        .y_label_formatter(&number)
        .label_style(("sans-serif", 13 * SCALE))
        .draw()?;
    for (place, curve) in curves.iter().enumerate() {
        let color = Palette99::pick(place).to_rgba();
        // The first of a pair is drawn broad and pale, so that both are seen where they agree.
        let pale = curve.name.ends_with("nominal");
        let style =
            if pale { color.mix(0.45).stroke_width(4 * SCALE) } else { color.stroke_width(2 * SCALE) };
        chart
            .draw_series(LineSeries::new(curve.points.iter().copied(), style))?
            .label(&curve.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 22 * SCALE as i32, y)], style));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .legend_area_size(28 * SCALE)
        .margin(8 * SCALE)
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.3).stroke_width(SCALE))
        .label_font(("sans-serif", 13 * SCALE))
        .draw()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(t: f64, position: f64) -> Sample {
        let status = motion_core::application::AxisStatus::default();
        Sample { t, position: Some(position), ..Sample::new(core::time::Duration::ZERO, 1, &status) }
    }

    #[test]
    fn numbers_are_read_at_a_glance() {
        let text = |value: f64| number(&value).replace('\u{2009}', " ");
        assert_eq!([0.0, -0.5, 999.0].map(text), ["0", "-0.5", "999"]);
        assert_eq!([1000.0, -3_276_800.0, 1e-12].map(text), ["1 000", "−3 276 800", "0"]);
    }

    #[test]
    fn a_long_recording_keeps_its_peaks() {
        let points: Vec<_> = (0..100_000).map(|n| (f64::from(n), f64::from(u8::from(n == 77_777)))).collect();
        let kept = thin(points);
        assert!(kept.len() <= 2 * COLUMNS && kept.contains(&(77_777.0, 1.0)));
        assert!(kept.is_sorted_by(|a, b| a.0 <= b.0));
    }

    /// Every panel, its unit, every curve; a name with signs of its own stays a name.
    #[test]
    fn the_drawing_is_labelled() {
        let samples: Vec<_> = (0..50).map(|n| sample(f64::from(n), f64::from(n * n))).collect();
        let text = svg("run <1> & more", &samples).unwrap();
        for words in
            ["position in units", "velocity in units/s", "units/s²", "following error in units", "time in s"]
        {
            assert!(text.contains(words), "{words}");
        }
        assert!(text.contains("run &lt;1&gt; &amp; more"), "{text:.600}");
        assert_eq!(svg("one point", &[sample(0.0, 5.0)]).unwrap().matches("<svg").count(), 1);
    }
}
