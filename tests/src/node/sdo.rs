//! The SDO server, frame by frame: what it must answer and what it must refuse.

use canopen_master::Address;
use canopen_master::data_type::Kind;
use canopen_master::sdo::message::{BlockSegment, Bytes, Content, Request, Response};
use canopen_master::sdo::{AbortCode, Block, Channel, Options, Outcome};

use super::tester::{Checked, SILENCE, Tester, reads, writes};
use super::words::{bytes, said, segment};
use super::{Check, Problem, check, fail, skip};

const DEVICE_TYPE: Address = Address::new(0x1000, 0);

pub(super) const CHECKS: &[Check] = &[
    check(
        "sdo.mandatory",
        "CiA 301, 7.5.2.1, 7.5.2.2, 7.5.2.21",
        "1000h, 1001h and 1018h:00, :01 can be read and have 4, 1, 1 and 4 bytes",
        "",
        mandatory,
    ),
    check(
        "sdo.expedited-upload",
        "CiA 301, 7.2.4.3.5",
        "4 bytes come in one answer that names the object and the number of bytes",
        "",
        expedited_upload,
    ),
    check(
        "sdo.no-object",
        "CiA 301, 7.2.4.3.17",
        "Reading and writing an object that does not exist is refused with 06020000h",
        "tries to write an object that does not exist",
        no_object,
    ),
    check(
        "sdo.no-sub-index",
        "CiA 301, 7.2.4.3.17",
        "A sub-index that does not exist is refused with 06090011h",
        "",
        no_sub_index,
    ),
    check(
        "sdo.read-only",
        "CiA 301, 7.2.4.3.17",
        "Writing a read-only object is refused with 06010002h",
        "tries to write 1000h",
        read_only,
    ),
    check(
        "sdo.write-only",
        "CiA 301, 7.2.4.3.17",
        "Reading a write-only object is refused with 06010001h",
        "",
        write_only,
    ),
    check(
        "sdo.too-long",
        "CiA 301, 7.2.4.3.17",
        "Data longer than the object are refused with 06070010h or 06070012h and change nothing",
        "tries to write a communication object",
        too_long,
    ),
    check(
        "sdo.too-short",
        "CiA 301, 7.2.4.3.17",
        "Data shorter than the object are refused with 06070010h or 06070013h and change nothing",
        "tries to write a communication object",
        too_short,
    ),
    check(
        "sdo.command-specifier",
        "CiA 301, 7.2.4.3.17",
        "A command specifier that does not exist is refused with 05040001h",
        "",
        command_specifier,
    ),
    check(
        "sdo.segment-out-of-place",
        "CiA 301, 7.2.4.3.17",
        "A segment without a transfer is refused with 05040001h",
        "",
        segment_out_of_place,
    ),
    check("sdo.abort-unanswered", "CiA 301, 7.2.4.3.17", "An abort is not answered", "", abort_unanswered),
    check(
        "sdo.segmented-upload",
        "CiA 301, 7.2.4.3.6",
        "A text longer than 4 bytes comes in segments: toggle bits alternate, the size is as announced",
        "",
        segmented_upload,
    ),
    check(
        "sdo.upload-toggle",
        "CiA 301, 7.2.4.3.6",
        "A request with the wrong toggle bit ends an upload with 05030000h",
        "",
        upload_toggle,
    ),
    check(
        "sdo.segmented-download",
        "CiA 301, 7.2.4.3.4",
        "What was read is written back in segments and is there",
        "writes a communication object with its own value",
        segmented_download,
    ),
    check(
        "sdo.download-toggle",
        "CiA 301, 7.2.4.3.4",
        "A segment with the wrong toggle bit ends a download with 05030000h and changes nothing",
        "begins to write a communication object",
        download_toggle,
    ),
    check(
        "sdo.client-abort",
        "CiA 301, 7.2.4.3.17",
        "After the client's abort the transfer is over and the next one works",
        "",
        client_abort,
    ),
    check(
        "sdo.restart",
        "CiA 301, 7.2.4.2",
        "A new request in the middle of a transfer begins anew",
        "",
        restart,
    ),
];

