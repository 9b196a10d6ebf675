//! Extension module: the process image of a field bus (manual A 6.9).
//!
//! The controller knows sizes and byte order, [`FieldBus`] is what a stack for DeviceNet, InterBus-S,
//! PROFIBUS-DP or Ethernet fills in.

use crate::parameters::Values;

/// Greatest size of an image, bytes (6.9.1).
pub const MAX_IMAGE: usize = 512;

/// Field buses that there are modules for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BusKind {
    /// 6.9.1.
    DeviceNet,
    /// 6.9.2.
    InterBusS,
    /// 6.9.3.
    ProfibusDp,
    /// 6.9.4: sizes as with DeviceNet.
    Ethernet,
}

/// A field bus stack in the extension slot.
pub trait FieldBus {
    /// What it is.
    fn kind(&self) -> BusKind;

    /// Exchanges the images: `output` is what goes to the bus, `input` what came from it. Returns
    /// whether the bus is in data exchange; if it is not, the controller keeps its last input.
    fn exchange(&mut self, output: &[u8], input: &mut [u8]) -> bool;
}

/// Byte order of the numbers in the image, `[056]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ByteOrder {
    /// Least significant byte at the lower address.
    #[default]
    Intel,
    /// Least significant byte at the higher address.
    Motorola,
}

/// The process image between application and field bus.
#[derive(Debug, Clone)]
pub struct ProcessImage {
    order: ByteOrder,
    sizes: (usize, usize),
    input: [u8; MAX_IMAGE],
    output: [u8; MAX_IMAGE],
    live: bool,
}

impl Default for ProcessImage {
    fn default() -> Self {
        Self {
            order: ByteOrder::Intel,
            sizes: (0, 0),
            input: [0; MAX_IMAGE],
            output: [0; MAX_IMAGE],
            live: false,
        }
    }
}

/// Bytes that the choices of `[080]` and `[081]` stand for.
const PROFIBUS: [usize; 8] = [1, 2, 3, 8, 16, 32, 64, 128];

impl ProcessImage {
    /// Takes over byte order and sizes for a module of this kind.
    pub fn configure(&mut self, kind: BusKind, values: &Values) {
        let size = |index| usize::try_from(values.at(index, 0)).unwrap_or(0).min(MAX_IMAGE);
        let choice = |index| PROFIBUS.get(size(index)).copied().unwrap_or(0);
        self.order = if values.at(56, 0) == 0 { ByteOrder::Intel } else { ByteOrder::Motorola };
        self.sizes = match kind {
            BusKind::DeviceNet | BusKind::Ethernet => (size(60), size(61)),
            BusKind::InterBusS => (size(70), size(70)),
            BusKind::ProfibusDp => (choice(80), choice(81)),
        };
    }

    /// Exchanges the images with the bus.
    pub fn exchange(&mut self, bus: &mut impl FieldBus) {
        let (input, output) = self.sizes;
        let mut fresh = [0; MAX_IMAGE];
        let (Some(fresh), Some(out)) = (fresh.get_mut(..input), self.output.get(..output)) else { return };
        self.live = bus.exchange(out, fresh);
        if self.live
            && let Some(input) = self.input.get_mut(..input)
        {
            input.copy_from_slice(fresh);
        }
    }

    /// Whether the bus was in data exchange in the last cycle.
    #[must_use]
    pub const fn is_live(&self) -> bool {
        self.live
    }

    /// What came from the bus, as long as it is configured.
    #[must_use]
    pub fn input(&self) -> &[u8] {
        self.input.get(..self.sizes.0).unwrap_or(&[])
    }

    /// What goes to the bus.
    #[must_use]
    pub fn output(&self) -> &[u8] {
        self.output.get(..self.sizes.1).unwrap_or(&[])
    }

    /// What goes to the bus, to be written.
    pub fn output_mut(&mut self) -> &mut [u8] {
        self.output.get_mut(..self.sizes.1).unwrap_or(&mut [])
    }

    /// A number of 32 bits at a byte offset of the input; `None` where it passes the end.
    #[must_use]
    pub fn read_i32(&self, offset: usize) -> Option<i32> {
        let bytes = self.input().get(offset..)?.first_chunk()?;
        Some(match self.order {
            ByteOrder::Intel => i32::from_le_bytes(*bytes),
            ByteOrder::Motorola => i32::from_be_bytes(*bytes),
        })
    }

    /// A number of 16 bits at a byte offset of the input; `None` where it passes the end.
    #[must_use]
    pub fn read_i16(&self, offset: usize) -> Option<i16> {
        let bytes = self.input().get(offset..)?.first_chunk()?;
        Some(match self.order {
            ByteOrder::Intel => i16::from_le_bytes(*bytes),
            ByteOrder::Motorola => i16::from_be_bytes(*bytes),
        })
    }

