//! The object dictionary as a client sees it.

use canopen_master::data_type::DataType;
use canopen_master::od::{
    Communication, Dictionary, Entry, Hooks, Limits, Objects, PdoSlot, Pdos, RamError, Rights, Stored, Table,
    TableError,
};
use canopen_master::sdo::{
    AbortCode, Access, Channel, Client, NEXT_REQUEST, Options, Outcome, Piece, Server, Small, Total,
};
use canopen_master::{Address, Frame};
use core::time::Duration;
use pdo::mapping::Entry as Mapped;
use pdo::{CobId, Mapping, RpdoFault};

const PERCENT: Limits = Limits { low: -100, high: 100 };

const TABLE: Table<'static, 15> = match Table::new([
    Entry::constant(0x1000, 0, DataType::UNSIGNED32, 0x0003_0191),
    Entry::text(0x1008, 0, "I/O node with a long name"),
    Entry::constant(0x1010, 0, DataType::UNSIGNED8, 1),
    Entry::store(1),
    Entry::constant(0x1011, 0, DataType::UNSIGNED8, 1),
    Entry::restore(1),
    Entry::variable(0x2000, 0, DataType::INTEGER16, -7i64 as u64).with_limits(&PERCENT).stored(),
    Entry::string(0x2001, 0, DataType::VISIBLE_STRING, 12, b"abc").stored(),
    Entry::variable(0x2002, 0, DataType::UNSIGNED64, u64::MAX),
    Entry::variable(0x2003, 0, DataType::UNSIGNED16, 0).with_rights(Rights::Wo),
    Entry::application(0x2004, 0, DataType::DOMAIN, Rights::Rw),
    Entry::variable(0x6000, 1, DataType::UNSIGNED8, 0x5A).with_rights(Rights::Ro).mappable(),
    Entry::variable(0x6200, 1, DataType::UNSIGNED8, 0).with_rights(Rights::Rww).mappable(),
    Entry::variable(0x6200, 2, DataType::BOOLEAN, 0).with_rights(Rights::Rww).mappable(),
    Entry::variable(0x6411, 1, DataType::INTEGER16, 0).mappable(),
]) {
    Ok(table) => table,
    Err(_) => panic!("entries out of order"),
};

#[derive(Debug, Default)]
struct App {
    written: Vec<Address>,
    stored: Vec<(Address, Vec<u8>)>,
    restored: bool,
    domain: Vec<u8>,
}

impl Hooks for App {
    fn read(&mut self, _: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        Ok(canopen_master::sdo::read_slice(&self.domain, offset, out))
    }
    fn write(&mut self, _: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        self.domain.truncate(piece.offset as usize);
        self.domain.extend(piece.data);
        Ok(())
    }
    fn check(&mut self, at: Address, value: &[u8]) -> Result<(), AbortCode> {
        let vetoed = at == Address::new(0x2000, 0) && value == 13i16.to_le_bytes();
        if vetoed { Err(AbortCode::LOCAL_CONTROL) } else { Ok(()) }
    }
    fn written(&mut self, at: Address) {
        self.written.push(at);
    }
    fn store(&mut self, group: u8, values: Stored<'_>) -> Result<(), AbortCode> {
        assert_eq!(group, 1);
        self.stored = values.map(|(at, value)| (at, value.to_vec())).collect();
        Ok(())
    }
    fn restore(&mut self, _: u8) -> Result<(), AbortCode> {
        self.restored = true;
        Ok(())
    }
}

/// One RPDO and one TPDO with up to 4 objects.
struct Device<'a> {
    objects: Objects<Dictionary<'a, App>, 1, 1, 4>,
    server: Server,
    client: Client<Vec<u8>>,
}

const CHANNEL: Channel = Channel { request: 0x601, response: 0x581 };