pub(super) const BLOCKS: &[Check] = &[
    check(
        "block.upload",
        "CiA 301, 7.2.4.3.12 to 7.2.4.3.15",
        "A block upload brings the same bytes as a segmented one, segments numbered from 1, CRC right",
        "",
        block_upload,
    ),
    check(
        "block.size-1",
        "CiA 301, 7.2.4.3.12",
        "Sub-blocks have no more segments than the client allows",
        "",
        block_size_one,
    ),
    check(
        "block.retransmission",
        "CiA 301, 7.2.4.2.12",
        "Segments that were not confirmed come again",
        "",
        retransmission,
    ),
    check(
        "block.bad-size",
        "CiA 301, 7.2.4.3.17",
        "A block size of 0 or 128 is refused with 05040002h",
        "",
        bad_block_size,
    ),
    check(
        "block.download",
        "CiA 301, 7.2.4.3.8 to 7.2.4.3.11",
        "What was read is written back in blocks and is there",
        "writes a communication object with its own value",
        block_download,
    ),
    check(
        "block.crc",
        "CiA 301, 7.2.4.3.16",
        "A wrong CRC ends a block download with 05040004h",
        "tries to write a communication object",
        block_crc,
    ),
];

/// An index that the device file has not.
fn absent(tester: &Tester<'_>) -> u16 {
    (0x5F00..=0x5FFF).rev().find(|index| tester.device().object(*index).is_none()).unwrap_or(0x1FFF)
}

/// A communication object of 2 or 4 bytes that does nothing as long as it keeps its value.
fn scratch(tester: &mut Tester<'_>) -> Checked<(Address, Vec<u8>)> {
    let known = [0x1017, 0x100C, 0x1015, 0x1006].map(|index| Address::new(index, 0));
    match known.into_iter().find(|at| tester.is_writable(*at)) {
        Some(at) => Ok((at, tester.read(at)?)),
        None => skip("the device file has none of 1006h, 100Ch, 1015h, 1017h as writable"),
    }
}

/// A text of more than 4 bytes.
fn text(tester: &mut Tester<'_>) -> Checked<(Address, Vec<u8>)> {
    let device = tester.device();
    let known = [0x1008, 0x100A, 0x1009].into_iter().filter_map(|index| device.object(index));
    let objects = known.chain(device.objects.iter().filter(|object| object.index < 0x6000));
    let texts = objects.flat_map(|object| object.entries().iter().map(move |entry| (object.index, entry)));
    let texts = texts.filter(|(_, entry)| {
        let kind = entry.data_type.map(|data_type| device.base_type(data_type).kind());
        reads(entry) && matches!(kind, Some(Kind::VisibleString | Kind::OctetString))
    });
    for (index, entry) in texts.take(20) {
        let at = Address::new(index, entry.subindex);
        match tester.upload(at, &tester.options(false))? {
            (Outcome::Done(5..), data) => return Ok((at, data)),
            (Outcome::Done(_) | Outcome::Aborted(_), _) => {}
            (outcome, _) => return tester.unreadable(at, outcome),
        }
    }
    skip("no text of more than 4 bytes can be read")
}

fn unchanged(tester: &mut Tester<'_>, at: Address, before: &[u8]) -> Checked {
    let after = tester.read(at)?;
    if after == before {
        return Ok(());
    }
    fail(format!("{at} was {} and is now {}", bytes(before), bytes(&after)))
}

fn mandatory(tester: &mut Tester<'_>) -> Checked {
    for (index, sub, size) in [(0x1000, 0, 4), (0x1001, 0, 1), (0x1018, 0, 1), (0x1018, 1, 4)] {
        let data = tester.read(Address::new(index, sub))?;
        if data.len() != size {
            return fail(format!("{index:04X}h:{sub:02X} has {} bytes, {size} expected", data.len()));
        }
    }
    Ok(())
}

