//! A recording: what axes did, a line a control cycle and axis, as CSV with a heading.

use core::time::Duration;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use motion_core::application::AxisStatus;
use serde::{Deserialize, Serialize};

use crate::exit::Exit;

/// One axis at one time. Positions in user measuring units, velocities a second, accelerations a second
/// squared.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Sample {
    /// Seconds since any moment.
    pub(crate) t: f64,
    /// 1…6.
    #[serde(default = "first")]
    pub(crate) axis: u8,
    #[serde(default)]
    pub(crate) nominal_position: Option<f64>,
    #[serde(default)]
    pub(crate) position: Option<f64>,
    #[serde(default)]
    pub(crate) nominal_velocity: Option<f64>,
    #[serde(default)]
    pub(crate) velocity: Option<f64>,
    #[serde(default)]
    pub(crate) nominal_acceleration: Option<f64>,
    #[serde(default)]
    pub(crate) acceleration: Option<f64>,
    /// Nominal minus actual position.
    #[serde(default)]
    pub(crate) following_error: Option<f64>,
}

const fn first() -> u8 {
    1
}

/// The columns that hold something to draw.
pub(crate) const DRAWN: [&str; 7] = [
    "nominal_position",
    "position",
    "nominal_velocity",
    "velocity",
    "nominal_acceleration",
    "acceleration",
    "following_error",
];

impl Sample {
    pub(crate) fn new(at: Duration, axis: u8, status: &AxisStatus) -> Self {
        Self {
            t: at.as_secs_f64(),
            axis,
            nominal_position: Some(f64::from(status.nominal_position)),
            position: Some(f64::from(status.position)),
            nominal_velocity: Some(status.nominal_velocity),
            velocity: Some(f64::from(status.velocity)),
            nominal_acceleration: Some(status.nominal_acceleration),
            acceleration: None,
            following_error: Some(f64::from(status.deviation)),
        }
    }

    fn numbers(&self) -> [Option<f64>; 8] {
        [
            Some(self.t),
            self.nominal_position,
            self.position,
            self.nominal_velocity,
            self.velocity,
            self.nominal_acceleration,
            self.acceleration,
            self.following_error,
        ]
    }
}

/// No axis comes near; a drawing cannot span much more.
const GREATEST: f64 = 1e100;

/// Reads a recording; an error says the line and what was expected there.
pub(crate) fn read(name: &str, source: impl Read) -> Result<Vec<Sample>, Exit> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(source);
    let headings = reader.headers().map_err(|error| Exit::file(name, &error))?.clone();
    let has = |column: &str| headings.iter().any(|heading| heading == column);
    if !has("t") || !DRAWN.iter().any(|column| has(column)) {
        let found = headings.iter().take(8).collect::<Vec<_>>().join(",");
        return Err(Exit::file(
            name,
            &format!(
                "line 1: a heading with t and at least one of {} expected, found {found:.80}",
                DRAWN.join(", ")
            ),
        ));
    }
    let mut samples: Vec<Sample> = Vec::new();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(|error| Exit::file(name, &error))? {
        let line = record.position().map_or(0, csv::Position::line);
        let trouble = |text: String| Exit::file(name, &format!("line {line}: {text}"));
        let sample: Sample = record.deserialize(Some(&headings)).map_err(|error| match error.kind() {
            csv::ErrorKind::Deserialize { err, .. } => {
                let column = err.field().and_then(|field| headings.get(field as usize)).unwrap_or("?");
                trouble(format!("{column}: {}", err.kind()))
            }
            _ => trouble(error.to_string()),
        })?;
        if let Some(number) = sample.numbers().iter().flatten().find(|number| !number.is_finite()) {
            return Err(trouble(format!("{number}: a number that is finite expected")));
        }
        if let Some(number) = sample.numbers().iter().flatten().find(|number| number.abs() > GREATEST) {
            return Err(trouble(format!("{number:e}: at most {GREATEST:e} expected")));
        }
        let before = samples.iter().rev().take(6).find(|before| before.axis == sample.axis);
        if let Some(before) = before.filter(|before| before.t > sample.t) {
            return Err(trouble(format!(
                "t = {} after t = {}: times that rise expected",
                sample.t, before.t
            )));
        }
        samples.push(sample);
    }
    if samples.is_empty() {
        return Err(Exit::file(name, &"the heading is there, but no line after it"));
    }
    Ok(samples)
}