impl<'a> Device<'a> {
    fn new(memory: &'a mut [u8]) -> Self {
        let rpdo = Communication::event_driven(CobId(0x201));
        let tpdo = Communication::event_driven(CobId(0x4000_0181));
        let outputs =
            Mapping::new(&[Mapped::new(0x6200, 1, 8), Mapped::new(0x0001, 0, 1), Mapped::new(0x6200, 2, 1)]);
        let inputs = Mapping::new(&[Mapped::new(0x6000, 1, 8)]);
        Self {
            objects: Objects {
                dictionary: Dictionary::new(TABLE.view(), memory, App::default()).unwrap(),
                pdos: Pdos::new(
                    [PdoSlot::new(rpdo, outputs.unwrap())],
                    [PdoSlot::new(tpdo, inputs.unwrap())],
                ),
            },
            server: Server::new(CHANNEL, NEXT_REQUEST),
            client: Client::new(CHANNEL),
        }
    }

    fn run(&mut self) -> (Outcome, Vec<u8>) {
        loop {
            if let Some(finished) = self.client.poll_event() {
                return (finished.outcome, finished.buffer);
            }
            let request = self.client.poll_transmit(Duration::ZERO).unwrap();
            self.server.handle_frame(Duration::ZERO, &request, &mut self.objects);
            let response = self.server.poll_transmit(Duration::ZERO, &mut self.objects).unwrap();
            self.client.handle_frame(Duration::ZERO, &response);
        }
    }

    fn read(&mut self, index: u16, sub: u8) -> Result<Vec<u8>, AbortCode> {
        self.client.upload(Address::new(index, sub), Vec::new(), &Options::default()).unwrap();
        match self.run() {
            (Outcome::Done(_), data) => Ok(data),
            (Outcome::Aborted(code), _) => Err(code),
            (other, _) => panic!("{other}"),
        }
    }

    fn write(&mut self, index: u16, sub: u8, data: &[u8]) -> Result<(), AbortCode> {
        self.client.download(Address::new(index, sub), data.to_vec(), &Options::default()).unwrap();
        match self.run() {
            (Outcome::Done(_), _) => Ok(()),
            (Outcome::Aborted(code), _) => Err(code),
            (other, _) => panic!("{other}"),
        }
    }
}

#[test]
fn values_rights_and_limits() {
    let mut memory = [0; TABLE.memory()];
    let mut device = Device::new(&mut memory);
    assert_eq!(device.read(0x1000, 0), Ok(vec![0x91, 0x01, 0x03, 0x00]));
    assert_eq!(device.read(0x1008, 0), Ok(b"I/O node with a long name".to_vec()));
    assert_eq!(device.read(0x2000, 0), Ok(vec![0xF9, 0xFF]));
    assert_eq!(device.read(0x2002, 0), Ok(vec![0xFF; 8]));
    assert_eq!(device.write(0x2002, 0, &[1, 2, 3, 4, 5, 6, 7, 8]), Ok(()));
    assert_eq!(device.read(0x2002, 0), Ok(vec![1, 2, 3, 4, 5, 6, 7, 8]));

    for (index, sub, data, refusal) in [
        (0x1000, 0, &[1, 2, 3, 4][..], AbortCode::READ_ONLY),
        (0x1000, 1, &[0], AbortCode::NO_SUB_INDEX),
        (0x3000, 0, &[0], AbortCode::NO_OBJECT),
        (0x6000, 1, &[0], AbortCode::READ_ONLY),
        (0x2000, 0, &[1], AbortCode::TOO_SHORT),
        (0x2000, 0, &[1, 2, 3], AbortCode::TOO_LONG),
        (0x2000, 0, &[0; 9], AbortCode::TOO_LONG),
        (0x2000, 0, &101i16.to_le_bytes(), AbortCode::TOO_HIGH),
        (0x2000, 0, &(-101i16).to_le_bytes(), AbortCode::TOO_LOW),
        (0x2000, 0, &13i16.to_le_bytes(), AbortCode::LOCAL_CONTROL),
        (0x2001, 0, &[b'x'; 13], AbortCode::TOO_LONG),
    ] {
        assert_eq!(device.write(index, sub, data), Err(refusal), "{index:04X}h:{sub} {data:?}");
    }
    assert_eq!(device.read(0x2003, 0), Err(AbortCode::WRITE_ONLY));
    assert_eq!(device.objects.dictionary.get::<i16>(Address::new(0x2000, 0)), Ok(-7), "nothing has changed");
    device.objects.dictionary.hooks.written.clear();
    assert_eq!(device.write(0x2000, 0, &100i16.to_le_bytes()), Ok(()));
    assert_eq!(device.write(0x2001, 0, b"twelve bytes"), Ok(()));
    assert_eq!(device.read(0x2001, 0), Ok(b"twelve bytes".to_vec()));
    assert_eq!(device.write(0x2001, 0, b""), Ok(()));
    assert_eq!(device.read(0x2001, 0), Ok(Vec::new()));
    let written = [0x2000, 0x2001, 0x2001].map(|index| Address::new(index, 0));
    assert_eq!(device.objects.dictionary.hooks.written, written);
    let domain: Vec<u8> = (0..200).collect();
    assert_eq!(device.write(0x2004, 0, &domain), Ok(()));
    assert_eq!(device.read(0x2004, 0), Ok(domain));
}

