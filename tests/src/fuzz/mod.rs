//! What the fuzz targets do with their input, here so that the committed corpora are replayed by an
//! ordinary test. A finding is a panic: of the code under test, or of an assertion here.

mod canopen;
mod captures;
mod device;
mod device_files;
mod frames;
mod linmot;
mod linmot_ops;
mod master;
mod network;
mod trace;

pub use canopen::{od_ops, sdo_client_ops, sdo_server_ops};
pub use captures::{capture_asc, capture_candump, capture_columns, capture_lb2, capture_pcap, capture_trc};
pub use device::device_ops;
pub use device_files::{eds_concise, eds_read, xdd_read};
pub use frames::{decode, request, response};
pub use linmot::{linmot_curve, linmot_curve_file, linmot_linrs, linmot_pvl, linmot_table, linmot_telegrams};
pub use linmot_ops::{linmot_client_ops, linmot_drive_ops};
pub use master::master_ops;
pub use network::{canopen_master_ops, canopen_slave_ops};
pub use trace::trace;

/// A fuzz target.
pub type Target = fn(&[u8]);

/// Every target by its name under `fuzz/fuzz_targets` and `fuzz/corpus`.
pub const TARGETS: [(&str, Target); 28] = [
    ("lb2_decode", decode),
    ("lb2_request", request),
    ("lb2_response", response),
    ("lb2_master_ops", master_ops),
    ("lb2_device_ops", device_ops),
    ("sdo_client_ops", sdo_client_ops),
    ("sdo_server_ops", sdo_server_ops),
    ("od_ops", od_ops),
    ("canopen_master_ops", canopen_master_ops),
    ("canopen_slave_ops", canopen_slave_ops),
    ("capture_candump", capture_candump),
    ("capture_asc", capture_asc),
    ("capture_trc", capture_trc),
    ("capture_columns", capture_columns),
    ("capture_pcap", capture_pcap),
    ("capture_lb2", capture_lb2),
    ("trace", trace),
    ("eds_read", eds_read),
    ("xdd_read", xdd_read),
    ("eds_concise", eds_concise),
    ("linmot_pvl", linmot_pvl),
    ("linmot_curve", linmot_curve),
    ("linmot_curve_file", linmot_curve_file),
    ("linmot_table", linmot_table),
    ("linmot_telegrams", linmot_telegrams),
    ("linmot_linrs", linmot_linrs),
    ("linmot_client_ops", linmot_client_ops),
    ("linmot_drive_ops", linmot_drive_ops),
];

/// Takes values from the front of fuzz input; an exhausted input gives zeros.
struct Input<'a>(&'a [u8]);

impl<'a> Input<'a> {
    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn u8(&mut self) -> u8 {
        match self.0.split_first() {
            Some((&byte, rest)) => {
                self.0 = rest;
                byte
            }
            None => 0,
        }
    }

    fn u16(&mut self) -> u16 {
        u16::from_le_bytes([self.u8(), self.u8()])
    }

    fn i32(&mut self) -> i32 {
        i32::from_le_bytes([self.u8(), self.u8(), self.u8(), self.u8()])
    }

    fn bytes(&mut self, len: u8) -> &'a [u8] {
        let (head, rest) = self.0.split_at(usize::from(len).min(self.0.len()));
        self.0 = rest;
        head
    }
}
