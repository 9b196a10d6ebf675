//! What is known of a bus, or of the buses of a capture, by listening.

use std::collections::{BTreeMap, VecDeque};

use canopen_master::NodeId;
use canopen_master::trace::{Kind, Tracer, Transfer};
use motion_io::can::BusEvent;
use motion_io::capture::{FrameKind, Record, Time};
use serde_json::{Value, json};

use super::nodes::{Node, View, is_silent, sender};
use super::sheet::{Sheet, Table, Tone};
use super::traffic::{Rate, Traffic};
use crate::can::value::hex;
use crate::decode::names::{Names, bytes};
use crate::decode::story::{Cycle, Story};
use crate::decode::{Ear, Teller, Totals, counted_kinds, number_of};

/// Lines of the story that are kept.
const LINES: usize = 500;

/// Everything that the frames told. Times in nanoseconds.
struct Watch<'a> {
    story: Story<'a>,
    lines: VecDeque<String>,
    names: BTreeMap<u16, String>,
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
            if self.lines.len() == LINES {
                self.lines.pop_front();
            }
            self.lines.push_back(line.to_owned());
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
        if let Some(name) = bus
            && !self.names.contains_key(&number)
        {
            self.names.insert(number, name.to_owned());
        }
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
                lines: VecDeque::new(),
                names: BTreeMap::new(),
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

    fn views(&self) -> impl Iterator<Item = (u16, View<'_>)> {
        let Self { watch, ear, now, .. } = self;
        let Watch { nodes, story, .. } = watch;
        nodes.iter().map(|(&at, node)| (at.0, View::new(node, at, *now, story, ear.tracer())))
    }

    /// The name of a bus, where there is one.
    fn bus(&self, number: u16) -> Option<&str> {
        self.watch.names.get(&number).map(String::as_str)
    }

    fn rates(&self, traffic: &Traffic) -> [Rate; 3] {
        let (now, start) = (self.now.unwrap_or(0), self.start.unwrap_or(0));
        [traffic.rate(now, start), traffic.mean(now, start), traffic.peak()]
    }

    fn load(&self, rate: Rate) -> Option<f64> {
        self.bit_rate.map(|bit_rate| rate.bits / f64::from(bit_rate) * 100.0)
    }

    /// The objects of a PDO's last frame.
    fn values(&self, cycle: Cycle, data: &[u8]) -> Vec<(canopen_master::trace::Field, NodeId)> {
        let Cycle::Pdo(bus, node, direction, number) = cycle else { return Vec::new() };
        let kind = Kind::Pdo { node, direction, number };
        self.ear.tracer().mapped(bus, &kind, data).map(|field| (field, node)).collect()
    }

    /// A mapped value in words.
    fn words(&self, field: &canopen_master::trace::Field, node: NodeId) -> String {
        let raw = field.raw.to_le_bytes();
        let raw = raw.get(..usize::from(field.object.bits).div_ceil(8)).unwrap_or(&raw);
        self.objects.words(node, field.object.address(), raw)
    }

    fn bus_table(&self) -> Table {
        let columns = [
            "bus",
            "state",
            "frames>",
            "frames/s>",
            "bit/s>",
            "load>",
            "mean>",
            "peak>",
            "error frames>",
            "lost>",
        ];
        let mut table = Table::new("Bus", &columns, "nothing heard");
        for (&number, traffic) in &self.watch.traffic {
            let [now, mean, peak] = self.rates(traffic);
            let percent = |rate| self.load(rate).map_or("-".into(), |load| format!("{load:.1} %"));
            let tone = match traffic.state {
                Some(motion_io::can::BusState::Active) | None if traffic.errors == 0 => Tone::Plain,
                Some(motion_io::can::BusState::Off) => Tone::Bad,
                _ => Tone::Warn,
            };
            let cells = [
                self.bus(number).unwrap_or("-").to_owned(),
                traffic.state.map_or("-".into(), |state| state.to_string()),
                traffic.frames().to_string(),
                format!("{:.1}", now.frames),
                format!("{:.0}", now.bits),
                percent(now),
                percent(mean),
                percent(peak),
                traffic.errors.to_string(),
                traffic.overruns.to_string(),
            ];
            table.push(tone, cells);
        }
        table
    }

    fn node_table(&self) -> Table {
        let several = self.watch.names.len() > 1;
        let columns: Vec<_> = several.then_some("bus").into_iter().chain(View::COLUMNS).collect();
        let mut table = Table::new("Nodes", &columns, "no node has been heard");
        for (bus, view) in self.views() {
            let bus = several.then(|| self.bus(bus).unwrap_or("-").to_owned());
            table.push(view.tone(), bus.into_iter().chain(view.cells()));
        }
        table
    }

    fn cycle_table(&self) -> Table {
        let several = self.watch.names.len() > 1;
        let columns = ["what", "count>", "period>", "shortest>", "longest>", "age>", "changes>", "last"];
        let columns: Vec<_> = several.then_some("bus").into_iter().chain(columns).collect();
        let mut table = Table::new("What repeats itself", &columns, "nothing");
        for (cycle, count) in self.watch.story.cycles() {
            let rhythm = count.rhythm;
            let ms = |nanos: Option<i64>| {
                nanos.map_or_else(String::new, |nanos| format!("{:.1} ms", nanos as f64 / 1e6))
            };
            let fields = self.values(*cycle, &count.data);
            let last = match fields.is_empty() {
                _ if !cycle.carries() => String::new(),
                true => bytes(&count.data),
                false => {
                    let words = fields.iter().map(|(field, node)| {
                        let name = self.objects.short(*node, field.object.address());
                        format!("{name} = {}", self.words(field, *node))
                    });
                    words.collect::<Vec<_>>().join("; ")
                }
            };
            let gone = rhythm.number > 2 && is_silent(rhythm.last, rhythm.period, self.now);
            let cells = [
                cycle.name(),
                rhythm.number.to_string(),
                ms(rhythm.period),
                ms(rhythm.shortest),
                ms(rhythm.longest),
                age(self.now, rhythm.last),
                if cycle.carries() { count.changes.to_string() } else { String::new() },
                last,
            ];
            let bus = several.then(|| self.bus(cycle.bus()).unwrap_or("-").to_owned());
            table.push(if gone { Tone::Faint } else { Tone::Plain }, bus.into_iter().chain(cells));
        }
        table
    }

    fn story_table(&self) -> Table {
        let mut table = Table::new("What happened", &[], "nothing yet");
        table.tail = true;
        self.watch.lines.iter().for_each(|line| table.push(Tone::Plain, [line.clone()]));
        table
    }

    fn span(&self) -> Option<i64> {
        self.now.zip(self.start).map(|(now, start)| now.saturating_sub(start))
    }

    pub(super) fn sheet(&self) -> Sheet {
        let span = self.span().map_or_else(String::new, |span| format!("  {:.1} s", span as f64 / 1e9));
        Sheet {
            head: format!("{}{span}", self.title),
            tables: vec![self.bus_table(), self.node_table(), self.cycle_table(), self.story_table()],
        }
    }

    pub(super) fn document(&self) -> Value {
        let rounded = |rate: Option<f64>| rate.map(|rate| (rate * 1000.0).round() / 1000.0);
        let buses = self.watch.traffic.iter().map(|(&number, traffic)| {
            let [now, mean, peak] = self.rates(traffic).map(|rate| {
                json!({
                    "frames_per_second": rounded(Some(rate.frames)),
                    "bits_per_second": rounded(Some(rate.bits)),
                    "load_percent": rounded(self.load(rate)),
                })
            });
            json!({
                "bus": self.bus(number),
                "state": traffic.state.map(|state| state.to_string()),
                "frames": traffic.frames(),
                "now": now,
                "mean": mean,
                "peak": peak,
                "error_frames": traffic.errors,
                "overruns": traffic.overruns,
            })
        });
        let nodes = self.views().map(|(number, view)| with_bus(self.bus(number), view.json()));
        let repeating = self.watch.story.cycles().iter().map(|(cycle, count)| {
            let rhythm = count.rhythm;
            let values = self.values(*cycle, &count.data).into_iter().map(|(field, node)| {
                let (object, at) = (field.object, field.object.address());
                json!({
                    "index": object.index,
                    "subindex": object.sub,
                    "bits": object.bits,
                    "name": self.objects.short(node, at),
                    "value": i64::try_from(self.objects.signed(node, at, object.bits, field.raw)).ok(),
                    "text": self.words(&field, node),
                })
            });
            let document = json!({
                "what": cycle.name(),
                "count": rhythm.number,
                "period": seconds(rhythm.period),
                "shortest": seconds(rhythm.shortest),
                "longest": seconds(rhythm.longest),
                "age": seconds(self.now.zip(rhythm.last).map(|(now, last)| now.saturating_sub(last))),
                "changes": cycle.carries().then_some(count.changes),
                "data": cycle.carries().then(|| hex(&count.data)),
                "values": values.collect::<Vec<_>>(),
            });
            with_bus(self.bus(cycle.bus()), document)
        });
        let by_kind: serde_json::Map<_, _> =
            counted_kinds(&self.totals).map(|(name, count)| (name.into(), count.into())).collect();
        json!({
            "source": self.title,
            "seconds": seconds(self.span()),
            "bitrate": self.bit_rate,
            "buses": buses.collect::<Vec<_>>(),
            "by_kind": by_kind,
            "nodes": nodes.collect::<Vec<_>>(),
            "repeating": repeating.collect::<Vec<_>>(),
            "story": self.watch.lines,
        })
    }
}

/// The document with the name of the bus before it.
fn with_bus(bus: Option<&str>, document: Value) -> Value {
    let mut whole = json!({ "bus": bus });
    if let (Some(whole), Value::Object(document)) = (whole.as_object_mut(), document) {
        whole.extend(document);
    }
    whole
}

/// Seconds for JSON, to the microsecond.
pub(super) fn seconds(nanos: Option<i64>) -> Value {
    nanos.map_or(Value::Null, |nanos| json!((nanos / 1000) as f64 / 1e6))
}

/// How long ago something was.
pub(super) fn age(now: Option<i64>, then: Option<i64>) -> String {
    let Some(age) = now.zip(then).map(|(now, then)| now.saturating_sub(then)) else { return String::new() };
    match age as f64 / 1e9 {
        age if age < 100.0 => format!("{age:.1} s"),
        age if age < 6000.0 => format!("{:.0} min", age / 60.0),
        age => format!("{:.0} h", age / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion_io::capture::Frame;

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
}
