//! PDO parameters written to and read from a dictionary over SDO.

use canopen_master::data_type::DataType;
use canopen_master::od::{Communication, Dictionary, Entry, Objects, PdoSlot, Pdos, Rights, Table};
use canopen_master::pdo_setup::{
    Failed, Parameters, PdoNumber, PdoNumberError, Read, ReadError, Step, Write,
};
use canopen_master::sdo::{AbortCode, Channel, Client, NEXT_REQUEST, Options, Outcome, Server, Small};
use canopen_master::{Address, Frame};
use core::time::Duration;
use pdo::mapping::Entry as Mapped;
use pdo::{CobId, Mapping, Transmission};

const TABLE: Table<'static, 3> = match Table::new([
    Entry::variable(0x6041, 0, DataType::UNSIGNED16, 0).with_rights(Rights::Ro).mappable(),
    Entry::variable(0x6064, 0, DataType::INTEGER32, 0).with_rights(Rights::Ro).mappable(),
    Entry::variable(0x6065, 0, DataType::UNSIGNED32, 0),
]) {
    Ok(table) => table,
    Err(_) => panic!("entries out of order"),
};

struct Network<'a> {
    objects: Objects<Dictionary<'a, ()>, 0, 1, 4>,
    server: Server,
    client: Client<Small>,
    requests: Vec<Frame>,
}

impl<'a> Network<'a> {
    fn new(memory: &'a mut [u8]) -> Self {
        let slot = PdoSlot::new(Communication::event_driven(CobId(0x181)), Mapping::EMPTY);
        let channel = Channel { request: 0x601, response: 0x581 };
        Self {
            objects: Objects {
                dictionary: Dictionary::new(TABLE.view(), memory, ()).unwrap(),
                pdos: Pdos::new([], [slot]),
            },
            server: Server::new(channel, NEXT_REQUEST),
            client: Client::new(channel),
            requests: Vec::new(),
        }
    }

    fn run(&mut self) -> (Outcome, Small) {
        loop {
            if let Some(finished) = self.client.poll_event() {
                return (finished.outcome, finished.buffer);
            }
            let request = self.client.poll_transmit(Duration::ZERO).unwrap();
            self.requests.push(request);
            self.server.handle_frame(Duration::ZERO, &request, &mut self.objects);
            let response = self.server.poll_transmit(Duration::ZERO, &mut self.objects).unwrap();
            self.client.handle_frame(Duration::ZERO, &response);
        }
    }

    fn write<const M: usize>(&mut self, parameters: &Parameters<M>) -> Result<(), Failed> {
        let mut write = Write::new(PdoNumber::tpdo(1).unwrap(), parameters);
        while let Some((at, value)) = write.request() {
            self.client.download(at, value, &Options::default()).unwrap();
            let (outcome, _) = self.run();
            write.handle(outcome)?;
        }
        Ok(())
    }

    fn read(&mut self, pdo: PdoNumber) -> Result<Parameters<8>, ReadError> {
        let mut read = Read::new(pdo);
        while let Some(at) = read.request() {
            self.client.upload(at, Small::EMPTY, &Options::default()).unwrap();
            let (outcome, value) = self.run();
            read.handle(outcome, &value)?;
        }
        Ok(*read.parameters().unwrap())
    }
}

fn parameters(entries: &[Mapped]) -> Parameters<8> {
    Parameters {
        inhibit: Some(100),
        event_timer: Some(500),
        sync_start: Some(2),
        mapping: Some(Mapping::new(entries).unwrap()),
        ..Parameters::new(CobId(0x4000_0182), Transmission::SyncCyclic(4))
    }
}

#[test]
fn written_in_order_and_read_back() {
    let mut memory = [0; TABLE.memory()];
    let mut network = Network::new(&mut memory);
    let wanted = parameters(&[Mapped::new(0x6041, 0, 16), Mapped::new(0x6064, 0, 32)]);
    network.write(&wanted).unwrap();
    let order: Vec<String> = network.requests.iter().map(ToString::to_string).collect();
    assert_eq!(
        order,
        [
            "601#23001801820100C0",
            "601#2F001A0000000000",
            "601#23001A0110004160",
            "601#23001A0220006460",
            "601#2F001A0002000000",
            "601#2F00180204000000",
            "601#2B00180364000000",
            "601#2B001805F4010000",
            "601#2F00180602000000",
            "601#2300180182010040",
        ]
    );
    assert_eq!(network.read(PdoNumber::tpdo(1).unwrap()), Ok(wanted));
}

#[test]
fn the_refused_entry_is_named() {
    let mut memory = [0; TABLE.memory()];
    let mut network = Network::new(&mut memory);
    let entry = Mapped::new(0x6065, 0, 32);
    let failed = network.write(&parameters(&[Mapped::new(0x6041, 0, 16), entry])).unwrap_err();
    assert_eq!(failed.step, Step::Entry(2, Some(entry)));
    assert_eq!(failed.at, Address::new(0x1A00, 2));
    assert_eq!(failed.outcome, Outcome::Aborted(AbortCode::NOT_MAPPABLE));
    assert_eq!(
        failed.to_string(),
        "TPDO 1: map entry 2, 6065h:00/32 (1A00h:02): aborted by the device: object cannot be mapped to \
         the PDO (06040041h)"
    );
}

#[test]
fn what_is_not_there() {
    let mut memory = [0; TABLE.memory()];
    let mut network = Network::new(&mut memory);
    let missing = network.read(PdoNumber::tpdo(2).unwrap()).unwrap_err();
    assert!(matches!(
        missing,
        ReadError::Failed(Failed { step: Step::CobId, outcome: Outcome::Aborted(AbortCode::NO_OBJECT), .. })
    ));
    assert_eq!(PdoNumber::rpdo(513), Err(PdoNumberError(513)));
    assert_eq!(PdoNumber::rpdo(512).map(PdoNumber::mapping), Ok(0x17FF));

    let mut read: Read<2> = Read::new(PdoNumber::rpdo(1).unwrap());
    for value in [Small::from(0x201u32), Small::from(255u8)] {
        read.handle(Outcome::Done(4), &value).unwrap();
    }
    for _ in 0..2 {
        read.handle(Outcome::Aborted(AbortCode::NO_SUB_INDEX), &Small::EMPTY).unwrap();
    }
    assert_eq!(read.handle(Outcome::Done(1), &Small::from(3u8)), Err(ReadError::Count { found: 3, room: 2 }));
}
