//! The JSON objects of CAN captures, one a line.
//!
//! Written by hand and not through a tree of values: a capture has millions of them.

mod fields;
mod line;
mod text;

use std::io::{self, Write};

use canopen_master::trace::{Direction as TransferDirection, Kind, Mode, Outcome, Tracer, Transfer};
use motion_io::capture::{FrameKind, Record, Time};

use super::hear::number_of;
use super::names::Names;
use super::{Teller, Totals, named};
use fields::{put_mapped, put_tail};
use line::Line;
use text::{Moment, key, put_hex, put_number, put_text, put_time, put_word};

/// Writes JSON without blanks.
pub(super) struct Json<'a> {
    out: Vec<u8>,
    names: &'a Names,
    /// The last bus and how it is written.
    bus: (String, Vec<u8>),
    /// By 11-bit identifier: the last plain data frame.
    lines: Vec<Option<Line>>,
}

impl<'a> Json<'a> {
    pub(super) fn new(names: &'a Names) -> Self {
        Self {
            out: Vec::with_capacity(2 * super::BLOCK),
            names,
            bus: (String::new(), b"\"\"".to_vec()),
            lines: vec![None; 0x800],
        }
    }

    /// What stands before the data.
    fn put_head(&mut self, record: &Record, bus: Option<&str>) {
        self.out.extend_from_slice(b"{\"t\":");
        put_time(&mut self.out, record.time);
        key!(self.out, "bus");
        self.put_bus(bus);
        key!(self.out, "id");
        put_number(&mut self.out, record.frame.id);
        let remote = record.frame.kind == FrameKind::Remote;
        self.out.extend_from_slice(match (record.frame.extended, remote) {
            (false, false) => b",\"ext\":false,\"rtr\":false,\"data\":\"".as_slice(),
            (false, true) => b",\"ext\":false,\"rtr\":true,\"data\":\"",
            (true, false) => b",\"ext\":true,\"rtr\":false,\"data\":\"",
            (true, true) => b",\"ext\":true,\"rtr\":true,\"data\":\"",
        });
    }

