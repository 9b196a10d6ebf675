//! Network management (CiA 301, 7.2.8 and 7.3.2): commands, states, the slave's state machine.

use core::fmt;

use pdo::{Frame, NodeId, cob};

/// What the master tells a node (CiA 301, table 38).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Command {
    /// Enter operational.
    Start = 0x01,
    /// Enter stopped.
    Stop = 0x02,
    /// Enter pre-operational.
    EnterPreOperational = 0x80,
    /// Reset the application and the communication.
    ResetNode = 0x81,
    /// Reset the communication.
    ResetCommunication = 0x82,
}

impl Command {
    /// All commands.
    pub const ALL: [Self; 5] =
        [Self::Start, Self::Stop, Self::EnterPreOperational, Self::ResetNode, Self::ResetCommunication];

    /// The command of a command specifier.
    #[must_use]
    pub const fn from_raw(raw: u8) -> Option<Self> {
        Some(match raw {
            0x01 => Self::Start,
            0x02 => Self::Stop,
            0x80 => Self::EnterPreOperational,
            0x81 => Self::ResetNode,
            0x82 => Self::ResetCommunication,
            _ => return None,
        })
    }

    /// The state a node shows when it has carried the command out; both resets end with a boot-up
    /// message, after which the node is pre-operational.
    #[must_use]
    pub const fn leads_to(self) -> State {
        match self {
            Self::Start => State::Operational,
            Self::Stop => State::Stopped,
            Self::EnterPreOperational => State::PreOperational,
            Self::ResetNode | Self::ResetCommunication => State::BootUp,
        }
    }

    /// Whether the node starts anew, which it tells by a boot-up message.
    #[must_use]
    pub const fn is_reset(self) -> bool {
        matches!(self, Self::ResetNode | Self::ResetCommunication)
    }

    /// The command as a frame.
    #[must_use]
    pub const fn frame(self, target: Target) -> Frame {
        Frame::standard(cob::NMT, [self as u8, target.raw()])
    }

    /// The command and its target in a frame; `None` for any other frame, and for a command
    /// specifier, a node ID or a length that CiA 301 does not know.
    #[must_use]
    pub fn parse(frame: &Frame) -> Option<(Self, Target)> {
        if frame.standard_id() != Some(cob::NMT) || frame.is_remote() {
            return None;
        }
        let &[command, node] = frame.data() else { return None };
        let target = match node {
            0 => Target::All,
            node => Target::Node(NodeId::new(node).ok()?),
        };
        Some((Self::from_raw(command)?, target))
    }
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Start => "start",
            Self::Stop => "stop",
            Self::EnterPreOperational => "enter pre-operational",
            Self::ResetNode => "reset node",
            Self::ResetCommunication => "reset communication",
        })
    }
}

/// Whom a command is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Target {
    /// Every node (node ID 0 in the frame).
    All,
    /// One node.
    Node(NodeId),
}

impl Target {
    /// The byte in the frame.
    #[must_use]
    pub const fn raw(self) -> u8 {
        match self {
            Self::All => 0,
            Self::Node(node) => node.raw(),
        }
    }

    /// Whether a node is meant.
    #[must_use]
    pub fn includes(self, node: NodeId) -> bool {
        match self {
            Self::All => true,
            Self::Node(target) => target == node,
        }
    }
}

/// A node's state as it shows in heartbeats and guarding replies (CiA 301, 7.2.8.3.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum State {
    /// Just started; on its way to pre-operational.
    BootUp = 0x00,
    /// Only NMT and error control.
    Stopped = 0x04,
    /// Everything, PDOs too.
    Operational = 0x05,
    /// Everything but PDOs.
    PreOperational = 0x7F,
}

impl State {
    /// The state of bits 0…6; `None` for a value that CiA 301 reserves.
    #[must_use]
    pub const fn from_raw(raw: u8) -> Option<Self> {
        match raw & 0x7F {
            0x00 => Some(Self::BootUp),
            0x04 => Some(Self::Stopped),
            0x05 => Some(Self::Operational),
            0x7F => Some(Self::PreOperational),
            _ => None,
        }
    }

    /// Whether the node processes and sends PDOs (CiA 301, table 37).
    #[must_use]
    pub const fn has_pdo(self) -> bool {
        matches!(self, Self::Operational)
    }

    /// Whether the node processes SDO, SYNC and TIME and sends EMCY (CiA 301, table 37).
    #[must_use]
    pub const fn has_sdo(self) -> bool {
        matches!(self, Self::Operational | Self::PreOperational)
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::BootUp => "boot-up",
            Self::Stopped => "stopped",
            Self::Operational => "operational",
            Self::PreOperational => "pre-operational",
        })
    }
}

