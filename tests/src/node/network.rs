//! NMT, heartbeat, node guarding.

use core::time::Duration;

use canopen_master::Address;
use canopen_master::nmt::{Command, State};
use canopen_master::sdo::Channel;

use super::tester::{Checked, SILENCE, Tester};
use super::words::bytes;
use super::{Check, check, fail, skip};

/// Before everything else: where a node that was just reset stands, all other checks begin.
pub(super) const BOOT: &[Check] = &[
    check(
        "nmt.boot-up",
        "CiA 301, 7.2.8.3.3",
        "After a reset of the communication the node sends one boot-up message: 700h + node ID, one byte 0",
        "resets the communication",
        |tester| boot(tester, Command::ResetCommunication),
    ),
    check(
        "nmt.reset-node",
        "CiA 301, 7.2.8.3.1",
        "After a reset of the node it sends its boot-up message",
        "resets the node",
        |tester| boot(tester, Command::ResetNode),
    ),
    check(
        "nmt.pre-operational",
        "CiA 301, 7.3.2.2.2",
        "After the boot-up message the node is pre-operational by itself",
        "resets the communication",
        after_boot,
    ),
];

pub(super) const CHECKS: &[Check] = &[
    check(
        "nmt.commands",
        "CiA 301, 7.2.8.3.1",
        "The node follows start, stop and enter pre-operational, and shows it",
        "changes the NMT state; writes 1017h",
        commands,
    ),
    check(
        "nmt.unknown-command",
        "CiA 301, 7.2.8.3.1",
        "An NMT command that does not exist, or one of a single byte, changes nothing",
        "writes 1017h",
        unknown_commands,
    ),
    check(
        "nmt.stopped",
        "CiA 301, 7.3.2.2.4",
        "A stopped node does not answer SDO requests",
        "changes the NMT state",
        stopped,
    ),
    check(
        "heartbeat.period",
        "CiA 301, 7.2.8.2.2.2",
        "With 1017h written, the heartbeat comes in that period and shows the state",
        "writes 1017h",
        heartbeat,
    ),
    check(
        "heartbeat.off",
        "CiA 301, 7.5.2.20",
        "With 1017h = 0 no heartbeat comes",
        "writes 1017h",
        heartbeat_off,
    ),
    check(
        "guarding.toggle",
        "CiA 301, 7.2.8.2.2.1",
        "A guarding request is answered with the state and a toggle bit that begins with 0 and alternates",
        "resets the communication; sends remote frames",
        guarding,
    ),
    check(
        "guarding.life-time",
        "CiA 301, 7.2.8.2.2.1",
        "When the guarding requests stay away for the life time, the node reports 8130h",
        "writes 100Ch, 100Dh; resets the communication",
        life_guarding,
    ),
];

fn boot(tester: &mut Tester<'_>, command: Command) -> Checked {
    let data = tester.restart(command)?;
    if data != [0] {
        return fail(format!("the boot-up message is {}, one byte 00 expected", bytes(&data)));
    }
    // One of them.
    let until = tester.now() + SILENCE;
    match tester.wait(tester.error_control(), until)? {
        Some(data) if data == [0] => fail("two boot-up messages"),
        _ => Ok(()),
    }
}

fn after_boot(tester: &mut Tester<'_>) -> Checked {
    tester.restart(Command::ResetCommunication)?;
    tester.let_show()?;
    tester.expect_state(State::PreOperational)
}

fn commands(tester: &mut Tester<'_>) -> Checked {
    tester.restart(Command::ResetCommunication)?;
    tester.let_show()?;
    for (command, state) in [
        (Command::Start, State::Operational),
        (Command::Stop, State::Stopped),
        (Command::EnterPreOperational, State::PreOperational),
        (Command::Stop, State::Stopped),
        (Command::Start, State::Operational),
        (Command::EnterPreOperational, State::PreOperational),
    ] {
        tester.command(command)?;
        tester.expect_state(state)?;
    }
    Ok(())
}

fn unknown_commands(tester: &mut Tester<'_>) -> Checked {
    tester.let_show()?;
    let node = tester.node().raw();
    for data in [&[0x55, node][..], &[0, node], &[1]] {
        tester.send(0, data)?;
        tester.expect_state(State::PreOperational)?;
    }
    Ok(())
}

