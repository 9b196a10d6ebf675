//! A node and its tester on a virtual bus.

use core::time::Duration;

use canopen_master::sdo::{Channel, Client, Options, Outcome};
use device_sim::can::{Bus, Faults, Network};
use device_sim::canopen::{Address, Device, Fault, Ld2000, Node, RemoteIo};
use pdo::{Frame, NodeId};

pub(crate) const MS: Duration = Duration::from_millis(1);

/// The master's end: an SDO client, frames to send, and everything that was heard.
pub(crate) struct Tester {
    pub(crate) client: Client<Vec<u8>>,
    pub(crate) send: Vec<Frame>,
    pub(crate) heard: Vec<(Duration, Frame)>,
}

impl Tester {
    pub(crate) fn new(node: u8) -> Self {
        let channel = Channel::default_of(NodeId::new(node).unwrap());
        Self { client: Client::new(channel), send: Vec::new(), heard: Vec::new() }
    }
}

impl device_sim::can::Node for Tester {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        let _ = self.client.handle_frame(now, frame);
        self.heard.push((now, *frame));
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.client.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        if self.send.is_empty() { self.client.poll_transmit(now) } else { Some(self.send.remove(0)) }
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.client.poll_timeout()
    }
}

pub(crate) struct Bench<D> {
    pub(crate) network: Network,
    pub(crate) tester: Tester,
    pub(crate) node: Node<D>,
}

impl<D: Device> Bench<D> {
    pub(crate) fn new(node: Node<D>, faults: Faults) -> Self {
        let id = node.node().map_or(127, NodeId::raw);
        let network = Network::new(Bus::new(500_000, faults), 2);
        let mut bench = Self { network, tester: Tester::new(id), node };
        bench.run(5 * MS);
        bench
    }

    pub(crate) fn run(&mut self, time: Duration) {
        let limit = self.network.now() + time;
        self.network.run_until(&mut [&mut self.tester, &mut self.node], limit, |_| false);
    }

    pub(crate) fn send(&mut self, frame: Frame) {
        self.tester.send.push(frame);
        self.run(2 * MS);
    }

    /// Identifiers and data of what was heard since the last call.
    pub(crate) fn heard(&mut self) -> Vec<String> {
        self.tester.heard.drain(..).map(|(_, frame)| frame.to_string()).collect()
    }

    pub(crate) fn transfer(&mut self) -> (Outcome, Vec<u8>) {
        let limit = self.network.now() + Duration::from_secs(60);
        loop {
            if let Some(finished) = self.tester.client.poll_event() {
                return (finished.outcome, finished.buffer);
            }
            assert!(self.network.step(&mut [&mut self.tester, &mut self.node], limit), "no outcome");
        }
    }

    pub(crate) fn read(&mut self, index: u16, sub: u8, options: &Options) -> Result<Vec<u8>, Outcome> {
        self.tester.client.upload(Address::new(index, sub), Vec::new(), options).unwrap();
        match self.transfer() {
            (Outcome::Done(_), data) => Ok(data),
            (outcome, _) => Err(outcome),
        }
    }

    pub(crate) fn write(
        &mut self,
        index: u16,
        sub: u8,
        data: &[u8],
        options: &Options,
    ) -> Result<(), Outcome> {
        self.tester.client.download(Address::new(index, sub), data.to_vec(), options).unwrap();
        match self.transfer() {
            (Outcome::Done(_), _) => Ok(()),
            (outcome, _) => Err(outcome),
        }
    }

    pub(crate) fn put(&mut self, index: u16, sub: u8, data: &[u8]) {
        self.write(index, sub, data, &Options::default()).unwrap();
    }

    pub(crate) fn get(&mut self, index: u16, sub: u8) -> Vec<u8> {
        self.read(index, sub, &Options::default()).unwrap()
    }
}

impl Bench<RemoteIo> {
    /// Changes inputs of the I/O node.
    pub(crate) fn with_io(&mut self, change: impl FnOnce(&mut RemoteIo)) {
        let now = self.network.now();
        self.node.with_device(now, |io, context| {
            change(io);
            io.update(context);
        });
        self.run(2 * MS);
    }
}

impl Bench<Ld2000> {
    pub(crate) fn fail(&mut self, fault: Fault) {
        let now = self.network.now();
        self.node.with_device(now, |drive, context| drive.fail(context, fault));
        self.run(10 * MS);
    }
}

pub(crate) fn id(raw: u8) -> Option<NodeId> {
    Some(NodeId::new(raw).unwrap())
}

/// What a master guards a node with.
pub(crate) fn guard(node: u8) -> Frame {
    let id = embedded_can::StandardId::new(0x700 + u16::from(node)).unwrap();
    Frame::remote_frame(id, 1).unwrap()
}

/// How every device file here begins.
pub(crate) const DEVICE_INFO: &str = "
[DeviceInfo]
VendorName=Nobody
VendorNumber=7
ProductName=Thing
ProductNumber=8
RevisionNumber=9
LSS_Supported=1
";

pub(crate) const START: Frame = Frame::standard(0x000, [1, 0]);
pub(crate) const SYNC: Frame = Frame::standard(0x080, []);
