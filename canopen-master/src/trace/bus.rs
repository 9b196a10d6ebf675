//! One bus: which identifier is what, and the state of its nodes.

use alloc::boxed::Box;
use alloc::collections::{BTreeMap, VecDeque};
use alloc::vec;
use core::time::Duration;

use embedded_can::Id;
use pdo::{Address, CobId, NodeId, Service};

use super::kind::{Kind, Lss};
use super::mapping::{Mapped, PdoDirection, PdoState};
use super::sdo::{SdoFrame, Transfer, Watch, Way};
use crate::emcy::ErrorCode;
use crate::lss;
use crate::nmt::{Command, State};
use crate::time::TimeOfDay;

/// First identifier of CAN Link less 1, and its channels.
const CAN_LINK: u16 = 0x100;
const CAN_LINK_CHANNELS: u8 = 14;

/// A frame with an 11-bit identifier.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heard<'a> {
    id: u16,
    remote: bool,
    data: &'a [u8],
}

impl<'a> Heard<'a> {
    /// `None` of a frame with a 29-bit identifier.
    #[inline]
    pub(super) fn new(frame: &'a impl embedded_can::Frame) -> Option<Self> {
        match frame.id() {
            Id::Standard(id) => {
                let remote = frame.is_remote_frame();
                Some(Self { id: id.as_raw(), remote, data: if remote { &[] } else { frame.data() } })
            }
            Id::Extended(_) => None,
        }
    }
}

/// What an identifier is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    Unknown,
    Nmt,
    Sync,
    Time,
    Emcy(NodeId),
    Pdo(NodeId, PdoDirection, u16),
    /// Node and channel, 0 = the default one.
    Sdo(NodeId, u8, Way),
    ErrorControl(NodeId),
    LssRequest,
    LssResponse,
    CanLink(u8),
}

