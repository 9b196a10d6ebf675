//! The controller as an LB2 device, through its public API.

use core::time::Duration;

use lb2::code::{ErrorCode, Failure, LoaderCode, StoredFailure};
use lb2::device::Device;
use motion_core::application::Plc;
use motion_core::io::{Inputs, Terminal};
use motion_core::parameters::{Values, iter};
use motion_core::storage::{Storage, StorageError};
use motion_core::{Controller, Model, Reset, ResetError, STORAGE_LEN, is_damaged, stored_model};

type Virtual = Controller<Vec<u8>, Vec<u8>>;

fn on(storage: Vec<u8>) -> Virtual {
    Controller::power_on(Model::Gel8231, storage, vec![0; 65536])
}

fn new() -> Virtual {
    on(vec![0xFF; STORAGE_LEN])
}

#[test]
fn identity() {
    let controller = new();
    assert_eq!(controller.device_type(), (0x2027, 6));
    assert_eq!(controller.os_version().to_string(), "5.15");
    assert_eq!(controller.device_number(), 0);
    assert_eq!(Model::ALL.map(Model::number), [0x2026, 0x2027, 0x202B, 0x202C]);
    assert_eq!(Model::from_number(8236), Some(Model::Gel8236));
    assert_eq!(Model::from_number(8232), None);
}

/// 6.3.3: 0 to 31; the number by which a select (00h) finds the device.
#[test]
fn parameter_005_is_the_device_number() {
    for number in [0, 1, 31] {
        let mut controller = new();
        controller.write_parameter(5, number);
        assert_eq!(controller.call_loader(), -1);
        assert_eq!(i32::from(controller.device_number()), number);
    }
    assert_eq!(new().write_parameter(5, 32).code, LoaderCode(0x81));
}

/// Parameters that cannot be read any more are those saved before, and that is told.
#[test]
fn a_damaged_memory_is_told_and_knows_its_model() {
    assert_eq!(stored_model(&new().power_off()), None);
    let [first, mut storage] = [7, 8].map(|saves| {
        let mut controller = new();
        for number in 7..=saves {
            controller.write_parameter(5, number);
            controller.call_loader();
            controller.save_parameters().unwrap();
        }
        controller.advance(Duration::ZERO).unwrap();
        controller.power_off()
    });
    assert_eq!((stored_model(&storage), is_damaged(&storage)), (Some(8231), Ok(false)));
    // In the second slot, where the first save has left nothing.
    let at = first.iter().zip(&storage).rposition(|(first, second)| first != second).unwrap();
    storage[at] ^= 1;
    assert_eq!(is_damaged(&storage), Ok(true));
    let mut controller = on(storage);
    assert_eq!(controller.device_number(), 7);
    // The next save takes the damaged slot.
    controller.save_parameters().unwrap();
    assert_eq!(is_damaged(&controller.power_off()), Ok(false));
}

/// Writes go to RAM, the loader makes them effective, 35h makes them permanent.
#[test]
fn parameters_live_in_three_places() {
    let mut controller = new();
    assert_eq!(controller.write_parameter(5, 7).code, LoaderCode::OK);
    assert_eq!((controller.read_parameter(5), controller.device_number()), (7, 0));
    assert_eq!(controller.call_loader(), -1);
    assert_eq!(controller.device_number(), 7);
    let mut controller = on(controller.power_off());
    assert_eq!(controller.read_parameter(5), 0, "not saved");
    controller.write_parameter(5, 7);
    controller.call_loader();
    controller.save_parameters().unwrap();
    assert_eq!(on(controller.power_off()).device_number(), 7);
}

#[test]
fn what_the_loader_refuses_is_neither_effective_nor_saved() {
    let mut controller = new();
    assert_eq!(controller.write_parameter(0, 2).code, LoaderCode::OK);
    assert_eq!(controller.call_loader(), 109);
    assert_eq!(controller.working(), &Values::factory());
    controller.save_parameters().unwrap();
    assert_eq!(on(controller.power_off()).edited(), &Values::factory());
}

/// Decision 4, and "a value out of range is refused and the old one stays".
#[test]
fn refused_values_leave_the_old_one() {
    let mut controller = new();
    let mut refused = |index, value, code, text: &str| {
        let answer = controller.write_parameter(index, value);
        assert_eq!((answer.code, answer.text.to_string().as_str()), (LoaderCode(code), text));
    };
    refused(642, 3_276_801, 0x81, "Value out of range");
    refused(642, -1, 0x81, "Value out of range");
    refused(50, 1, 0x80, "No such parameter");
    refused(1000, 1, 0x80, "No such parameter");
    refused(301, 1, 0x82, "Choice not available here");
    assert_eq!(controller.edited(), &Values::factory());
    assert_eq!((controller.read_parameter(50), controller.read_parameter(65535)), (0, 0));
    let unused = controller.describe_parameter(50);
    assert!(unused.name.is_empty() && unused.group.is_empty() && unused.variant.is_empty());
    assert_eq!(controller.write_parameter(300, 1).code, LoaderCode(0x01), "slave: switch on again");
    assert_eq!(controller.write_parameter(302, 1).code, LoaderCode(0x01), "CAN Link: switch on again");
    assert_eq!(controller.write_parameter(302, 1).code, LoaderCode::OK, "unchanged");
}