/// Writes a recording.
pub(crate) fn write(
    name: &str,
    target: impl Write,
    samples: impl IntoIterator<Item = Sample>,
) -> Result<(), Exit> {
    let mut writer = csv::Writer::from_writer(target);
    for sample in samples {
        writer.serialize(sample).map_err(|error| Exit::file(name, &error))?;
    }
    writer.flush().map_err(|error| Exit::file(name, &error))
}

/// Writes a recording while it comes, on a thread of its own: a slow disk does not hold up the cycle.
pub(crate) struct Recorder {
    samples: Sender<Sample>,
    trouble: Receiver<String>,
    thread: JoinHandle<Result<(), Exit>>,
}

impl Recorder {
    pub(crate) fn create(path: &Path) -> Result<Self, Exit> {
        let name = path.display().to_string();
        let trouble = |error: std::io::Error| Exit::file(&name, &error);
        let file = std::fs::File::options().write(true).create(true).truncate(false).open(path);
        let file = file.map_err(trouble)?;
        // Two writers would mix their lines.
        if let Err(std::fs::TryLockError::WouldBlock) = file.try_lock() {
            return Err(Exit::file(&name, &"in use by another program"));
        }
        if file.metadata().is_ok_and(|found| found.is_file()) {
            file.set_len(0).map_err(trouble)?;
        }
        let (samples, received) = channel();
        let (tell, trouble) = channel();
        let thread = std::thread::spawn(move || {
            write(&name, file, received).inspect_err(|exit| {
                // Nobody listens any more when the program ends.
                let _ = tell.send(exit.message.clone());
            })
        });
        Ok(Self { samples, trouble, thread })
    }

    /// Why nothing is written any more, once.
    pub(crate) fn poll_trouble(&self) -> Option<String> {
        self.trouble.try_recv().ok()
    }

    pub(crate) fn put(&self, sample: Sample) {
        // A thread that has ended has an error, which `finish` tells.
        let _ = self.samples.send(sample);
    }

    /// Waits for the end of the file.
    pub(crate) fn finish(self) -> Result<(), Exit> {
        drop(self.samples);
        self.thread.join().unwrap_or_else(|_| Err(Exit::trouble("the recording stopped unexpectedly")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        read("F.csv", text.as_bytes()).unwrap_err().message
    }

    #[test]
    fn what_is_written_is_read() {
        let status = AxisStatus { position: -5, nominal_position: 7, deviation: 12, ..AxisStatus::default() };
        let samples = [0, 2].map(|ms| Sample::new(Duration::from_millis(ms), 2, &status));
        let mut file = Vec::new();
        write("F.csv", &mut file, samples).unwrap();
        assert_eq!(read("F.csv", file.as_slice()).unwrap(), samples);
    }

    #[test]
    fn columns_may_be_missing_and_in_any_order() {
        let samples = read("F.csv", "position , t\n# a remark\n 1.5, 0\n,1e-3\n".as_bytes()).unwrap();
        assert_eq!(samples.iter().map(|s| (s.t, s.axis)).collect::<Vec<_>>(), [(0.0, 1), (0.001, 1)]);
        assert_eq!(samples.iter().map(|s| s.position).collect::<Vec<_>>(), [Some(1.5), None]);
    }

    #[test]
    fn mistakes_are_named_with_their_line() {
        assert!(refused("").contains("heading with t"), "{}", refused(""));
        assert!(refused("t,speed\n").contains("found t,speed"));
        assert!(refused("t,position\n").contains("no line after it"));
        let wrong = refused("t,position\n0,1\n1,fast\n");
        assert!(wrong.contains("line 3: position: invalid float literal"), "{wrong}");
        assert!(refused("t,position\n0,NaN\n").contains("line 2: NaN: a number that is finite"));
        assert!(refused("t,position\n0,8e307\n").contains("line 2: 8e307: at most 1e100"));
        assert!(refused("t,position\n1,1\n0,1\n").contains("line 3: t = 0 after t = 1"));
        assert!(refused("t,position\n1\n").contains("line: 2"), "{}", refused("t,position\n1\n"));
        assert!(read("F.csv", [b'\xFF'; 10].as_slice()).is_err());
    }
}
