//! The writer, line by line, in the form of manual B's figures 12 and 13.

use core::fmt::{Result, Write};

use crate::curve::{INFO_WORDS, InfoBlock};
use crate::upid::{Layer, TreeIdentity, Upid};

/// Writes a file to anything that takes text. Call the methods in the order of the file.
#[derive(Debug)]
pub struct Writer<W>(W);

const END: &str = "\r\n";

impl<W: Write> Writer<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// Those of `out`, here and in every method.
    pub fn new(mut out: W) -> core::result::Result<Self, core::fmt::Error> {
        write!(out, "@FileType PVL{END}@FormatVersion 1{END}")?;
        Ok(Self(out))
    }

    /// What the file was written to.
    pub fn into_inner(self) -> W {
        self.0
    }

    /// What the file is written to.
    pub const fn inner(&mut self) -> &mut W {
        &mut self.0
    }

    /// Begins the parameters of a layer.
    ///
    /// # Errors
    /// Those of the output.
    pub fn section(&mut self, layer: Layer, identity: TreeIdentity) -> Result {
        let TreeIdentity { tree_id, main_version, sub_version } = identity;
        let number = layer.number();
        write!(
            self.0,
            "@StartObject Parameter{END}@TreeLayer {number}{END}@TreeID {tree_id}{END}\
             @MainVersion {main_version}{END}@SubVersion {sub_version}{END}@StartData{END}\
             @Col1 UPID @Col2 Value @Col3 Caption @Col4 ScaledValue Unit{END}"
        )
    }

    /// One parameter; `caption` and `scaled` are for people.
    ///
    /// # Errors
    /// Those of the output.
    pub fn parameter(&mut self, upid: Upid, value: u32, caption: &str, scaled: &str) -> Result {
        write!(self.0, "{upid}, {value:08X}h, {caption}, {scaled}{END}")
    }

    /// Ends a layer or a curve.
    ///
    /// # Errors
    /// Those of the output.
    pub fn end(&mut self) -> Result {
        write!(self.0, "@EndData{END}@EndObject{END}")
    }

    /// Begins a curve; its setpoints follow.
    ///
    /// # Errors
    /// Those of the output.
    pub fn curve(&mut self, info: &InfoBlock, name: &str) -> Result {
        let (id, info_size, data_size) = (info.id, INFO_WORDS * 4, info.data_size());
        write!(
            self.0,
            "@StartObject Curve{END}@CurveName {name}{END}@CurveID {id}{END}\
             @InfoBlockByteSize {info_size}{END}@DataBlockByteSize {data_size}{END}\
             @StartInfo{END}@Col1 Value{END}"
        )?;
        for word in info.encode() {
            write!(self.0, "{word:08X}h{END}")?;
        }
        write!(self.0, "@EndInfo{END}@StartData{END}@Col1 Value{END}")
    }

    /// One setpoint of the curve.
    ///
    /// # Errors
    /// Those of the output.
    pub fn setpoint(&mut self, setpoint: i32) -> Result {
        write!(self.0, "{:08X}h{END}", setpoint as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pvl::{Event, Parser};
    use proptest::prelude::*;
    use std::{string::String, vec::Vec};

    proptest! {
        #[test]
        fn what_is_written_is_read(
            rows in proptest::collection::btree_map(0x1000u16..0x1EFF, any::<u32>(), 0..40),
            id in 1u16..=100, length in 1u32.., setpoints in proptest::collection::vec(any::<i32>(), 2..40),
        ) {
            let identity = TreeIdentity { tree_id: 4612, main_version: 3, sub_version: 0 };
            let info = InfoBlock::cam(id, "a name", length, setpoints.len() as u16).unwrap();
            let mut writer = Writer::new(String::new()).unwrap();
            let mut expected = Vec::from([Event::Section { layer: Some(Layer::MotionControl), identity }]);
            writer.section(Layer::MotionControl, identity).unwrap();
            for (upid, value) in &rows {
                writer.parameter(Upid(*upid), *value, "Motion Control SW", "1, 2").unwrap();
                expected.push(Event::Parameter { upid: Upid(*upid), value: *value });
            }
            writer.end().unwrap();
            expected.push(Event::EndSection { parameters: rows.len() });
            writer.curve(&info, "a name").unwrap();
            expected.push(Event::Curve(info));
            for setpoint in &setpoints {
                writer.setpoint(*setpoint).unwrap();
                expected.push(Event::Setpoint(*setpoint));
            }
            writer.end().unwrap();
            expected.push(Event::EndCurve { setpoints: setpoints.len() });
            let (mut parser, mut events) = (Parser::new(), Vec::new());
            let text = writer.into_inner();
            text.lines().for_each(|line| parser.line(line, &mut |event| events.push(event)));
            parser.finish(&mut |event| events.push(event));
            prop_assert_eq!(events, expected);
        }
    }
}
