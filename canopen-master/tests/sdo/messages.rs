//! `parse ∘ encode = identity`, and parsers take any bytes.

use canopen_master::sdo::message::{BlockSegment, Bytes, Content, Request, Response};
use canopen_master::sdo::{AbortCode, Address};
use proptest::prelude::*;

fn content() -> impl Strategy<Value = Content> {
    prop_oneof![
        prop::collection::vec(any::<u8>(), 1..=4)
            .prop_map(|b| Content::Expedited { data: Bytes::new(&b).unwrap(), sized: true }),
        any::<[u8; 4]>().prop_map(|b| Content::Expedited { data: Bytes::new(&b).unwrap(), sized: false }),
        any::<Option<u32>>().prop_map(Content::Segmented),
    ]
}

proptest! {
    #[test]
    fn messages_come_back(
        index: u16, sub: u8, content in content(), toggle: bool, last: bool, size: Option<u32>, crc: bool,
        sum: u16, code: u32, byte: u8, block_size: u8, unused in 0u8..8, sequence in 1u8..128, seven: [u8; 7],
        data in prop::collection::vec(any::<u8>(), 0..=7),
    ) {
        let at = Address::new(index, sub);
        let (code, data) = (AbortCode(code), Bytes::new(&data).unwrap());
        for request in [
            Request::InitiateDownload { at, content },
            Request::DownloadSegment { toggle, last, data },
            Request::InitiateUpload { at },
            Request::UploadSegment { toggle },
            Request::Abort { at, code },
            Request::InitiateBlockDownload { at, crc, size },
            Request::EndBlockDownload { unused, crc: sum },
            Request::InitiateBlockUpload { at, crc, block_size, threshold: byte },
            Request::StartBlockUpload,
            Request::AckBlockUpload { sequence: byte, block_size },
            Request::EndBlockUpload,
        ] {
            prop_assert_eq!(Request::parse(&request.encode()), Ok(request));
        }
        for response in [
            Response::InitiateDownload { at },
            Response::DownloadSegment { toggle },
            Response::InitiateUpload { at, content },
            Response::UploadSegment { toggle, last, data },
            Response::Abort { at, code },
            Response::InitiateBlockDownload { at, crc, block_size },
            Response::AckBlockDownload { sequence: byte, block_size },
            Response::EndBlockDownload,
            Response::InitiateBlockUpload { at, crc, size },
            Response::EndBlockUpload { unused, crc: sum },
        ] {
            prop_assert_eq!(Response::parse(&response.encode()), Ok(response));
        }
        let segment = BlockSegment { sequence, last, data: seven };
        prop_assert_eq!(BlockSegment::parse(&segment.encode()), Some(segment));
    }

    #[test]
    fn what_parses_comes_back(bytes in prop::collection::vec(any::<u8>(), 0..=8)) {
        if let Ok(request) = Request::parse(&bytes) {
            prop_assert_eq!(Request::parse(&request.encode()), Ok(request));
        }
        if let Ok(response) = Response::parse(&bytes) {
            prop_assert_eq!(Response::parse(&response.encode()), Ok(response));
        }
        if let Some(segment) = BlockSegment::parse(&bytes) {
            prop_assert_eq!(&segment.encode()[..], &bytes[..]);
        }
    }
}