    /// The data and what follows it.
    fn put_rest(&mut self, record: &Record, kind: &Kind, tracer: &Tracer) {
        let out = &mut self.out;
        put_hex(out, record.frame.data());
        put_tail(out, record, kind);
        put_mapped(out, self.names, kind, tracer, number_of(record), record.frame.data());
        out.extend_from_slice(b"}\n");
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
    #[inline]
    fn frame(
        &mut self,
        record: &Record,
        _time: Option<Time>,
        bus: Option<&str>,
        kind: &Kind,
        tracer: &Tracer,
    ) {
        let frame = &record.frame;
        let number = number_of(record);
        let plain = !frame.extended
            && frame.kind == FrameKind::Data
            && record.direction.is_none()
            && !record.loopback;
        let moment = record.time.filter(|_| plain).and_then(Moment::of);
        let Some(moment) = moment else {
            self.put_head(record, bus);
            return self.put_rest(record, kind, tracer);
        };
        let line = self.lines.get(frame.id as usize).and_then(Option::as_ref);
        let line = line.filter(|line| line.begins_like(number, moment));
        // Only in these the data is told in words, too.
        let constant =
            !matches!(kind, Kind::Emcy { .. }) && tracer.mapped(number, kind, frame.data()).next().is_none();
        if let Some(line) = line
            && constant
            && line.ends_like(frame, kind)
        {
            return line.put(&mut self.out, moment, frame.first_8());
        }
        let from = self.out.len();
        let known = line.is_some();
        match line {
            Some(line) => line.put_head(&mut self.out, moment),
            None => self.put_head(record, bus),
        }
        let data_at = self.out.len() - from;
        self.put_rest(record, kind, tracer);
        // Of the others the next one mostly differs behind its data, and only its head is taken.
        let stays = matches!(kind, Kind::Pdo { .. } | Kind::Heartbeat { .. } | Kind::Unknown);
        if (!known || stays && constant)
            && let (Some(place), Some(text)) = (self.lines.get_mut(frame.id as usize), self.out.get(from..))
        {
            *place = Line::new(number, frame, constant.then_some(*kind), moment, text, data_at);
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
        if let Some(announced) = transfer.misannounced() {
            key!(out, "announced");
            put_number(out, announced);
        }
        if transfer.wrong_crc.is_some() {
            out.extend_from_slice(b",\"crc_error\":true");
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

#[cfg(test)]
mod tests {
    use canopen_master::trace::Tracer;
    use motion_io::capture::{Bus, Direction, Frame};

    use super::*;
    use crate::decode::{Ear, Totals};

    /// Has every frame told twice: by one that remembers and by a new one.
    struct Both<'a> {
        remembers: Json<'a>,
        frames: usize,
    }

    impl Both<'_> {
        fn compare(&mut self, tell: impl Fn(&mut Json<'_>)) {
            let mut fresh = Json::new(self.remembers.names);
            tell(&mut fresh);
            self.remembers.out.clear();
            tell(&mut self.remembers);
            assert_eq!(
                String::from_utf8_lossy(&self.remembers.out),
                String::from_utf8_lossy(&fresh.out),
                "frame {}",
                self.frames
            );
        }
    }

    impl Teller for Both<'_> {
        fn frame(
            &mut self,
            record: &Record,
            time: Option<Time>,
            bus: Option<&str>,
            kind: &Kind,
            tracer: &Tracer,
        ) {
            self.frames += 1;
            self.compare(|json| json.frame(record, time, bus, kind, tracer));
        }

        fn transfer(&mut self, transfer: &Transfer, given: Option<Time>, bus: Option<&str>) {
            self.compare(|json| json.transfer(transfer, given, bus));
        }

        fn text(&mut self) -> &mut Vec<u8> {
            &mut self.remembers.out
        }
    }

    #[test]
    fn what_is_remembered_of_an_identifier_changes_nothing() {
        let mut seed = 1_u64;
        let mut below = |limit: u64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) % limit
        };
        let names = Names::default();
        let mut both = Both { remembers: Json::new(&names), frames: 0 };
        let mut ear = Ear::new(&names, false);
        let mut totals = Totals::default();
        let mut nanos = 1_682_489_978_000_000_000_i64;
        for count in 0..40_000 {
            // Mostly microseconds, that a second begins with other digits from time to time.
            nanos += 1000 * below(if count % 100 == 0 { 2_000_000 } else { 400 }) as i64;
            let id =
                [0x80, 0x81, 0x181, 0x182, 0x201, 0x581, 0x601, 0x701, 0x702, 0x7E5, 0][below(11) as usize];
            // A mapping is read, other requests, counting bytes.
            let data: [u8; 8] = match below(4) {
                0 => [0x40, 0, 0x1A, below(3) as u8, 0, 0, 0, 0],
                1 => [0x4F, 0, 0x1A, 0, below(2) as u8, 0, 0, 0],
                2 => [0x43, 0, 0x1A, 1, 16, 0, 0x41, 0x60],
                _ => (below(1 << 31) << 32 | below(1 << 31)).to_le_bytes(),
            };
            let len = if below(3) == 0 { below(9) as usize } else { 8 };
            let (extended, kind) = match below(40) {
                0 => (true, FrameKind::Data),
                1 => (false, FrameKind::Remote),
                2 => (false, FrameKind::Error),
                3 => (false, FrameKind::Fd { bit_rate_switch: true, error_passive: false }),
                _ => (false, FrameKind::Data),
            };
            let mut record = Record::new(Frame::new(id, extended, kind, &data[..len]).unwrap());
            record.time = match below(40) {
                0 => None,
                1 => Some(Time(nanos + 1)),
                2 => Some(Time(-nanos)),
                _ => Some(Time(nanos)),
            };
            record.bus = (below(20) != 0).then_some(Bus(u16::from(below(20) == 0)));
            record.direction = match below(20) {
                0 => Some(Direction::Rx),
                1 => Some(Direction::Tx),
                _ => None,
            };
            record.loopback = below(20) == 0;
            ear.hear(&record, &mut both, &mut totals);
        }
        ear.finish(&mut both);
        assert_eq!(both.frames, 40_000);
        assert!(totals.by_kind.iter().filter(|count| **count > 100).count() >= 8, "{:?}", totals.by_kind);
    }
}
