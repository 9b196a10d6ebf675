//! What is known of a bus, or of the buses of a capture, by listening.

mod show;

use std::collections::BTreeMap;

use canopen_master::NodeId;
use canopen_master::trace::{Kind, Tracer, Transfer};
use motion_io::can::BusEvent;
use motion_io::capture::{FrameKind, Reader, Record, Time};

use super::lines::Lines;
use super::nodes::{Node, sender};
use super::traffic::Traffic;
use crate::decode::names::Names;
use crate::decode::story::Story;
use crate::decode::{Ear, Teller, Totals, number_of};

/// Everything that the frames told. Times in nanoseconds.
struct Watch<'a> {
    story: Story<'a>,
    lines: Lines,
    traffic: BTreeMap<u16, Traffic>,
    nodes: BTreeMap<(u16, NodeId), Node>,
    last: Option<i64>,
}

impl Watch<'_> {
    /// Takes what the story has written, line by line.
    fn collect(&mut self) {
        let text = self.story.text();
        if text.is_empty() {
            return;
        }
        for line in String::from_utf8_lossy(text).lines() {
            self.lines.push(line.to_owned());
        }
        text.clear();
    }
}

impl Teller for Watch<'_> {
    fn deltas(&mut self) {
        self.story.deltas();
    }

    fn frame(
        &mut self,
        record: &Record,
        time: Option<Time>,
        bus: Option<&str>,
        kind: &Kind,
        tracer: &Tracer,
    ) {
        self.story.frame(record, time, bus, kind, tracer);
        self.collect();
        if record.loopback {
            return;
        }
        let number = number_of(record);
        let nanos = time.map(|time| time.0);
        self.last = nanos.or(self.last);
        let traffic = self.traffic.entry(number).or_default();
        if record.frame.kind == FrameKind::Error {
            traffic.errors += 1;
            return;
        }
        traffic.frame(nanos, &record.frame);
        if let Some(node) = sender(kind) {
            let remote = record.frame.kind == FrameKind::Remote;
            let node = self.nodes.entry((number, node)).or_default();
            node.frame(nanos, kind, record.frame.data(), remote);
        }
    }

    fn transfer(&mut self, transfer: &Transfer, given: Option<Time>, bus: Option<&str>) {
        self.story.transfer(transfer, given, bus);
        self.collect();
        // Somebody who never answers is not there.
        if let Some(node) = self.nodes.get_mut(&(transfer.bus, transfer.node)) {
            node.transfer(transfer);
        }
    }

    fn text(&mut self) -> &mut Vec<u8> {
        self.story.text()
    }
}

/// One bus or several.
pub(super) struct Buses<'a> {
    /// What is listened to.
    title: String,
    objects: &'a Names,
    bit_rate: Option<u32>,
    ear: Ear,
    totals: Totals,
    watch: Watch<'a>,
    /// When it began to be listened to; of captures, the first frame.
    start: Option<i64>,
    now: Option<i64>,
}

impl<'a> Buses<'a> {
    pub(super) fn new(title: String, objects: &'a Names, can_link: bool, bit_rate: Option<u32>) -> Self {
        Self {
            title,
            objects,
            bit_rate,
            ear: Ear::new(objects, can_link),
            totals: Totals::default(),
            watch: Watch {
                story: Story::new(objects, false),
                lines: Lines::default(),
                traffic: BTreeMap::new(),
                nodes: BTreeMap::new(),
                last: None,
            },
            start: None,
            now: None,
        }
    }

    /// Time goes on, though no frame may have come.
    pub(super) fn set_now(&mut self, now: Time) {
        self.start.get_or_insert(now.0);
        self.now = Some(now.0);
        // A bus on which nothing comes is one too.
        if self.watch.traffic.is_empty() {
            self.watch.traffic.insert(u16::MAX, Traffic::default());
        }
    }

    /// One frame.
    pub(super) fn hear(&mut self, record: &Record) {
        self.ear.hear(record, &mut self.watch, &mut self.totals);
        self.heard();
    }

    /// The frame that the reader of a capture has just read.
    pub(super) fn hear_next<R: std::io::Read>(&mut self, reader: &Reader<R>) {
        self.ear.hear_next(reader, &mut self.watch, &mut self.totals);
        self.heard();
    }

    /// The capture has ended.
    pub(super) fn finish(&mut self) {
        self.ear.finish(&mut self.watch);
    }

    fn heard(&mut self) {
        if let Some(last) = self.watch.last {
            self.start.get_or_insert(last);
            self.now = Some(self.now.map_or(last, |now| now.max(last)));
        }
    }

    /// Something that the endpoint tells about its bus.
    pub(super) fn event(&mut self, now: Time, event: BusEvent) {
        self.watch.traffic.entry(u16::MAX).or_default().event(event);
        self.watch.story.remark(Some(now), &event.to_string());
        self.watch.collect();
    }
}

