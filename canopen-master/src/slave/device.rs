//! The objects of a slave made of a [`Dictionary`] and [`Pdos`].

use core::time::Duration;

use pdo::{Address, Frame, Handled, RpdoEvent};

use super::Objects;
use crate::od::{self, Dictionary, Hooks, Pdos};
use crate::sdo::{AbortCode, Access, Piece, Total};

/// A dictionary with `R` RPDOs and `T` TPDOs of up to `M` mapped objects each.
#[derive(Debug)]
pub struct Device<'a, H, const R: usize, const T: usize, const M: usize> {
    /// Everything but 1400h…1BFFh.
    pub dictionary: Dictionary<'a, H>,
    /// 1400h…1BFFh.
    pub pdos: Pdos<R, T, M>,
}

impl<'a, H: Hooks, const R: usize, const T: usize, const M: usize> Device<'a, H, R, T, M> {
    fn objects(&mut self) -> od::Objects<'_, 'a, H, R, T, M> {
        od::Objects { dictionary: &mut self.dictionary, pdos: &mut self.pdos }
    }
}

impl<H: Hooks, const R: usize, const T: usize, const M: usize> Access for Device<'_, H, R, T, M> {
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        self.objects().read(at, offset, out)
    }

    fn begin_write(&mut self, at: Address, size: Option<u32>) -> Result<(), AbortCode> {
        self.objects().begin_write(at, size)
    }

    fn write(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        self.objects().write(at, piece)
    }

    fn abandon(&mut self, at: Address) {
        self.objects().abandon(at);
    }
}

impl<H: Hooks, const R: usize, const T: usize, const M: usize> Objects for Device<'_, H, R, T, M> {
    fn start(&mut self, _now: Duration) {
        self.pdos.start();
    }

    fn stop(&mut self) {
        self.pdos.stop();
    }

    fn handle_frame(&mut self, now: Duration, frame: &Frame) -> Handled {
        self.pdos.handle_frame(now, frame)
    }

    fn handle_sync(&mut self, counter: Option<u8>) {
        self.pdos.handle_sync(counter, &self.dictionary);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.pdos.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        self.pdos.poll_transmit(now, &self.dictionary)
    }

    fn poll_event(&mut self) -> Option<(usize, RpdoEvent)> {
        self.pdos.poll_event(&mut self.dictionary)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.pdos.poll_timeout()
    }
}
