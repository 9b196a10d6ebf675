//! The JSON objects of CAN captures, one a line.
//!
//! Written by hand and not through a tree of values: a capture has millions of them.

mod fields;
mod text;

use std::io::{self, Write};

use canopen_master::trace::{Direction as TransferDirection, Kind, Mode, Outcome, Tracer, Transfer};
use motion_io::capture::{FrameKind, Record, Time};

use super::hear::number_of;
use super::names::Names;
use super::{Teller, Totals, named};
use fields::{put_mapped, put_tail};
use text::{Piece, key, put_hex, put_number, put_text, put_time, put_word};

/// Writes JSON without blanks.
pub(super) struct Json<'a> {
    out: Vec<u8>,
    names: &'a Names,
    /// The last bus and how it is written.
    bus: (String, Vec<u8>),
    /// By 11-bit identifier: what stands between the time and the data of plain data frames.
    heads: Vec<Head>,
    /// Whole seconds of the frame before, and how they are written.
    seconds: (u64, Piece<24>),
}

/// The constant text around the data of one identifier on one bus.
#[derive(Debug, Clone, Copy)]
struct Head {
    bus: u16,
    known: bool,
    text: Piece<96>,
    /// What follows the data, while the frame is of the same kind.
    tail: Option<(Kind, Piece<96>)>,
}

impl<'a> Json<'a> {
    pub(super) fn new(names: &'a Names) -> Self {
        Self {
            out: Vec::with_capacity(2 * super::BLOCK),
            names,
            bus: (String::new(), b"\"\"".to_vec()),
            heads: vec![Head { bus: 0, known: false, text: Piece::EMPTY, tail: None }; 0x800],
            seconds: (u64::MAX, Piece::EMPTY),
        }
    }

    /// `{"t":…` with six decimals, the whole seconds from the frame before where they are the same.
    #[inline]
    fn put_start(&mut self, time: Option<Time>) {
        let nanos = match time {
            Some(Time(nanos)) if nanos >= 0 && nanos % 1000 == 0 => nanos as u64,
            _ => {
                self.out.extend_from_slice(b"{\"t\":");
                return put_time(&mut self.out, time);
            }
        };
        let seconds = nanos / 1_000_000_000;
        if self.seconds.0 != seconds {
            let text = format!("{{\"t\":{seconds}.");
            self.seconds = (seconds, Piece::new(text.as_bytes()).unwrap_or(Piece::EMPTY));
        }
        self.seconds.1.put(&mut self.out);
        let micros = (nanos % 1_000_000_000 / 1000) as u32;
        let pair = |number: u32| {
            let number = (number % 100) as u8;
            [b'0' + number / 10, b'0' + number % 10]
        };
        self.out.extend_from_slice([pair(micros / 10_000), pair(micros / 100), pair(micros)].as_flattened());
    }

    /// What stands between time and data.
    #[inline]
    fn put_head(&mut self, record: &Record, bus: Option<&str>) {
        let frame = &record.frame;
        let number = number_of(record);
        let plain = !frame.extended && frame.kind == FrameKind::Data;
        let at = frame.id as usize;
        if plain
            && let Some(head) = self.heads.get(at)
            && head.known
            && head.bus == number
        {
            return head.text.put(&mut self.out);
        }
        let from = self.out.len();
        key!(self.out, "bus");
        self.put_bus(bus);
        key!(self.out, "id");
        put_number(&mut self.out, frame.id);
        let remote = frame.kind == FrameKind::Remote;
        self.out.extend_from_slice(match (frame.extended, remote) {
            (false, false) => b",\"ext\":false,\"rtr\":false,\"data\":\"".as_slice(),
            (false, true) => b",\"ext\":false,\"rtr\":true,\"data\":\"",
            (true, false) => b",\"ext\":true,\"rtr\":false,\"data\":\"",
            (true, true) => b",\"ext\":true,\"rtr\":true,\"data\":\"",
        });
        let text = self.out.get(from..).and_then(Piece::new);
        if plain && let (Some(head), Some(text)) = (self.heads.get_mut(at), text) {
            *head = Head { bus: number, known: true, text, tail: None };
        }
    }

    fn put_bus(&mut self, bus: Option<&str>) {
        let Some(bus) = bus else { return self.out.extend_from_slice(b"null") };
        if self.bus.0 != bus {
            self.bus.0.clear();
            self.bus.0.push_str(bus);
            self.bus.1.clear();
            put_text(&mut self.bus.1, bus);
        }
        self.out.extend_from_slice(&self.bus.1);
    }
}

