//! Our client, answered by the recorded server.

use canopen_master::sdo::message::{BlockSegment, Content, Request};
use canopen_master::sdo::{AbortCode, Block, Buffer, Channel, Client, Options, Outcome as Ended};
use canopen_master::trace::{Direction, Outcome, Way};
use pdo::Frame;

use super::{Comparison, Exchange, Verdict, same_request};

/// Data whose length is told to the server, or not.
struct Data {
    bytes: Vec<u8>,
    sized: bool,
}

impl Buffer for Data {
    fn size(&self) -> Option<u32> {
        self.sized.then(|| u32::try_from(self.bytes.len()).unwrap_or(u32::MAX))
    }

    fn read(&mut self, offset: u32, out: &mut [u8]) -> Result<usize, AbortCode> {
        self.bytes.read(offset, out)
    }

    fn begin(&mut self, size: Option<u32>) -> Result<(), AbortCode> {
        self.bytes.begin(size)
    }

    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), AbortCode> {
        self.bytes.write(offset, data)
    }
}

pub(super) fn replay(exchange: &Exchange) -> Verdict {
    let transfer = &exchange.transfer;
    let Some(Ok(first)) = exchange.messages.first().map(|message| Request::parse(&message.data)) else {
        return Verdict::NotReplayed("its first request is not understood");
    };
    let mut options = Options::default();
    let mut sized = true;
    match first {
        Request::InitiateBlockUpload { crc, block_size, threshold, .. } => {
            options.block = Some(Block { block_size, crc, threshold });
        }
        Request::InitiateBlockDownload { crc, size, .. } => {
            options.block = Some(Block { block_size: 127, crc, threshold: 0 });
            sized = size.is_some();
        }
        Request::InitiateDownload { content: Content::Segmented(size), .. } => match size {
            Some(1..=4) => {
                return Verdict::NotReplayed("up to 4 bytes in segments, which ours sends expedited");
            }
            size => sized = size.is_some(),
        },
        _ => {}
    }
    if transfer.direction == Direction::Download && transfer.outcome != Outcome::Done && !is_expedited(&first)
    {
        return Verdict::NotReplayed("what was to be sent is not in the capture as a whole");
    }
    let mut client = Client::new(Channel::default_of(transfer.node));
    let data = |bytes| Data { bytes, sized };
    let begun = match transfer.direction {
        Direction::Upload => client.upload(transfer.at, data(Vec::new()), &options),
        Direction::Download => client.download(transfer.at, data(sent(&first, &transfer.data)), &options),
    };
    if let Err(refused) = begun {
        return Verdict::Different(refused.to_string());
    }
    let mut comparison = Comparison::new();
    for (number, message) in exchange.messages.iter().enumerate() {
        if message.way == Way::Response {
            if let Some(frame) = frame(client.channel().response, &message.data) {
                client.handle_frame(message.time, &frame);
            }
            continue;
        }
        let ours = client.poll_transmit(message.time);
        let ours = ours.as_ref().map(Frame::data);
        let same = ours.and_then(|ours| {
            let segments = BlockSegment::parse(&message.data) == BlockSegment::parse(ours);
            same_request(&message.data, ours).or_else(|| segments.then_some("unused bytes"))
        });
        comparison.frame(number, &message.data, ours, same);
    }
    if matches!(comparison.verdict, Verdict::Different(_)) {
        return comparison.verdict;
    }
    let Some(finished) = client.poll_event() else {
        return Verdict::Different("our client waits for more".into());
    };
    let upload = transfer.direction == Direction::Upload;
    match (finished.outcome, transfer.outcome) {
        (Ended::Done(_), Outcome::Done) if !upload || finished.buffer.bytes == transfer.data => {
            comparison.verdict
        }
        (Ended::Aborted(ours), Outcome::Aborted { code, .. }) if ours == code => comparison.verdict,
        (ours, theirs) => Verdict::Different(format!("{theirs:?} recorded, our client: {ours}")),
    }
}

const fn is_expedited(first: &Request) -> bool {
    matches!(first, Request::InitiateDownload { content: Content::Expedited { .. }, .. })
}

/// What an expedited download carries is there even if it was refused.
fn sent(first: &Request, data: &[u8]) -> Vec<u8> {
    match first {
        Request::InitiateDownload { content: Content::Expedited { data, .. }, .. } => {
            data.padded().iter().take(data.len()).copied().collect()
        }
        _ => data.to_vec(),
    }
}

fn frame(id: u16, data: &[u8]) -> Option<Frame> {
    Frame::data_frame(embedded_can::StandardId::new(id)?, data)
}