fn stopped(tester: &mut Tester<'_>) -> Checked {
    tester.command(Command::Stop)?;
    let channel = Channel::default_of(tester.node());
    tester.send(channel.request, &[0x40, 0, 0x10, 0, 0, 0, 0, 0])?;
    let silent = tester.expect_silence(channel.response, "SDO request while stopped");
    tester.command(Command::EnterPreOperational)?;
    silent
}

const PERIOD: Duration = Duration::from_millis(100);

fn heartbeat(tester: &mut Tester<'_>) -> Checked {
    let at = Address::new(0x1017, 0);
    if !tester.is_writable(at) {
        return skip("the device file has no 1017h that can be written");
    }
    tester.write(at, &100u16.to_le_bytes())?;
    let id = tester.error_control();
    let until = tester.now() + 5 * PERIOD;
    if tester.wait(id, until)?.is_none() {
        return fail("no heartbeat within 500 ms with 1017h = 100");
    }
    let start = tester.now();
    for number in 1..=10 {
        let until = tester.now() + 5 * PERIOD;
        match tester.wait(id, until)?.as_deref() {
            Some([0x7F]) => {}
            Some(data) => return fail(format!("heartbeat {}, 7F (pre-operational) expected", bytes(data))),
            None => return fail(format!("no heartbeat {number} within 500 ms")),
        }
    }
    let mean = (tester.now() - start) / 10;
    // Of a bus that others use, and of a clock of 1 % at the node.
    if mean.abs_diff(PERIOD) > PERIOD / 5 {
        return fail(format!("the heartbeat's period is {} ms, 100 ms expected", mean.as_millis()));
    }
    Ok(())
}

fn heartbeat_off(tester: &mut Tester<'_>) -> Checked {
    let at = Address::new(0x1017, 0);
    if !tester.is_writable(at) {
        return skip("the device file has no 1017h that can be written");
    }
    tester.write(at, &100u16.to_le_bytes())?;
    tester.write(at, &[0, 0])?;
    for _ in 0..3 {
        tester.expect_silence(tester.error_control(), "heartbeat with 1017h = 0")?;
    }
    Ok(())
}

/// The device file has both guarding objects.
fn has_guarding(tester: &Tester<'_>) -> bool {
    [0x100C, 0x100D].iter().all(|index| tester.device().object(*index).is_some())
}

fn guard(tester: &mut Tester<'_>) -> Checked<u8> {
    tester.guard_request()?;
    let until = tester.now() + tester.config.answer;
    match tester.wait(tester.error_control(), until)?.as_deref() {
        Some([reply]) => Ok(*reply),
        Some(data) => fail(format!("guarding reply {}, one byte expected", bytes(data))),
        None => fail("no answer to a guarding request"),
    }
}

fn guarding(tester: &mut Tester<'_>) -> Checked {
    if !has_guarding(tester) {
        return skip("the device file has no guarding (100Ch, 100Dh)");
    }
    tester.restart(Command::ResetCommunication)?;
    for expected in [0x7F, 0xFF, 0x7F, 0xFF] {
        let reply = guard(tester)?;
        if reply != expected {
            return fail(format!("guarding reply {reply:02X}h, {expected:02X}h expected"));
        }
    }
    // A reset begins anew.
    tester.restart(Command::ResetCommunication)?;
    match guard(tester)? {
        0x7F => Ok(()),
        reply => fail(format!("first guarding reply after boot-up {reply:02X}h, 7Fh expected")),
    }
}

fn life_guarding(tester: &mut Tester<'_>) -> Checked {
    let (time, factor) = (Address::new(0x100C, 0), Address::new(0x100D, 0));
    if !tester.is_writable(time) || !tester.is_writable(factor) {
        return skip("the device file has no 100Ch and 100Dh that can be written");
    }
    if tester.device().object(0x1014).is_none() {
        return skip("the device file has no emergencies (1014h)");
    }
    tester.restart(Command::ResetCommunication)?;
    tester.write(time, &100u16.to_le_bytes())?;
    tester.write(factor, &[2])?;
    tester.emergencies.clear();
    for _ in 0..3 {
        guard(tester)?;
        let until = tester.now() + PERIOD;
        if tester.wait_for_emergency(0x8130, until)? {
            return fail("8130h while guarding requests came every 100 ms, life time 200 ms");
        }
    }
    let until = tester.now() + 10 * PERIOD;
    let reported = tester.wait_for_emergency(0x8130, until)?;
    tester.restart(Command::ResetCommunication)?;
    if reported {
        Ok(())
    } else {
        fail("no emergency 8130h within 1 s after the last guarding request, life time 200 ms")
    }
}