/// An expedited download without indicated size: the type says how many bytes count.
#[test]
fn size_not_indicated() {
    let mut memory = [0; TABLE.memory()];
    let mut device = Device::new(&mut memory);
    let request = Frame::standard(0x601, [0x22, 0x00, 0x20, 0, 5, 0, 0xDE, 0xAD]);
    device.server.handle_frame(Duration::ZERO, &request, &mut device.objects);
    let answer = device.server.poll_transmit(Duration::ZERO, &mut device.objects);
    assert_eq!(answer, Some(Frame::standard(0x581, [0x60, 0x00, 0x20, 0, 0, 0, 0, 0])));
    assert_eq!(device.objects.dictionary.get::<i16>(Address::new(0x2000, 0)), Ok(5));
}

/// Only expedited data may be longer than the type: of segments, every byte counts.
#[test]
fn segments_without_indicated_size_are_not_cut() {
    let mut memory = [0; TABLE.memory()];
    let mut device = Device::new(&mut memory);
    // 3 bytes, and 4 as in an expedited download.
    for segment in [[0x09, 5, 0, 1, 0, 0, 0, 0], [0x07, 5, 0, 1, 2, 0, 0, 0]] {
        for (request, expected) in [
            ([0x20, 0x00, 0x20, 0, 0, 0, 0, 0], [0x60, 0x00, 0x20, 0, 0, 0, 0, 0]),
            (segment, [0x80, 0x00, 0x20, 0, 0x12, 0, 7, 6]),
        ] {
            let request = Frame::standard(0x601, request);
            device.server.handle_frame(Duration::ZERO, &request, &mut device.objects);
            let answer = device.server.poll_transmit(Duration::ZERO, &mut device.objects);
            assert_eq!(answer, Some(Frame::standard(0x581, expected)));
        }
    }
    assert_eq!(device.objects.dictionary.get::<i16>(Address::new(0x2000, 0)), Ok(-7));
}