fn expedited_upload(tester: &mut Tester<'_>) -> Checked {
    match tester.ask(Request::InitiateUpload { at: DEVICE_TYPE })? {
        Response::InitiateUpload { at, content: Content::Expedited { data, .. } }
            if at == DEVICE_TYPE && data.len() == 4 =>
        {
            Ok(())
        }
        other => fail(format!("{}; an expedited answer of 4 bytes for {DEVICE_TYPE} expected", said(&other))),
    }
}

fn no_object(tester: &mut Tester<'_>) -> Checked {
    let at = Address::new(absent(tester), 0);
    tester.expect_abort(Request::InitiateUpload { at }, &[AbortCode::NO_OBJECT])?;
    let content = Content::Expedited { data: Bytes::new(&[0; 4]).unwrap_or(Bytes::EMPTY), sized: true };
    tester.expect_abort(Request::InitiateDownload { at, content }, &[AbortCode::NO_OBJECT])
}

fn no_sub_index(tester: &mut Tester<'_>) -> Checked {
    let last = tester.device().object(0x1018).and_then(|object| object.subs.last());
    let sub = last.map_or(5, |entry| entry.subindex.saturating_add(1)).max(5);
    tester.expect_abort(Request::InitiateUpload { at: Address::new(0x1018, sub) }, &[AbortCode::NO_SUB_INDEX])
}

fn read_only(tester: &mut Tester<'_>) -> Checked {
    let value = tester.read(DEVICE_TYPE)?;
    let content = Content::Expedited { data: Bytes::new(&value).unwrap_or(Bytes::EMPTY), sized: true };
    tester.expect_abort(Request::InitiateDownload { at: DEVICE_TYPE, content }, &[AbortCode::READ_ONLY])
}

fn write_only(tester: &mut Tester<'_>) -> Checked {
    let objects = &tester.device().objects;
    let all = objects.iter().flat_map(|object| object.entries().iter().map(|entry| (object.index, entry)));
    let only = all.into_iter().find(|(_, entry)| writes(entry) && !reads(entry));
    let Some((index, entry)) = only else { return skip("the device file has no write-only object") };
    let at = Address::new(index, entry.subindex);
    tester.expect_abort(Request::InitiateUpload { at }, &[AbortCode::WRITE_ONLY])
}

fn wrong_length(tester: &mut Tester<'_>, longer: bool) -> Checked {
    let (at, before) = scratch(tester)?;
    let code = if longer { AbortCode::TOO_LONG } else { AbortCode::TOO_SHORT };
    let mut data = before.clone();
    if longer {
        data.push(0);
    } else {
        data.pop();
    }
    let outcome = tester.download(at, &data, &tester.options(false))?;
    unchanged(tester, at, &before)?;
    match outcome {
        Outcome::Aborted(found) if found == code || found == AbortCode::LENGTH => Ok(()),
        other => fail(format!("{at}, {} in place of {} bytes: {other}", data.len(), before.len())),
    }
}

fn too_long(tester: &mut Tester<'_>) -> Checked {
    wrong_length(tester, true)
}

fn too_short(tester: &mut Tester<'_>) -> Checked {
    wrong_length(tester, false)
}

fn command_specifier(tester: &mut Tester<'_>) -> Checked {
    match tester.ask_raw([0xE0, 0, 0x10, 0, 0, 0, 0, 0])?.as_deref().map(Response::parse) {
        Some(Ok(answer)) => tester.is_abort(answer, &[AbortCode::COMMAND]),
        Some(Err(error)) => fail(error.to_string()),
        None => fail("no answer to command specifier 7, abort code 05040001h expected"),
    }
}