#[test]
fn descriptions_fit_31h() {
    let controller = new();
    for entry in iter() {
        let description = controller.describe_parameter(entry.index());
        assert_eq!(description.name.to_string(), entry.name());
        assert_eq!(description.group.to_string(), entry.group());
        assert_eq!(description.variant.is_empty(), entry.choices().is_empty(), "{entry}");
        let mut wire = [0; lb2::frame::MAX_WIRE];
        lb2::telegram::Response::ParameterDescription(description).encode(&mut wire).unwrap();
    }
    let languages = controller.describe_parameter(1);
    assert_eq!(languages.variant.to_string(), "DEUTSCH");
    assert_eq!((languages.minimum, languages.maximum, languages.default), (0, 1, 0));
}

#[test]
fn resets_go_to_the_factory_or_the_image() {
    let mut controller = new();
    assert_eq!(controller.reset(Reset::Image), Err(ResetError::NoImage));
    controller.write_parameter(5, 9);
    controller.call_loader();
    controller.create_image().unwrap();
    controller.reset(Reset::Factory).unwrap();
    let mut controller = on(controller.power_off());
    assert_eq!(controller.device_number(), 0);
    controller.reset(Reset::Image).unwrap();
    assert_eq!(on(controller.power_off()).device_number(), 9);
}

#[test]
fn failures_and_run_time_survive_and_the_oldest_of_21_is_dropped() {
    let mut controller = new();
    for n in 0..21 {
        controller.store_failure(StoredFailure { axis: n % 7, failure: Failure(n) });
    }
    controller.advance(Duration::from_secs(3)).unwrap();
    let mut controller = on(controller.power_off());
    assert_eq!(controller.run_time(), Duration::from_secs(3));
    assert_eq!(controller.failure_count(), 20);
    assert_eq!(controller.failure(0), Some(StoredFailure { axis: 1, failure: Failure(1) }));
    assert_eq!(controller.failure(19), Some(StoredFailure { axis: 6, failure: Failure(20) }));
    assert_eq!(controller.failure(20), None);
    assert_eq!((controller.delete_failures(), controller.delete_failures()), (20, 0));
    controller.advance(Duration::ZERO).unwrap();
    assert_eq!(on(controller.power_off()).failure_count(), 0);
}

/// Decision 5.
#[test]
fn flash_cells_are_written_once_between_erasures() {
    let mut controller = new();
    let read = |controller: &Virtual, bank, offset| {
        let mut out = [0; 4];
        controller.read_flash(bank, offset, &mut out).unwrap();
        out
    };
    controller.erase_flash(15).unwrap();
    assert_eq!(controller.write_flash(15, false, &[1, 2]), Err(ErrorCode::FLASH_PROTECTED));
    controller.write_flash(15, true, &[1, 2]).unwrap();
    controller.write_flash(15, true, &[3, 4]).unwrap();
    assert_eq!(read(&controller, 15, 0), [1, 2, 3, 4]);
    assert_eq!(read(&controller, 16, 0), [0xFF; 4], "the other bank");
    assert_eq!(controller.write_flash_at(15, 2, &[5, 6]), Err(ErrorCode::FLASH_WRITE));
    controller.write_flash_at(15, 0xFFFC, &[7, 8]).unwrap();
    let mut controller = on(controller.power_off());
    assert_eq!(read(&controller, 15, 0xFFFC), [7, 8, 0xFF, 0xFF]);
    assert_eq!(controller.write_flash(15, true, &[9, 9]), Err(ErrorCode::FLASH_WRITE), "pointer at 0 again");
    controller.erase_flash(15).unwrap();
    for _ in 0..512 {
        controller.write_flash(15, true, &[0x55; 128]).unwrap();
    }
    assert_eq!(controller.write_flash(15, true, &[1, 2]), Err(ErrorCode::RANGE));
    controller.write_flash(15, true, &[]).unwrap();
}

#[test]
fn ram_is_lost_with_the_power() {
    let mut controller = new();
    controller.write_ram(12, 0xFFFE, &[1, 2]).unwrap();
    let mut out = [0; 2];
    controller.read_ram(12, 0xFFFE, &mut out).unwrap();
    assert_eq!(out, [1, 2]);
    assert_eq!(controller.read_ram(12, 0xFFFF, &mut out), Err(ErrorCode::RANGE));
    on(controller.power_off()).read_ram(12, 0xFFFE, &mut out).unwrap();
    assert_eq!(out, [0, 0]);
}