/// The frame that a node announces its start with.
#[must_use]
pub const fn boot_up(node: NodeId) -> Frame {
    Frame::standard(cob::ERROR_CONTROL + node.raw() as u16, [State::BootUp as u8])
}

/// What a command did to a slave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Change {
    /// The slave went from one state to another; a command for the state it is in changes nothing.
    State(State),
    /// The application and the communication start anew, by [`Slave::boot`].
    ResetNode,
    /// The communication starts anew, by [`Slave::boot`].
    ResetCommunication,
}

/// The slave's state machine.
///
/// After power-up and after a reset the node is initialising: it answers nothing, until
/// [`boot`](Self::boot) makes it pre-operational.
#[derive(Debug, Clone)]
pub struct Slave {
    node: NodeId,
    state: State,
}

impl Slave {
    /// An initialising slave.
    #[must_use]
    pub const fn new(node: NodeId) -> Self {
        Self { node, state: State::BootUp }
    }

    /// Its address.
    #[must_use]
    pub const fn node(&self) -> NodeId {
        self.node
    }

    /// Its state; [`State::BootUp`] while it initialises.
    #[must_use]
    pub const fn state(&self) -> State {
        self.state
    }

    /// Ends the initialisation: the slave is pre-operational when the boot-up frame that this
    /// returns has been sent.
    pub fn boot(&mut self) -> Frame {
        self.state = State::PreOperational;
        boot_up(self.node)
    }

    /// Takes a command; `None` if it changes nothing.
    pub fn handle(&mut self, command: Command, target: Target) -> Option<Change> {
        if self.state == State::BootUp || !target.includes(self.node) {
            return None;
        }
        match command {
            Command::ResetNode => {
                self.state = State::BootUp;
                Some(Change::ResetNode)
            }
            Command::ResetCommunication => {
                self.state = State::BootUp;
                Some(Change::ResetCommunication)
            }
            Command::Start | Command::Stop | Command::EnterPreOperational => {
                self.enter(command.leads_to()).then_some(Change::State(self.state))
            }
        }
    }

    /// Changes the state without a command: a node that starts itself (CiA 301, 1F80h), or leaves
    /// operational after an error (1029h). Returns whether it was in another state.
    pub fn enter(&mut self, state: State) -> bool {
        core::mem::replace(&mut self.state, state) != state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NODE: NodeId = NodeId::MIN;

    /// CiA 301, 7.2.8.3.1: the command specifiers.
    #[test]
    fn golden_commands() {
        for (command, raw) in Command::ALL.into_iter().zip([1, 2, 0x80, 0x81, 0x82]) {
            let frame = command.frame(Target::Node(NODE));
            assert_eq!((frame.standard_id(), frame.data()), (Some(0), &[raw, 1][..]));
            assert_eq!(Command::parse(&frame), Some((command, Target::Node(NODE))));
            assert_eq!(Command::parse(&command.frame(Target::All)), Some((command, Target::All)));
        }
        for wrong in [
            Frame::standard(0, [1]),
            Frame::standard(0, [3, 1]),
            Frame::standard(0, [1, 128]),
            Frame::standard(0, [1, 1, 0]),
            Frame::standard(1, [1, 1]),
        ] {
            assert_eq!(Command::parse(&wrong), None, "{wrong}");
        }
    }

    #[test]
    fn the_slave_follows_commands_for_it() {
        let mut slave = Slave::new(NODE);
        assert_eq!(slave.handle(Command::Start, Target::All), None, "still initialising");
        assert_eq!(slave.boot(), Frame::standard(0x701, [0]));
        assert_eq!(slave.state(), State::PreOperational);
        assert_eq!(slave.handle(Command::Start, Target::Node(NodeId::MAX)), None);
        assert_eq!(slave.handle(Command::Start, Target::All), Some(Change::State(State::Operational)));
        assert_eq!(slave.handle(Command::Start, Target::All), None, "already there");
        assert_eq!(slave.handle(Command::Stop, Target::Node(NODE)), Some(Change::State(State::Stopped)));
        assert!(!slave.state().has_sdo());
        assert_eq!(slave.handle(Command::ResetCommunication, Target::All), Some(Change::ResetCommunication));
        assert_eq!(slave.state(), State::BootUp);
        slave.boot();
        assert_eq!(slave.handle(Command::ResetNode, Target::All), Some(Change::ResetNode));
    }
}