fn segment_out_of_place(tester: &mut Tester<'_>) -> Checked {
    tester.expect_abort(Request::UploadSegment { toggle: false }, &[AbortCode::COMMAND])?;
    let segment = Request::DownloadSegment { toggle: false, last: true, data: Bytes::EMPTY };
    tester.expect_abort(segment, &[AbortCode::COMMAND])
}

fn abort_unanswered(tester: &mut Tester<'_>) -> Checked {
    tester.abort(DEVICE_TYPE)?;
    tester.expect_silence(Channel::default_of(tester.node()).response, "after an abort")
}

/// Begins a segmented upload; the size announced.
fn begin_upload(tester: &mut Tester<'_>, at: Address) -> Checked<Option<u32>> {
    match tester.ask(Request::InitiateUpload { at })? {
        Response::InitiateUpload { at: found, content: Content::Segmented(size) } if found == at => Ok(size),
        other => fail(format!("{}; the beginning of a segmented upload of {at} expected", said(&other))),
    }
}

fn segmented_upload(tester: &mut Tester<'_>) -> Checked {
    let checked = run_segmented_upload(tester);
    tester.bad_segments = matches!(checked, Err(Problem::Fail(_)));
    checked
}

fn run_segmented_upload(tester: &mut Tester<'_>) -> Checked {
    let (at, data) = text(tester)?;
    let size = begin_upload(tester, at)?;
    let (mut got, mut toggle) = (Vec::<u8>::new(), false);
    loop {
        match tester.ask(Request::UploadSegment { toggle })? {
            Response::UploadSegment { toggle: found, last, data } if found == toggle => {
                got.extend(data.padded().iter().take(data.len()));
                if last {
                    break;
                }
                if got.len() > data_limit(size) {
                    tester.abort(at)?;
                    return fail("more bytes than announced");
                }
            }
            other => {
                let toggle = u8::from(toggle);
                return fail(format!("{}; a segment with toggle bit {toggle} expected", said(&other)));
            }
        }
        toggle = !toggle;
    }
    if size.is_some_and(|size| size as usize != got.len()) {
        return fail(format!("{} bytes came, {} were announced", got.len(), size.unwrap_or(0)));
    }
    if got == data { Ok(()) } else { fail("two uploads of a text differ") }
}

fn data_limit(size: Option<u32>) -> usize {
    size.map_or(1 << 20, |size| size as usize)
}

fn upload_toggle(tester: &mut Tester<'_>) -> Checked {
    let (at, _) = text(tester)?;
    begin_upload(tester, at)?;
    tester.expect_abort(Request::UploadSegment { toggle: true }, &[AbortCode::TOGGLE])?;
    // And the transfer is over.
    tester.expect_abort(Request::UploadSegment { toggle: false }, &[AbortCode::COMMAND])
}

/// Begins a segmented download of a value that is only one of two or four bytes.
fn begin_download(tester: &mut Tester<'_>, at: Address, size: usize) -> Checked {
    let content = Content::Segmented(Some(size as u32));
    match tester.ask(Request::InitiateDownload { at, content })? {
        Response::InitiateDownload { at: found } if found == at => Ok(()),
        Response::Abort { code, .. } => skip(format!("{at} is not taken in segments: {code}")),
        other => fail(format!("{}; the beginning of a segmented download to {at} expected", said(&other))),
    }
}

fn segment_of(toggle: bool, data: &[u8]) -> Request {
    Request::DownloadSegment { toggle, last: true, data: Bytes::new(data).unwrap_or(Bytes::EMPTY) }
}

fn segmented_download(tester: &mut Tester<'_>) -> Checked {
    let (at, value) = scratch(tester)?;
    begin_download(tester, at, value.len())?;
    match tester.ask(segment_of(false, &value))? {
        Response::DownloadSegment { toggle: false } => unchanged(tester, at, &value),
        other => fail(format!("{}; a confirmed segment with toggle bit 0 expected", said(&other))),
    }
}

