//! `eds convert`: the same device in another format, or configured.

use std::path::Path;

use canopen_master::eds::{self, Device, Format, Reading, ValueError};
use serde_json::json;

use super::cli::{Input, Kind};
use super::{bytes, place, read};
use crate::exit::Exit;
use crate::output::{Output, counted};

pub(super) struct Changes<'a> {
    pub(super) node: Option<u8>,
    pub(super) bit_rate: Option<u16>,
    pub(super) values: &'a [String],
    pub(super) concise: Option<&'a Path>,
    pub(super) anew: bool,
}

impl Changes<'_> {
    const fn configures(&self) -> bool {
        self.node.is_some() || self.bit_rate.is_some() || !self.values.is_empty() || self.concise.is_some()
    }
}

pub(super) fn run(
    out: &Output,
    dry_run: bool,
    input: &Input,
    output: &Path,
    to: Option<Kind>,
    changes: &Changes<'_>,
) -> Result<(), Exit> {
    let kind = to.or_else(|| Kind::of(output)).ok_or_else(|| {
        let name = output.display();
        Exit::usage(format!("what shall {name} be? Name it .eds, .dcf, .xdd, .xdc or .bin, or say --to KIND"))
    })?;
    let reading = read(input)?;
    if !reading.diagnostics.is_empty() {
        out.remark(super::doubts(&reading));
    }
    if !kind.is_configuration() && changes.configures() {
        return Err(Exit::usage(format!(
            "{} describes a kind of device and holds no configured values (CiA 306-1, 7; CiA 311): --node, --bit-rate, \
             --set and --concise need a .dcf, .xdc or .bin",
            output.display()
        )));
    }
    let mut device = reading.device.clone();
    configure(out, &mut device, changes)?;
    if !kind.is_configuration() && device.is_configuration() {
        // Where the name says nothing, a description is what has no settings of a node.
        let format = matches!(kind, Kind::Xdd) == (reading.source.format == Format::Xdd);
        let same = Kind::of(&input.file).map_or(format && device.commissioning.is_empty(), |own| own == kind);
        if same {
            out.remark(
                "the file holds what is configured in a device, which a description should not: it is kept",
            );
        } else {
            unconfigure(out, &mut device);
        }
    }
    let Rendered { written, lost, values } = render(&reading, &device, kind, changes)?;
    if values == Some(0) {
        out.remark(format!(
            "{} configures nothing: no value in it that may be written",
            input.file.display()
        ));
    }
    for what in &lost {
        out.remark(format!("not carried over: {what}"));
    }
    let (objects, entries) = super::counts(&device);
    let name = output.display().to_string();
    let to_stdout = output.as_os_str() == "-";
    if !dry_run {
        if to_stdout {
            crate::output::put(&written);
            return Ok(());
        }
        crate::output::write_beside(output, &written)?;
    }
    let document = json!({
        "file": input.file.display().to_string(), "output": name, "objects": objects, "entries": entries,
        "values": values, "bytes": written.len(), "lost": lost, "written": !dry_run,
    });
    out.document(document, || {
        let verb = if dry_run { "would write" } else { "written" };
        let what = match values {
            Some(values) => counted(values, "value", "values"),
            None => {
                format!("{}, {}", counted(objects, "object", "objects"), counted(entries, "entry", "entries"))
            }
        };
        println!("{name}: {verb}, {what}, {} bytes", written.len());
    });
    Ok(())
}

fn configure(out: &Output, device: &mut Device, changes: &Changes<'_>) -> Result<(), Exit> {
    if let Some(node) = changes.node {
        device.commissioning.set("NodeID", node.to_string());
    }
    if let Some(rate) = changes.bit_rate {
        device.commissioning.set("Baudrate", rate.to_string());
    }
    if let Some(path) = changes.concise {
        let name = path.display().to_string();
        let entries = eds::parse_concise(&bytes(path)?).map_err(|error| Exit::file(&name, &error))?;
        for entry in device.apply_concise(&entries) {
            let why = match device.entry(entry.index, entry.subindex) {
                None => "is not in the file".to_owned(),
                Some(_) => format!("{} bytes are no value of its data type", entry.data.len()),
            };
            out.remark(format!("{name}: {:04X}h:{:02X} left out: {why}", entry.index, entry.subindex));
        }
    }
    for text in changes.values {
        let (object, value) =
            text.split_once('=').ok_or_else(|| Exit::usage(format!("\"{text}\" is not OBJECT=VALUE")))?;
        let (index, subindex) = place(device, object)?;
        let node = device.node_id();
        let base = device.entry(index, subindex.unwrap_or(0)).and_then(|entry| entry.data_type);
        let base = base.map(|data_type| device.base_type(data_type));
        let entry = device
            .object_mut(index)
            .and_then(|found| found.entry_mut(subindex.unwrap_or(0)))
            .ok_or_else(|| Exit::usage(format!("{object} is not in the file")))?;
        if let Some(base) = base {
            // Any node ID shows whether the rest is well-formed.
            eds::to_bytes(value, base, node.or(Some(1)))
                .map_err(|error| Exit::usage(format!("{object}=\"{value}\": {error}")))?;
        }
        if !entry.access.is_some_and(eds::Access::can_write) {
            out.remark(format!("{object} cannot be written: no device takes this value"));
        }
        entry.value = Some(value.to_owned());
    }
    Ok(())
}

/// An EDS describes every device of its kind: what is configured in one does not belong there.
fn unconfigure(out: &Output, device: &mut Device) {
    let mut count = 0;
    for object in &mut device.objects {
        for entry in core::iter::once(&mut object.own).chain(&mut object.subs) {
            count += usize::from(entry.value.take().is_some());
            entry.denotation = None;
            entry.ref_name = None;
        }
    }
    device.commissioning = eds::Fields::default();
    out.remark(format!(
        "{count} configured values and the node's settings are left out: a description has none"
    ));
}

/// The bytes of the output.
struct Rendered {
    written: Vec<u8>,
    /// What its format has no place for.
    lost: Vec<String>,
    /// How many values a concise DCF has.
    values: Option<usize>,
}

fn render(reading: &Reading, device: &Device, kind: Kind, changes: &Changes<'_>) -> Result<Rendered, Exit> {
    let text = |(written, lost)| Ok(Rendered { written, lost, values: None });
    let format = match kind {
        Kind::Eds | Kind::Dcf => Format::Eds,
        Kind::Xdd | Kind::Xdc => Format::Xdd,
        Kind::Concise => {
            let entries = device.to_concise(None).map_err(|error| {
                if error.error == ValueError::NeedsNodeId {
                    Exit::usage(format!("{error}: give it by --node N"))
                } else {
                    Exit::check(error.to_string())
                }
            })?;
            let written = eds::encode_concise(&entries);
            return Ok(Rendered { written, lost: Vec::new(), values: Some(entries.len()) });
        }
    };
    if format == reading.source.format && !changes.anew {
        return text((reading.source.encode(&reading.update(device)), Vec::new()));
    }
    text(match format {
        Format::Eds => (reading.source.encode(&eds::write_eds(device)), eds::lost_in_eds(device)),
        Format::Xdd => {
            let (text, lost) = eds::write_xdd(device);
            (text.into_bytes(), lost)
        }
    })
}
