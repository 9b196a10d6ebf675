//! `motionctl can link`: the channels of a CAN Link bus.

use core::sync::atomic::Ordering;
use core::time::Duration;

use can_link::{Channel, Event, Link, Role, Setting, Trigger};
use motion_io::can::{Driver, Engine, open};
use pdo::Frame;
use serde_json::{Value, json};

use super::cli::{CanLine, LinkCommand, Stream};
use super::network::STEP;
use super::session::{duration, endpoint, gone};
use super::stop_flag;
use super::value::{bytes, hex};
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
}

impl Device {
    fn open(global: &Global, line: &CanLine, own: Option<(Channel, Setting)>) -> Result<Self, Exit> {
        let mut link = Link::new();
        for channel in Channel::all() {
            let setting = own.filter(|(own, _)| *own == channel).map_or(Setting::RECEIVE, |(_, own)| own);
            link.set(channel, setting).map_err(|error| Exit::usage(error.to_string()))?;
        }
        let port = open(&endpoint(global, line)?).map_err(|error| Exit::trouble(error.to_string()))?;
        Ok(Self { driver: Driver::new(port), wire: Wire(link) })
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
        json!({
            "channel": channel.number(),
            "data": received.map(|received| hex(received.data())),
            "age": received.map(|received| received.age.as_secs_f64()),
            "source": received.map(|_| "bus"),
            "conflict": self.wire.0.conflicts(channel) > 0,
        })
    }
}

fn limit(run: &Stream, default: Duration) -> Result<Duration, Exit> {
    run.seconds.map_or(Ok(default), |seconds| duration("--for", seconds))
}

pub(crate) fn run(out: &Output, global: &Global, command: &LinkCommand) -> Result<(), Exit> {
    match command {
        LinkCommand::List { line, stream } => list(out, global, line, stream),
        LinkCommand::Watch { line, stream } => watch(out, global, line, stream),
        LinkCommand::Set { channel, data, period, line, stream } => {
            let channel = Channel::new(*channel).map_err(|error| Exit::usage(error.to_string()))?;
            let data = bytes(data)
                .ok_or_else(|| Exit::usage(format!("{data:?}: up to 8 pairs of hex digits expected")))?;
            set(out, global, line, (channel, &data), *period, stream)
        }
    }
}

/// All channels after listening for a while.
fn list(out: &Output, global: &Global, line: &CanLine, run: &Stream) -> Result<(), Exit> {
    let mut device = Device::open(global, line, None)?;
    device.run(limit(run, LISTEN)?, |_, _| {})?;
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

fn words(channel: &Value) -> String {
    let data = channel["data"].as_str().unwrap_or("");
    let age = channel["age"].as_f64().unwrap_or(0.0);
    format!("channel {:>2}: {data:16}  {age:.3} s ago", channel["channel"])
}

/// Values as they come.
fn watch(out: &Output, global: &Global, line: &CanLine, run: &Stream) -> Result<(), Exit> {
    let mut device = Device::open(global, line, None)?;
    device.run(limit(run, Duration::MAX)?, |device, event| {
        let Event::Received(channel) = event else { return };
        let t = device.driver.now().as_secs_f64();
        let mut document = device.channel(channel);
        document["t"] = json!(t);
        let text = format!("{t:10.3}  channel {channel:>2}: {}", document["data"].as_str().unwrap_or(""));
        out.line(document, || text);
    })
}

/// Sends a value once, or at a period until stopped.
fn set(
    out: &Output,
    global: &Global,
    line: &CanLine,
    (channel, data): (Channel, &[u8]),
    period: Option<f64>,
    run: &Stream,
) -> Result<(), Exit> {
    let (trigger, default) = match period {
        Some(seconds) => (Trigger::Period(duration("--period", seconds)?), Duration::MAX),
        None => (Trigger::Change, FLUSH),
    };
    let setting = Setting { role: Role::Transmit(trigger), ..Setting::OFF };
    let limit = limit(run, default)?;
    let mut device = Device::open(global, line, Some((channel, setting)))?;
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