impl Teller for Json<'_> {
    fn frame(
        &mut self,
        record: &Record,
        _time: Option<Time>,
        bus: Option<&str>,
        kind: &Kind,
        tracer: &Tracer,
    ) {
        let frame = &record.frame;
        self.put_start(record.time);
        self.put_head(record, bus);
        let out = &mut self.out;
        put_hex(out, frame.data());
        let plain = !frame.extended
            && frame.kind == FrameKind::Data
            && record.direction.is_none()
            && !record.loopback
            && matches!(kind, Kind::Pdo { .. } | Kind::Heartbeat { .. } | Kind::Unknown);
        let head = self.heads.get_mut(frame.id as usize).filter(|_| plain);
        if let Some(Head { tail: Some((same, tail)), .. }) = &head
            && same == kind
            && tracer.mapped(number_of(record), kind, frame.data()).next().is_none()
        {
            return tail.put(out);
        }
        let from = out.len();
        put_tail(out, record, kind);
        let constant = !put_mapped(out, self.names, kind, tracer, number_of(record), frame.data());
        out.extend_from_slice(b"}\n");
        if let Some(head) = head.filter(|_| constant) {
            head.tail = out.get(from..).and_then(Piece::new).map(|tail| (*kind, tail));
        }
    }

    fn transfer(&mut self, transfer: &Transfer, given: Option<Time>, bus: Option<&str>) {
        // Of an answer without its request there are only the frames.
        if transfer.late {
            return;
        }
        self.out.extend_from_slice(b"{\"kind\":\"sdo-transfer\",\"bus\":");
        self.put_bus(bus);
        let out = &mut self.out;
        key!(out, "node");
        put_number(out, transfer.node.raw());
        key!(out, "direction");
        put_word(
            out,
            match transfer.direction {
                TransferDirection::Upload => "upload",
                TransferDirection::Download => "download",
            },
        );
        key!(out, "mode");
        put_word(
            out,
            match transfer.mode {
                Mode::Expedited => "expedited",
                Mode::Segmented => "segmented",
                Mode::Block => "block",
            },
        );
        key!(out, "index");
        put_number(out, transfer.at.index);
        key!(out, "subindex");
        put_number(out, transfer.at.sub);
        key!(out, "size");
        put_number(out, transfer.size);
        key!(out, "data");
        out.push(b'"');
        put_hex(out, &transfer.data);
        out.push(b'"');
        if transfer.data.len() as u64 != transfer.size {
            out.extend_from_slice(b",\"truncated\":true");
        }
        if transfer.lacking {
            out.extend_from_slice(b",\"lacking\":true");
        }
        key!(out, "outcome");
        put_word(
            out,
            match transfer.outcome {
                Outcome::Done => "done",
                Outcome::Aborted { .. } => "aborted",
                Outcome::Incomplete => "incomplete",
            },
        );
        key!(out, "abort_code");
        match transfer.outcome {
            Outcome::Aborted { code, .. } => put_number(out, code.0),
            _ => out.extend_from_slice(b"null"),
        }
        key!(out, "frames");
        put_number(out, transfer.frames);
        if let Some(name) = self.names.given(transfer.node, transfer.at) {
            key!(out, "name");
            put_text(out, name);
            if let Some(value) = self.names.value(transfer.node, transfer.at, &transfer.data) {
                key!(out, "value");
                let _ = serde_json::to_writer(&mut *out, &value);
            }
        }
        key!(out, "t");
        put_time(out, given);
        out.extend_from_slice(b"}\n");
    }

    fn text(&mut self) -> &mut Vec<u8> {
        &mut self.out
    }
}

/// The last object.
pub(super) fn summary(totals: &Totals, out: &mut impl Write) -> io::Result<()> {
    // Every frame object counts, copies too.
    let mut counts = totals.by_kind;
    counts.iter_mut().zip(totals.copies_by_kind).for_each(|(count, copies)| *count += copies);
    let by_kind: serde_json::Map<_, _> =
        named(&counts).map(|(name, count)| (name.into(), count.into())).collect();
    let summary = serde_json::json!({
        "kind": "summary",
        "schema_version": crate::output::SCHEMA_VERSION,
        "frames": totals.frames,
        "loopback": totals.copies,
        "damaged": totals.damaged,
        "discarded_bytes": totals.discarded_bytes,
        "by_kind": by_kind,
    });
    writeln!(out, "{summary}")
}
