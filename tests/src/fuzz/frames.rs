//! Decoder and typed parsers.

use lb2::frame::{Damage, Decoder, Frame, Item, MAX_WIRE, encode};
use lb2::telegram::{Request, Response};

use super::Input;

#[derive(Debug, PartialEq, Eq)]
enum Seen {
    Frame(u64, Vec<u8>),
    Damage(Damage),
}

struct Run {
    seen: Vec<Seen>,
    decoder: Decoder,
}

impl Run {
    fn new() -> Self {
        Self { seen: Vec::new(), decoder: Decoder::new() }
    }

    fn feed(&mut self, mut bytes: &[u8]) {
        loop {
            let (taken, item) = self.decoder.decode(bytes);
            bytes = &bytes[taken..];
            match item {
                Some(Item::Frame { offset, frame }) => {
                    assert_eq!(Frame::new_checked(frame.block()), Ok(frame));
                    self.seen.push(Seen::Frame(offset, frame.block().to_vec()));
                }
                Some(Item::Damage(damage)) => self.seen.push(Seen::Damage(damage)),
                None => return assert!(bytes.is_empty()),
            }
        }
    }
}

/// The first bytes cut the rest into chunks; whole, chunked and byte by byte must agree, every frame
/// must stand on the wire where it is said to, and every byte must be accounted for.
pub fn decode(data: &[u8]) {
    let mut input = Input(data);
    let cuts: Vec<u8> = (0..input.u8() % 16).map(|_| input.u8()).collect();
    let stream = input.0;

    let mut whole = Run::new();
    whole.feed(stream);
    let mut chunked = Run::new();
    let mut rest = stream;
    for cut in cuts.iter().cycle() {
        if cuts.iter().all(|&cut| cut == 0) || rest.is_empty() {
            break;
        }
        let (chunk, after) = rest.split_at(usize::from(*cut).min(rest.len()));
        chunked.feed(chunk);
        rest = after;
    }
    chunked.feed(rest);
    let mut bytewise = Run::new();
    stream.chunks(1).for_each(|byte| bytewise.feed(byte));
    assert_eq!(whole.seen, chunked.seen);
    assert_eq!(whole.seen, bytewise.seen);
    assert_eq!(whole.decoder.discarded(), chunked.decoder.discarded());
    assert_eq!(whole.decoder.discarded(), bytewise.decoder.discarded());

    whole.decoder.gap();
    whole.feed(&[]);
    let mut good = 0;
    let mut end = 0;
    for seen in &whole.seen {
        let Seen::Frame(offset, block) = seen else { continue };
        let mut wire = [0; MAX_WIRE];
        let len = encode(block[1], &block[2..block.len() - 1], &mut wire).unwrap();
        let at = *offset as usize;
        assert_eq!(stream[at..at + len], wire[..len]);
        assert!(*offset >= end, "frames overlap");
        end = offset + len as u64;
        good += len as u64;
    }
    assert_eq!(whole.decoder.position(), stream.len() as u64);
    assert_eq!(whole.decoder.discarded() + good, stream.len() as u64);
}

/// A frame with the input as function and data, as the decoder delivers it.
fn with_frame(data: &[u8], check: impl Fn(&Frame<'_>)) {
    let Some((&function, data)) = data.split_first() else { return };
    let mut wire = [0; MAX_WIRE];
    let Ok(len) = encode(function, data, &mut wire) else { return };
    match Decoder::new().decode(&wire[..len]) {
        (taken, Some(Item::Frame { frame, .. })) if taken == len => check(&frame),
        other => panic!("{other:?}"),
    }
}

/// What parses as a request comes back from its own encoding.
pub fn request(data: &[u8]) {
    with_frame(data, |frame| {
        let Ok(request) = Request::parse(frame) else { return };
        let mut wire = [0; MAX_WIRE];
        let len = request.encode(&mut wire).unwrap();
        let _ = (request.check(), request.echo().to_string(), request.is_repeatable());
        match Decoder::new().decode(&wire[..len]).1 {
            Some(Item::Frame { frame, .. }) => assert_eq!(Request::parse(&frame), Ok(request)),
            other => panic!("{other:?}"),
        }
    });
}

/// What parses as a response comes back from its own encoding.
pub fn response(data: &[u8]) {
    with_frame(data, |frame| {
        let Ok(response) = Response::parse(frame) else { return };
        let mut wire = [0; MAX_WIRE];
        let len = response.encode(&mut wire).unwrap();
        let _ = (response.echo(), format!("{response:?}"));
        match Decoder::new().decode(&wire[..len]).1 {
            Some(Item::Frame { frame, .. }) => assert_eq!(Response::parse(&frame), Ok(response)),
            other => panic!("{other:?}"),
        }
    });
}
