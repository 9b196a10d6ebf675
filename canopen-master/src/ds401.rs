//! CiA 401, generic I/O: device type, object numbers, filters of the digital image.

/// Low word of the device type (1000h).
pub const PROFILE: u16 = 0x0191;

/// Digital inputs in groups of 8, UNSIGNED8.
pub const DIGITAL_INPUTS: u16 = 0x6000;
/// Polarity of the digital inputs in groups of 8: 1 = inverted.
pub const INPUT_POLARITY: u16 = 0x6002;
/// Digital outputs in groups of 8, UNSIGNED8.
pub const DIGITAL_OUTPUTS: u16 = 0x6200;
/// Polarity of the digital outputs in groups of 8: 1 = inverted.
pub const OUTPUT_POLARITY: u16 = 0x6202;
/// Digital outputs, error mode: 1 = take the error value, 0 = keep.
pub const OUTPUT_ERROR_MODE: u16 = 0x6206;
/// Digital outputs, error value.
pub const OUTPUT_ERROR_VALUE: u16 = 0x6207;
/// Analogue inputs, INTEGER16, left aligned.
pub const ANALOGUE_INPUTS: u16 = 0x6401;
/// Analogue outputs, INTEGER16, left aligned.
pub const ANALOGUE_OUTPUTS: u16 = 0x6411;
/// Analogue inputs cause TPDOs only while this BOOLEAN is true.
pub const ANALOGUE_INTERRUPT_ENABLE: u16 = 0x6423;
/// Analogue inputs: how far a value must move to cause a TPDO, UNSIGNED32.
pub const ANALOGUE_DELTA: u16 = 0x6426;

/// What an I/O device has, bits 16…19 of its device type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Functions {
    /// Bit 16.
    pub digital_inputs: bool,
    /// Bit 17.
    pub digital_outputs: bool,
    /// Bit 18.
    pub analogue_inputs: bool,
    /// Bit 19.
    pub analogue_outputs: bool,
}

impl Functions {
    /// From the device type (1000h); `None` where its profile is not CiA 401.
    #[must_use]
    pub const fn parse(device_type: u32) -> Option<Self> {
        if device_type as u16 != PROFILE {
            return None;
        }
        Some(Self {
            digital_inputs: device_type & 1 << 16 != 0,
            digital_outputs: device_type & 1 << 17 != 0,
            analogue_inputs: device_type & 1 << 18 != 0,
            analogue_outputs: device_type & 1 << 19 != 0,
        })
    }

    /// The device type (1000h).
    #[must_use]
    pub const fn device_type(self) -> u32 {
        PROFILE as u32
            | (self.digital_inputs as u32) << 16
            | (self.digital_outputs as u32) << 17
            | (self.analogue_inputs as u32) << 18
            | (self.analogue_outputs as u32) << 19
    }
}

/// One group of 8 digital outputs of a device: what its terminals show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct OutputGroup {
    /// 6200h.
    pub value: u8,
    /// 6202h.
    pub polarity: u8,
    /// 6206h.
    pub error_mode: u8,
    /// 6207h.
    pub error_value: u8,
}

impl OutputGroup {
    /// The terminals; `failed`: the node is stopped, has left operational after an error, or has a
    /// device error (CiA 401, 6206h).
    #[must_use]
    pub const fn terminals(&self, failed: bool) -> u8 {
        let value = if failed {
            self.value & !self.error_mode | self.error_value & self.error_mode
        } else {
            self.value
        };
        value ^ self.polarity
    }
}

/// Decides when an analogue input has moved enough to be sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AnalogueDelta {
    sent: Option<i16>,
}

impl AnalogueDelta {
    /// Whether a value is to be sent: the first one, and one that is `delta` (6426h) or more away
    /// from the last one sent; a delta of 0 sends every change.
    pub fn is_due(&mut self, value: i16, delta: u32) -> bool {
        let due = match self.sent {
            None => true,
            Some(sent) => u32::from(value.abs_diff(sent)) >= delta.max(1),
        };
        if due {
            self.sent = Some(value);
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn device_type() {
        let all = Functions::parse(0x000F_0191).unwrap();
        assert!(all.digital_inputs && all.digital_outputs && all.analogue_inputs && all.analogue_outputs);
        assert_eq!(all.device_type(), 0x000F_0191);
        let inputs = Functions { digital_inputs: true, ..Functions::default() };
        assert_eq!(Functions::parse(inputs.device_type()), Some(inputs));
        assert_eq!(Functions::parse(0x0002_0192), None);
    }

    #[test]
    fn outputs_in_failure() {
        let group = OutputGroup { value: 0xF0, polarity: 0x01, error_mode: 0x0F, error_value: 0x0A };
        assert_eq!((group.terminals(false), group.terminals(true)), (0xF1, 0xFB));
    }

    #[test]
    fn analogue_delta() {
        let mut delta = AnalogueDelta::default();
        let sent: [bool; 5] = [0, 99, 100, i16::MIN, i16::MAX].map(|value| delta.is_due(value, 100));
        assert_eq!(sent, [true, false, true, true, true]);
        assert!(!AnalogueDelta { sent: Some(5) }.is_due(5, 0));
    }
}
