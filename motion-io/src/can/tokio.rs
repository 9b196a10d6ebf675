//! Engines on a CAN interface of the Linux kernel, in a task of tokio.

use core::time::Duration;
use std::io;
use std::os::fd::OwnedFd;

use ::tokio::io::Interest;
use ::tokio::io::unix::AsyncFd;
use ::tokio::time::timeout;

use super::drive::{Driver, Engine};
use super::{CanPort, Event, socketcan};
use crate::endpoint::CanEndpoint;
use crate::port::OpenError;

/// An interface that is taken down shows as an error, not as something to read.
const INTEREST: Interest = Interest::READABLE.add(Interest::ERROR);

/// As [`Driver`], for one task of many: waiting for frames and for the engine's next time-out leaves the
/// thread to others.
#[derive(Debug)]
pub struct AsyncDriver {
    driver: Driver,
    ready: AsyncFd<OwnedFd>,
}

impl AsyncDriver {
    /// Opens an interface such as `can0`, within a runtime that drives I/O and time.
    ///
    /// # Errors
    /// There is no such interface, or it cannot be opened.
    ///
    /// # Panics
    /// Outside of a runtime of tokio that drives I/O.
    pub fn open(interface: &str) -> Result<Self, OpenError> {
        let endpoint = CanEndpoint::SocketCan { interface: interface.to_owned() };
        let (port, handle) = socketcan::open_with_handle(&endpoint, interface)?;
        Self::new(port, handle).map_err(|error| OpenError::new(&endpoint, error))
    }

    /// On a port whose `receive` does not wait when its timeout is zero; `handle` tells when to ask it.
    fn new(port: Box<dyn CanPort>, handle: OwnedFd) -> io::Result<Self> {
        // What tokio puts on its caller in the function's successor holds of an owned descriptor: it stays
        // open, and the same, as long as it is owned.
        #[allow(deprecated, reason = "the successor is an unsafe function")]
        let ready = AsyncFd::with_interest(handle, INTEREST)?;
        Ok(Self { driver: Driver::new(port), ready })
    }