impl Role {
    const fn predefined(id: u16) -> Self {
        match Service::of(id) {
            Service::Nmt => Self::Nmt,
            Service::Sync => Self::Sync,
            Service::Time => Self::Time,
            Service::Emcy(node) => Self::Emcy(node),
            Service::Tpdo(pdo, node) => Self::Pdo(node, PdoDirection::Transmit, pdo.number() as u16),
            Service::Rpdo(pdo, node) => Self::Pdo(node, PdoDirection::Receive, pdo.number() as u16),
            Service::SdoResponse(node) => Self::Sdo(node, 0, Way::Response),
            Service::SdoRequest(node) => Self::Sdo(node, 0, Way::Request),
            Service::ErrorControl(node) => Self::ErrorControl(node),
            Service::LssResponse => Self::LssResponse,
            Service::LssRequest => Self::LssRequest,
            _ => Self::Unknown,
        }
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct NodeState {
    /// Shown last, or told last.
    state: Option<State>,
    /// Shown last.
    shown: Option<State>,
    /// A guard request has not been answered.
    asked: bool,
    /// Toggle of the last guard reply.
    toggle: Option<bool>,
}

impl NodeState {
    /// A data frame on the identifier of error control: exactly one byte.
    #[inline]
    fn handle(&mut self, node: NodeId, data: &[u8]) -> Kind {
        let &[byte] = data else { return Kind::Unknown };
        let before = self.shown;
        if byte == 0 {
            *self = Self { state: Some(State::BootUp), shown: Some(State::BootUp), ..Self::default() };
            return Kind::BootUp { node, before };
        }
        let state = State::from_raw(byte & 0x7F);
        self.shown = state.or(before);
        self.state = state.or(self.state);
        let toggle = byte & 0x80 != 0;
        // A heartbeat has no toggle bit: the request of such an answer is missing in the capture.
        if self.asked || toggle {
            self.asked = false;
            let wrong_toggle = self.toggle.replace(toggle) == Some(toggle);
            return Kind::GuardReply { node, toggle, wrong_toggle, state, before };
        }
        Kind::Heartbeat { node, state, before }
    }
}

/// A frame that needs no state to be understood.
#[inline]
fn plain(role: Role, frame: Heard<'_>) -> Kind {
    let data = frame.data;
    match role {
        Role::Pdo(node, direction, number) => Kind::Pdo { node, direction, number },
        _ if frame.remote => Kind::Unknown,
        Role::Sync => {
            let counter = match data {
                &[counter] => Some(counter),
                _ => None,
            };
            Kind::Sync { counter, interval: None }
        }
        Role::Nmt => match data {
            &[command, target] => Kind::Nmt { command: Command::from_raw(command), target },
            _ => Kind::Unknown,
        },
        // Devices are seen that send 8 bytes, the last ones unused.
        Role::Time => Kind::Time(data.first_chunk().copied().map(TimeOfDay::parse)),
        Role::Emcy(node) => Kind::Emcy {
            node,
            code: data.first_chunk().map(|code| ErrorCode(u16::from_le_bytes(*code))),
            register: data.get(2).copied(),
        },
        Role::LssRequest => match data.try_into() {
            Ok(bytes) => Kind::Lss(Lss::Request(lss::Request::parse(bytes))),
            Err(_) => Kind::Unknown,
        },
        Role::LssResponse => match data.try_into() {
            Ok(bytes) => Kind::Lss(Lss::Response(lss::Response::parse(bytes))),
            Err(_) => Kind::Unknown,
        },
        Role::CanLink(channel) => Kind::CanLink { channel },
        Role::Unknown | Role::Sdo(..) | Role::ErrorControl(_) => Kind::Unknown,
    }
}

fn sdo_kind(frame: SdoFrame) -> Kind {
    match () {
        () if frame.abort().is_some() => Kind::SdoAbort(frame),
        () if frame.way == Way::Request => Kind::SdoRequest(frame),
        () => Kind::SdoResponse(frame),
    }
}

#[derive(Debug)]
pub(super) struct BusState {
    /// By identifier.
    roles: Box<[Role]>,
    /// By node ID.
    nodes: Box<[NodeState]>,
    /// Default SDO channels by node ID.
    sdo: Box<[Option<Box<Watch>>]>,
    further_sdo: BTreeMap<(NodeId, u8), Box<Watch>>,
    pdos: BTreeMap<(NodeId, PdoDirection, u16), PdoState>,
    /// The identifiers of further SDO channels as they are learned.
    channels: BTreeMap<(NodeId, u8, u8), u16>,
    last_sync: Option<Duration>,
}

impl BusState {
    pub(super) fn new(can_link: bool) -> Self {
        let mut roles: Box<[Role]> = (0..0x800).map(Role::predefined).collect();
        if can_link {
            for channel in 1..=CAN_LINK_CHANNELS {
                if let Some(role) = roles.get_mut(usize::from(CAN_LINK) + usize::from(channel)) {
                    *role = Role::CanLink(channel);
                }
            }
        }
        Self {
            roles,
            nodes: vec![NodeState::default(); 128].into_boxed_slice(),
            sdo: (0..128).map(|_| None).collect(),
            further_sdo: BTreeMap::new(),
            pdos: BTreeMap::new(),
            channels: BTreeMap::new(),
            last_sync: None,
        }
    }

    pub(super) fn state(&self, node: NodeId) -> Option<State> {
        self.nodes.get(usize::from(node.raw()))?.state
    }

    #[inline]
    pub(super) fn fields(&self, node: NodeId, direction: PdoDirection, number: u16) -> &[Mapped] {
        if self.pdos.is_empty() {
            return &[];
        }
        self.pdos.get(&(node, direction, number)).map_or(&[], PdoState::objects)
    }

    #[inline]
    pub(super) fn handle_frame(
        &mut self,
        now: Option<Duration>,
        bus: u16,
        frame: Heard<'_>,
        events: &mut VecDeque<Transfer>,
    ) -> Kind {
        let role = self.roles.get(usize::from(frame.id)).copied().unwrap_or(Role::Unknown);
        match (role, frame.remote) {
            (Role::ErrorControl(node), true) => self.guard_request(node),
            (Role::ErrorControl(node), false) => match self.nodes.get_mut(usize::from(node.raw())) {
                Some(known) => known.handle(node, frame.data),
                None => Kind::Unknown,
            },
            (Role::Sdo(node, channel, way), false) => {
                self.sdo(now, bus, node, channel, way, frame.data, events)
            }
            (Role::Sync, false) => {
                let interval = now.zip(self.last_sync).map(|(now, last)| now.saturating_sub(last));
                self.last_sync = now;
                match plain(role, frame) {
                    Kind::Sync { counter, .. } => Kind::Sync { counter, interval },
                    other => other,
                }
            }
            (Role::Nmt, false) => {
                let kind = plain(role, frame);
                if let Kind::Nmt { command: Some(command), target } = kind {
                    self.nmt(command, target);
                }
                kind
            }
            _ => plain(role, frame),
        }
    }

    /// What a frame is, without any consequence.
    pub(super) fn look(&self, frame: Heard<'_>) -> Kind {
        let known = |node: NodeId| self.nodes.get(usize::from(node.raw())).copied().unwrap_or_default();
        let role = self.roles.get(usize::from(frame.id)).copied().unwrap_or(Role::Unknown);
        match (role, frame.remote) {
            (Role::ErrorControl(node), true) => Kind::GuardRequest { node, unanswered: known(node).asked },
            (Role::ErrorControl(node), false) => known(node).handle(node, frame.data),
            (Role::Sdo(node, channel, way), false) => {
                let watch = match channel {
                    0 => self.sdo.get(usize::from(node.raw())).and_then(Option::as_deref),
                    _ => self.further_sdo.get(&(node, channel)).map(Box::as_ref),
                };
                sdo_kind(match watch {
                    Some(watch) => watch.look(way, frame.data),
                    None => Watch::new(node).look(way, frame.data),
                })
            }
            _ => plain(role, frame),
        }
    }

    pub(super) fn finish(&mut self, events: &mut VecDeque<Transfer>) {
        for watch in self.sdo.iter_mut().flatten().chain(self.further_sdo.values_mut()) {
            watch.finish(events);
        }
    }

    fn nmt(&mut self, command: Command, target: u8) {
        for (node, known) in (0..).zip(&mut self.nodes) {
            if target != 0 && target != node {
                continue;
            }
            if known.state.is_some() {
                known.state = Some(command.leads_to());
            }
            if command.is_reset() {
                known.toggle = None;
            }
        }
    }

    fn guard_request(&mut self, node: NodeId) -> Kind {
        let unanswered = match self.nodes.get_mut(usize::from(node.raw())) {
            Some(state) => core::mem::replace(&mut state.asked, true),
            None => false,
        };
        Kind::GuardRequest { node, unanswered }
    }

    #[allow(clippy::too_many_arguments, reason = "what a frame on a channel is")]
    fn sdo(
        &mut self,
        now: Option<Duration>,
        bus: u16,
        node: NodeId,
        channel: u8,
        way: Way,
        data: &[u8],
        events: &mut VecDeque<Transfer>,
    ) -> Kind {
        let watch = if channel == 0 {
            let Some(slot) = self.sdo.get_mut(usize::from(node.raw())) else { return Kind::Unknown };
            slot.get_or_insert_with(|| Box::new(Watch::new(node)))
        } else {
            self.further_sdo.entry((node, channel)).or_insert_with(|| Box::new(Watch::new(node)))
        };
        let already = events.len();
        let frame: SdoFrame = watch.handle(now, bus, way, data, events);
        let learned = events
            .range(already..)
            .find(|transfer| transfer.is_done() && !transfer.late && is_communication(transfer.at));
        if let Some((at, value)) = learned.map(|transfer| (transfer.at, transfer.data.clone())) {
            self.learn(node, at, &value);
        }
        sdo_kind(frame)
    }

    /// Takes in the value of an object of a node.
    pub(super) fn learn(&mut self, node: NodeId, at: Address, value: &[u8]) {
        let cob = value.first_chunk().map(|value| CobId(u32::from_le_bytes(*value)));
        match (at.index, at.sub) {
            (0x1005, 0) => self.add(cob, Role::Sync),
            (0x1014, 0) => self.add(cob, Role::Emcy(node)),
            (0x1201..=0x127F, sub @ 1..=2) => {
                let channel = (at.index - 0x1200) as u8;
                let way = if sub == 1 { Way::Request } else { Way::Response };
                self.learn_channel(node, channel, sub, way, cob);
            }
            (0x1400..=0x15FF, 1) => self.learn_pdo(node, PdoDirection::Receive, at.index - 0x1400 + 1, cob),
            (0x1800..=0x19FF, 1) => self.learn_pdo(node, PdoDirection::Transmit, at.index - 0x1800 + 1, cob),
            (0x1600..=0x17FF, sub) => {
                self.pdo(node, PdoDirection::Receive, at.index - 0x1600 + 1).learn_mapping(sub, value);
            }
            (0x1A00..=0x1BFF, sub) => {
                self.pdo(node, PdoDirection::Transmit, at.index - 0x1A00 + 1).learn_mapping(sub, value);
            }
            _ => {}
        }
    }

    fn pdo(&mut self, node: NodeId, direction: PdoDirection, number: u16) -> &mut PdoState {
        self.pdos.entry((node, direction, number)).or_default()
    }

    fn set_role(&mut self, id: u16, role: Role) {
        if let Some(slot) = self.roles.get_mut(usize::from(id)) {
            *slot = role;
        }
    }

    /// A service has another identifier; the predefined one stays, for nodes that still use it.
    fn add(&mut self, cob: Option<CobId>, role: Role) {
        if let Some(id) = cob.filter(|cob| cob.is_valid()).and_then(CobId::standard_id)
            && self.roles.get(usize::from(id)) == Some(&Role::Unknown)
        {
            self.set_role(id, role);
        }
    }

    fn learn_channel(&mut self, node: NodeId, channel: u8, sub: u8, way: Way, cob: Option<CobId>) {
        if let Some(old) = self.channels.remove(&(node, channel, sub)) {
            self.set_role(old, Role::predefined(old));
        }
        if let Some(id) = cob.filter(|cob| cob.is_valid()).and_then(CobId::standard_id) {
            self.channels.insert((node, channel, sub), id);
            self.set_role(id, Role::Sdo(node, channel, way));
        }
    }

    /// A PDO has an identifier, or none any more. One that is switched off keeps what it was for
    /// until another takes it: a master switches PDOs off only to set them up.
    fn learn_pdo(&mut self, node: NodeId, direction: PdoDirection, number: u16, cob: Option<CobId>) {
        let Some(cob) = cob else { return };
        let id = cob.is_valid().then(|| cob.standard_id()).flatten();
        let pdo = self.pdo(node, direction, number);
        let Some(id) = id else { return };
        let old = pdo.id.replace(id);
        if let Some(old) = old.filter(|old| *old != id)
            && self.roles.get(usize::from(old)) == Some(&Role::Pdo(node, direction, number))
        {
            self.set_role(old, Role::predefined(old));
        }
        let taken = self.roles.get(usize::from(id)).copied().unwrap_or(Role::Unknown);
        // An RPDO that listens to another node's TPDO is that TPDO.
        let listens = direction == PdoDirection::Receive
            && matches!(taken, Role::Pdo(other, PdoDirection::Transmit, _) if other != node);
        if matches!(taken, Role::Unknown | Role::Pdo(..)) && !listens {
            self.set_role(id, Role::Pdo(node, direction, number));
        }
    }
}

/// Whether an object says how frames are to be understood.
const fn is_communication(at: Address) -> bool {
    matches!(at.index, 0x1005 | 0x1014 | 0x1201..=0x127F | 0x1400..=0x1BFF)
}