fn download_toggle(tester: &mut Tester<'_>) -> Checked {
    let (at, value) = scratch(tester)?;
    begin_download(tester, at, value.len())?;
    tester.expect_abort(segment_of(true, &value), &[AbortCode::TOGGLE])?;
    unchanged(tester, at, &value)
}

fn client_abort(tester: &mut Tester<'_>) -> Checked {
    let (at, data) = text(tester)?;
    begin_upload(tester, at)?;
    tester.abort(at)?;
    tester.expect_abort(Request::UploadSegment { toggle: false }, &[AbortCode::COMMAND])?;
    unchanged(tester, at, &data)
}

fn restart(tester: &mut Tester<'_>) -> Checked {
    let (at, data) = text(tester)?;
    begin_upload(tester, at)?;
    tester.ask(Request::UploadSegment { toggle: false })?;
    let size = tester.read(DEVICE_TYPE)?.len();
    if size != 4 {
        return fail(format!("{DEVICE_TYPE} read in the middle of an upload has {size} bytes, 4 expected"));
    }
    unchanged(tester, at, &data)
}

fn block(block_size: u8, tester: &Tester<'_>) -> Options {
    let block = Block { block_size, threshold: 0, ..Block::default() };
    Options { block: Some(block), ..tester.options(true) }
}

/// Begins a block upload of a text; `None`: the server has no blocks.
fn begin_block_upload(tester: &mut Tester<'_>, block_size: u8) -> Checked<(Address, Vec<u8>)> {
    let (at, data) = text(tester)?;
    match tester.ask(Request::InitiateBlockUpload { at, crc: true, block_size, threshold: 0 })? {
        Response::InitiateBlockUpload { at: found, size, .. } if found == at => match size {
            Some(size) if size as usize != data.len() => {
                tester.abort(at)?;
                fail(format!("{size} bytes announced, {} expected", data.len()))
            }
            _ => Ok((at, data)),
        },
        Response::Abort { code, .. }
            if code == AbortCode::COMMAND || code == AbortCode::UNSUPPORTED_ACCESS =>
        {
            skip(format!("the node has no block upload: {code}"))
        }
        other => {
            tester.abort(at)?;
            fail(format!("{}; the beginning of a block upload of {at} expected", said(&other)))
        }
    }
}

fn block_upload(tester: &mut Tester<'_>) -> Checked {
    let (at, data) = begin_block_upload(tester, 127)?;
    tester.abort(at)?;
    match tester.upload(at, &block(127, tester))? {
        (Outcome::Done(_), found) if found == data => Ok(()),
        (Outcome::Done(_), found) => {
            fail(format!("{} came in blocks, {} in segments", bytes(&found), bytes(&data)))
        }
        (outcome, _) => fail(format!("block upload of {at}: {outcome}")),
    }
}

/// What came, if anything.
fn came(data: Option<&[u8]>) -> String {
    match data {
        Some(data) => Response::parse(data).map_or_else(|_| bytes(data), |answer| said(&answer)),
        None => "no answer".into(),
    }
}

/// The next segment of a sub-block.
fn block_segment(tester: &mut Tester<'_>) -> Checked<BlockSegment> {
    let until = tester.now() + tester.config.answer;
    let data = tester.wait(Channel::default_of(tester.node()).response, until)?;
    match data.as_deref().and_then(BlockSegment::parse) {
        Some(segment) => Ok(segment),
        None => fail(format!("{} in place of a segment of a block", came(data.as_deref()))),
    }
}

fn block_size_one(tester: &mut Tester<'_>) -> Checked {
    let (at, _) = begin_block_upload(tester, 1)?;
    tester.send(Channel::default_of(tester.node()).request, &Request::StartBlockUpload.encode())?;
    let first = block_segment(tester)?;
    let until = tester.now() + SILENCE;
    let more = tester.wait(Channel::default_of(tester.node()).response, until)?;
    tester.abort(at)?;
    if first.sequence != 1 {
        return fail(format!("first segment numbered {}, 1 expected", first.sequence));
    }
    match more {
        Some(data) => {
            let data = bytes(&data);
            fail(format!("{data} after the only segment of a sub-block, before it was confirmed"))
        }
        None => Ok(()),
    }
}

