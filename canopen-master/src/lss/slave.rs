//! The slave's side.

use pdo::{Frame, NodeId};

use super::{
    BitTiming, FASTSCAN_CONFIRM, Identity, Mode, Part, Refusal, Request, Response, UNCONFIGURED, node_of,
};

/// What the device has to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Store node ID and bit rate, then call [`Slave::stored`].
    Store {
        /// `None`: the device has no node ID after the next start.
        node: Option<NodeId>,
        /// `None`: the bit rate has not been set.
        bit_timing: Option<BitTiming>,
    },
    /// Stop sending after the delay, change the bit rate, send again after another delay.
    ActivateBitTiming {
        /// The bit rate to change to.
        bit_timing: BitTiming,
        /// ms.
        delay_ms: u16,
    },
    /// A device without node ID has one now and may start as that node. A device that had one keeps
    /// it until it is reset.
    Start(NodeId),
}

/// An LSS slave.
#[derive(Debug, Clone)]
pub struct Slave {
    identity: Identity,
    rates: u16,
    mode: Mode,
    active: u8,
    pending: u8,
    bit_timing: Option<BitTiming>,
    selected: Identity,
    /// Which numbers of `selected` came, in the order of CiA 305.
    matched: Option<Part>,
    fastscan: Part,
}

impl Slave {
    /// A waiting slave with this identity and node ID, `None` for a device that has none. `rates`
    /// are the bit rates it can run at.
    #[must_use]
    pub fn new(identity: Identity, node: Option<NodeId>, rates: &[BitTiming]) -> Self {
        let active = node.map_or(UNCONFIGURED, NodeId::raw);
        Self {
            identity,
            rates: rates.iter().fold(0, |set, rate| set | 1 << rate.index()),
            mode: Mode::Waiting,
            active,
            pending: active,
            bit_timing: None,
            selected: Identity::default(),
            matched: None,
            fastscan: Part::Vendor,
        }
    }

    /// Its state.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// The node ID it runs with.
    #[must_use]
    pub const fn node(&self) -> Option<NodeId> {
        node_of(self.active)
    }

    /// The node ID it will have after the next reset of communication, which takes effect by
    /// [`restart`](Self::restart).
    #[must_use]
    pub const fn pending(&self) -> Option<NodeId> {
        node_of(self.pending)
    }

    /// The communication starts anew: the pending node ID is the node ID.
    pub const fn restart(&mut self) {
        self.active = self.pending;
        self.mode = Mode::Waiting;
    }

    /// Takes a request; returns the answer, and what the device has to do.
    pub fn handle(&mut self, request: Request) -> (Option<Frame>, Option<Action>) {
        let (response, action) = self.react(request);
        (response.map(Response::frame), action)
    }

    /// The answer to a store request, after the device has tried.
    #[must_use]
    pub const fn stored(result: Result<(), Refusal>) -> Frame {
        let result = match result {
            Ok(()) => Refusal::NONE,
            Err(refusal) => refusal,
        };
        Response::Done { command: 0x17, result }.frame()
    }

    fn react(&mut self, request: Request) -> (Option<Response>, Option<Action>) {
        match (request, self.mode) {
            (Request::SwitchGlobal(mode), before) => {
                self.mode = mode;
                self.matched = None;
                let left = before == Mode::Configuration && mode == Mode::Waiting;
                if left && self.active == UNCONFIGURED {
                    self.active = self.pending;
                    return (None, self.node().map(Action::Start));
                }
                (None, None)
            }
            (Request::Select(part, value), Mode::Waiting) => (self.select(part, value), None),
            (Request::IdentifyUnconfigured, _) if self.is_unconfigured() => {
                (Some(Response::Unconfigured), None)
            }
            (Request::Fastscan { number, bit, part, next }, Mode::Waiting) if self.is_unconfigured() => {
                (self.compare(number, bit, part, next), None)
            }
            (Request::ConfigureNodeId(node), Mode::Configuration) => {
                let valid = node == UNCONFIGURED || node_of(node).is_some();
                if valid {
                    self.pending = node;
                }
                (Some(done(0x11, valid)), None)
            }
            (Request::ConfigureBitTiming { table, index }, Mode::Configuration) => {
                let known =
                    BitTiming::from_index(index).filter(|_| table == 0 && self.rates >> index & 1 == 1);
                self.bit_timing = known.or(self.bit_timing);
                (Some(done(0x13, known.is_some())), None)
            }
            (Request::ActivateBitTiming { delay_ms }, Mode::Configuration) => {
                let action = |bit_timing| Action::ActivateBitTiming { bit_timing, delay_ms };
                (None, self.bit_timing.map(action))
            }
            (Request::Store, Mode::Configuration) => {
                (None, Some(Action::Store { node: self.pending(), bit_timing: self.bit_timing }))
            }
            (Request::Inquire(part), Mode::Configuration) => {
                (Some(Response::Identity(part, self.identity.part(part))), None)
            }
            (Request::InquireNodeId, Mode::Configuration) => (Some(Response::NodeId(self.active)), None),
            _ => (None, None),
        }
    }

