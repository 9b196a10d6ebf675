//! A slave by itself, spoken to in plain frames.

use core::time::Duration;

use canopen_master::emcy::ErrorCode;
use canopen_master::nmt::State;
use canopen_master::slave::{self, Event, Slave};
use canopen_master::{Frame, NodeId};

use crate::net::{Dictionary, drive, identity, ms, node};

const RESET_COMMUNICATION: Frame = Frame::standard(0x000, [0x82, 1]);

fn slave(address: Option<NodeId>) -> Slave<Dictionary> {
    let mut slave = Slave::new(&slave::Config::new(identity(1), address), drive(identity(1)));
    slave.boot(Duration::ZERO);
    sent(&mut slave, Duration::ZERO);
    slave
}

fn sent(slave: &mut Slave<Dictionary>, now: Duration) -> Vec<String> {
    core::iter::from_fn(|| slave.poll_transmit(now)).map(|frame| frame.to_string()).collect()
}

fn answer(slave: &mut Slave<Dictionary>, frame: &Frame) -> Vec<String> {
    slave.handle_frame(Duration::ZERO, frame);
    sent(slave, Duration::ZERO)
}

/// CiA 301, 7.3.2.2.1: the communication area takes its power-on values. What guarding found ends with the
/// guarding; an error of the device does not.
#[test]
fn a_reset_empties_the_error_history_and_keeps_the_devices_errors() {
    let history = Frame::standard(0x601, [0x40, 0x03, 0x10, 0, 0, 0, 0, 0]);
    let mut slave = slave(Some(node(1)));
    slave.objects_mut().set(0x100C, 0, &100_u16.to_le_bytes());
    slave.objects_mut().set(0x100D, 0, &[3]);
    slave.boot(ms(0));
    slave
        .handle_frame(ms(0), &Frame::remote_frame(embedded_can::StandardId::new(0x701).unwrap(), 1).unwrap());
    slave.handle_timeout(ms(301));
    slave.raise(ErrorCode::TEMPERATURE, [0; 5]).unwrap();
    assert_eq!(slave.error_register(), 0x19);
    assert_eq!(sent(&mut slave, ms(301)).last().unwrap(), "081#0040190000000000");
    assert_eq!(answer(&mut slave, &history), ["581#4F03100002000000"]);
    slave.handle_frame(ms(301), &RESET_COMMUNICATION);
    slave.boot(ms(301));
    assert_eq!(answer(&mut slave, &history), ["701#00", "581#4F03100000000000"]);
    assert_eq!(slave.error_register(), 0x09);
}

/// Emergencies that waited for the inhibit time do not outlive a reset; one from before the first start is told.
#[test]
fn emergencies_that_wait_end_with_a_reset() {
    let mut slave = Slave::new(&slave::Config::new(identity(1), Some(node(1))), drive(identity(1)));
    slave.objects_mut().set(0x1015, 0, &1000_u16.to_le_bytes());
    slave.raise(ErrorCode::TEMPERATURE, [1; 5]).unwrap();
    slave.boot(ms(0));
    assert_eq!(sent(&mut slave, ms(0)), ["701#00", "081#0040090101010101"]);
    slave.raise(ErrorCode::CURRENT, [0; 5]).unwrap();
    assert_eq!(answer(&mut slave, &RESET_COMMUNICATION), [""; 0]);
    slave.boot(ms(0));
    assert_eq!(sent(&mut slave, ms(1000)), ["701#00"]);
}

/// CiA 301, 7.2.7.1: the register tells what is left. A node that is watched no more is no error.
#[test]
fn each_lost_node_is_an_error_of_its_own() {
    let [five, six] = [0x705, 0x706].map(|id| Frame::standard(id, [5]));
    let mut slave = slave(Some(node(1)));
    slave.objects_mut().set(0x1016, 1, &0x0005_0064_u32.to_le_bytes());
    slave.objects_mut().set(0x1016, 2, &0x0006_0064_u32.to_le_bytes());
    slave.boot(ms(0));
    for (from, frames) in [(0, [five, six]), (200, [six, five])] {
        frames.iter().for_each(|frame| assert!(slave.handle_frame(ms(from), frame).is_taken()));
        sent(&mut slave, ms(from));
        slave.handle_timeout(ms(from + 100));
        assert_eq!(sent(&mut slave, ms(from + 100)), ["081#3081110000000000"; 2]);
        slave.handle_frame(ms(from + 100), &five);
        assert_eq!(sent(&mut slave, ms(from + 100)), ["081#0000110000000000"]);
        assert_eq!(slave.error_register(), 0x11);
    }
    let unwatch = Frame::standard(0x601, [0x23, 0x16, 0x10, 2, 0, 0, 0, 0]);
    slave.handle_frame(ms(300), &unwatch);
    assert_eq!(sent(&mut slave, ms(300)), ["081#0000000000000000", "581#6016100200000000"]);
    assert_eq!(slave.error_register(), 0);
}

/// What was wrong for a moment leaves the error register as it was.
#[test]
fn errors_that_are_over_when_told() {
    let mut slave = slave(Some(node(1)));
    slave.mention(ErrorCode::LIFE_GUARD, [5, 4, 0, 0, 0]);
    assert_eq!(sent(&mut slave, ms(0)), ["081#3081110504000000"]);
    assert_eq!(slave.error_register(), 0);
    // A counter where none was expected (CiA 301, 7.2.5): expected and found lengths.
    assert_eq!(answer(&mut slave, &Frame::standard(0x080, [1])), ["081#4082110001000000"]);
}

/// A stopped node has no SDO: what was under way is over, and nothing of it comes later.
#[test]
fn a_transfer_ends_where_the_node_stops() {
    let mut slave = slave(Some(node(1)));
    slave.objects_mut().set(0x2100, 0, &[7; 20]);
    let upload = Frame::standard(0x601, [0x40, 0x00, 0x21, 0, 0, 0, 0, 0]);
    assert_eq!(answer(&mut slave, &upload), ["581#4100210014000000"]);
    slave.handle_frame(ms(0), &Frame::standard(0x000, [0x02, 1]));
    assert_eq!((slave.state(), slave.poll_timeout()), (State::Stopped, None));
    slave.handle_frame(ms(0), &Frame::standard(0x000, [0x80, 1]));
    slave.handle_timeout(Duration::from_secs(60));
    assert_eq!(sent(&mut slave, Duration::from_secs(60)), [""; 0]);
}

/// What depends on the address can be set before the slave boots with it.
#[test]
fn the_next_address_is_known_before_it_holds() {
    let mut slave = slave(None);
    let [to_configuration, set, to_waiting] = [[4, 1], [0x11, 9], [4, 0]]
        .map(|[command, value]| Frame::standard(0x7E5, [command, value, 0, 0, 0, 0, 0, 0]));
    answer(&mut slave, &to_configuration);
    assert_eq!(slave.next_node(), None);
    assert_eq!(answer(&mut slave, &set), ["7E4#1100000000000000"]);
    assert_eq!((slave.node(), slave.next_node()), (None, Some(node(9))));
    answer(&mut slave, &to_waiting);
    assert_eq!(slave.poll_event(), Some(Event::ResetCommunication));
    assert!(slave.boot(ms(0)));
    assert_eq!((slave.node(), sent(&mut slave, ms(0))), (Some(node(9)), vec!["709#00".to_owned()]));
}