    /// The engine's time.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.driver.now()
    }

    /// As [`Driver::turn`]: sends what the engine has to send, then waits for frames until the engine's next
    /// time-out, at most until `limit` on the engine's clock. A turn that is dropped while it waits has lost
    /// nothing.
    ///
    /// # Errors
    /// The interface failed or is gone.
    pub async fn turn<E: Engine>(
        &mut self,
        engine: &mut E,
        limit: Duration,
        mut observe: impl FnMut(Duration, Event, bool),
    ) -> io::Result<()> {
        let mut ready = None;
        if !self.driver.send(engine, &mut observe)? {
            let wait = self.driver.wait(engine, limit);
            ready = timeout(wait, self.ready.ready(INTEREST)).await.ok().transpose()?;
        }
        // The kernel tells again of what comes after everything has been fetched.
        if self.driver.receive(engine, Duration::ZERO, &mut observe)?
            && let Some(ready) = &mut ready
        {
            ready.clear_ready();
        }
        self.driver.handle_timeout(engine);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixDatagram;

    use ::tokio::time::{Instant, advance, sleep};
    use pdo::Frame;

    use super::*;
    use crate::can::BusEvent;

    /// One end of a socket pair, a datagram a frame; reckons with the runtime's time, which is paused.
    struct Pair {
        socket: UnixDatagram,
        start: Instant,
        /// So many frames are not taken.
        full: usize,
    }

    impl CanPort for Pair {
        fn send(&mut self, frame: &Frame) -> io::Result<()> {
            if self.full > 0 {
                self.full -= 1;
                return Err(io::ErrorKind::WouldBlock.into());
            }
            self.socket.send(frame.data()).map(|_| ())
        }

        fn receive(&mut self, timeout: Duration) -> io::Result<Option<Event>> {
            assert_eq!(timeout, Duration::ZERO, "a task does not hold the thread up");
            let mut data = [0; 8];
            match self.socket.recv(&mut data) {
                Ok(0) => Ok(Some(Event::Bus(BusEvent::Overrun))),
                Ok(_) => Ok(Some(Event::Frame(Frame::standard(0x181, data)))),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(None),
                Err(error) => Err(error),
            }
        }

        fn now(&self) -> Duration {
            self.start.elapsed()
        }
    }

    /// Answers each frame with one of its own; sends one each time that it waits for comes.
    #[derive(Default)]
    struct Echo {
        seen: Vec<(Duration, u8)>,
        bus: usize,
        queue: Vec<u8>,
        ticks: Vec<Duration>,
        period: Option<Duration>,
    }

    impl Engine for Echo {
        fn handle_frame(&mut self, now: Duration, frame: &Frame) {
            self.seen.push((now, frame.data()[0]));
            self.queue.push(frame.data()[0] | 0x80);
        }

        fn handle_timeout(&mut self, now: Duration) {
            self.ticks.push(now);
            self.queue.push(self.ticks.len() as u8);
        }

        fn poll_transmit(&mut self, _now: Duration) -> Option<Frame> {
            (!self.queue.is_empty()).then(|| Frame::standard(0x201, [self.queue.remove(0)]))
        }

        fn poll_timeout(&self) -> Option<Duration> {
            let last = self.ticks.last().copied().unwrap_or_default();
            self.period.map(|period| last + period)
        }

        fn handle_bus(&mut self, _now: Duration, _event: BusEvent) {
            self.bus += 1;
        }
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn pair(full: usize) -> (AsyncDriver, UnixDatagram) {
        let (ours, theirs) = UnixDatagram::pair().unwrap();
        ours.set_nonblocking(true).unwrap();
        theirs.set_nonblocking(true).unwrap();
        let handle = OwnedFd::from(ours.try_clone().unwrap());
        let port = Pair { socket: ours, start: Instant::now(), full };
        (AsyncDriver::new(Box::new(port), handle).unwrap(), theirs)
    }

    fn sent(peer: &UnixDatagram) -> Vec<u8> {
        let mut data = [0; 8];
        core::iter::from_fn(|| peer.recv(&mut data).ok().map(|_| data[0])).collect()
    }

    #[::tokio::test(start_paused = true)]
    async fn what_comes_is_taken_at_once_and_answered_in_the_next_turn() {
        let (mut driver, peer) = pair(0);
        let mut echo = Echo::default();
        peer.send(&[1; 8]).unwrap();
        peer.send(&[2; 8]).unwrap();
        peer.send(&[]).unwrap();
        let mut observed = Vec::new();
        driver.turn(&mut echo, ms(1000), |at, event, sent| observed.push((at, event, sent))).await.unwrap();
        assert_eq!(echo.seen, [(ms(0), 1), (ms(0), 2)]);
        assert_eq!((echo.bus, observed.len()), (1, 3));
        assert!(observed.iter().all(|(_, _, sent)| !sent));
        assert_eq!(sent(&peer), []);
        observed.clear();
        driver.turn(&mut echo, ms(1000), |at, event, sent| observed.push((at, event, sent))).await.unwrap();
        // Having sent, it does not wait.
        assert_eq!(driver.now(), ms(0));
        assert_eq!(sent(&peer), [0x81, 0x82]);
        assert!(observed.len() == 2 && observed.iter().all(|(_, _, sent)| *sent));
    }

    #[::tokio::test(start_paused = true)]
    async fn time_outs_come_when_they_are_due_and_what_they_send_goes_out_in_the_next_turn() {
        let (mut driver, peer) = pair(0);
        let mut echo = Echo { period: Some(ms(30)), ..Echo::default() };
        while driver.now() < ms(100) {
            driver.turn(&mut echo, ms(100), |_, _, _| ()).await.unwrap();
        }
        assert_eq!(echo.ticks, [ms(30), ms(60), ms(90)]);
        assert_eq!(sent(&peer), [1, 2, 3]);
        // Overdue at its start: told, not slept over.
        advance(ms(50)).await;
        let now = driver.now();
        driver.turn(&mut echo, ms(1000), |_, _, _| ()).await.unwrap();
        assert_eq!(echo.ticks.last(), Some(&now));
    }

    #[::tokio::test(start_paused = true)]
    async fn a_turn_without_anything_ends_at_its_limit() {
        let (mut driver, _peer) = pair(0);
        driver.turn(&mut Echo::default(), ms(250), |_, _, _| ()).await.unwrap();
        assert_eq!(driver.now(), ms(250));
    }

    #[::tokio::test(start_paused = true)]
    async fn a_frame_without_room_waits_in_its_order() {
        let (mut driver, peer) = pair(3);
        let mut echo = Echo { queue: vec![1, 2], ..Echo::default() };
        let mut turns = 0;
        while !echo.queue.is_empty() {
            driver.turn(&mut echo, ms(1000), |_, _, _| ()).await.unwrap();
            turns += 1;
        }
        assert_eq!((turns, sent(&peer)), (4, vec![1, 2]));
        assert!(driver.now() < ms(20), "{:?}", driver.now());
    }

    #[::tokio::test(start_paused = true)]
    async fn a_dropped_turn_has_lost_nothing() {
        let (mut driver, peer) = pair(0);
        let mut echo = Echo::default();
        ::tokio::select! {
            _ = driver.turn(&mut echo, ms(1000), |_, _, _| ()) => panic!("nothing was to be done"),
            () = sleep(ms(10)) => {}
        }
        peer.send(&[7; 8]).unwrap();
        driver.turn(&mut echo, ms(1000), |_, _, _| ()).await.unwrap();
        assert_eq!(echo.seen.iter().map(|(_, first)| *first).collect::<Vec<_>>(), [7]);
    }

    #[::tokio::test(start_paused = true)]
    async fn more_than_one_batch_is_taken_without_waiting_between() {
        let (mut driver, peer) = pair(0);
        let mut echo = Echo::default();
        let (mut put, mut turns) = (0, 0);
        while echo.seen.len() < 200 {
            while put < 200 && peer.send(&[put; 8]).is_ok() {
                put += 1;
            }
            driver.turn(&mut echo, ms(1000), |_, _, _| ()).await.unwrap();
            let _ = sent(&peer);
            turns += 1;
            assert!(turns < 1000, "{} seen", echo.seen.len());
        }
        assert!(echo.seen.iter().map(|(_, first)| *first).eq(0..200));
        assert_eq!(driver.now(), ms(0));
    }

    #[::tokio::test(start_paused = true)]
    async fn other_tasks_run_while_it_waits() {
        let (mut driver, peer) = pair(0);
        let mut echo = Echo::default();
        let other = async {
            sleep(ms(40)).await;
            peer.send(&[9; 8]).unwrap();
        };
        let (turned, ()) = ::tokio::join!(driver.turn(&mut echo, ms(1000), |_, _, _| ()), other);
        turned.unwrap();
        assert_eq!(echo.seen, [(ms(40), 9)]);
    }
}
