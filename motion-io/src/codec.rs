//! LB2 framing as a codec for tokio's streams and sinks.

use std::io;

use bytes::{Buf, Bytes, BytesMut};
use lb2::frame::{Damage, Frame, Item, MAX_WIRE};
use lb2::telegram::{Request, Response};
use tokio_util::codec::{Decoder, Encoder};

/// Telegrams and damage out of a byte stream, requests and responses into one.
#[derive(Debug, Default)]
pub struct Lb2Codec {
    decoder: lb2::frame::Decoder,
}

/// What a stream of telegrams yields.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Telegram {
    /// A good telegram: its block (number, function, data, check byte; not doubled).
    Frame(Bytes),
    /// Bytes that are no telegram. The stream goes on.
    Damage(Damage),
}

impl Telegram {
    /// The telegram as a checked view; `None` for damage.
    #[must_use]
    pub fn frame(&self) -> Option<Frame<'_>> {
        match self {
            Self::Frame(block) => Frame::new_checked(block).ok(),
            Self::Damage(_) => None,
        }
    }
}

impl Decoder for Lb2Codec {
    type Item = Telegram;
    type Error = io::Error;

    fn decode(&mut self, source: &mut BytesMut) -> io::Result<Option<Telegram>> {
        let (taken, item) = self.decoder.decode(source);
        let telegram = item.map(|item| match item {
            Item::Frame { frame, .. } => Telegram::Frame(Bytes::copy_from_slice(frame.block())),
            Item::Damage(damage) => Telegram::Damage(damage),
        });
        source.advance(taken);
        Ok(telegram)
    }

    /// The end of the stream ends an open telegram.
    fn decode_eof(&mut self, source: &mut BytesMut) -> io::Result<Option<Telegram>> {
        if let Some(telegram) = self.decode(source)? {
            return Ok(Some(telegram));
        }
        self.decoder.gap();
        self.decode(source)
    }
}

impl Encoder<Request<'_>> for Lb2Codec {
    type Error = io::Error;

    fn encode(&mut self, request: Request<'_>, out: &mut BytesMut) -> io::Result<()> {
        append(out, |room| request.encode(room))
    }
}

impl Encoder<Response<'_>> for Lb2Codec {
    type Error = io::Error;

    fn encode(&mut self, response: Response<'_>, out: &mut BytesMut) -> io::Result<()> {
        append(out, |room| response.encode(room))
    }
}

fn append(
    out: &mut BytesMut,
    encode: impl FnOnce(&mut [u8]) -> Result<usize, lb2::frame::EncodeError>,
) -> io::Result<()> {
    let before = out.len();
    out.resize(before + MAX_WIRE, 0);
    let encoded = encode(out.get_mut(before..).unwrap_or(&mut []));
    out.truncate(before + *encoded.as_ref().unwrap_or(&0));
    encoded.map(drop).map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn telegrams_go_in_and_out() {
        let mut codec = Lb2Codec::default();
        let mut bytes = BytesMut::from(&[0x00][..]);
        codec.encode(Request::ReadParameter { index: 0x82 }, &mut bytes).unwrap();
        codec.encode(Response::FailureCount(3), &mut bytes).unwrap();
        let tail = bytes.split_off(bytes.len() - 1);
        assert!(matches!(codec.decode(&mut bytes), Ok(Some(Telegram::Damage(_)))));
        let first = codec.decode(&mut bytes).unwrap().unwrap();
        assert_eq!(Request::parse(&first.frame().unwrap()), Ok(Request::ReadParameter { index: 0x82 }));
        assert_eq!(codec.decode(&mut bytes).unwrap(), None);
        bytes.unsplit(tail);
        let second = codec.decode(&mut bytes).unwrap().unwrap();
        assert_eq!(Response::parse(&second.frame().unwrap()), Ok(Response::FailureCount(3)));
        bytes.extend_from_slice(&[0x82, 0x96, 0x09]);
        assert!(matches!(codec.decode_eof(&mut bytes), Ok(Some(Telegram::Damage(_)))));
        assert_eq!(codec.decode_eof(&mut bytes).unwrap(), None);
    }
}