/// CiA 301, 7.5.2.13 and 7.5.2.14.
#[test]
fn store_and_restore() {
    let mut memory = [0; TABLE.memory()];
    let mut device = Device::new(&mut memory);
    assert_eq!(device.read(0x1010, 1), Ok(vec![1, 0, 0, 0]));
    assert_eq!(device.write(0x1010, 1, b"load"), Err(AbortCode::CANNOT_STORE));
    device.write(0x2000, 0, &42i16.to_le_bytes()).unwrap();
    device.write(0x2001, 0, b"kept").unwrap();
    assert_eq!(device.write(0x1010, 1, b"save"), Ok(()));
    let stored = device.objects.dictionary.hooks.stored.clone();
    assert_eq!(stored.len(), 2);
    assert_eq!(device.write(0x1011, 1, b"save"), Err(AbortCode::CANNOT_STORE));
    assert_eq!(device.write(0x1011, 1, b"load"), Ok(()));
    assert!(device.objects.dictionary.hooks.restored);

    let mut memory = [0; TABLE.memory()];
    let mut after = Dictionary::new(TABLE.view(), &mut memory, ()).unwrap();
    stored.iter().for_each(|(at, value)| after.load(*at, value));
    after.load(Address::new(0x2002, 0), &[0; 8]);
    assert_eq!(after.get::<i16>(Address::new(0x2000, 0)), Ok(42));
    assert_eq!(after.bytes(Address::new(0x2001, 0)), Some(&b"kept"[..]));
    assert_eq!(after.get::<u64>(Address::new(0x2002, 0)), Ok(u64::MAX), "not one of those kept");
}

/// CiA 301, 7.5.2.36: disable, count 0, entries, count, enable; anything else is refused.
#[test]
fn mapping_at_run_time() {
    let mut memory = [0; TABLE.memory()];
    let mut device = Device::new(&mut memory);
    let entry = |index: u32, sub: u32, bits: u32| (index << 16 | sub << 8 | bits).to_le_bytes();
    let cob_id = |id: u32| id.to_le_bytes();
    assert_eq!(device.read(0x1400, 1), Ok(cob_id(0x201).to_vec()));
    assert_eq!(device.read(0x1A00, 1), Ok(entry(0x6000, 1, 8).to_vec()));
    for (index, sub, data, refusal) in [
        (0x1600, 0, &[0][..], AbortCode::UNSUPPORTED_ACCESS),
        (0x1400, 1, &cob_id(0x202), AbortCode::INVALID_VALUE),
        (0x1401, 1, &cob_id(0x202), AbortCode::NO_OBJECT),
        (0x1400, 2, &[252], AbortCode::INVALID_VALUE),
        (0x1800, 2, &[241], AbortCode::INVALID_VALUE),
        (0x1800, 3, &[1, 0], AbortCode::INVALID_VALUE),
        (0x1400, 6, &[0], AbortCode::NO_SUB_INDEX),
        (0x1800, 4, &[0], AbortCode::NO_SUB_INDEX),
        (0x1800, 0, &[0], AbortCode::READ_ONLY),
        (0x1800, 5, &[0], AbortCode::TOO_SHORT),
    ] {
        assert_eq!(device.write(index, sub, data), Err(refusal), "{index:04X}h:{sub} {data:?}");
    }
    device.write(0x1400, 1, &cob_id(0x8000_0201)).unwrap();
    assert_eq!(device.write(0x1600, 1, &entry(0x6411, 1, 16)), Err(AbortCode::UNSUPPORTED_ACCESS));
    device.write(0x1600, 0, &[0]).unwrap();
    for (sub, data, refusal) in [
        (1, entry(0x6000, 1, 8), AbortCode::NOT_MAPPABLE),
        (1, entry(0x2002, 0, 64), AbortCode::NOT_MAPPABLE),
        (1, entry(0x6411, 1, 8), AbortCode::NOT_MAPPABLE),
        (1, entry(0x7000, 1, 8), AbortCode::NO_OBJECT),
        (5, entry(0x6411, 1, 16), AbortCode::NO_SUB_INDEX),
    ] {
        assert_eq!(device.write(0x1600, sub, &data), Err(refusal));
    }
    device.write(0x1600, 1, &entry(0x6411, 1, 16)).unwrap();
    device.write(0x1600, 2, &entry(0x0007, 0, 32)).unwrap();
    device.write(0x1600, 3, &entry(0x6200, 1, 8)).unwrap();
    device.write(0x1600, 4, &entry(0x6411, 1, 16)).unwrap();
    assert_eq!(device.write(0x1600, 0, &[4]), Err(AbortCode::PDO_LENGTH), "72 bits");
    assert_eq!(device.write(0x1600, 0, &[9]), Err(AbortCode::PDO_LENGTH));
    device.write(0x1600, 0, &[3]).unwrap();
    device.write(0x1400, 2, &[1]).unwrap();
    assert_eq!(device.write(0x1800, 1, &cob_id(0xC000_0181)), Ok(()));
    assert_eq!(device.write(0x1800, 6, &[241]), Err(AbortCode::TOO_HIGH), "SYNC counts to 240");
    assert_eq!(device.write(0x1800, 6, &[240]), Ok(()));
    assert_eq!(device.write(0x1400, 1, &cob_id(0x601)), Err(AbortCode::INVALID_VALUE), "restricted");
    assert_eq!(device.write(0x1400, 1, &cob_id(0x2000_0201)), Err(AbortCode::INVALID_VALUE), "29 bits");
    device.write(0x1400, 1, &cob_id(0x333)).unwrap();

    device.objects.pdos.start();
    device.objects.pdos.handle_frame(Duration::ZERO, &Frame::standard(0x333, [0xFE, 0xFF, 9, 9, 9, 9, 0x77]));
    assert_eq!(device.objects.pdos.poll_event(&mut device.objects.dictionary), None, "waits for SYNC");
    device.objects.pdos.handle_sync(None, &device.objects.dictionary);
    assert!(matches!(device.objects.pdos.poll_event(&mut device.objects.dictionary), Some((0, Ok(())))));
    assert_eq!(device.objects.dictionary.get::<i16>(Address::new(0x6411, 1)), Ok(-2));
    assert_eq!(device.objects.dictionary.get::<u8>(Address::new(0x6200, 1)), Ok(0x77));
}

