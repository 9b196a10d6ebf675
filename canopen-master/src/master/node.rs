//! What the master keeps of each node.

use core::time::Duration;

use pdo::{LengthCheck, NodeId};

use crate::boot::{Booted, Failure, Process};
use crate::clock::earliest;
use crate::guarding::Guard;
use crate::heartbeat::Consumer;
use crate::nmt::State;
use crate::scan::{Head, Info};
use crate::sdo::{AbortCode, Buffer, Channel, Client, Ticket};

/// The data of one PDO as it came last, or was written last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Image {
    bytes: [u8; 8],
    len: u8,
}

impl Image {
    /// 0…8 bytes.
    #[must_use]
    #[inline]
    pub fn data(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or(&[])
    }

    #[inline]
    pub(super) fn set(&mut self, data: &[u8]) {
        if let Some(whole) = data.first_chunk::<8>() {
            self.bytes = *whole;
            self.len = 8;
            return;
        }
        for (to, from) in self.bytes.iter_mut().zip(data) {
            *to = *from;
        }
        self.len = data.len() as u8;
    }
}

/// The buffer of a node's transfer, whoever asked for it.
#[derive(Debug)]
pub(super) enum Data<'d, B> {
    /// Scan and boot.
    Head(Head),
    /// An entry of a DCF.
    Dcf(&'d [u8]),
    /// The application.
    User(B),
}

impl<B: Buffer> Buffer for Data<'_, B> {
    fn begin(&mut self, size: Option<u32>) -> Result<(), AbortCode> {
        match self {
            Self::Head(head) => head.begin(size),
            Self::Dcf(data) => data.begin(size),
            Self::User(buffer) => buffer.begin(size),
        }
    }

    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode> {
        match self {
            Self::Head(head) => head.write(offset, data),
            Self::Dcf(own) => own.write(offset, data),
            Self::User(buffer) => buffer.write(offset, data),
        }
    }

    fn size(&self) -> Option<u32> {
        match self {
            Self::Head(head) => head.size(),
            Self::Dcf(data) => Buffer::size(data),
            Self::User(buffer) => buffer.size(),
        }
    }

    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<usize, AbortCode> {
        match self {
            Self::Head(head) => head.read(offset, out),
            Self::Dcf(data) => data.read(offset, out),
            Self::User(buffer) => buffer.read(offset, out),
        }
    }
}

/// What the master itself does with a node.
#[derive(Debug)]
pub(super) enum Job<'d> {
    None,
    Scan(ScanStep),
    Boot(Process<'d>),
    /// The outcome waits to be polled.
    Booted(Result<Booted, Failure>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ScanStep {
    DeviceType,
    Name,
    /// Sub-index of 1018h, 1…4.
    Identity(u8),
    OpMode,
}

// What frames of a cycle touch lies together, on one or two lines of a cache.
#[derive(Debug)]
#[repr(C)]
pub(super) struct Node<'d, B> {
    pub(super) heartbeat: Option<Consumer>,
    pub(super) inputs: [Image; 4],
    /// `None`: any length.
    pub(super) lengths: [Option<LengthCheck>; 4],
    /// The heartbeat that would tell nothing but that the node is alive, or [`UNUSUAL`].
    pub(super) usual: u8,
    pub(super) state: Option<State>,
    pub(super) guard: Option<Guard>,
    pub(super) sdo: Client<Data<'d, B>>,
    pub(super) job: Job<'d>,
    /// Of the job's transfer.
    pub(super) ticket: Option<Ticket>,
    pub(super) info: Option<Info>,
    pub(super) outputs: [Image; 4],
}

/// No heartbeat: bit 7 belongs to guarding.
pub(super) const UNUSUAL: u8 = 0xFF;

impl<B: Buffer> Node<'_, B> {
    pub(super) const fn new(node: NodeId) -> Self {
        let empty = Image { bytes: [0; 8], len: 0 };
        Self {
            guard: None,
            heartbeat: None,
            state: None,
            usual: UNUSUAL,
            sdo: Client::new(Channel::default_of(node)),
            job: Job::None,
            ticket: None,
            info: None,
            inputs: [empty; 4],
            lengths: [None; 4],
            outputs: [empty; 4],
        }
    }

    /// The same heartbeat once more would tell nothing new, unless something changes until then: whoever
    /// can change something is given the node by `Master::node_mut`, which sets it to [`UNUSUAL`].
    pub(super) fn note_usual(&mut self, heartbeat: u8) {
        let watched = self.heartbeat.as_ref().is_some_and(Consumer::is_watching);
        if watched && self.guard.is_none() && matches!(self.job, Job::None) {
            self.usual = heartbeat;
        }
    }

    /// Whether a transfer, a boot or a scan can begin.
    pub(super) const fn is_free(&self) -> bool {
        matches!(self.job, Job::None) && self.sdo.is_idle()
    }

    /// The earliest of its deadlines, those of error control only while the bus is there.
    pub(super) fn poll_timeout(&self, bus: bool) -> Option<Duration> {
        let guard = self.guard.as_ref().filter(|_| bus).and_then(Guard::poll_timeout);
        let heartbeat = self.heartbeat.as_ref().filter(|_| bus).and_then(Consumer::poll_timeout);
        let boot = match &self.job {
            Job::Boot(process) => process.deadline(),
            _ => None,
        };
        earliest(&[guard, heartbeat, boot, self.sdo.poll_timeout()])
    }
}
