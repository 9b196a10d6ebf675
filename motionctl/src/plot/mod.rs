//! `motionctl plot`: a recording or a trajectory as a drawing.

mod chart;
mod recording;

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

pub(crate) use chart::{Curve, Panel, drawing};
pub(crate) use recording::{Recorder, Sample, write};

use crate::exit::Exit;
use crate::output::{Output, apart, write_beside};

#[derive(Debug, Args)]
pub(crate) struct Plot {
    /// CSV with a heading: t in seconds, axis, and any of nominal_position, position, nominal_velocity,
    /// velocity, nominal_acceleration, acceleration, following_error; `run --record` and `demo --record`
    /// write it; `-` is standard input
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Where to draw; absent: FILE with the ending .svg
    #[arg(long, short, value_name = "F.svg")]
    output: Option<PathBuf>,
    /// Only these axes
    #[arg(long, value_name = "N", value_delimiter = ',')]
    axis: Vec<u8>,
    /// Only from this time on, in seconds
    #[arg(long, value_name = "SECONDS")]
    from: Option<f64>,
    /// Only up to this time
    #[arg(long, value_name = "SECONDS")]
    to: Option<f64>,
}

pub(crate) fn run(out: &Output, arguments: &Plot) -> Result<(), Exit> {
    let name = arguments.file.display().to_string();
    let output = match (&arguments.output, name.as_str()) {
        (Some(output), _) => output.clone(),
        (None, "-") => return Err(Exit::usage("--output F.svg expected, as FILE is standard input")),
        (None, _) => arguments.file.with_extension("svg"),
    };
    apart(("FILE", &arguments.file), ("the drawing (--output)", &output))?;
    let mut samples = if name == "-" {
        recording::read("standard input", std::io::stdin().lock())?
    } else {
        let file = std::fs::File::open(&arguments.file).map_err(|error| Exit::file(&name, &error))?;
        recording::read(&name, file)?
    };
    let (from, to) = (arguments.from.unwrap_or(f64::NEG_INFINITY), arguments.to.unwrap_or(f64::INFINITY));
    samples.retain(|sample| {
        (arguments.axis.is_empty() || arguments.axis.contains(&sample.axis))
            && (from..=to).contains(&sample.t)
    });
    if samples.is_empty() {
        return Err(Exit::check(format!("{name}: nothing of these axes at these times")));
    }
    if out.only_plans(|| format!("would draw {} samples in {}", samples.len(), output.display())) {
        return Ok(());
    }
    draw(&output, &name, &samples)?;
    let document = json!({ "output": output.display().to_string(), "samples": samples.len() });
    out.document(document, || out.say(&format!("{} samples drawn in {}", samples.len(), output.display())));
    Ok(())
}

/// Draws samples into a file.
pub(crate) fn draw(path: &Path, title: &str, samples: &[Sample]) -> Result<(), Exit> {
    let text = chart::svg(title, samples).map_err(|error| Exit::file(&path.display().to_string(), &error))?;
    write_beside(path, text.as_bytes())
}
