//! What the slave serves: the dictionary and the PDOs, and of the PDO parameters only those that the node
//! describes.

use core::time::Duration;

use canopen_master::od;
use canopen_master::sdo::{AbortCode, Access, Piece, Total};
use canopen_master::slave;
use pdo::{Address, Frame, Handled, RpdoFault};

use super::Device;
use super::common::{MAPPED, PDOS};
use super::dictionary::Dictionary;

/// All objects of a node, as a client sees them.
#[derive(Debug)]
pub(super) struct Served<D>(pub(super) od::Objects<Dictionary<D>, PDOS, PDOS, MAPPED>);

impl<D: Device> Served<D> {
    /// The one that serves an object, if the node has it and lets it be written.
    fn server(&mut self, at: Address, writing: bool) -> Result<&mut dyn Access, AbortCode> {
        let od::Objects { dictionary, pdos } = &self.0;
        if matches!(at.index, 0x1400..0x1C00) && dictionary.device.describes_pdos() {
            if writing {
                dictionary.writable(at)?;
            } else {
                dictionary.objects.found(at)?;
            }
            // How many parameters there are, and what the engine does not have, is as described.
            let is_count = at.sub == 0 && at.index & 0x200 == 0;
            if is_count || pdos.parameter(at).is_err() {
                return Ok(&mut self.0.dictionary);
            }
        }
        Ok(&mut self.0)
    }
}

impl<D: Device> Access for Served<D> {
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        self.server(at, false)?.read(at, offset, out)
    }

    fn begin_write(&mut self, at: Address, size: Option<u32>) -> Result<(), AbortCode> {
        self.server(at, true)?.begin_write(at, size)
    }

    fn write(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        self.server(at, true)?.write(at, piece)
    }

    fn abandon(&mut self, at: Address) {
        self.0.abandon(at);
    }
}

impl<D: Device> slave::Objects for Served<D> {
    fn start(&mut self, now: Duration) {
        self.0.start(now);
    }

    fn stop(&mut self) {
        self.0.stop();
    }

    fn handle_frame(&mut self, now: Duration, frame: &Frame) -> Handled {
        self.0.handle_frame(now, frame)
    }

    fn handle_sync(&mut self, counter: Option<u8>) {
        self.0.handle_sync(counter);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.0.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        self.0.poll_transmit(now)
    }

    fn poll_event(&mut self) -> Option<(usize, Result<(), RpdoFault>)> {
        self.0.poll_event()
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.0.poll_timeout()
    }
}