    /// CiA 305: the four numbers come in order, the last one decides.
    fn select(&mut self, part: Part, value: u32) -> Option<Response> {
        let expected = self.matched.map_or(Part::Vendor, Part::next);
        if part == Part::Vendor || part == expected {
            self.selected.set_part(part, value);
            self.matched = Some(part);
        } else {
            self.matched = None;
        }
        if self.matched != Some(Part::Serial) {
            return None;
        }
        self.matched = None;
        (self.selected == self.identity).then(|| {
            self.mode = Mode::Configuration;
            Response::Selected
        })
    }

    fn compare(&mut self, number: u32, bit: u8, part: Part, next: Part) -> Option<Response> {
        if bit == FASTSCAN_CONFIRM {
            self.fastscan = Part::Vendor;
            return Some(Response::Identified);
        }
        let mask = u32::MAX.checked_shl(u32::from(bit))?;
        if part != self.fastscan || (self.identity.part(part) ^ number) & mask != 0 {
            return None;
        }
        self.fastscan = next;
        if bit == 0 && next < part {
            self.mode = Mode::Configuration;
        }
        Some(Response::Identified)
    }

    const fn is_unconfigured(&self) -> bool {
        self.active == UNCONFIGURED && self.pending == UNCONFIGURED
    }
}

const fn done(command: u8, ok: bool) -> Response {
    Response::Done { command, result: if ok { Refusal::NONE } else { Refusal::NOT_SUPPORTED } }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDENTITY: Identity = Identity { vendor: 1, product: 2, revision: 3, serial: 4 };

    fn slave(node: Option<NodeId>) -> Slave {
        Slave::new(IDENTITY, node, &[BitTiming::from_kbits(500).unwrap()])
    }

    #[test]
    fn only_the_right_identity_in_the_right_order_selects() {
        let mut slave = slave(Some(NodeId::MIN));
        let select = |slave: &mut Slave, values: [u32; 4]| {
            let mut last = None;
            for (part, value) in Part::ALL.into_iter().zip(values) {
                last = slave.handle(Request::Select(part, value)).0;
            }
            last
        };
        assert_eq!(select(&mut slave, [1, 2, 3, 5]), None);
        assert_eq!(slave.handle(Request::Select(Part::Serial, 4)).0, None, "three numbers are missing");
        assert_eq!(slave.handle(Request::InquireNodeId).0, None, "waiting slaves do not answer");
        assert_eq!(select(&mut slave, [1, 2, 3, 4]), Some(Response::Selected.frame()));
        assert_eq!(slave.mode(), Mode::Configuration);
        assert_eq!(slave.handle(Request::InquireNodeId).0, Some(Response::NodeId(1).frame()));
    }

    #[test]
    fn configuration() {
        let mut slave = slave(None);
        slave.handle(Request::SwitchGlobal(Mode::Configuration));
        assert_eq!(slave.handle(Request::ConfigureNodeId(128)).0, Some(done(0x11, false).frame()));
        assert_eq!(slave.handle(Request::ConfigureNodeId(9)).0, Some(done(0x11, true).frame()));
        let node = NodeId::new(9).ok();
        let rate = |index| Request::ConfigureBitTiming { table: 0, index };
        assert_eq!(slave.handle(Request::ActivateBitTiming { delay_ms: 5 }), (None, None), "none was set");
        assert_eq!(slave.handle(rate(0)).0, Some(done(0x13, false).frame()));
        assert_eq!(slave.handle(rate(2)).0, Some(done(0x13, true).frame()));
        let bit_timing = BitTiming::from_kbits(500);
        assert_eq!(slave.handle(Request::Store), (None, Some(Action::Store { node, bit_timing })));
        assert_eq!(Slave::stored(Err(Refusal::STORAGE)).data(), [0x17, 2, 0, 0, 0, 0, 0, 0]);
        assert_eq!(slave.node(), None);
        let started = slave.handle(Request::SwitchGlobal(Mode::Waiting));
        assert_eq!(started, (None, node.map(Action::Start)));
        assert_eq!(slave.node(), node);
    }

    #[test]
    fn a_node_keeps_its_id_until_it_is_reset() {
        let mut slave = slave(Some(NodeId::MIN));
        slave.handle(Request::SwitchGlobal(Mode::Configuration));
        slave.handle(Request::ConfigureNodeId(9));
        assert_eq!(slave.handle(Request::SwitchGlobal(Mode::Waiting)), (None, None));
        assert_eq!((slave.node(), slave.pending()), (Some(NodeId::MIN), NodeId::new(9).ok()));
        slave.restart();
        assert_eq!(slave.node(), NodeId::new(9).ok());
    }
}