#[test]
fn process_data() {
    let mut memory = [0; TABLE.memory()];
    let Device { objects: Objects { mut dictionary, mut pdos }, .. } = Device::new(&mut memory);
    let frame = Frame::standard(0x201, [0xA5, 0b10]);
    assert!(!pdos.handle_frame(Duration::ZERO, &frame).is_taken(), "not operational yet");
    assert_eq!(pdos.poll_transmit(Duration::ZERO, &dictionary), None);
    pdos.start();
    assert_eq!(pdos.poll_transmit(Duration::ZERO, &dictionary), Some(Frame::standard(0x181, [0x5A])));
    assert!(pdos.handle_frame(Duration::ZERO, &frame).is_taken());
    assert!(matches!(pdos.poll_event(&mut dictionary), Some((0, Ok(())))));
    assert_eq!(dictionary.get::<u8>(Address::new(0x6200, 1)), Ok(0xA5));
    assert_eq!(dictionary.get::<bool>(Address::new(0x6200, 2)), Ok(true));
    assert_eq!(dictionary.hooks.written.len(), 2, "the dummy is nowhere");
    pdos.handle_frame(Duration::ZERO, &Frame::standard(0x201, [1]));
    assert!(matches!(pdos.poll_event(&mut dictionary), Some((0, Err(RpdoFault::TooShort(_))))));
    dictionary.set(Address::new(0x6000, 1), 7u8).unwrap();
    pdos.trigger(0);
    assert_eq!(pdos.poll_transmit(Duration::ZERO, &dictionary), Some(Frame::standard(0x181, [7])));
    pdos.stop();
    pdos.trigger(0);
    assert_eq!(pdos.poll_transmit(Duration::ZERO, &dictionary), None);
}

