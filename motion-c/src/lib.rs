#![doc = include_str!("../README.md")]

mod blocks;
mod can;
mod controller;
mod plc;

pub use blocks::{
    Block, BlockKind, BlockOutputs, motion_block_free, motion_block_new, motion_gear_in, motion_gear_out,
    motion_halt, motion_home, motion_jog, motion_move_absolute, motion_move_relative, motion_move_velocity,
    motion_power, motion_reset, motion_set_position, motion_stop,
};
pub use can::{CanFrame, motion_can_receive, motion_can_timeout, motion_can_transmit};
pub use controller::{
    Application, Controller, Encoder, Failure, Inputs, Outputs, Pulse, motion_controller_cycle,
    motion_controller_cycle_time, motion_controller_failures, motion_controller_free, motion_controller_load,
    motion_controller_new, motion_controller_power_off, motion_controller_read_parameter,
    motion_controller_save, motion_controller_storage_len, motion_controller_write_parameter,
};
pub use plc::{
    AxisState, AxisStatus, Plc, motion_error_text, motion_plc_actual_value, motion_plc_analog_input,
    motion_plc_digital_input, motion_plc_set_digital_output, motion_read_status,
};
