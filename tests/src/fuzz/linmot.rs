//! LinMot files, blocks and telegrams.

use linmot::curve::{INFO_WORDS, InfoBlock, resample, sine};
use linmot::linrs::{self, Checksum, Decoder, MAX_FRAME};
use linmot::module::{Input as ModuleInput, Output};
use linmot::pvl::{Event, LineDecoder, Parser, Severity, Writer};
use linmot::request::Request;
use linmot::sdo::{Access, Answer};
use linmot::table::{ENTRY_SIZE, Entry, Presence, check_links};

use super::Input;

fn events(bytes: &[u8]) -> Vec<Event> {
    let (mut parser, mut decoder, mut events) = (Parser::new(), LineDecoder::new(), Vec::new());
    for line in bytes.split(|byte| *byte == b'\n') {
        parser.line(&decoder.decode(line), &mut |event| events.push(event));
    }
    parser.finish(&mut |event| events.push(event));
    events
}

/// Reads a PVL file of any bytes. What has no error, written again, reads the same.
pub fn linmot_pvl(data: &[u8]) {
    let found = events(data);
    let is_error = |event: &Event| matches!(event, Event::Problem { severity: Severity::Error, .. });
    if found.iter().any(is_error) {
        return;
    }
    let found: Vec<Event> =
        found.into_iter().filter(|event| !matches!(event, Event::Problem { .. })).collect();
    let mut writer = Writer::new(String::new()).unwrap();
    for event in &found {
        match event {
            Event::Section { layer, identity } => writer.section(layer.unwrap(), *identity).unwrap(),
            Event::Parameter { upid, value } => writer.parameter(*upid, *value, "caption", "1").unwrap(),
            Event::Curve(info) => writer.curve(info, "name").unwrap(),
            Event::Setpoint(setpoint) => writer.setpoint(*setpoint).unwrap(),
            Event::EndSection { .. } | Event::EndCurve { .. } => writer.end().unwrap(),
            other => panic!("{other:?}"),
        }
    }
    let again: Vec<Event> = events(writer.into_inner().as_bytes())
        .into_iter()
        .filter(|event| !matches!(event, Event::Problem { severity: Severity::Warning, .. }))
        .collect();
    // A file of empty objects has nothing to write.
    if !found.is_empty() {
        assert_eq!(again, found);
    }
}

/// Curve blocks, table entries, links, and the telegrams of all carriers, from any bytes.
pub fn linmot_parse(data: &[u8]) {
    let mut input = Input(data);
    match input.u8() % 6 {
        0 => {
            let mut words = [0; INFO_WORDS];
            words.iter_mut().for_each(|word| *word = input.i32() as u32);
            let info = InfoBlock::parse(&words);
            assert_eq!(InfoBlock::parse(&info.encode()), info);
            let setpoint = input.u16();
            assert!(info.x(setpoint) <= info.x_length || setpoint >= info.setpoints || info.setpoints < 2);
            let (start, end) = (input.i32(), input.i32());
            let found = sine(start, end, setpoint.min(info.setpoints), info.setpoints);
            assert!((start.min(end)..=start.max(end)).contains(&found) || setpoint >= info.setpoints.max(2));
        }
        1 => {
            let points: Vec<(f64, f64)> =
                (0..input.u8() % 8).map(|_| (f64::from(input.i32()), f64::from(input.i32()))).collect();
            let found = resample(&points, input.u16(), input.u16());
            assert_eq!(found.is_none(), points.is_empty());
        }
        2 => {
            if let Ok(entry) = Entry::parse(input.bytes(ENTRY_SIZE as u8)) {
                assert_eq!(Entry::from_words(&entry.words()), Ok(entry));
                assert!(entry.name().len() <= 16);
            }
        }
        3 => {
            let mut presence = Presence::default();
            (0..8).for_each(|list| presence.set_list(list, input.i32() as u32));
            let links: Vec<u16> = (0..256).map(|_| u16::from(input.u8())).collect();
            let mut faults = 0;
            check_links(&presence, |entry| links.get(usize::from(entry)).copied(), |_| faults += 1);
            assert!(faults <= presence.iter().count());
        }
        4 => {
            let mut telegram = [0; 8];
            telegram.iter_mut().for_each(|byte| *byte = input.u8());
            if let Some(access) = Access::parse(telegram) {
                assert_eq!(Access::parse(access.encode()), Some(access));
                if let Some(request) = access.request(false) {
                    // Bytes of a write that mean nothing to its command are not kept.
                    let again = Access::new(&request).and_then(|access| access.request(false));
                    assert_eq!(again, Some(request));
                }
            }
            if let Some((index, sub, answer)) = Answer::parse(telegram) {
                assert_eq!(Answer::parse(answer.encode(index, sub)), Some((index, sub, answer)));
            }
            assert_eq!(Output::parse(Output::parse(telegram).encode()), Output::parse(telegram));
            assert_eq!(
                ModuleInput::parse(ModuleInput::parse(telegram).encode()),
                ModuleInput::parse(telegram)
            );
        }
        _ => frames(&mut input),
    }
}

/// Any bytes in any pieces: every byte ends up in a frame or is counted as discarded.
fn frames(input: &mut Input<'_>) {
    let checksum = [Checksum::None, Checksum::Sum, Checksum::Crc][usize::from(input.u8() % 3)];
    let mut decoder = Decoder::new(checksum);
    let (mut given, mut framed) = (0, 0);
    let mut take = |decoder: &mut Decoder, mut bytes: &[u8]| {
        loop {
            let (taken, found) = decoder.decode(bytes);
            bytes = &bytes[taken..];
            let Some(message) = found else { return };
            let mut out = [0; MAX_FRAME];
            framed += message.encode(checksum, &mut out) as u64;
            if let Some(request) = linrs::request(&message) {
                let again = linrs::request(&linrs::telegram(message.id, &request));
                let text = matches!(request, Request::ErrorText { .. });
                assert!(again == Some(request) || text);
            }
        }
    };
    while !input.is_empty() {
        let len = input.u8() % 80;
        let piece = input.bytes(len);
        given += piece.len() as u64;
        take(&mut decoder, piece);
        if len.is_multiple_of(7) {
            decoder.gap();
            take(&mut decoder, &[]);
        }
    }
    while decoder.in_frame() {
        decoder.gap();
        take(&mut decoder, &[]);
    }
    assert_eq!(given, framed + decoder.discarded());
}
