//! A dictionary and PDOs as one: what an SDO client sees, and what a slave works on.

use pdo::Address;

use super::pdos::{Parameter, Pdos};
use crate::data_type::DataType;
use crate::sdo::message::load;
use crate::sdo::{AbortCode, Access, Piece, Total, read_slice};

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
            Some(_) => Ok(read_slice(self.pdos.parameter(at)?.as_slice(), offset, out)),
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
        let value = load(piece.exactly(size)?) as u32;
        self.pdos.write(parameter, value, &self.dictionary)
    }

    fn abandon(&mut self, at: Address) {
        self.dictionary.abandon(at);
    }
}
