//! Both engines joined by a wire that takes no time, and objects of any size.

use core::time::Duration;
use std::collections::BTreeMap;

use canopen_master::Frame;
use canopen_master::sdo::{
    AbortCode, Access, Address, Channel, Client, Finished, NEXT_REQUEST, Piece, Server, Total, read_slice,
};

/// An object and how the server gets to see it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Object {
    pub data: Vec<u8>,
    /// The size is not told before the end.
    pub unsized_: bool,
}

/// Objects in memory; writing collects pieces and stores them with the last one.
#[derive(Debug, Default)]
pub(crate) struct Objects {
    pub map: BTreeMap<Address, Object>,
    pub writing: Vec<u8>,
    pub abandoned: usize,
    pub pieces: Vec<(u32, usize, bool)>,
}

impl Access for Objects {
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        let object = self.map.get(&at).ok_or(AbortCode::NO_OBJECT)?;
        let (len, total) = read_slice(&object.data, offset, out);
        Ok((len, total.filter(|_| !object.unsized_)))
    }

    fn begin_write(&mut self, at: Address, _: Option<u32>) -> Result<(), AbortCode> {
        self.writing.clear();
        self.map.contains_key(&at).then_some(()).ok_or(AbortCode::NO_OBJECT)
    }

    fn write(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        if piece.offset == 0 {
            self.writing.clear();
        }
        assert_eq!(piece.offset as usize, self.writing.len(), "pieces without gaps");
        self.pieces.push((piece.offset, piece.data.len(), piece.last));
        self.writing.extend(piece.data);
        if piece.last {
            let object = self.map.get_mut(&at).ok_or(AbortCode::NO_OBJECT)?;
            object.data = core::mem::take(&mut self.writing);
        }
        Ok(())
    }

    fn abandon(&mut self, _: Address) {
        self.abandoned += 1;
        self.writing.clear();
    }
}

pub(crate) const CHANNEL: Channel = Channel { request: 0x605, response: 0x585 };
pub(crate) const AT: Address = Address::new(0x2000, 0x01);

pub(crate) const fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// Client and server on one wire.
pub(crate) struct Pair {
    pub now: Duration,
    pub client: Client<Vec<u8>>,
    pub server: Server,
    pub objects: Objects,
    /// What went over the wire.
    pub log: Vec<Frame>,
}

impl Pair {
    pub(crate) fn new(data: &[u8]) -> Self {
        let mut objects = Objects::default();
        objects.map.insert(AT, Object { data: data.to_vec(), unsized_: false });
        Self {
            now: Duration::ZERO,
            client: Client::new(CHANNEL),
            server: Server::new(CHANNEL, NEXT_REQUEST),
            objects,
            log: Vec::new(),
        }
    }

    /// Runs until the transfer ends.
    pub(crate) fn run(&mut self) -> Finished<Vec<u8>> {
        for _ in 0..1_000_000 {
            if let Some(finished) = self.client.poll_event() {
                // The last word still goes out.
                while let Some(frame) = self.client.poll_transmit(self.now) {
                    self.log.push(frame);
                    self.server.handle_frame(self.now, &frame, &mut self.objects);
                }
                return finished;
            }
            let mut moved = false;
            while let Some(frame) = self.client.poll_transmit(self.now) {
                self.log.push(frame);
                assert!(self.server.handle_frame(self.now, &frame, &mut self.objects).is_taken());
                moved = true;
            }
            while let Some(frame) = self.server.poll_transmit(self.now, &mut self.objects) {
                self.log.push(frame);
                assert!(self.client.handle_frame(self.now, &frame).is_taken());
                moved = true;
            }
            if moved {
                continue;
            }
            let timeouts = [self.client.poll_timeout(), self.server.poll_timeout()];
            self.now = timeouts.into_iter().flatten().min().expect("no transfer hangs");
            self.client.handle_timeout(self.now);
            self.server.handle_timeout(self.now, &mut self.objects);
        }
        panic!("livelock");
    }
}
