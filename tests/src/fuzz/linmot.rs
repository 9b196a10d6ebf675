//! LinMot files, blocks and telegrams.

use linmot::curve::{INFO_WORDS, InfoBlock, Profile, resample};
use linmot::linrs::{self, Checksum, Decoder, MAX_FRAME};
use linmot::module::{Input as ModuleInput, Output};
use linmot::pvl::{Event, LineDecoder, Parser, Severity, Writer};
use linmot::request::Request;
use linmot::sdo::{self, Access, Answer};
use linmot::table::{ENTRY_SIZE, Entry, LISTS, LinkFault, Presence, check_links};
use motion_io::linmot::curve_file;

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

/// Curve info blocks and setpoints from any bytes.
pub fn linmot_curve(data: &[u8]) {
    let mut input = Input(data);
    let mut words = [0; INFO_WORDS];
    words.iter_mut().for_each(|word| *word = input.i32() as u32);
    let info = InfoBlock::parse(&words);
    assert_eq!(InfoBlock::parse(&info.encode()), info);
    let number = input.u16();
    assert!(info.x(number) <= info.x_length || number >= info.setpoints || info.setpoints < 2);
    if info.check().is_ok() {
        assert!(info.data_size() <= u32::from(u16::MAX) && (1..=100).contains(&info.id));
        assert_eq!((info.x(0), info.x(info.setpoints - 1)), (0, info.x_length));
    }
    let (start, end) = (input.i32(), input.i32());
    for profile in Profile::ALL {
        let found = profile.setpoint(start, end, number, info.setpoints);
        assert!((start.min(end)..=start.max(end)).contains(&found));
    }
    let points: Vec<(f64, f64)> =
        (0..input.u8() % 8).map(|_| (f64::from(input.i32()), f64::from(input.i32()))).collect();
    let found = resample(&points, input.u16(), input.u16());
    assert_eq!(found.is_none(), points.is_empty());
    let ascends = points.is_sorted_by(|left, right| left.0 < right.0);
    if let Some(found) = found.filter(|_| ascends) {
        let between = |found: f64| {
            points.iter().any(|point| point.1 <= found) && points.iter().any(|point| point.1 >= found)
        };
        assert!(between(f64::from(found)), "{found} in {points:?}");
    }
}

/// A curve file of any bytes. One that can be read, written again, reads the same.
pub fn linmot_curve_file(data: &[u8]) {
    let mut input = Input(data);
    let id = u16::from(input.u8());
    let Ok((info, setpoints)) = curve_file::read(&mut &*input.0, id) else { return };
    assert!(info.check().is_ok() && usize::from(info.setpoints) == setpoints.len() && info.id == id);
    let mut file = Vec::new();
    curve_file::write(&mut file, &info, &setpoints).unwrap();
    assert_eq!(curve_file::read(&mut file.as_slice(), id).unwrap(), (info, setpoints));
}

/// Command table entries, presence lists and links from any bytes.
pub fn linmot_table(data: &[u8]) {
    let mut input = Input(data);
    let mut presence = Presence::default();
    (0..LISTS).for_each(|list| presence.set_list(list, input.i32() as u32));
    assert!(!presence.contains(0) && !presence.contains(256));
    let mut again = Presence::default();
    (0..LISTS).for_each(|list| again.set_list(list, presence.list(list)));
    assert_eq!(again, presence);
    let exist: Vec<u16> = presence.iter().collect();
    let links: Vec<u16> = (0..256).map(|_| u16::from(input.u8())).collect();
    let linked = |entry: u16| links.get(usize::from(entry)).copied();
    let (mut missing, mut in_loops) = (0, 0);
    check_links(&presence, linked, |fault| match fault {
        LinkFault::Missing { entry, linked: to } => {
            assert!(presence.contains(entry) && !presence.contains(to) && linked(entry) == Some(to));
            missing += 1;
        }
        LinkFault::Loop { entry, length } => {
            // Following the links as often as the loop is long leads back, and not before.
            let way: Vec<u16> =
                core::iter::successors(Some(entry), |at| linked(*at)).take(usize::from(length) + 1).collect();
            assert_eq!(way.last(), Some(&entry));
            assert!(way[1..way.len() - 1].iter().all(|at| *at > entry));
            in_loops += usize::from(length);
        }
        other => panic!("{other:?}"),
    });
    assert_eq!(missing, exist.iter().filter(|entry| !presence.contains(links[usize::from(**entry)])).count());
    assert!(missing + in_loops <= exist.len());
    while !input.is_empty() {
        if let Ok(entry) = Entry::parse(input.bytes(ENTRY_SIZE as u8)) {
            assert_eq!(Entry::from_words(&entry.words()), Ok(entry));
            assert!(entry.name().len() <= 16);
            let mut other = entry;
            other.link(entry.linked());
            assert_eq!(other, entry);
        }
    }
}

/// Telegrams of SDO and of the configuration module from any bytes.
pub fn linmot_telegrams(data: &[u8]) {
    let mut input = Input(data);
    let mut client = sdo::Client::new();
    while !input.is_empty() {
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
            let output = Output::parse(telegram);
            if let Some(request) = Request::parse(output.command, output.words) {
                let _ = client.reply(&request, answer);
            }
        }
        assert_eq!(Output::parse(Output::parse(telegram).encode()), Output::parse(telegram));
        assert_eq!(ModuleInput::parse(ModuleInput::parse(telegram).encode()), ModuleInput::parse(telegram));
    }
}

/// LinRS from any bytes in any pieces: every byte ends up in a frame or is counted as discarded.
pub fn linmot_linrs(data: &[u8]) {
    let mut input = Input(data);
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
                // Words of a tunnelled command that mean nothing to it are not kept.
                let again = linrs::request(&linrs::telegram(message.id, &request)).expect("a command");
                assert_eq!(again.command(), request.command());
                let third = linrs::request(&linrs::telegram(message.id, &again));
                assert_eq!(third, Some(again));
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
