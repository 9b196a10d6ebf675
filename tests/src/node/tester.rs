//! What the checks work with: the node under test at the end of a wire.

use core::time::Duration;
use std::io;

use canopen_master::eds::{Access, Device, Entry};
use canopen_master::emcy::Emergency;
use canopen_master::nmt::{Command, State, Target};
use canopen_master::sdo::message::{Request, Response};
use canopen_master::sdo::{AbortCode, Channel, Client, Options, Outcome};
use canopen_master::{Address, NodeId};
use embedded_can::Frame as _;
use pdo::{Frame, Payload, Service, cob};

use super::words::{asked, bytes, coded, said};
use super::{Config, Problem, fail, skip};

/// A CAN bus with a clock. Times are since any fixed moment.
pub trait Wire {
    /// The time.
    fn now(&self) -> Duration;

    /// Sends a frame.
    ///
    /// # Errors
    /// The wire failed.
    fn send(&mut self, frame: &Frame) -> io::Result<()>;

    /// The next frame of the bus, `None` when it is `until` and none has come.
    ///
    /// # Errors
    /// The wire failed.
    fn receive(&mut self, until: Duration) -> io::Result<Option<Frame>>;
}

/// How long a node that is to be silent is listened to.
pub(super) const SILENCE: Duration = Duration::from_millis(100);
/// How long a node has to start again after a reset.
pub(super) const RESTART: Duration = Duration::from_secs(5);

/// What a check comes to.
pub(super) type Checked<T = ()> = Result<T, Problem>;

/// How the node shows its state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shows {
    /// Its heartbeat can be switched on.
    Heartbeat,
    /// It answers guarding requests.
    Guarding,
    /// Not at all, as its device file says.
    Nothing,
}

pub(super) struct Tester<'a> {
    pub(super) wire: &'a mut dyn Wire,
    pub(super) config: &'a Config<'a>,
    /// Emergencies of the node since somebody took them.
    pub(super) emergencies: Vec<Emergency>,
    /// `sdo.segmented-upload` has failed.
    pub(super) bad_segments: bool,
    /// Somebody else is on the bus.
    pub(super) others: bool,
}

impl<'a> Tester<'a> {
    pub(super) fn new(wire: &'a mut dyn Wire, config: &'a Config<'a>) -> Self {
        Self { wire, config, emergencies: Vec::new(), bad_segments: false, others: false }
    }

    pub(super) const fn node(&self) -> NodeId {
        self.config.node
    }