fn retransmission(tester: &mut Tester<'_>) -> Checked {
    let (at, data) = begin_block_upload(tester, 2)?;
    if data.len() <= 7 {
        tester.abort(at)?;
        return skip(format!("{at} has {} bytes: one segment, two needed", data.len()));
    }
    let request = Channel::default_of(tester.node()).request;
    tester.send(request, &Request::StartBlockUpload.encode())?;
    block_segment(tester)?;
    let second = block_segment(tester)?;
    tester.send(request, &Request::AckBlockUpload { sequence: 1, block_size: 2 }.encode())?;
    let again = block_segment(tester);
    tester.abort(at)?;
    let again = again?;
    let expected = BlockSegment { sequence: 1, ..second };
    if again != expected {
        let (again, expected) = (segment(&again), segment(&expected));
        return fail(format!("{again} came again; {expected} expected ({} bytes in all)", data.len()));
    }
    Ok(())
}

fn bad_block_size(tester: &mut Tester<'_>) -> Checked {
    let (at, _) = begin_block_upload(tester, 127)?;
    tester.abort(at)?;
    for block_size in [0, 128] {
        let request = Request::InitiateBlockUpload { at, crc: true, block_size, threshold: 0 };
        tester.expect_abort(request, &[AbortCode::BLOCK_SIZE])?;
    }
    Ok(())
}

/// Begins a block download; the number of segments the server takes at once.
fn begin_block_download(tester: &mut Tester<'_>, at: Address, size: usize) -> Checked<bool> {
    match tester.ask(Request::InitiateBlockDownload { at, crc: true, size: Some(size as u32) })? {
        Response::InitiateBlockDownload { at: found, crc, block_size: 1..=127 } if found == at => Ok(crc),
        Response::Abort { code, .. } => skip(format!("{at} is not taken in blocks: {code}")),
        other => {
            tester.abort(at)?;
            fail(format!("{}; the beginning of a block download to {at} expected", said(&other)))
        }
    }
}

fn block_download(tester: &mut Tester<'_>) -> Checked {
    let (at, value) = scratch(tester)?;
    begin_block_download(tester, at, value.len())?;
    tester.abort(at)?;
    match tester.download(at, &value, &block(127, tester))? {
        Outcome::Done(_) => unchanged(tester, at, &value),
        outcome => fail(format!("block download to {at}: {outcome}")),
    }
}

fn block_crc(tester: &mut Tester<'_>) -> Checked {
    let (at, value) = scratch(tester)?;
    if !begin_block_download(tester, at, value.len())? {
        tester.abort(at)?;
        return skip("the server has no CRC");
    }
    let mut data = [0; 7];
    data.iter_mut().zip(&value).for_each(|(place, byte)| *place = *byte);
    let confirmed = tester.ask_raw(BlockSegment { sequence: 1, last: true, data }.encode())?;
    let answer = confirmed.as_deref().map(Response::parse);
    if !matches!(answer, Some(Ok(Response::AckBlockDownload { sequence: 1, .. }))) {
        tester.abort(at)?;
        return fail(format!("{}; segment 1 confirmed expected", came(confirmed.as_deref())));
    }
    let right = value.iter().fold(0u16, |crc, &byte| {
        (0..8).fold(crc ^ u16::from(byte) << 8, |crc, _| crc << 1 ^ if crc >> 15 == 1 { 0x1021 } else { 0 })
    });
    let end = Request::EndBlockDownload { unused: 7 - value.len().min(7) as u8, crc: !right };
    tester.expect_abort(end, &[AbortCode::CRC])?;
    unchanged(tester, at, &value)
}
