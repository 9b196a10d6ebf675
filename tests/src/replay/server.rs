//! Our server, asked by the recorded client.

use canopen_master::Address;
use canopen_master::sdo::message::{BlockSegment, Content, Response};
use canopen_master::sdo::{AbortCode, Access, Channel, NEXT_REQUEST, Piece, Server, Total, read_slice};
use canopen_master::trace::{Direction, MAX_KEPT, Mode, Outcome, Way};
use pdo::Frame;

use super::{Comparison, Exchange, Message, Verdict, same_response};

/// The object as the recorded server had it.
struct Recorded<'a> {
    exchange: &'a Exchange,
    /// What was read; of an upload that was refused in its middle, as long as it was announced.
    object: Vec<u8>,
    written: Vec<u8>,
}

impl<'a> Recorded<'a> {
    fn new(exchange: &'a Exchange) -> Self {
        let mut object = exchange.transfer.data.clone();
        let second = exchange.messages.get(1).map(|second| Response::parse(&second.data));
        if let Some(Ok(Response::InitiateUpload { content: Content::Segmented(Some(size)), .. })) = second
            && exchange.transfer.outcome != Outcome::Done
        {
            object.resize(object.len().max(size as usize).min(MAX_KEPT), 0);
        }
        Self { exchange, object, written: Vec::new() }
    }

    /// With what the recorded server's object refused; faults of the protocol our server finds itself.
    fn refused(&self) -> Option<AbortCode> {
        match self.exchange.transfer.outcome {
            Outcome::Aborted { by: Way::Response, code } if !is_protocol(code) => Some(code),
            _ => None,
        }
    }

    /// The abort answered the first request.
    fn at_once(&self) -> bool {
        self.exchange.messages.iter().filter(|message| message.way == Way::Response).count() <= 1
    }
}

/// 0503xxxxh and 0504xxxxh, out of memory apart, are about the protocol.
const fn is_protocol(code: AbortCode) -> bool {
    matches!(code.0 >> 16, 0x0503 | 0x0504) && code.0 != AbortCode::OUT_OF_MEMORY.0
}

impl Access for Recorded<'_> {
    fn read(&mut self, _at: Address, offset: u32, out: &mut [u8]) -> Result<(usize, Total), AbortCode> {
        match self.refused() {
            Some(code) if self.at_once() || offset as usize >= self.exchange.transfer.data.len() => Err(code),
            _ => Ok(read_slice(&self.object, offset, out)),
        }
    }

    fn begin_write(&mut self, _at: Address, _size: Option<u32>) -> Result<(), AbortCode> {
        self.refused().filter(|_| self.at_once()).map_or(Ok(()), Err)
    }

    fn write(&mut self, _at: Address, piece: &Piece<'_>) -> Result<(), AbortCode> {
        self.written.truncate(piece.offset as usize);
        self.written.extend_from_slice(piece.data);
        self.refused().filter(|_| piece.last).map_or(Ok(()), Err)
    }
}

/// What the recorded server allowed at the beginning of a block download.
fn block_size(messages: &[Message]) -> u8 {
    let sizes = messages.iter().filter(|message| message.way == Way::Response);
    let mut sizes = sizes.filter_map(|message| match Response::parse(&message.data) {
        Ok(Response::InitiateBlockDownload { block_size, .. }) => Some(block_size),
        _ => None,
    });
    sizes.next().unwrap_or(127)
}

pub(super) fn replay(exchange: &Exchange) -> Verdict {
    let transfer = &exchange.transfer;
    let refused_blocks = matches!(transfer.outcome, Outcome::Aborted { code: AbortCode::COMMAND, .. });
    if transfer.mode == Mode::Block && refused_blocks {
        return Verdict::NotReplayed("the recorded server has no blocks, ours has");
    }
    let channel = Channel::default_of(transfer.node);
    let mut server = Server::new(channel, NEXT_REQUEST).with_block_size(block_size(&exchange.messages));
    let mut objects = Recorded::new(exchange);
    let mut comparison = Comparison::new();
    let blocks = switched(exchange);
    for (number, message) in exchange.messages.iter().enumerate() {
        if message.way == Way::Request {
            let Some(frame) = frame(channel.request, &message.data) else { continue };
            server.handle_frame(message.time, &frame, &mut objects);
            continue;
        }
        let ours = server.poll_transmit(message.time, &mut objects);
        let ours = ours.as_ref().map(Frame::data);
        if let (Some(why), Some(_)) = (blocks, ours) {
            return Verdict::NotReplayed(why);
        }
        let same = ours.and_then(|ours| {
            let segments = BlockSegment::parse(&message.data) == BlockSegment::parse(ours);
            same_response(&message.data, ours).or_else(|| segments.then_some("unused bytes"))
        });
        comparison.frame(number, &message.data, ours, same);
    }
    if transfer.direction == Direction::Download
        && transfer.outcome == Outcome::Done
        && objects.written.get(..transfer.data.len()) != Some(&transfer.data[..])
    {
        return Verdict::Different("our server did not receive what was sent".into());
    }
    comparison.verdict
}

/// The recorded server answered a block upload without blocks, whatever the threshold.
fn switched(exchange: &Exchange) -> Option<&'static str> {
    let asks =
        exchange.messages.first().is_some_and(|first| first.data.first().is_some_and(|cs| cs >> 5 == 5));
    let plain = matches!(
        exchange.messages.get(1).map(|second| Response::parse(&second.data)),
        Some(Ok(Response::InitiateUpload { .. }))
    );
    (asks && plain).then_some("the recorded server switched from blocks to segments")
}

fn frame(id: u16, data: &[u8]) -> Option<Frame> {
    Frame::data_frame(embedded_can::StandardId::new(id)?, data)
}
