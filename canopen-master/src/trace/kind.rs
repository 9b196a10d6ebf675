//! What one frame is.

use core::time::Duration;

use pdo::NodeId;

use super::mapping::PdoDirection;
use super::sdo::SdoFrame;
use crate::emcy::ErrorCode;
use crate::lss;
use crate::nmt::{Command, State};
use crate::time::TimeOfDay;

/// What a frame is, as far as what came before tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// NMT command of the master.
    Nmt {
        /// `None` for a command specifier that CiA 301 does not know.
        command: Option<Command>,
        /// 0 = all nodes.
        target: u8,
    },
    /// SYNC.
    Sync {
        /// 1…240, of a SYNC with counter.
        counter: Option<u8>,
        /// Since the SYNC before it.
        interval: Option<Duration>,
    },
    /// TIME; `None` where there are fewer than the 6 bytes.
    Time(Option<TimeOfDay>),
    /// EMCY; what a short frame leaves out is `None`.
    Emcy {
        /// From whom.
        node: NodeId,
        /// Error code.
        code: Option<ErrorCode>,
        /// Error register, object 1001h.
        register: Option<u8>,
    },
    /// A PDO, or the remote frame that asks for one.
    Pdo {
        /// Whose.
        node: NodeId,
        /// From the device's view.
        direction: PdoDirection,
        /// 1…512.
        number: u16,
    },
    /// To an SDO server.
    SdoRequest(SdoFrame),
    /// From an SDO server.
    SdoResponse(SdoFrame),
    /// Either side ends a transfer.
    SdoAbort(SdoFrame),
    /// The master asks for a node's state by a remote frame.
    GuardRequest {
        /// Whom.
        node: NodeId,
        /// The request before it has not been answered.
        unanswered: bool,
    },
    /// The answer to one.
    GuardReply {
        /// From whom.
        node: NodeId,
        /// Alternates, 0 in the first reply.
        toggle: bool,
        /// It did not alternate.
        wrong_toggle: bool,
        /// `None` for a number that is no state.
        state: Option<State>,
        /// State that it showed before.
        before: Option<State>,
    },
    /// Heartbeat.
    Heartbeat {
        /// From whom.
        node: NodeId,
        /// `None` for a number that is no state.
        state: Option<State>,
        /// State that it showed before.
        before: Option<State>,
    },
    /// A node has started.
    BootUp {
        /// Which.
        node: NodeId,
        /// State that it showed before.
        before: Option<State>,
    },
    /// Layer setting services.
    Lss(Lss),
    /// A channel of the CAN Link user protocol.
    CanLink {
        /// 1…14.
        channel: u8,
    },
    /// None of these.
    Unknown,
}

/// A message of the layer setting services; `None` for a command specifier that CiA 305 does not know.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lss {
    /// From the master.
    Request(Option<lss::Request>),
    /// From a slave.
    Response(Option<lss::Response>),
}
