//! A dictionary and PDOs as one: what an SDO client sees, and what a slave works on.

use core::time::Duration;

use pdo::{Address, Frame, Handled, RpdoFault};

use super::pdos::{Parameter, Pdos};
use crate::data_type::DataType;
use crate::sdo::{AbortCode, Access, Piece, Total, read_slice};
use crate::slave;

/// The objects that PDOs carry: a dictionary's part in [`Pdos`].
pub trait ProcessData {
    /// Type of an object that an RPDO (else a TPDO) may carry.
    ///
    /// # Errors
    /// For the client that wants to map it: [`AbortCode::NO_OBJECT`], [`AbortCode::NOT_MAPPABLE`].
    fn mapped_type(&self, at: Address, rpdo: bool) -> Result<DataType, AbortCode>;

    /// The value for a TPDO; bits beyond the mapped width are cut off.
    fn bits(&self, at: Address) -> u64;

    /// A value from an RPDO. One that the object does not take leaves it as it was.
    fn set_bits(&mut self, at: Address, bits: u64);
}

/// A dictionary, such as a [`Dictionary`](super::Dictionary), and PDO parameters as a server serves them;
/// [`Slave`](crate::slave::Slave) moves the process data between both.
#[derive(Debug)]
pub struct Objects<D, const R: usize, const T: usize, const M: usize> {
    /// Everything but 1400h…1BFFh.
    pub dictionary: D,
    /// 1400h…1BFFh.
    pub pdos: Pdos<R, T, M>,
}

impl<D: Access + ProcessData, const R: usize, const T: usize, const M: usize> Access for Objects<D, R, T, M> {
    #[inline]
    fn read(&mut self, at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        match Parameter::of(at) {
            None => self.dictionary.read(at, offset, out),
            Some(parameter) => {
                let (value, size) = self.pdos.read(parameter)?;
                Ok(read_slice(value.to_le_bytes().get(..size).unwrap_or(&[]), offset, out))
            }
        }
    }

    fn begin_write(&mut self, at: Address, size: Option<u32>) -> Result<(), AbortCode> {
        match Parameter::of(at) {
            None => self.dictionary.begin_write(at, size),
            Some(parameter) => self.pdos.read(parameter).map(|_| ()),
        }
    }

    fn write(&mut self, at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        let Some(parameter) = Parameter::of(at) else { return self.dictionary.write(at, piece) };
        let (_, size) = self.pdos.read(parameter)?;
        let value = piece.exactly(size)?.iter().rev().fold(0, |value, &byte| value << 8 | u32::from(byte));
        self.pdos.write(parameter, value, &self.dictionary)
    }

    fn abandon(&mut self, at: Address) {
        self.dictionary.abandon(at);
    }
}

impl<D: Access + ProcessData, const R: usize, const T: usize, const M: usize> slave::Objects
    for Objects<D, R, T, M>
{
    fn start(&mut self, _now: Duration) {
        self.pdos.start();
    }

    fn stop(&mut self) {
        self.pdos.stop();
    }

    fn handle_frame(&mut self, now: Duration, frame: &Frame) -> Handled {
        self.pdos.handle_frame(now, frame)
    }

    fn handle_sync(&mut self, counter: Option<u8>) {
        self.pdos.handle_sync(counter, &self.dictionary);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.pdos.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        self.pdos.poll_transmit(now, &self.dictionary)
    }

    fn poll_event(&mut self) -> Option<(usize, Result<(), RpdoFault>)> {
        self.pdos.poll_event(&mut self.dictionary)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.pdos.poll_timeout()
    }
}
