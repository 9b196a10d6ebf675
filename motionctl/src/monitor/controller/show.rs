//! A controller as tables and as a document.

use motion_core::AXES;
use motion_core::bus::{OBJECTS, Object, Role, Settings};
use motion_core::parameters::{Values, get};
use motion_io::capture::Time;
use serde_json::{Value, json};

use super::super::sheet::{Sheet, Table, Tone};
use super::super::time::age;
use super::{Controller, Place, source};
use crate::can::value::{decode, hex};
use crate::lb2::{Identity, failure_json};

/// What a CAN bus is, and its objects: name, kind, node.
type Bus = (&'static str, Vec<(String, String, u8)>);

impl Controller {
    /// A parameter's value in words; nothing where it has not been heard.
    fn text(&self, index: u16, display: &Values) -> Option<String> {
        let (value, entry) = (self.values.get(&index)?, get(index)?);
        let text = entry.format(*value, display).to_string();
        Some(match entry.unit() {
            "" => text,
            unit => format!("{text} {unit}"),
        })
    }

    /// Of an axis: mode, input and its type, output and its type, greatest and working velocity.
    fn axis(&self, axis: u8, display: &Values) -> [Option<String>; 7] {
        let own = |first: u16| self.text(first + u16::from(axis), display);
        // Choices 1 to 6 of [606] and [612] are the inputs and outputs.
        let of = |choice: u16, first: u16| {
            let number = *self.values.get(&(choice + u16::from(axis)))?;
            let number = u16::try_from(number).ok().filter(|number| (1..=6).contains(number))?;
            self.text(first + number - 1, display)
        };
        [own(600), own(606), of(606, 100), own(612), of(612, 450), own(642), own(684)]
    }

    /// What a CAN bus is, and its objects: name, kind, node.
    fn bus(&self, at: usize, display: &Values) -> Option<Bus> {
        let known = [300, 302].iter().all(|first| self.values.contains_key(&(first + at as u16)));
        if !known {
            return None;
        }
        let role = match Role::read(display, at) {
            Role::Master => "CANopen master",
            Role::Slave => "CANopen slave",
            Role::Link => return Some(("CAN Link", Vec::new())),
        };
        let settings = Settings::read(display, at);
        let named = |way: &str, objects: [Option<Object>; OBJECTS]| {
            let objects = (1..).zip(objects).filter_map(|(number, object)| Some((number, object?)));
            objects
                .map(|(number, object)| {
                    (format!("{way}{number}"), format!("{:?}", object.kind), object.node.raw())
                })
                .collect::<Vec<_>>()
        };
        Some((role, [named("IN", settings.inputs), named("OUT", settings.outputs)].concat()))
    }

    fn controller_table(&self, display: &Values) -> Table {
        let mut table = Table::new("Controller", &["what", "is"], "has not answered yet");
        if let Some(Identity { model, axes, os_version, custom_version }) = &self.identity {
            table.push(Tone::Plain, ["model".into(), format!("GEL {model}, {axes} axes")]);
            let versions = format!("{os_version}, customized {custom_version}");
            table.push(Tone::Plain, ["software".into(), versions]);
        }
        for (name, index) in
            [("device number", 5), ("axes activated", 0), ("PLC active", 3), ("at PLC stop", 4)]
        {
            if let Some(text) = self.text(index, display) {
                table.push(Tone::Plain, [name.into(), text]);
            }
        }
        let missing = "not among LB2's functions; --ram shows what the PLC program keeps in RAM bank 12";
        table.push(Tone::Faint, ["positions, inputs".into(), missing.into()]);
        table
    }

    fn failure_table(&self) -> Table {
        let empty = if self.failures.is_some() { "none stored" } else { "not read yet" };
        let mut table = Table::new("Failures", &["from", "number>", "failure"], empty);
        for stored in self.failures.iter().flatten() {
            let cells = [source(stored), stored.failure.0.to_string(), stored.failure.to_string()];
            table.push(Tone::Bad, cells);
        }
        table
    }

    fn axis_table(&self, display: &Values) -> Table {
        let columns = [
            "axis>",
            "mode",
            "actual value",
            "its type",
            "nominal value",
            "its type",
            "V max.>",
            "V work>",
            "failures>",
        ];
        let mut table = Table::new("Axes", &columns, "");
        let active = self.values.get(&0).and_then(|count| u8::try_from(*count).ok()).unwrap_or(AXES);
        for axis in 0..AXES {
            let failures = self.failures.iter().flatten().filter(|stored| stored.axis == axis + 1).count();
            let tone = match failures {
                0 if axis >= active => Tone::Faint,
                0 => Tone::Plain,
                _ => Tone::Bad,
            };
            let cells = self.axis(axis, display).map(|text| text.unwrap_or_else(|| "-".into()));
            let ends = [(axis + 1).to_string(), failures.to_string()];
            let [number, failures] = ends;
            table.push(tone, core::iter::once(number).chain(cells).chain([failures]));
        }
        table
    }

    fn bus_table(&self, display: &Values) -> Table {
        let mut table = Table::new("CAN", &["bus>", "is", "objects"], "not read yet");
        for at in 0..2 {
            if let Some((role, objects)) = self.bus(at, display) {
                let objects: Vec<_> = objects
                    .iter()
                    .map(|(name, kind, node)| format!("{name} {kind} of node {node}"))
                    .collect();
                table.push(Tone::Plain, [(at + 1).to_string(), role.into(), objects.join(", ")]);
            }
        }
        table
    }

    fn watched_table(&self, display: &Values) -> Option<Table> {
        let mut table = Table::new("Watched", &["what", "value"], "");
        for entry in &self.watched {
            let text = self.text(entry.index(), display).unwrap_or_else(|| "-".into());
            table.push(Tone::Plain, [entry.to_string(), text]);
        }
        for (place, bytes) in &self.ram {
            let text = bytes.as_ref().map_or_else(
                || "-".into(),
                |bytes| match in_json(place, bytes) {
                    Value::String(text) => text,
                    value => value.to_string(),
                },
            );
            table.push(Tone::Plain, [place.name.clone(), text]);
        }
        (!table.rows.is_empty()).then_some(table)
    }

    pub(in super::super) fn sheet(&self) -> Sheet {
        let display = self.display();
        let silent = self.silent.map_or_else(String::new, |since| {
            let nanos = |time| Some(Time::from_zero(time).0);
            format!("NO ANSWER for {}  ", age(nanos(self.now), nanos(since)))
        });
        let mut tables = vec![self.controller_table(&display), self.failure_table()];
        tables.extend(self.watched_table(&display));
        tables.extend([self.axis_table(&display), self.bus_table(&display), self.lines.table("nothing yet")]);
        Sheet { head: format!("{silent}{:.1} s  {}", self.now.as_secs_f64(), self.title), tables }
    }

    pub(in super::super) fn document(&self) -> Value {
        let display = self.display();
        let number = self.values.get(&5).copied();
        let identity = self.identity.as_ref().map(|identity| identity.json(number));
        let failures =
            self.failures.as_ref().map(|failures| failures.iter().map(failure_json).collect::<Vec<_>>());
        let axes = (0..AXES).map(|axis| {
            let [mode, input, input_type, output, output_type, v_max, v_work] = self.axis(axis, &display);
            json!({
                "axis": axis + 1,
                "mode": mode,
                "input": input,
                "input_type": input_type,
                "output": output,
                "output_type": output_type,
                "v_max": v_max,
                "v_work": v_work,
            })
        });
        let buses = (0..2).filter_map(|at| {
            let (role, objects) = self.bus(at, &display)?;
            let objects = objects
                .into_iter()
                .map(|(name, kind, node)| json!({ "object": name, "type": kind, "node": node }));
            Some(json!({ "can": at + 1, "role": role, "objects": objects.collect::<Vec<_>>() }))
        });
        let parameters = self.watched.iter().map(|entry| {
            json!({
                "index": entry.index(),
                "name": entry.name(),
                "group": entry.group(),
                "value": self.values.get(&entry.index()),
                "text": self.text(entry.index(), &display),
            })
        });
        let ram = self.ram.iter().map(|(place, bytes)| {
            json!({
                "offset": place.offset,
                "name": place.name,
                "data": bytes.as_ref().map(|bytes| hex(bytes)),
                "value": bytes.as_ref().map(|bytes| in_json(place, bytes)),
            })
        });
        json!({
            "source": self.title,
            "seconds": (self.now.as_secs_f64() * 1e6).round() / 1e6,
            "answers": self.silent.is_none() && self.identity.is_some(),
            "identity": identity,
            "failures": failures,
            "axes_activated": self.values.get(&0),
            "plc": { "active": self.text(3, &display), "at_stop": self.text(4, &display) },
            "axes": axes.collect::<Vec<_>>(),
            "can": buses.collect::<Vec<_>>(),
            "parameters": parameters.collect::<Vec<_>>(),
            "ram": ram.collect::<Vec<_>>(),
            "story": self.lines,
        })
    }
}

fn in_json(place: &Place, bytes: &[u8]) -> Value {
    decode(bytes, place.data_type).unwrap_or_else(|_| json!(hex(bytes)))
}
