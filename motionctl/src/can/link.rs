//! `motionctl can link`: the channels of a CAN Link bus.

use core::sync::atomic::Ordering;
use core::time::Duration;

use can_link::{Channel, Event, Link, Role, Setting, Trigger};
use canopen_master::data_type::DataType;
use motion_io::can::{Driver, Engine, open};
use pdo::Frame;
use serde_json::{Value, json};

use super::cli::{CanLine, Content, LinkCommand, Stream};
use super::network::STEP;
use super::session::{endpoint, gone};
use super::stop_flag;
use super::value::{bytes, decode, encode, hex, named_type};
use crate::cli::Global;
use crate::exit::Exit;
use crate::output::Output;

/// How long `list` listens unless told.
const LISTEN: Duration = Duration::from_secs(1);
/// A value that is sent once may wait so long for room in the transmit queue.
const FLUSH: Duration = Duration::from_millis(20);

struct Wire(Link);

impl Engine for Wire {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        let _ = self.0.handle_frame(now, frame);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.0.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        self.0.poll_transmit(now)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.0.poll_timeout()
    }
}

/// A device on an open endpoint that receives all channels, but for one that it sends on.
struct Device {
    driver: Driver,
    wire: Wire,
    /// What the bytes of a channel are, where it was told.
    content: Option<DataType>,
}

impl Device {
    fn open(
        global: &Global,
        line: &CanLine,
        content: Option<DataType>,
        own: Option<(Channel, Setting)>,
    ) -> Result<Self, Exit> {
        let mut link = Link::new();
        for channel in Channel::all() {
            let setting = own.filter(|(own, _)| *own == channel).map_or(Setting::RECEIVE, |(_, own)| own);
            link.set(channel, setting).map_err(|error| Exit::usage(error.to_string()))?;
        }
        let port = open(&endpoint(global, line)?).map_err(|error| Exit::trouble(error.to_string()))?;
        Ok(Self { driver: Driver::new(port), wire: Wire(link), content })
    }

    /// One turn until something comes, at most until `limit`.
    fn turn(&mut self, limit: Duration) -> Result<(), Exit> {
        self.driver.run(&mut self.wire, limit, |_| {}).map_err(|error| gone(&error))
    }

    /// Turns until `limit`, or until stopped; `tell` learns of every event.
    fn run(&mut self, limit: Duration, mut tell: impl FnMut(&mut Self, Event)) -> Result<(), Exit> {
        let stop = stop_flag()?;
        while self.driver.now() < limit && !stop.load(Ordering::Relaxed) {
            self.turn(limit.min(self.driver.now() + STEP))?;
            while let Some(event) = self.wire.0.poll_event() {
                tell(self, event);
            }
        }
        Ok(())
    }

    /// What a channel holds, as a JSON object.
    fn channel(&mut self, channel: Channel) -> Value {
        let received = self.wire.0.read(self.driver.now(), channel);
        let mut document = json!({
            "channel": channel.number(),
            "data": received.map(|received| hex(received.data())),
            "age": received.map(|received| received.age.as_secs_f64()),
            "source": received.map(|_| "bus"),
            "conflict": self.wire.0.conflicts(channel) > 0,
        });
        if let Some(content) = self.content {
            // Null where the bytes are no such value.
            document["value"] = json!(received.and_then(|received| decode(received.data(), content).ok()));
        }
        document
    }
}

pub(crate) fn run(out: &Output, global: &Global, command: &LinkCommand) -> Result<(), Exit> {
    match command {
        LinkCommand::List { line, content, stream } => {
            list(out, Device::open(global, line, content.data_type()?, None)?, stream)
        }
        LinkCommand::Watch { line, content, stream } => {
            watch(out, Device::open(global, line, content.data_type()?, None)?, stream)
        }
        LinkCommand::Set { channel, data, content, period, line, stream } => {
            let channel = Channel::new(*channel).map_err(|error| Exit::usage(error.to_string()))?;
            let data = match content.data_type()? {
                Some(data_type) => encode(data, data_type)?,
                None => bytes(data).ok_or_else(|| {
                    Exit::usage(format!("{data:?}: up to 8 pairs of hex digits, or --type T expected"))
                })?,
            };
            set(out, global, line, (channel, &data), *period, stream)
        }
    }
}

impl Content {
    fn data_type(&self) -> Result<Option<DataType>, Exit> {
        self.data_type.as_deref().map(named_type).transpose()
    }
}

/// All channels after listening for a while.
fn list(out: &Output, mut device: Device, run: &Stream) -> Result<(), Exit> {
    device.run(run.limit.unwrap_or(LISTEN), |_, _| {})?;
    let channels: Vec<Value> = Channel::all().map(|channel| device.channel(channel)).collect();
    out.document(json!({ "channels": &channels }), || {
        let heard = channels.iter().filter(|channel| !channel["data"].is_null());
        if heard.clone().count() == 0 {
            println!("nothing came on any channel");
        }
        heard.for_each(|channel| println!("{}", words(channel)));
    });
    Ok(())
}

/// The value where it is one, and the bytes.
fn content(channel: &Value) -> String {
    let data = channel["data"].as_str().unwrap_or("");
    match &channel["value"] {
        Value::Null => data.into(),
        value => format!("{value} ({data})"),
    }
}

fn words(channel: &Value) -> String {
    let age = channel["age"].as_f64().unwrap_or(0.0);
    format!("channel {:>2}: {:16}  {age:.3} s ago", channel["channel"], content(channel))
}

/// Values as they come.
fn watch(out: &Output, mut device: Device, run: &Stream) -> Result<(), Exit> {
    device.run(run.limit.unwrap_or(Duration::MAX), |device, event| {
        let Event::Received(channel) = event else { return };
        let t = device.driver.now().as_secs_f64();
        let mut document = device.channel(channel);
        document["t"] = json!(t);
        let text = format!("{t:10.3}  channel {channel:>2}: {}", content(&document));
        out.line(document, || text);
    })
}

/// Sends a value once, or at a period until stopped.
fn set(
    out: &Output,
    global: &Global,
    line: &CanLine,
    (channel, data): (Channel, &[u8]),
    period: Option<Duration>,
    run: &Stream,
) -> Result<(), Exit> {
    let (trigger, default) = match period {
        Some(period) => (Trigger::Period(period), Duration::MAX),
        None => (Trigger::Change, FLUSH),
    };
    let setting = Setting { role: Role::Transmit(trigger), ..Setting::OFF };
    let limit = run.limit.unwrap_or(default);
    if out.only_plans(|| format!("would send {} on channel {channel}", hex(data))) {
        return Ok(());
    }
    let mut device = Device::open(global, line, None, Some((channel, setting)))?;
    device.wire.0.write(channel, data).map_err(|error| Exit::usage(error.to_string()))?;
    if period.is_some() {
        let ready = json!({ "event": "ready", "channel": channel.number() });
        out.document(ready, || out.say(&format!("sending on channel {channel}")));
    }
    device.run(limit, |_, _| {})?;
    let conflicts = device.wire.0.conflicts(channel);
    let document = json!({
        "channel": channel.number(),
        "data": hex(data),
        "age": 0.0,
        "source": "own",
        "conflict": conflicts > 0,
    });
    out.document(document, || out.say(&format!("channel {channel}: {}", hex(data))));
    if conflicts > 0 {
        let text = format!("channel {channel}: another device sends on it too, {conflicts} frames came");
        return Err(Exit::check(text));
    }
    Ok(())
}
