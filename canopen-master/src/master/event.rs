//! What the master tells, and what it does not take.

use pdo::{DefaultPdo, NodeId, RpdoFault};

use super::NmtTicket;
use crate::boot::{Booted, Failure};
use crate::bus::BusStatus;
use crate::emcy::Emergency;
use crate::nmt::{Command, State};
use crate::node_set::NodeSet;
use crate::{guarding, heartbeat, lss, sdo};

/// What [`Master::poll_event`](super::Master::poll_event) tells.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Event<B> {
    /// A node has started.
    BootUp(NodeId),
    /// A node shows another state than before.
    State {
        /// Which.
        node: NodeId,
        /// Its state.
        state: State,
    },
    /// Node guarding.
    Guarding {
        /// Which.
        node: NodeId,
        /// What happened.
        event: guarding::Event,
    },
    /// Heartbeat.
    Heartbeat {
        /// Which.
        node: NodeId,
        /// What happened.
        event: heartbeat::Event,
    },
    /// An emergency message; it is in the history too.
    Emergency {
        /// Who sent it.
        node: NodeId,
        /// What it says.
        emergency: Emergency,
    },
    /// A TPDO of another length than [`Master::expect_pdo`](super::Master::expect_pdo) was told.
    Pdo {
        /// Who sent it.
        node: NodeId,
        /// Which.
        number: DefaultPdo,
        /// What is wrong, and whether it was taken all the same.
        fault: RpdoFault,
    },
    /// The one outcome of an NMT command.
    Nmt {
        /// Of [`Master::nmt`](super::Master::nmt).
        ticket: NmtTicket,
        /// The command.
        command: Command,
        /// Nodes that showed the state it leads to.
        confirmed: NodeSet,
        /// Nodes that did not in time, or got another command meanwhile.
        missing: NodeSet,
    },
    /// The one outcome of an SDO transfer.
    Sdo {
        /// With which node.
        node: NodeId,
        /// How it ended, and the buffer.
        finished: sdo::Finished<B>,
    },
    /// The one outcome of a boot.
    Booted {
        /// Which.
        node: NodeId,
        /// How it went.
        result: Result<Booted, Failure>,
    },
    /// A scan is over; [`Master::info`](super::Master::info) has what was read.
    Scanned {
        /// Nodes that answered.
        found: NodeSet,
        /// Nodes that did not.
        silent: NodeSet,
    },
    /// The one outcome of an LSS operation.
    Lss {
        /// Of [`Master::lss`](super::Master::lss).
        ticket: lss::Ticket,
        /// How it ended.
        outcome: lss::Outcome,
    },
    /// The adapter's state has changed.
    Bus(BusStatus),
    /// The adapter does not take frames for now; told once until it takes one again.
    TransmitFull,
    /// Frames that waited, or were on their way, when the bus went away; they are not sent.
    Discarded(u32),
    /// Events that found no place, because nobody polled.
    Overflow(u32),
}

/// What can wait in the queue of events; outcomes wait where they arise.
#[derive(Debug, Clone, Copy)]
pub(super) enum Notice {
    BootUp(NodeId),
    State(NodeId, State),
    Guarding(NodeId, guarding::Event),
    Heartbeat(NodeId, heartbeat::Event),
    Emergency(NodeId, Emergency),
    Pdo(NodeId, DefaultPdo, RpdoFault),
    Bus(BusStatus),
    TransmitFull,
    Discarded(u32),
}

impl<B> From<Notice> for Event<B> {
    fn from(notice: Notice) -> Self {
        match notice {
            Notice::BootUp(node) => Self::BootUp(node),
            Notice::State(node, state) => Self::State { node, state },
            Notice::Guarding(node, event) => Self::Guarding { node, event },
            Notice::Heartbeat(node, event) => Self::Heartbeat { node, event },
            Notice::Emergency(node, emergency) => Self::Emergency { node, emergency },
            Notice::Pdo(node, number, fault) => Self::Pdo { node, number, fault },
            Notice::Bus(status) => Self::Bus(status),
            Notice::TransmitFull => Self::TransmitFull,
            Notice::Discarded(frames) => Self::Discarded(frames),
        }
    }
}

/// Why a command was not taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SubmitError {
    /// The master was made for fewer nodes.
    #[error("node {node}, this master has nodes 1 to {last}")]
    Node {
        /// The node asked for.
        node: NodeId,
        /// Its last node.
        last: u8,
    },
    /// A transfer, a boot or a scan with this node is under way, or its outcome has not been polled.
    #[error("a transfer, boot or scan with node {0} is under way, or its outcome was not polled")]
    Busy(NodeId),
    /// A scan is under way.
    #[error("a scan is under way")]
    Scanning,
    /// So many NMT commands wait for their confirmation.
    #[error("{0} NMT commands wait for their confirmation")]
    Unconfirmed(usize),
    /// So many frames wait to be sent.
    #[error("the transmit queue is full, {0} frames wait")]
    QueueFull(usize),
    /// The adapter is bus-off or gone: nothing would be sent.
    #[error("the bus is not available: {0:?}")]
    OffBus(BusStatus),
    /// The frame has more than 8 bytes.
    #[error("{0} bytes, a PDO has up to 8")]
    Length(usize),
    /// The transfer's buffer.
    #[error(transparent)]
    Sdo(#[from] sdo::SubmitError),
    /// LSS.
    #[error(transparent)]
    Lss(#[from] lss::SubmitError),
}

/// An SDO transfer that was not begun, with its buffer.
#[derive(Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{error}")]
pub struct Refused<B> {
    /// Why.
    pub error: SubmitError,
    /// As it was given.
    pub buffer: B,
}

impl<B> core::fmt::Debug for Refused<B> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Refused({:?})", self.error)
    }
}