/// Memory whose power fails after so many bytes.
struct Cut {
    bytes: Vec<u8>,
    left: usize,
}

impl Storage for Cut {
    fn read(&self, offset: usize, out: &mut [u8]) -> Result<(), StorageError> {
        self.bytes.read(offset, out)
    }

    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StorageError> {
        let len = data.len().min(self.left);
        self.left -= len;
        self.bytes.write(offset, &data[..len])?;
        if len < data.len() { Err(StorageError { offset }) } else { Ok(()) }
    }
}

/// A power cut at any byte of a save leaves either the old or the new set, never a mixture.
#[test]
fn a_save_is_safe_against_power_failure() {
    let mut controller = new();
    controller.write_parameter(5, 1);
    controller.call_loader();
    controller.save_parameters().unwrap();
    let bytes = controller.power_off();
    let (mut old, mut new) = (0, 0);
    for left in (0..4000).chain([usize::MAX]) {
        let storage = Cut { bytes: bytes.clone(), left };
        let mut controller = Controller::power_on(Model::Gel8230, storage, vec![0; 65536]);
        for entry in iter() {
            if entry.allows(entry.maximum()) && ![0, 107, 302, 684].contains(&entry.row().first) {
                controller.write_parameter(entry.index(), entry.maximum());
            }
        }
        controller.write_parameter(5, 2);
        controller.write_parameter(9, 2);
        controller.write_parameter(10, 2);
        for first in [310, 342] {
            for index in first..first + 8 {
                let address = 13 + i32::from((index - first) % 4);
                assert!(!controller.write_parameter(index, address).code.is_error());
            }
        }
        assert_eq!(controller.call_loader(), -1);
        let expected = controller.working().clone();
        let saved = controller.save_parameters();
        let after = on(controller.power_off().bytes);
        match after.device_number() {
            1 => {
                assert!(saved.is_err());
                let mut before = Values::factory();
                before.set(5, 1).unwrap();
                assert_eq!(after.working(), &before, "cut after {left} bytes");
                old += 1;
            }
            2 => {
                assert_eq!(after.working(), &expected, "cut after {left} bytes");
                new += 1;
            }
            other => panic!("cut after {left} bytes: device number {other}"),
        }
    }
    // One commit byte, 2424 bytes of values, sequence, check sum: the commit byte is the last of 2434.
    assert_eq!((old, new), (2434, 4001 - 2434));
}

/// 6.6.1.1, `[247]`: the internal offset of an input "is stored safe against power failures".
#[test]
fn a_set_position_survives_the_loss_of_power() {
    let mut controller = new();
    let mut inputs = Inputs::default();
    inputs.digital.set(Terminal::PLC_RUN, true);
    inputs.encoders[0].count = 500;
    let mut application =
        |plc: &mut Plc<'_>| plc.axis(1).and_then(|axis| axis.set_position(70)).unwrap_or_default();
    controller.cycle(Duration::ZERO, &inputs, &mut application);
    controller.cycle(Duration::ZERO, &inputs, &mut ());
    assert_eq!(controller.actual_values()[0].position, 70);
    controller.advance(Duration::from_millis(3)).unwrap();
    let mut controller = on(controller.power_off());
    controller.cycle(Duration::ZERO, &inputs, &mut ());
    assert_eq!(controller.actual_values()[0].position, 70);
    // Another type of input sets it back.
    for kind in [1, 0] {
        controller.write_parameter(100, kind);
        controller.call_loader();
    }
    controller.cycle(Duration::ZERO, &inputs, &mut ());
    assert_eq!(controller.actual_values()[0].position, 500);
}

/// An encoder failure is in the list in the same cycle, with its axis, as LB2 50h shows it.
#[test]
fn an_encoder_failure_is_stored_in_the_same_cycle() {
    let mut controller = new();
    let mut inputs = Inputs::default();
    controller.cycle(Duration::ZERO, &inputs, &mut ());
    assert_eq!(controller.failure_count(), 0);
    inputs.encoders[1].fault = true;
    controller.cycle(Duration::ZERO, &inputs, &mut ());
    let stored = StoredFailure { axis: 2, failure: motion_core::failure::READING_LOST };
    assert_eq!((controller.failure_count(), controller.failure(0)), (1, Some(stored)));
}

/// `[000]`: 1 ms an activated axis, changed by the loader while running.
#[test]
fn the_cycle_follows_the_loader() {
    let mut controller = new();
    assert_eq!(controller.cycle_time(), Duration::from_millis(3));
    controller.write_parameter(0, 5);
    assert_eq!(controller.cycle_time(), Duration::from_millis(3));
    controller.call_loader();
    assert_eq!(controller.cycle_time(), Duration::from_millis(5));
}
