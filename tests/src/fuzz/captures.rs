//! Capture readers: whatever the file holds, nothing is lost and nothing depends on how it is read.

use std::io::{self, Read};

use motion_io::capture::{
    Capture, Chunk, Format, Frame, FrameKind, Item, Record, WriteFormat, Writer, open_as,
};

/// Gives few bytes at a time, as a pipe may.
struct Trickle<'a> {
    data: &'a [u8],
    step: usize,
}

impl Read for Trickle<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let len = self.step.min(out.len()).min(self.data.len());
        let (head, rest) = self.data.split_at(len);
        out[..len].copy_from_slice(head);
        self.data = rest;
        Ok(len)
    }
}

/// What a capture gives: frames with their bus, damages as text, bytes of LB2 lines.
#[derive(Debug, Default, PartialEq, Eq)]
struct Seen {
    frames: Vec<(Record, Option<String>)>,
    damages: Vec<String>,
    bytes: Vec<u8>,
    failed: bool,
}

fn read(source: impl Read, format: Format) -> Seen {
    let mut seen = Seen::default();
    match open_as(source, format) {
        Err(_) => seen.failed = true,
        Ok(Capture::Lb2(mut reader)) => {
            while let Some(chunk) = reader.next().expect("memory does not fail") {
                match chunk {
                    Chunk::Bytes { bytes, .. } => seen.bytes.extend_from_slice(bytes),
                    Chunk::Damage(damage) => seen.damages.push(damage.to_string()),
                }
            }
        }
        Ok(Capture::Can(mut reader)) => loop {
            match reader.next().expect("memory does not fail") {
                None => break,
                Some(Item::Damage(damage)) => seen.damages.push(damage.to_string()),
                Some(Item::Frame(_)) => {
                    let record = *reader.record();
                    let bus =
                        record.bus.map(|bus| reader.bus_name(bus).expect("a bus has a name").to_owned());
                    seen.frames.push((record, bus));
                }
            }
        },
    }
    seen
}

fn check(data: &[u8], format: Format) {
    let whole = read(data, format);
    // Opening looks at the first bytes; a source that gives few is read the same.
    assert_eq!(whole, read(Trickle { data, step: 7 }, format));
    let lines = data.split(|&byte| byte == b'\n').count();
    assert!(format == Format::Pcap || whole.frames.len() + whole.damages.len() <= lines);
    for (Record { frame, .. }, _) in &whole.frames {
        let content: Vec<u8> =
            if frame.kind == FrameKind::Remote { vec![0; frame.len()] } else { frame.data().into() };
        assert_eq!(Frame::new(frame.id, frame.extended, frame.kind, &content), Some(*frame));
    }
    let mut writer = Writer::new(Vec::new(), WriteFormat::PcapNg);
    for (record, bus) in &whole.frames {
        writer.write(record, bus.as_deref()).expect("memory does not fail");
    }
    let again = read(writer.finish().expect("memory does not fail").as_slice(), Format::Pcap);
    assert_eq!(again.damages, Vec::<String>::new());
    let frames = |seen: &Seen| seen.frames.iter().map(|(record, _)| record.frame).collect::<Vec<_>>();
    assert_eq!(frames(&again), frames(&whole));
}

/// candump logs and screen text.
pub fn capture_candump(data: &[u8]) {
    check(data, Format::Candump);
}

/// Vector `.asc`.
pub fn capture_asc(data: &[u8]) {
    check(data, Format::Asc);
}

/// PEAK `.trc`.
pub fn capture_trc(data: &[u8]) {
    check(data, Format::Trc);
}

/// IXXAT trace text and column dumps.
pub fn capture_columns(data: &[u8]) {
    check(data, Format::Ixxat);
}

/// pcap and pcapng.
pub fn capture_pcap(data: &[u8]) {
    check(data, Format::Pcap);
}

/// LB2 as hex text and as raw bytes.
pub fn capture_lb2(data: &[u8]) {
    assert_eq!(read(data, Format::Lb2Raw).bytes, data);
    assert_eq!(read(data, Format::Lb2Hex), read(Trickle { data, step: 3 }, Format::Lb2Hex));
    // Recognising the format of anything does not fail either, beyond saying that it is none.
    let _ = motion_io::capture::open(data);
}