/// What a device does to its own PDOs, such as choosing a mapping or holding an event back.
#[test]
fn the_device_changes_its_pdos() {
    let mut memory = [0; TABLE.memory()];
    let Device { objects: Objects { dictionary, mut pdos }, .. } = Device::new(&mut memory);
    let mut slot = pdos.tpdo_slots()[0];
    slot.mapping = Mapping::new(&[Mapped::new(0x6000, 1, 8), Mapped::new(0x6000, 1, 8)]).unwrap();
    assert!(pdos.set_tpdo_slot(0, slot) && !pdos.set_tpdo_slot(1, slot));
    assert_eq!(pdos.parameter(Address::new(0x1A00, 2)), Ok(Small::from(0x6000_0108u32)));
    assert_eq!(pdos.parameter(Address::new(0x1800, 4)), Err(AbortCode::NO_SUB_INDEX));
    assert_eq!(pdos.parameter(Address::new(0x1801, 0)), Err(AbortCode::NO_OBJECT));
    assert_eq!(pdos.parameter(Address::new(0x1C00, 0)), Err(AbortCode::NO_OBJECT));
    pdos.start();
    assert_eq!(pdos.data(0, &dictionary).unwrap().bytes(), [0x5A, 0x5A, 0, 0, 0, 0, 0, 0]);
    pdos.withdraw(0);
    assert_eq!(pdos.poll_transmit(Duration::ZERO, &dictionary), None, "held back");
    pdos.trigger(0);
    assert_eq!(pdos.poll_transmit(Duration::ZERO, &dictionary), Some(Frame::standard(0x181, [0x5A; 2])));
    slot.communication.cob_id = CobId(0x8000_0181);
    pdos.set_tpdo_slot(0, slot);
    assert_eq!((pdos.data(0, &dictionary), pdos.data(1, &dictionary)), (None, None));
}

/// A PDO is missed in operational only.
#[test]
fn no_time_out_after_the_stop() {
    let mut memory = [0; TABLE.memory()];
    let Device { objects: Objects { mut dictionary, mut pdos }, .. } = Device::new(&mut memory);
    let mut slot = pdos.rpdo_slots()[0];
    slot.communication.event_timer = 10;
    for stopped in [false, true] {
        pdos.set_rpdo_slot(0, slot);
        pdos.start();
        pdos.handle_frame(Duration::ZERO, &Frame::standard(0x201, [1, 2]));
        pdos.poll_event(&mut dictionary);
        if stopped {
            pdos.stop();
        }
        pdos.handle_timeout(Duration::from_millis(10));
        let event = pdos.poll_event(&mut dictionary);
        assert_eq!(event, (!stopped).then_some((0, Err(RpdoFault::TimedOut))));
    }
}

#[test]
fn tables_that_are_none() {
    let entry = Entry::variable(0x2000, 0, DataType::UNSIGNED8, 0);
    let at = entry.at;
    assert_eq!(Table::new([entry, entry]).map(|_| ()), Err(TableError::Order(at)));
    let string = Entry::string(0x2000, 0, DataType::OCTET_STRING, 2, b"abc");
    assert_eq!(Table::new([string]).map(|_| ()), Err(TableError::Initial(at)));
    let wrong = Limits { low: 1, high: 0 };
    assert_eq!(Table::new([entry.with_limits(&wrong)]).map(|_| ()), Err(TableError::Initial(at)));
    let large = Entry::string(0x2000, 0, DataType::OCTET_STRING, u16::MAX, b"");
    let more = Entry::variable(0x2001, 0, DataType::UNSIGNED8, 0);
    assert_eq!(Table::new([large, more]).map(|_| ()), Err(TableError::Memory(more.at)));
    let short = Dictionary::new(TABLE.view(), &mut [0; 3], ()).map(|_| ()).unwrap_err();
    assert_eq!(short, RamError { needed: TABLE.memory() as u16, found: 3 });
    assert_eq!(Small::from(1u8).as_slice(), [1]);
}

/// The dictionary alone serves too.
#[test]
fn without_pdos() {
    let mut memory = [0; TABLE.memory()];
    let mut dictionary = Dictionary::new(TABLE.view(), &mut memory, ()).unwrap();
    let mut out = [0; 8];
    assert_eq!(dictionary.read(Address::new(0x2000, 0), 0, &mut out), Ok((2, Some(2))));
    assert_eq!(dictionary.read(Address::new(0x2004, 0), 0, &mut out), Err(AbortCode::NO_DATA));
}