    pub(super) const fn device(&self) -> &'a Device {
        self.config.device
    }

    pub(super) fn now(&self) -> Duration {
        self.wire.now()
    }

    pub(super) fn error_control(&self) -> u16 {
        cob::ERROR_CONTROL + u16::from(self.node().raw())
    }

    pub(super) fn send(&mut self, id: u16, data: &[u8]) -> Checked {
        let frame = embedded_can::StandardId::new(id).and_then(|id| Frame::data_frame(id, data));
        match frame {
            Some(frame) => Ok(self.wire.send(&frame)?),
            None => fail("no frame"),
        }
    }

    fn receive(&mut self, until: Duration) -> Checked<Option<Frame>> {
        let frame = self.wire.receive(until)?;
        if let Some(frame) = &frame
            && let Some(id) = frame.standard_id()
        {
            let own = self.node().raw();
            if id == 0x80 + u16::from(own)
                && let Some(emergency) = Emergency::parse(frame.data())
            {
                self.emergencies.push(emergency);
            }
            let node = Service::of_frame(frame).and_then(Service::node);
            self.others |= node.is_some_and(|node| node.raw() != own);
        }
        Ok(frame)
    }

    /// Waits for a data frame on an identifier.
    pub(super) fn wait(&mut self, id: u16, until: Duration) -> Checked<Option<Vec<u8>>> {
        while let Some(frame) = self.receive(until)? {
            if frame.standard_id() == Some(id) && frame.is_data_frame() {
                return Ok(Some(frame.data().to_vec()));
            }
        }
        Ok(None)
    }

    /// Listens for a time to an identifier on which nothing is to come.
    pub(super) fn expect_silence(&mut self, id: u16, what: &str) -> Checked {
        let until = self.now() + SILENCE;
        match self.wait(id, until)? {
            Some(data) => fail(format!("{what}: {} came, silence expected", bytes(&data))),
            None => Ok(()),
        }
    }

    /// Waits for an emergency with one of these codes.
    pub(super) fn wait_for_emergency(&mut self, code: u16, until: Duration) -> Checked<bool> {
        loop {
            if self.emergencies.iter().any(|emergency| emergency.code.0 == code) {
                return Ok(true);
            }
            if self.receive(until)?.is_none() {
                return Ok(false);
            }
        }
    }

    // SDO, frame by frame.

    pub(super) fn ask_raw(&mut self, data: [u8; 8]) -> Checked<Option<Vec<u8>>> {
        let channel = Channel::default_of(self.node());
        self.send(channel.request, &data)?;
        let until = self.now() + self.config.answer;
        self.wait(channel.response, until)
    }

    pub(super) fn ask(&mut self, request: Request) -> Checked<Response> {
        let Some(data) = self.ask_raw(request.encode())? else {
            return fail(format!("no answer to {} within {:?}", asked(&request), self.config.answer));
        };
        if data.len() != 8 {
            return fail(format!("an SDO answer has {} bytes, 8 expected", data.len()));
        }
        Response::parse(&data).map_or_else(|error| fail(format!("{}: {error}", bytes(&data))), Ok)
    }

    /// A request that must be refused with one of these codes.
    pub(super) fn expect_abort(&mut self, request: Request, codes: &[AbortCode]) -> Checked {
        let answer = self.ask(request)?;
        self.is_abort(answer, codes)
    }

    pub(super) fn is_abort(&mut self, answer: Response, codes: &[AbortCode]) -> Checked {
        let expected = codes.iter().map(|code| format!("{:08X}h", code.0)).collect::<Vec<_>>().join(" or ");
        match answer {
            Response::Abort { code, .. } if codes.contains(&code) => Ok(()),
            Response::Abort { code, .. } => {
                fail(format!("aborted with {}; {expected} expected", coded(code)))
            }
            other => {
                // Leave no transfer open behind us.
                self.abort(Address::new(0, 0))?;
                fail(format!("{}; abort code {expected} expected", said(&other)))
            }
        }
    }

    /// Ends what a check has begun; nothing answers an abort.
    pub(super) fn abort(&mut self, at: Address) -> Checked {
        let request = Request::Abort { at, code: AbortCode::GENERAL }.encode();
        self.send(Channel::default_of(self.node()).request, &request)
    }

    // SDO, whole transfers by our own client.

    fn transfer(&mut self, mut client: Client<Vec<u8>>) -> Checked<(Outcome, Vec<u8>)> {
        loop {
            while let Some(frame) = client.poll_transmit(self.now()) {
                self.wire.send(&frame)?;
            }
            if let Some(finished) = client.poll_event() {
                while let Some(frame) = client.poll_transmit(self.now()) {
                    self.wire.send(&frame)?;
                }
                return Ok((finished.outcome, finished.buffer));
            }
            let until = client.poll_timeout().unwrap_or_else(|| self.now());
            if let Some(frame) = self.receive(until)? {
                client.handle_frame(self.now(), &frame);
            }
            client.handle_timeout(self.now());
        }
    }

    pub(super) fn options(&self, block: bool) -> Options {
        if block { Options::block(self.config.answer) } else { Options::new(self.config.answer) }
    }

    pub(super) fn upload(&mut self, at: Address, options: &Options) -> Checked<(Outcome, Vec<u8>)> {
        let mut client = Client::new(Channel::default_of(self.node()));
        match client.upload(at, Vec::new(), options) {
            Ok(_) => self.transfer(client),
            Err(refused) => fail(refused.to_string()),
        }
    }

    pub(super) fn download(&mut self, at: Address, data: &[u8], options: &Options) -> Checked<Outcome> {
        let mut client = Client::new(Channel::default_of(self.node()));
        match client.download(at, data.to_vec(), options) {
            Ok(_) => Ok(self.transfer(client)?.0),
            Err(refused) => fail(refused.to_string()),
        }
    }

    /// A failed upload. One of several segments that breaks off says nothing new where segments are known
    /// to be wrong; four bytes need none.
    pub(super) fn unreadable<T>(&self, at: Address, outcome: Outcome) -> Checked<T> {
        let why = format!("{at} cannot be read: {outcome}");
        let data_type = self.entry(at).and_then(|entry| entry.data_type);
        let size = data_type.and_then(|data_type| self.device().base_type(data_type).size());
        let in_segments = size.is_none_or(|bytes| bytes > 4);
        if self.bad_segments && in_segments && matches!(outcome, Outcome::GaveUp(_) | Outcome::TimedOut) {
            return skip(format!("{why}, which is sdo.segmented-upload's to say"));
        }
        fail(why)
    }

    /// The value of an object that must be readable.
    pub(super) fn read(&mut self, at: Address) -> Checked<Vec<u8>> {
        match self.upload(at, &self.options(false))? {
            (Outcome::Done(_), data) => Ok(data),
            (outcome, _) => self.unreadable(at, outcome),
        }
    }

    /// The same as a number.
    pub(super) fn read_number(&mut self, at: Address) -> Checked<u64> {
        Ok(number(&self.read(at)?))
    }

    pub(super) fn write(&mut self, at: Address, data: &[u8]) -> Checked {
        match self.download(at, data, &self.options(false))? {
            Outcome::Done(_) => Ok(()),
            outcome => fail(format!("{at} cannot be written with {}: {outcome}", bytes(data))),
        }
    }

    /// Whether the device file has an object that can be written.
    pub(super) fn is_writable(&self, at: Address) -> bool {
        self.entry(at).is_some_and(|entry| writes(entry) && reads(entry))
    }

    pub(super) fn entry(&self, at: Address) -> Option<&'a Entry> {
        self.config.device.entry(at.index, at.sub)
    }

    // NMT.

    pub(super) fn command(&mut self, command: Command) -> Checked {
        Ok(self.wire.send(&command.frame(Target::Node(self.node())))?)
    }

    /// Resets the communication and waits for the boot-up message.
    pub(super) fn restart(&mut self, command: Command) -> Checked<Vec<u8>> {
        let id = self.error_control();
        self.command(command)?;
        let until = self.now() + RESTART;
        loop {
            match self.wait(id, until)? {
                // A heartbeat that was on its way.
                Some(data) if data.len() == 1 && data != [0] => {}
                Some(data) => return Ok(data),
                None => {
                    return fail(format!(
                        "no boot-up message within {} s after {command}",
                        RESTART.as_secs()
                    ));
                }
            }
        }
    }

    pub(super) fn shows(&self) -> Shows {
        if self.is_writable(Address::new(0x1017, 0)) {
            Shows::Heartbeat
        } else if self.config.device.object(0x100C).is_some() {
            Shows::Guarding
        } else {
            Shows::Nothing
        }
    }

    /// Lets the node show its state from now on.
    pub(super) fn let_show(&mut self) -> Checked {
        match self.shows() {
            Shows::Heartbeat => self.write(Address::new(0x1017, 0), &100u16.to_le_bytes()),
            Shows::Guarding => Ok(()),
            Shows::Nothing => skip("the node has neither heartbeat (1017h) nor guarding (100Ch)"),
        }
    }

    pub(super) fn guard_request(&mut self) -> Checked {
        let id = embedded_can::StandardId::new(self.error_control());
        match id.and_then(|id| Frame::remote_frame(id, 1)) {
            Some(frame) => Ok(self.wire.send(&frame)?),
            None => fail("no frame"),
        }
    }

    /// Waits until the node shows a state; up to three heartbeats may still be of the one before.
    pub(super) fn expect_state(&mut self, state: State) -> Checked {
        let mut last = None;
        for _ in 0..3 {
            if self.shows() == Shows::Guarding {
                self.guard_request()?;
            }
            let until = self.now() + Duration::from_millis(300).max(self.config.answer);
            match self.wait(self.error_control(), until)?.as_deref() {
                Some([raw]) if raw & 0x7F == state as u8 => return Ok(()),
                Some(data) => last = Some(data.to_vec()),
                None => return fail(format!("the node does not show its state, {state} expected")),
            }
        }
        fail(format!(
            "the node shows {}, {:02X}h ({state}) expected",
            bytes(&last.unwrap_or_default()),
            state as u8
        ))
    }
}

/// A little-endian number of up to 8 bytes.
pub(super) fn number(data: &[u8]) -> u64 {
    Payload::from_slice(data).word()
}

pub(super) fn reads(entry: &Entry) -> bool {
    entry.access != Some(Access::WriteOnly)
}

pub(super) fn writes(entry: &Entry) -> bool {
    !matches!(entry.access, None | Some(Access::ReadOnly | Access::Const))
}
