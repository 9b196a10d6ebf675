//! SDO engines and the object dictionary.

use core::time::Duration;

use canopen_master::Frame;
use canopen_master::data_type::DataType;
use canopen_master::od::{Communication, Dictionary, Entry, Limits, Objects, PdoSlot, Pdos, Rights, Table};
use canopen_master::sdo::message::{BlockSegment, Request, Response};
use canopen_master::sdo::{
    AbortCode, Access, Address, Block, Channel, Client, NEXT_REQUEST, Options, Outcome, Piece, Server, Total,
};
use pdo::{CobId, Mapping};

use super::Input;

const CHANNEL: Channel = Channel { request: 0x601, response: 0x581 };
/// Far apart enough that all of a few bits of input hit one.
const ADDRESSES: [Address; 4] =
    [Address::new(0x2000, 0), Address::new(0x2000, 1), Address::new(0x1400, 1), Address::new(0x1600, 0)];

pub(super) fn address(input: &mut Input<'_>) -> Address {
    let byte = input.u8();
    match ADDRESSES.get(usize::from(byte)) {
        Some(&at) => at,
        None => Address::new(input.u16(), byte),
    }
}

/// A frame that is mostly well-formed, on the identifier given.
fn frame(input: &mut Input<'_>, id: u16) -> Frame {
    let mut bytes = [0; 8];
    let len = if input.u8().is_multiple_of(8) { input.u8() % 9 } else { 8 };
    bytes[0] = input.u8();
    // Of those that name an object, few would hit one.
    let at = address(input);
    bytes[1..3].copy_from_slice(&at.index.to_le_bytes());
    bytes[3] = at.sub;
    for byte in &mut bytes[4..] {
        *byte = input.u8();
    }
    let id = embedded_can::StandardId::new(id).unwrap();
    Frame::data_frame(id, &bytes[..usize::from(len)]).unwrap()
}

/// Plays a server that answers anything. Every ticket has exactly one outcome, what is sent is an SDO
/// request, and with a silent server the client comes to rest.
pub fn sdo_client_ops(data: &[u8]) {
    let mut input = Input(data);
    let mut client: Client<Vec<u8>> = Client::new(CHANNEL);
    let (mut now, mut open) = (Duration::ZERO, None);
    let mut options = Options::new(Duration::from_millis(10));
    let sent = |client: &mut Client<Vec<u8>>, now| {
        for _ in 0..200 {
            let Some(frame) = client.poll_transmit(now) else { return };
            assert_eq!(frame.standard_id(), Some(CHANNEL.request));
            assert!(Request::parse(frame.data()).is_ok() || BlockSegment::parse(frame.data()).is_some());
        }
        panic!("more than a sub-block without an answer");
    };
    while !input.is_empty() {
        match input.u8() % 8 {
            0 => {
                let block = Block {
                    block_size: input.u8(),
                    crc: input.u8().is_multiple_of(2),
                    threshold: input.u8(),
                };
                options.block = (!input.u8().is_multiple_of(4)).then_some(block);
                let at = address(&mut input);
                open = client.upload(at, Vec::new(), &options).map_or(open, Some);
            }
            1 => {
                let len = input.u8();
                let data = input.bytes(len).repeat(usize::from(1 + input.u8() % 8));
                let at = address(&mut input);
                open = client.download(at, data, &options).map_or(open, Some);
            }
            2 => open.into_iter().for_each(|ticket| client.cancel(ticket)),
            3 => {
                now += Duration::from_millis(u64::from(input.u8() % 16));
                client.handle_timeout(now);
            }
            4 => sent(&mut client, now),
            _ => {
                let frame = frame(&mut input, CHANNEL.response);
                assert!(client.handle_frame(now, &frame).is_taken());
            }
        }
        ended(&mut client, &mut open);
    }
    for _ in 0..20 {
        sent(&mut client, now);
        ended(&mut client, &mut open);
        now = client.poll_timeout().unwrap_or(now).max(now);
        client.handle_timeout(now);
    }
    assert!(client.is_idle() && client.poll_timeout().is_none() && open.is_none());
}