    /// Puts a number of 32 bits at a byte offset of the output; false where it passes the end.
    pub fn write_i32(&mut self, offset: usize, value: i32) -> bool {
        let bytes = match self.order {
            ByteOrder::Intel => value.to_le_bytes(),
            ByteOrder::Motorola => value.to_be_bytes(),
        };
        self.put(offset, &bytes)
    }

    /// Puts a number of 16 bits at a byte offset of the output; false where it passes the end.
    pub fn write_i16(&mut self, offset: usize, value: i16) -> bool {
        let bytes = match self.order {
            ByteOrder::Intel => value.to_le_bytes(),
            ByteOrder::Motorola => value.to_be_bytes(),
        };
        self.put(offset, &bytes)
    }

    fn put(&mut self, offset: usize, bytes: &[u8]) -> bool {
        let Some(to) = self.output_mut().get_mut(offset..offset.saturating_add(bytes.len())) else {
            return false;
        };
        to.copy_from_slice(bytes);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    struct Echo {
        kind: BusKind,
        live: bool,
        seen: Vec<u8>,
        /// Sizes of output and input.
        sizes: (usize, usize),
    }

    impl FieldBus for Echo {
        fn kind(&self) -> BusKind {
            self.kind
        }

        fn exchange(&mut self, output: &[u8], input: &mut [u8]) -> bool {
            self.sizes = (output.len(), input.len());
            self.seen = output.to_vec();
            for (to, from) in input.iter_mut().zip(output) {
                *to = *from;
            }
            self.live
        }
    }

    fn run(kind: BusKind, changes: &[(u16, i32)]) -> (ProcessImage, Echo) {
        let mut values = Values::factory();
        for &(index, value) in changes {
            values.set(index, value).unwrap();
        }
        let mut image = ProcessImage::default();
        image.configure(kind, &values);
        let mut bus = Echo { kind, live: true, seen: Vec::new(), sizes: (0, 0) };
        image.write_i32(0, 0x0102_0304);
        image.write_i16(4, 0x0506);
        image.exchange(&mut bus);
        (image, bus)
    }

    /// `[056]`: LSB first or last.
    #[test]
    fn parameter_056_is_the_byte_order() {
        let sizes = [(60, 8), (61, 8)];
        for (order, bytes) in [(0, [4, 3, 2, 1, 6, 5, 0, 0]), (1, [1, 2, 3, 4, 5, 6, 0, 0])] {
            let (image, bus) = run(BusKind::DeviceNet, &[sizes[0], sizes[1], (56, order)]);
            assert_eq!(bus.seen, bytes);
            assert_eq!((image.read_i32(0), image.read_i16(4)), (Some(0x0102_0304), Some(0x0506)));
            assert_eq!((image.read_i32(5), image.read_i16(7)), (None, None));
        }
    }

    /// `[060]`, `[061]`: DeviceNet and Ethernet; 0 = inactive.
    #[test]
    fn parameters_060_and_061_are_the_sizes_of_devicenet_and_ethernet() {
        for kind in [BusKind::DeviceNet, BusKind::Ethernet] {
            assert_eq!(run(kind, &[(60, 3), (61, 512)]).1.sizes, (512, 3));
            assert_eq!(run(kind, &[]).1.sizes, (0, 0));
        }
    }

    /// `[070]`: InterBus-S has one size for both.
    #[test]
    fn parameter_070_is_the_size_of_interbus() {
        assert_eq!(run(BusKind::InterBusS, &[(70, 20), (60, 5)]).1.sizes, (20, 20));
    }

    /// `[080]`, `[081]`: PROFIBUS-DP, as printed.
    #[test]
    fn parameters_080_and_081_are_the_sizes_of_profibus() {
        for (choice, bytes) in [1, 2, 3, 8, 16, 32, 64, 128].into_iter().enumerate() {
            let (_, bus) = run(BusKind::ProfibusDp, &[(80, choice as i32), (81, 7)]);
            assert_eq!(bus.sizes, (128, bytes));
        }
    }

    #[test]
    fn a_silent_bus_leaves_the_last_input() {
        let (mut image, mut bus) = run(BusKind::Ethernet, &[(60, 4), (61, 4)]);
        image.write_i32(0, 9);
        bus.live = false;
        image.exchange(&mut bus);
        assert_eq!((image.is_live(), image.read_i32(0)), (false, Some(0x0102_0304)));
    }
}
