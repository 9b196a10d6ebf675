//! 7.1.2 and 7.2.1: command IDs and status values, by name.

use linmot::code::{Command, Status};

/// 7.1.2.
#[test]
fn every_command_has_its_id_and_name() {
    let rows = [
        (0x00, Command::NO_OPERATION, "no operation"),
        (0x10, Command::READ_ROM, "read ROM value of parameter by UPID"),
        (0x11, Command::READ_RAM, "read RAM value of parameter by UPID"),
        (0x12, Command::WRITE_ROM, "write ROM value of parameter by UPID"),
        (0x13, Command::WRITE_RAM, "write RAM value of parameter by UPID"),
        (0x14, Command::WRITE_BOTH, "write RAM and ROM value of parameter by UPID"),
        (0x15, Command::READ_MINIMUM, "get minimal value of parameter by UPID"),
        (0x16, Command::READ_MAXIMUM, "get maximal value of parameter by UPID"),
        (0x17, Command::READ_DEFAULT, "get default value of parameter by UPID"),
        (0x20, Command::START_LIST, "start getting UPID list"),
        (0x21, Command::NEXT_ITEM, "get next UPID list item"),
        (0x22, Command::START_MODIFIED, "start getting modified UPID list"),
        (0x23, Command::NEXT_MODIFIED, "get next modified UPID list item"),
        (0x30, Command::RESTART, "restart drive"),
        (0x31, Command::DEFAULT_OS, "set parameter ROM values to default, OS software"),
        (0x32, Command::DEFAULT_MC, "set parameter ROM values to default, MC software"),
        (0x33, Command::DEFAULT_INTERFACE, "set parameter ROM values to default, interface software"),
        (0x34, Command::DEFAULT_APPLICATION, "set parameter ROM values to default, application software"),
        (0x35, Command::STOP, "stop MC and application software (for flash access)"),
        (0x36, Command::START, "start MC and application software"),
        (0x40, Command::SAVE_CURVES, "save all curves from RAM to flash"),
        (0x41, Command::DELETE_CURVES, "delete all curves (RAM)"),
        (0x50, Command::ADD_CURVE, "start adding curve (RAM)"),
        (0x51, Command::ADD_CURVE_INFO, "add curve info block (RAM)"),
        (0x52, Command::ADD_CURVE_DATA, "add curve data (RAM)"),
        (0x53, Command::MODIFY_CURVE, "start modifying curve (RAM)"),
        (0x54, Command::MODIFY_CURVE_INFO, "modify curve info block (RAM)"),
        (0x55, Command::MODIFY_CURVE_DATA, "modify curve data (RAM)"),
        (0x60, Command::GET_CURVE, "start getting curve (RAM)"),
        (0x61, Command::GET_CURVE_INFO, "get curve info block (RAM)"),
        (0x62, Command::GET_CURVE_DATA, "get curve data (RAM)"),
        (0x70, Command::ERROR_COUNTS, "get error log entry counter"),
        (0x71, Command::ERROR_CODE, "get error log entry error code"),
        (0x72, Command::ERROR_TIME_LOW, "get error log entry time low"),
        (0x73, Command::ERROR_TIME_HIGH, "get error log entry time high"),
        (0x74, Command::ERROR_TEXT, "get error code text stringlet"),
        (0x80, Command::SAVE_TABLE, "command table: save to flash"),
        (0x81, Command::CLEAR_TABLE, "command table: delete all entries (RAM)"),
        (0x82, Command::DELETE_ENTRY, "command table: delete entry"),
        (0x83, Command::WRITE_ENTRY, "command table: write entry"),
        (0x84, Command::WRITE_ENTRY_DATA, "command table: write entry data"),
        (0x85, Command::GET_ENTRY, "command table: get entry"),
        (0x86, Command::GET_ENTRY_DATA, "command table: get entry data"),
        (0x87, Command::PRESENCE_0, "get presence list of entries 0..31 from RAM"),
        (0x88, Command::PRESENCE_1, "get presence list of entries 32..63 from RAM"),
        (0x89, Command::PRESENCE_2, "get presence list of entries 64..95 from RAM"),
        (0x8A, Command::PRESENCE_3, "get presence list of entries 96..127 from RAM"),
        (0x8B, Command::PRESENCE_4, "get presence list of entries 128..159 from RAM"),
        (0x8C, Command::PRESENCE_5, "get presence list of entries 160..191 from RAM"),
        (0x8D, Command::PRESENCE_6, "get presence list of entries 192..223 from RAM"),
        (0x8E, Command::PRESENCE_7, "get presence list of entries 224..255 from RAM"),
    ];
    let found: Vec<_> =
        Command::ALL.iter().map(|command| (command.0, *command, command.to_string())).collect();
    let expected: Vec<_> = rows.map(|(id, command, name)| (id, command, name.to_owned())).into();
    assert_eq!(found, expected);
}

/// 7.2.1, and D7h of the LinRS manual.
#[test]
fn every_status_has_its_value_and_name() {
    let rows = [
        (0x00, Status::OK, "OK, done"),
        (0x02, Status::RUNNING, "command running, busy"),
        (0x04, Status::NOT_FINISHED, "block not finished"),
        (0x05, Status::BUSY, "busy"),
        (0xC0, Status::UPID, "UPID error"),
        (0xC1, Status::TYPE, "parameter type error"),
        (0xC2, Status::RANGE, "range error"),
        (0xC3, Status::USAGE, "address usage error"),
        (0xC5, Status::NO_START, "next UPID list item without start getting UPID list"),
        (0xC6, Status::END, "end of UPID list reached"),
        (0xD0, Status::ODD_ADDRESS, "odd address, or block already finished"),
        (0xD1, Status::SIZE, "size error"),
        (0xD4, Status::DEFINED, "curve already defined or not present, or invalid entry number"),
        (0xD7, Status::NOT_STOPPED, "MC software not stopped"),
    ];
    let found: Vec<_> = Status::ALL.iter().map(|status| (status.0, *status, status.to_string())).collect();
    let expected: Vec<_> = rows.map(|(value, status, name)| (value, status, name.to_owned())).into();
    assert_eq!(found, expected);
}