fn ended(client: &mut Client<Vec<u8>>, open: &mut Option<canopen_master::sdo::Ticket>) {
    if let Some(finished) = client.poll_event() {
        assert_eq!(Some(finished.ticket), open.take());
        if let Outcome::Done(bytes) = finished.outcome {
            assert_eq!(finished.buffer.len(), bytes as usize);
        }
        assert!(client.poll_event().is_none() && client.is_idle());
    }
}

/// Objects that check what the server promises them.
struct Strict {
    size: u32,
    told: bool,
    writing: Option<(Address, u32)>,
}

impl Access for Strict {
    fn read(&mut self, _: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        assert!(offset <= self.size);
        let len = out.len().min((self.size - offset) as usize);
        out[..len].fill(offset as u8);
        Ok((len, self.told.then_some(self.size)))
    }
    fn begin_write(&mut self, at: Address, size: Option<u32>) -> Result<(), AbortCode> {
        assert_eq!(self.writing, None, "the last one was neither completed nor abandoned");
        if size.is_some_and(|size| size > 5000) {
            return Err(AbortCode::TOO_LONG);
        }
        self.writing = Some((at, 0));
        Ok(())
    }
    fn write(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        let (begun, offset) = self.writing.take().unwrap_or((at, 0));
        assert_eq!((begun, offset), (at, piece.offset), "pieces without gaps");
        let end = offset + piece.data.len() as u32;
        assert!(piece.size.is_none_or(|size| if piece.last { size == end } else { end <= size }));
        assert!(!piece.last || end > 8 || piece.is_whole(), "no scalar is torn");
        if !piece.last {
            self.writing = Some((at, end));
        }
        Ok(())
    }
    fn abandon(&mut self, at: Address) {
        assert_eq!(self.writing.take().map(|(begun, _)| begun), Some(at));
    }
}

/// Plays a client that sends anything. The objects see what they were promised, what is sent is an SDO
/// answer, and with a silent client the server comes to rest with nothing half written.
pub fn sdo_server_ops(data: &[u8]) {
    let mut input = Input(data);
    let mut server = Server::new(CHANNEL, NEXT_REQUEST).with_block_size(input.u8() % 16);
    let mut objects = Strict { size: 0, told: true, writing: None };
    let mut now = Duration::ZERO;
    while !input.is_empty() {
        match input.u8() % 8 {
            0 if server.is_idle() => {
                objects.size = u32::from(input.u16() % 2000);
                objects.told = !input.u8().is_multiple_of(4);
            }
            1 => {
                now += Duration::from_millis(u64::from(input.u8()) * 10);
                server.handle_timeout(now, &mut objects);
            }
            2 | 3 => answered(&mut server, now, &mut objects),
            _ => {
                let frame = frame(&mut input, CHANNEL.request);
                assert!(server.handle_frame(now, &frame, &mut objects).is_taken());
            }
        }
    }
    for _ in 0..20 {
        answered(&mut server, now, &mut objects);
        now = server.poll_timeout().unwrap_or(now).max(now);
        server.handle_timeout(now, &mut objects);
    }
    assert!(server.is_idle() && server.poll_timeout().is_none());
    assert_eq!(objects.writing, None);
}

fn answered(server: &mut Server, now: Duration, objects: &mut impl Access) {
    for _ in 0..200 {
        let Some(frame) = server.poll_transmit(now, objects) else { return };
        assert_eq!(frame.standard_id(), Some(CHANNEL.response));
        assert!(Response::parse(frame.data()).is_ok() || BlockSegment::parse(frame.data()).is_some());
    }
    panic!("more than a sub-block without an answer");
}

const LIMITS: Limits = Limits { low: -5, high: 100 };

