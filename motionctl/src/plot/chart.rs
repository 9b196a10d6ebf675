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

/// A line of a recording: its name and where it is in a sample.
type Line = (&'static str, fn(&Sample) -> Option<f64>);

/// Title, unit and lines of the panels of a recording.
const PANELS: [(&str, &str, &[Line]); 4] = [
    ("position", "units", &[("nominal", |s| s.nominal_position), ("actual", |s| s.position)]),
    ("velocity", "units/s", &[("nominal", |s| s.nominal_velocity), ("actual", |s| s.velocity)]),
    ("acceleration", "units/s²", &[("nominal", |s| s.nominal_acceleration), ("actual", |s| s.acceleration)]),
    ("following error", "units", &[("nominal − actual", |s| s.following_error)]),
];

/// Curves over the same x in one frame.
#[derive(Debug)]
pub(crate) struct Panel {
    /// What is drawn, and in which unit.
    pub(crate) title: String,
    pub(crate) curves: Vec<Curve>,
}

/// One curve of a panel.
#[derive(Debug)]
pub(crate) struct Curve {
    /// Empty where it needs none.
    pub(crate) name: String,
    /// x and y, x ascending.
    pub(crate) points: Vec<(f64, f64)>,
}

fn curves(lines: &[Line], axes: &[u8], samples: &[Sample]) -> Vec<Curve> {
    let mut curves = Vec::new();
    for &axis in axes {
        for (name, value) in lines {
            let points = samples.iter().filter(|sample| sample.axis == axis);
            let points: Vec<_> = points.filter_map(|sample| Some((sample.t, value(sample)?))).collect();
            if !points.is_empty() {
                let name = if axes.len() > 1 { format!("axis {axis}, {name}") } else { (*name).to_string() };
                curves.push(Curve { name, points });
            }
        }
    }
    curves
}

/// Keeps the least and the greatest value of each of [`COLUMNS`], so that nothing is lost to the eye.
fn thin(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= 2 * COLUMNS {
        return points.to_vec();
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
        return format!("{rounded}").replace('-', "−");
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

/// The drawing of a recording.
pub(crate) fn svg(title: &str, samples: &[Sample]) -> Result<String, String> {
    let mut axes: Vec<u8> = samples.iter().map(|sample| sample.axis).collect();
    axes.sort_unstable();
    axes.dedup();
    let panels = PANELS.iter().map(|(title, unit, lines)| Panel {
        title: format!("{title} in {unit}"),
        curves: curves(lines, &axes, samples),
    });
    let panels: Vec<_> = panels.filter(|panel| !panel.curves.is_empty()).collect();
    drawing(title, "time in s", &panels)
}

/// Panels one below the other over one x axis, which says `x`.
pub(crate) fn drawing(title: &str, x: &str, panels: &[Panel]) -> Result<String, String> {
    let points = panels.iter().flat_map(|panel| &panel.curves).flat_map(|curve| &curve.points);
    let all = range(points.map(|point| point.0), 0.0, 0.0);
    let mut text = String::new();
    let height = TITLE + PANEL * panels.len() as u32;
    draw(title, (x, &all), panels, height, &mut text).map_err(|error| error.to_string())?;
    let size = |scale: u32| format!("width=\"{}\" height=\"{}\"", WIDTH / scale, height / scale);
    Ok(text.replacen(&size(1), &size(SCALE), 1))
}

/// What the x axis says, and where it begins and ends.
type Axis<'a> = (&'a str, &'a core::ops::Range<f64>);

fn draw<'a>(
    title: &str,
    x: Axis<'_>,
    panels: &[Panel],
    height: u32,
    text: &'a mut String,
) -> Result<(), Failure<'a>> {
    let font = 20 * SCALE;
    let root = SVGBackend::with_string(text, (WIDTH, height)).into_drawing_area();
    root.fill(&WHITE)?;
    let rest = root.margin(8 * SCALE, 0, 0, 0).titled(title, ("sans-serif", font))?;
    for (area, panel) in rest.split_evenly((panels.len(), 1)).iter().zip(panels) {
        draw_panel(area, panel, x)?;
    }
    root.present()
}

fn draw_panel<'a>(area: &Area<'a>, panel: &Panel, (x, all): Axis<'_>) -> Result<(), Failure<'a>> {
    let curves = &panel.curves;
    let values = curves.iter().flat_map(|curve| curve.points.iter().map(|point| point.1));
    // The names of the curves stand above them, over no curve.
    let names = curves.iter().filter(|curve| !curve.name.is_empty()).count();
    let values = range(values, 0.06, 0.06 + 0.16 * names as f64);
    let mut chart = ChartBuilder::on(area)
        .margin_left(16 * SCALE)
        .margin_right(24 * SCALE)
        .margin_top(6 * SCALE)
        .x_label_area_size(42 * SCALE)
        .y_label_area_size(104 * SCALE)
        .build_cartesian_2d(all.clone(), values)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.2).stroke_width(SCALE))
        .axis_style(BLACK.stroke_width(SCALE))
        .set_all_tick_mark_size(5 * SCALE)
        .x_desc(x)
        .y_desc(&panel.title)
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
        let line = chart.draw_series(LineSeries::new(thin(&curve.points), style))?;
        if curve.name.is_empty() {
            continue;
        }
        line.label(&curve.name)
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
        assert_eq!([0.0, -0.5, 999.0].map(text), ["0", "−0.5", "999"]);
        assert_eq!([1000.0, -3_276_800.0, 1e-12].map(text), ["1 000", "−3 276 800", "0"]);
    }

    #[test]
    fn a_long_recording_keeps_its_peaks() {
        let points: Vec<_> = (0..100_000).map(|n| (f64::from(n), f64::from(u8::from(n == 77_777)))).collect();
        let kept = thin(&points);
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
