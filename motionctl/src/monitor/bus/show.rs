//! Buses as tables and as a document.

use canopen_master::NodeId;
use canopen_master::trace::{Field, Kind};
use motion_io::can::BusState;
use serde_json::{Value, json};

use super::super::nodes::View;
use super::super::sheet::{Sheet, Table, Tone};
use super::super::time::{age, in_ms, seconds, since};
use super::super::traffic::{Rate, Traffic};
use super::{Buses, Watch};
use crate::can::value::hex;
use crate::decode::counted_kinds;
use crate::decode::names::bytes;
use crate::decode::story::Cycle;

impl Buses<'_> {
    pub(super) fn views(&self) -> impl Iterator<Item = (u16, View<'_>)> {
        let Self { watch, ear, now, .. } = self;
        let Watch { nodes, story, .. } = watch;
        nodes.iter().map(|(&at, node)| (at.0, View::new(node, at, *now, story, ear.tracer())))
    }

    fn rates(&self, traffic: &Traffic) -> [Rate; 3] {
        let (now, start) = (self.now.unwrap_or(0), self.start.unwrap_or(0));
        [traffic.rate(now, start), traffic.mean(now, start), traffic.peak()]
    }

    fn load(&self, rate: Rate) -> Option<f64> {
        self.bit_rate.map(|bit_rate| rate.bits / f64::from(bit_rate) * 100.0)
    }

    /// The objects of a PDO's last frame.
    fn values(&self, cycle: Cycle, data: &[u8]) -> Vec<(Field, NodeId)> {
        let Cycle::Pdo(bus, node, direction, number) = cycle else { return Vec::new() };
        let kind = Kind::Pdo { node, direction, number };
        self.ear.tracer().mapped(bus, &kind, data).map(|field| (field, node)).collect()
    }

    /// A mapped value in words.
    fn words(&self, field: &Field, node: NodeId) -> String {
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
                Some(BusState::Active) | None if traffic.errors == 0 => Tone::Plain,
                Some(BusState::Off) => Tone::Bad,
                _ => Tone::Warn,
            };
            let cells = [
                self.ear.bus_name(number).unwrap_or("-").to_owned(),
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
        let several = self.ear.has_several_buses();
        let columns: Vec<_> = several.then_some("bus").into_iter().chain(View::COLUMNS).collect();
        let mut table = Table::new("Nodes", &columns, "no node has been heard");
        for (bus, view) in self.views() {
            let bus = several.then(|| self.ear.bus_name(bus).unwrap_or("-").to_owned());
            table.push(view.tone(), bus.into_iter().chain(view.cells()));
        }
        table
    }

    fn cycle_table(&self) -> Table {
        let several = self.ear.has_several_buses();
        let columns = ["what", "count>", "period>", "shortest>", "longest>", "age>", "changes>", "last"];
        let columns: Vec<_> = several.then_some("bus").into_iter().chain(columns).collect();
        let mut table = Table::new("What repeats itself", &columns, "nothing");
        for (cycle, count) in self.watch.story.cycles() {
            let rhythm = count.rhythm;
            let ms = |nanos: Option<i64>| nanos.map_or_else(String::new, in_ms);
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
            let gone = rhythm.number > 2 && rhythm.silence(self.now).is_some();
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
            let bus = several.then(|| self.ear.bus_name(cycle.bus()).unwrap_or("-").to_owned());
            table.push(if gone { Tone::Faint } else { Tone::Plain }, bus.into_iter().chain(cells));
        }
        table
    }

    fn span(&self) -> Option<i64> {
        since(self.now, self.start)
    }

    pub(in super::super) fn sheet(&self) -> Sheet {
        let span = self.span().map_or_else(String::new, |span| format!("{:.1} s  ", span as f64 / 1e9));
        Sheet {
            head: format!("{span}{}", self.title),
            tables: vec![
                self.bus_table(),
                self.node_table(),
                self.cycle_table(),
                self.watch.lines.table("nothing yet"),
            ],
        }
    }

    pub(in super::super) fn document(&self) -> Value {
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
                "bus": self.ear.bus_name(number),
                "state": traffic.state.map(|state| state.to_string()),
                "frames": traffic.frames(),
                "now": now,
                "mean": mean,
                "peak": peak,
                "error_frames": traffic.errors,
                "overruns": traffic.overruns,
            })
        });
        let nodes = self.views().map(|(number, view)| with_bus(self.ear.bus_name(number), view.json()));
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
                "age": seconds(since(self.now, rhythm.last)),
                "changes": cycle.carries().then_some(count.changes),
                "data": cycle.carries().then(|| hex(&count.data)),
                "values": values.collect::<Vec<_>>(),
            });
            with_bus(self.ear.bus_name(cycle.bus()), document)
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