pub(super) const TABLE: Table<'static, 7> = match Table::new([
    Entry::constant(0x1000, 0, DataType::UNSIGNED32, 0x0003_0191),
    Entry::store(1),
    Entry::variable(0x2000, 0, DataType::INTEGER16, 0).with_limits(&LIMITS).stored().mappable(),
    Entry::string(0x2000, 1, DataType::VISIBLE_STRING, 20, b"abc"),
    Entry::variable(0x6000, 1, DataType::UNSIGNED24, 0).with_rights(Rights::Ro).mappable(),
    Entry::variable(0x6200, 1, DataType::BOOLEAN, 0).with_rights(Rights::Rww).mappable(),
    Entry::variable(0x6200, 2, DataType::UNSIGNED64, 0).mappable(),
]) {
    Ok(table) => table,
    Err(_) => panic!("entries out of order"),
};

/// Plays SDO writes, reads and PDOs. Limits always hold, what was written is read, and PDOs have the
/// length of their mapping.
pub fn od_ops(data: &[u8]) {
    let mut input = Input(data);
    let mut memory = [0; TABLE.memory()];
    let dictionary = Dictionary::new(TABLE.view(), &mut memory, ()).unwrap();
    let slot = |id| PdoSlot::new(Communication::event_driven(CobId(id)), Mapping::EMPTY);
    let mut objects: Objects<Dictionary<'_, ()>, 1, 1, 4> =
        Objects { dictionary, pdos: Pdos::new([slot(0x8000_0201)], [slot(0xC000_0181)]) };
    let indices = [0x1000, 0x1010, 0x2000, 0x6000, 0x6200, 0x1400, 0x1600, 0x1800, 0x1A00];
    let mut now = Duration::ZERO;
    while !input.is_empty() {
        let at = match indices.get(usize::from(input.u8())) {
            Some(&index) => Address::new(index, input.u8() % 8),
            None => Address::new(input.u16(), input.u8()),
        };
        let operation = input.u8();
        let len = input.u8() % 24;
        let data = input.bytes(len);
        match operation % 6 {
            0 | 1 => {
                let size = (operation & 8 == 0).then_some(data.len() as u32);
                let piece = Piece { offset: 0, data, last: true, size };
                let mut read = [0; 24];
                let written = objects.write(at, &piece).is_ok();
                let signature = at.index == 0x1010;
                if let (true, Some(_), false, Ok((len, _))) =
                    (written, size, signature, objects.read(at, 0, &mut read))
                {
                    let boolean = at == Address::new(0x6200, 1);
                    assert!(boolean || read[..len] == data[..], "{at}");
                }
            }
            2 => {
                let mut read = [0; 24];
                if let Ok((len, total)) = objects.read(at, u32::from(operation / 6), &mut read) {
                    assert!(len <= read.len() && total.is_none_or(|total| len <= total as usize));
                }
            }
            3 => objects.pdos.start(),
            4 => {
                let id = objects.pdos.rpdo_slots()[0].communication.cob_id.standard_id().unwrap();
                let id = embedded_can::StandardId::new(id).unwrap();
                let frame = Frame::data_frame(id, data.get(..8).unwrap_or(data)).unwrap();
                objects.pdos.handle_frame(now, &frame);
                while objects.pdos.poll_event(&mut objects.dictionary).is_some() {}
            }
            _ => {
                now += Duration::from_millis(u64::from(operation));
                objects.pdos.handle_timeout(now);
                objects.pdos.trigger(0);
                objects.pdos.handle_sync(None, &objects.dictionary);
                let bytes = objects.pdos.tpdo_slots()[0].mapping.bytes();
                if let Some(frame) = objects.pdos.poll_transmit(now, &objects.dictionary) {
                    assert_eq!(frame.data().len(), usize::from(bytes));
                }
            }
        }
        let value = objects.dictionary.get::<i16>(Address::new(0x2000, 0)).unwrap();
        assert!((-5..=100).contains(&value));
    }
}
