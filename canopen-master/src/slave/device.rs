//! A slave's objects made of a [`Dictionary`](od::Dictionary) and [`Pdos`](od::Pdos).

use core::time::Duration;

use pdo::{Frame, Handled, RpdoFault};

use super::Objects;
use crate::od::{self, Hooks};

/// A dictionary with `R` RPDOs and `T` TPDOs of up to `M` mapped objects each.
pub type Device<'a, H, const R: usize, const T: usize, const M: usize> = od::Objects<'a, H, R, T, M>;

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

    fn poll_event(&mut self) -> Option<(usize, Result<(), RpdoFault>)> {
        self.pdos.poll_event(&mut self.dictionary)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.pdos.poll_timeout()
    }
}
