//! Parameter trees of virtual drives.

use linmot::code::ParameterType;
use linmot::drive::Parameter;
use linmot::upid::{Layer, STRINGLETS, Upid, Usage};

/// Read-only value, not used for the hash.
const VARIABLE: Usage = Usage(0x1005);
/// ROM can be written, RAM follows at the next start.
const STORED: Usage = Usage(0x000D);
/// Both can be written, RAM acts at once.
const LIVE: Usage = Usage(0x010F);

fn parameter(upid: u16, kind: ParameterType, usage: Usage, range: (u32, u32), default: u32) -> Parameter {
    Parameter { upid: Upid(upid), kind, usage, minimum: range.0, maximum: range.1, default }
}

/// A string and its stringlets.
fn string(upid: Upid, text: &[u8]) -> impl Iterator<Item = Parameter> {
    let own = parameter(upid.0, ParameterType::STRING, Usage::default(), (0, 0), 0);
    let stringlets = (0..STRINGLETS).map(move |number| (number, linmot::upid::stringlet(text, number)));
    let parts: Vec<Parameter> = stringlets
        .filter_map(|(number, default)| {
            let upid = upid.stringlet(number)?;
            Some(parameter(upid.0, ParameterType::STRINGLET, STORED, (0, u32::MAX), default))
        })
        .collect();
    core::iter::once(own).chain(parts)
}

/// The tree of a drive with CANopen and LinRS interface. UPIDs and types are those that manual B and
/// the LinRS manual name (motor definitions, position controller, strings, identification); values of
/// the identification and the application's parameters are project-defined.
#[must_use]
pub fn sg5() -> Vec<Parameter> {
    use ParameterType as T;
    let identity = |layer: Layer, values: [u32; 3]| {
        layer
            .identity()
            .into_iter()
            .zip(values)
            .map(|(upid, value)| parameter(upid.0, T::U16, VARIABLE, (0, 0xFFFF), value))
    };
    let mut tree = Vec::new();
    tree.extend(string(Upid::DRIVE_NAME, b"MyController"));
    tree.extend(string(Upid::USER_COMMENT, b""));
    for (layer, values) in Layer::ALL.into_iter().zip([[1, 3, 0], [4612, 3, 0], [257, 3, 5], [513, 1, 0]]) {
        tree.extend(identity(layer, values));
    }
    tree.extend([
        parameter(0x1194, T::U16, STORED, (0, 100), 0),
        parameter(0x119E, T::U16, STORED, (0, 32_000), 8000),
        parameter(0x119F, T::U16, STORED, (0, 10_000), 115),
        parameter(0x11A0, T::U16, STORED, (0, 10_000), 70),
        parameter(0x11A1, T::U16, STORED, (0, 65_535), 2380),
        parameter(0x11A2, T::S32, STORED, (-10_000_000i32 as u32, 10_000_000), 650_000),
        parameter(0x11A3, T::S32, STORED, (0, 10_000_000), 1_000_000),
        parameter(0x11A4, T::S32, STORED, (0, 10_000_000), 1_000_000),
        parameter(0x11A5, T::U16, STORED, (0, 65_535), 2380),
        parameter(0x13A0, T::S16, LIVE, (-32_000i16 as u16 as u32, 32_000), 0),
        parameter(0x13A2, T::U16, LIVE, (0, 65_535), 10),
        parameter(0x13A3, T::U16, LIVE, (0, 65_535), 30),
        parameter(0x13A4, T::U16, LIVE, (0, 65_535), 0),
        parameter(0x13A5, T::U16, LIVE, (0, 32_000), 8000),
        parameter(0x1B62, T::S32, Usage(0x1001), (i32::MIN as u32, i32::MAX as u32), 0),
        parameter(0x2008, T::RADIO_DIR_BIT, STORED, (0, 1), 1),
        parameter(0x2080, T::ENUM_DIR8, STORED, (0, 2), 0),
        parameter(0x20A0, T::U8, STORED, (1, 127), 1),
        parameter(0x20A1, T::BOOL, STORED, (0, 1), 0),
        parameter(0x2136, T::U16, Usage(0x1001), (0, 0xFFFF), 0),
        parameter(0x3000, T::S32, LIVE, (i32::MIN as u32, i32::MAX as u32), 0),
        parameter(0x3001, T::S8, STORED, (-100i8 as u8 as u32, 100), -5i8 as u8 as u32),
        parameter(0x3002, T::U32, STORED, (0, u32::MAX), 0xFFFF_FFFF),
    ]);
    tree.sort_by_key(|parameter| parameter.upid);
    tree
}

/// [`sg5`] with more parameters, spread over the layers, so that `count` can be written.
#[must_use]
pub fn generated(count: usize) -> Vec<Parameter> {
    let mut tree = sg5();
    let writable = |tree: &[Parameter]| tree.iter().filter(|p| p.usage.contains(Usage::ROM_WRITE)).count();
    let missing = count.saturating_sub(writable(&tree));
    let ranges = [0x1400..0x1B00u16, 0x2200..0x2E00, 0x3100..0x3E00];
    let free = (0..).flat_map(|n| {
        ranges.clone().map(|range| (range.contains(&(range.start + n))).then(|| range.start + n))
    });
    tree.extend(free.take(3 * usize::from(u16::MAX / 4)).flatten().take(missing).map(|upid| {
        let usage = if upid % 3 == 0 { LIVE } else { STORED };
        parameter(upid, ParameterType::U32, usage, (0, u32::MAX), u32::from(upid) * 3)
    }));
    tree.sort_by_key(|parameter| parameter.upid);
    tree
}