#[cfg(test)]
mod tests {
    use super::super::sheet::Tone;
    use super::*;
    use motion_io::capture::Frame;
    use serde_json::{Value, json};

    const MS: i64 = 1_000_000;

    /// Frames of a bus, at their times in milliseconds, until the last time.
    fn after(frames: &[(i64, u32, &[u8])], end: i64) -> Buses<'static> {
        let names: &'static Names = Box::leak(Box::default());
        let mut buses = Buses::new("test".into(), names, false, Some(500_000));
        buses.set_now(Time(0));
        for &(ms, id, data) in frames {
            // 10000h: a remote frame.
            let kind = if id > 0x7FF { FrameKind::Remote } else { FrameKind::Data };
            let frame = Frame::new(id & 0x7FF, false, kind, data).unwrap();
            buses.hear(&Record { time: Some(Time(ms * MS)), ..Record::new(frame) });
        }
        buses.set_now(Time(end * MS));
        buses
    }

    fn node(buses: &Buses<'_>, id: usize) -> Value {
        let document = buses.document();
        let nodes = document["nodes"].as_array().unwrap();
        nodes.iter().find(|node| node["node"] == id).cloned().unwrap_or(Value::Null)
    }

    #[test]
    fn heartbeats_that_stay_out() {
        let beats: Vec<(i64, u32, &[u8])> =
            (0..10).filter(|n| *n != 5).map(|n| (n * 100, 0x703, &[0x05][..])).collect();
        let buses = after(&beats, 950);
        let control = node(&buses, 3)["error_control"].clone();
        assert_eq!(control["kind"], "heartbeat");
        assert_eq!(
            (&control["missed"], &control["silent"], &control["age"]),
            (&json!(1), &json!(false), &json!(0.05))
        );
        assert!((control["period"].as_f64().unwrap() - 0.1).abs() < 0.001);
        assert_eq!(node(&buses, 3)["state"], "operational");
        assert_eq!(buses.views().next().unwrap().1.tone(), Tone::Good);
        let later = after(&beats, 1200);
        assert_eq!(node(&later, 3)["error_control"]["silent"], true);
        assert_eq!(later.views().next().unwrap().1.tone(), Tone::Bad);
    }

    #[test]
    fn guarding_without_answers_and_a_node_that_never_does() {
        let frames: [(i64, u32, &[u8]); 8] = [
            (0, 0x1_0704, &[0]),
            (1, 0x704, &[0x7F]),
            (100, 0x1_0704, &[0]),
            (101, 0x704, &[0xFF]),
            (200, 0x1_0704, &[0]),
            (300, 0x1_0704, &[0]),
            (310, 0x1_0705, &[0]),
            (410, 0x1_0705, &[0]),
        ];
        let buses = after(&frames, 420);
        let control = |id| node(&buses, id)["error_control"].clone();
        assert_eq!((&control(4)["kind"], &control(4)["missed"]), (&json!("guarding"), &json!(1)));
        assert_eq!((&control(4)["silent"], &control(4)["age"]), (&json!(true), &json!(0.319)));
        assert_eq!((&control(5)["silent"], &control(5)["age"]), (&json!(true), &Value::Null));
        assert_eq!((&node(&buses, 5)["state"], &node(&buses, 5)["frames"]), (&Value::Null, &json!(0)));
    }

    #[test]
    fn emergencies_and_what_a_node_is() {
        let frames: [(i64, u32, &[u8]); 8] = [
            (0, 0x601, &[0x40, 0x00, 0x10, 0, 0, 0, 0, 0]),
            (1, 0x581, &[0x43, 0x00, 0x10, 0, 0x92, 0x01, 0x02, 0]),
            (2, 0x602, &[0x40, 0x00, 0x10, 0, 0, 0, 0, 0]),
            (3, 0x601, &[0x40, 0x08, 0x10, 0, 0, 0, 0, 0]),
            (4, 0x581, &[0x80, 0x08, 0x10, 0, 0, 0, 0x02, 0x06]),
            (5, 0x081, &[0x30, 0x81, 0x11, 1, 2, 3, 4, 5]),
            (6, 0x081, &[0x00, 0x00, 0x00, 0, 0, 0, 0, 0]),
            (7, 0x701, &[0x00]),
        ];
        let buses = after(&frames, 10);
        let one = node(&buses, 1);
        assert_eq!((&one["profile"], &one["sdo"]), (&json!(0x192), &json!({ "transfers": 2, "failed": 1 })));
        let emergency = &one["emergency"];
        assert_eq!((&emergency["code"], &emergency["over"]), (&json!(0x8130), &json!(true)));
        assert_eq!((&emergency["manufacturer"], &emergency["age"]), (&json!("0102030405"), &json!(0.005)));
        assert_eq!((&one["boot_ups"], &one["emergencies"]), (&json!(1), &json!(1)));
        // Nobody has heard node 2.
        assert_eq!(node(&buses, 2), Value::Null);
    }

    #[test]
    fn values_of_process_data() {
        let frames: [(i64, u32, &[u8]); 7] = [
            (0, 0x601, &[0x23, 0x00, 0x1A, 1, 0x10, 0x00, 0x41, 0x60]),
            (1, 0x581, &[0x60, 0x00, 0x1A, 1, 0, 0, 0, 0]),
            (2, 0x601, &[0x2F, 0x00, 0x1A, 0, 1, 0, 0, 0]),
            (3, 0x581, &[0x60, 0x00, 0x1A, 0, 0, 0, 0, 0]),
            (10, 0x181, &[0x37, 0x06]),
            (20, 0x181, &[0x38, 0x06]),
            (30, 0x281, &[1, 2, 3]),
        ];
        let buses = after(&frames, 40);
        let document = buses.document();
        let repeating = document["repeating"].as_array().unwrap();
        assert_eq!((&repeating[0]["what"], &repeating[0]["changes"]), (&json!("node 1 TPDO 1"), &json!(1)));
        let value = json!({
            "index": 0x6041, "subindex": 0, "bits": 16, "name": "status word", "value": 0x638, "text": "0638h, fault, target reached",
        });
        assert_eq!(repeating[0]["values"], json!([value]));
        assert_eq!((&repeating[1]["data"], &repeating[1]["values"]), (&json!("010203"), &json!([])));
        assert_eq!(node(&buses, 1)["drive"], "fault");
        assert!(document["story"][0].as_str().unwrap().contains("mapping of TPDO 1"), "{document}");
        let load = document["buses"][0]["now"]["load_percent"].as_f64().unwrap();
        let bits = document["buses"][0]["now"]["bits_per_second"].as_f64().unwrap();
        assert!((load - bits / 5000.0).abs() < 0.001 && load > 1.0, "{document}");
    }

    #[test]
    fn what_the_endpoint_tells_of_its_bus() {
        let mut buses = after(&[], 0);
        buses.event(Time(MS), BusEvent::State(motion_io::can::BusState::Passive));
        buses.event(Time(MS), BusEvent::Error(motion_io::can::BusError::NoAcknowledge));
        buses.event(Time(MS), BusEvent::Overrun);
        let document = buses.document();
        let bus = &document["buses"][0];
        assert_eq!((&bus["state"], &bus["error_frames"]), (&json!("error passive"), &json!(1)));
        assert_eq!(bus["overruns"], 1);
        assert_eq!(document["story"].as_array().unwrap().len(), 3);
        assert!(buses.sheet().text().contains("no acknowledge"));
    }

    /// Whatever is on the bus, and whatever time it bears: there is a sheet and a document, and the screen
    /// can be drawn.
    #[test]
    fn any_frames_at_any_time() {
        let names = Names::default();
        let mut buses = Buses::new("test".into(), &names, true, Some(10_000));
        let mut seed = 0x2545_F491_4F6C_DD1D_u64;
        let mut random = || {
            seed ^= seed << 13;
            seed ^= seed >> 7;
            seed ^= seed << 17;
            seed
        };
        let mut time = 0_i64;
        for round in 0..30_000 {
            let bits = random();
            let data = random().to_le_bytes();
            let kind = match bits % 16 {
                0 => FrameKind::Remote,
                1 => FrameKind::Error,
                2 => FrameKind::Fd { bit_rate_switch: true, error_passive: false },
                _ => FrameKind::Data,
            };
            // Few nodes, so that their services meet.
            let extended = bits >> 8 & 0xFF == 0;
            let id = if extended { bits >> 32 & 0xFF } else { bits >> 32 & 0x783 };
            let frame = Frame::new(id as u32, extended, kind, &data[..(bits >> 16) as usize % 9]).unwrap();
            time = match bits >> 20 & 0x3FF {
                0 => i64::MIN,
                1 => i64::MAX,
                2 => -time.saturating_abs(),
                step => time.saturating_add(step as i64 * 1000),
            };
            let given = (bits >> 31 & 7 != 0).then_some(Time(time));
            buses.hear(&Record { time: given, loopback: bits >> 40 & 15 == 0, ..Record::new(frame) });
            if round % 1000 == 0 {
                let sheet = buses.sheet();
                assert!(!sheet.text().is_empty() && buses.document()["nodes"].is_array());
            }
        }
        buses.finish();
        assert!(buses.document()["nodes"].as_array().unwrap().len() > 2);
    }
}
