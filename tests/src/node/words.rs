//! What was asked and what came, in words.

use canopen_master::sdo::AbortCode;
use canopen_master::sdo::message::{BlockSegment, Content, Request, Response};

/// `91 01 0F 00`.
pub(super) fn bytes(data: &[u8]) -> String {
    match data {
        [] => "no bytes".into(),
        data => data.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" "),
    }
}

/// `06010002h, attempt to write a read only object`.
pub(super) fn coded(code: AbortCode) -> String {
    format!("{:08X}h, {}", code.0, code.text().unwrap_or("which CiA 301 does not name"))
}

pub(super) fn asked(request: &Request) -> String {
    match request {
        Request::InitiateDownload { at, .. } => format!("the request to write {at}"),
        Request::DownloadSegment { .. } => "a segment of a download".into(),
        Request::InitiateUpload { at } => format!("the request to read {at}"),
        Request::UploadSegment { .. } => "the request for a segment".into(),
        Request::Abort { .. } => "an abort".into(),
        Request::InitiateBlockDownload { at, .. } => format!("the request to write {at} in blocks"),
        Request::EndBlockDownload { .. } => "the end of a block download".into(),
        Request::InitiateBlockUpload { at, .. } => format!("the request to read {at} in blocks"),
        Request::StartBlockUpload => "the start of a block upload".into(),
        Request::AckBlockUpload { .. } => "the confirmation of a sub-block".into(),
        Request::EndBlockUpload => "the confirmed end of a block upload".into(),
    }
}

pub(super) fn said(response: &Response) -> String {
    match response {
        Response::InitiateDownload { at } => format!("it was accepted, writing {at}"),
        Response::DownloadSegment { toggle } => {
            format!("the segment was accepted with toggle bit {}", u8::from(*toggle))
        }
        Response::InitiateUpload { at, content: Content::Expedited { data, sized } } => {
            let number = if *sized { "" } else { ", their number not indicated" };
            format!("{at} answered {}{number}", bytes(data.padded().get(..data.len()).unwrap_or(&[])))
        }
        Response::InitiateUpload { at, content: Content::Segmented(Some(size)) } => {
            format!("{at} answered that {size} bytes follow in segments")
        }
        Response::InitiateUpload { at, content: Content::Segmented(None) } => {
            format!("{at} answered that segments follow")
        }
        Response::UploadSegment { toggle, last, data } => format!(
            "{} segment of {} bytes came with toggle bit {}",
            if *last { "the last" } else { "a" },
            data.len(),
            u8::from(*toggle)
        ),
        Response::Abort { at, code } => format!("{at} was aborted with {}", coded(*code)),
        Response::InitiateBlockDownload { at, block_size, .. } => {
            format!("it was accepted, writing {at} in sub-blocks of {block_size} segments")
        }
        Response::AckBlockDownload { sequence, block_size } => {
            format!("segments up to {sequence} were confirmed, sub-blocks of {block_size} segments asked for")
        }
        Response::EndBlockDownload => "the end of the block download was accepted".into(),
        Response::InitiateBlockUpload { at, .. } => format!("it was accepted, reading {at} in blocks"),
        Response::EndBlockUpload { unused, crc } => {
            format!("the end of a block upload came, CRC {crc:04X}h, {unused} bytes unused")
        }
    }
}

pub(super) fn segment(segment: &BlockSegment) -> String {
    let last = if segment.last { ", the last" } else { "" };
    format!("segment {}{last}: {}", segment.sequence, bytes(&segment.data))
}
