//! Block transfers byte by byte: against each engine a scripted peer.

use canopen_master::Frame;
use canopen_master::sdo::{Block, Client, Fault, NEXT_REQUEST, Options, Outcome, Server};

use super::pair::{AT, CHANNEL, Object, Objects, ms};

const BEGIN_UP: [u8; 8] = [0xA4, 0x00, 0x20, 1, 3, 0, 0, 0];
const BEGIN_DOWN: [u8; 8] = [0xC6, 0x00, 0x20, 1, 20, 0, 0, 0];

fn options() -> Options {
    Options { timeout: ms(100), block: Some(Block { block_size: 3, crc: true, threshold: 0 }) }
}

/// 1, 2, … 20: three segments, the last with 6 bytes.
fn data() -> Vec<u8> {
    (1..=20).collect()
}

/// The polynomial division itself, bit by bit.
fn crc(bytes: &[u8]) -> [u8; 2] {
    let crc = bytes.iter().fold(0u16, |crc, &byte| {
        (0..8).fold(crc ^ u16::from(byte) << 8, |crc, _| crc << 1 ^ if crc >> 15 == 1 { 0x1021 } else { 0 })
    });
    crc.to_le_bytes()
}

fn segment(first: u8, from: u8) -> [u8; 8] {
    let mut bytes = [0; 8];
    bytes[0] = first;
    for (i, byte) in bytes[1..].iter_mut().enumerate() {
        let value = from + i as u8;
        *byte = if value <= 20 { value } else { 0 };
    }
    bytes
}

struct ClientScript(Client<Vec<u8>>);

impl ClientScript {
    fn download() -> Self {
        let mut client = Client::new(CHANNEL);
        client.download(AT, data(), &options()).unwrap();
        Self(client)
    }

    fn upload() -> Self {
        let mut client = Client::new(CHANNEL);
        client.upload(AT, Vec::new(), &options()).unwrap();
        Self(client)
    }

    #[track_caller]
    fn sends(&mut self, at: u64, bytes: [u8; 8]) {
        assert_eq!(self.0.poll_transmit(ms(at)), Some(Frame::standard(CHANNEL.request, bytes)));
    }

    #[track_caller]
    fn sends_nothing(&mut self, at: u64) {
        assert_eq!(self.0.poll_transmit(ms(at)), None);
    }

    fn gets(&mut self, at: u64, bytes: [u8; 8]) {
        self.0.handle_frame(ms(at), &Frame::standard(CHANNEL.response, bytes));
    }

    #[track_caller]
    fn ends(&mut self) -> Outcome {
        self.0.poll_event().expect("an outcome").outcome
    }
}

/// 7.2.4.3.8…11; the block size is another one for each sub-block.
#[test]
fn download_with_changing_block_size() {
    let mut script = ClientScript::download();
    script.sends(0, BEGIN_DOWN);
    script.gets(0, [0xA4, 0x00, 0x20, 1, 2, 0, 0, 0]);
    script.sends(0, segment(1, 1));
    script.sends(0, segment(2, 8));
    script.sends_nothing(0);
    script.gets(0, [0xA2, 2, 9, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]);
    script.sends(0, segment(0x81, 15));
    script.sends_nothing(0);
    script.gets(0, [0xA2, 1, 9, 0, 0, 0, 0, 0]);
    let [low, high] = crc(&data());
    script.sends(0, [0xC5, low, high, 0, 0, 0, 0, 0]);
    script.gets(0, [0xA1, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(script.ends(), Outcome::Done(20));
    script.sends_nothing(0);
}

/// 7.2.4.2.11: what was not confirmed is sent again, and counts once in the CRC.
#[test]
fn download_sends_again_what_was_lost() {
    let mut script = ClientScript::download();
    script.sends(0, BEGIN_DOWN);
    script.gets(0, [0xA4, 0x00, 0x20, 1, 3, 0, 0, 0]);
    script.sends(0, segment(1, 1));
    script.sends(0, segment(2, 8));
    script.sends(0, segment(0x83, 15));
    script.gets(0, [0xA2, 1, 3, 0, 0, 0, 0, 0]);
    script.sends(0, segment(1, 8));
    script.sends(0, segment(0x82, 15));
    script.sends_nothing(0);
    script.gets(0, [0xA2, 2, 3, 0, 0, 0, 0, 0]);
    let [low, high] = crc(&data());
    script.sends(0, [0xC5, low, high, 0, 0, 0, 0, 0]);
}

#[test]
fn download_faults() {
    let begun = [0xA4, 0x00, 0x20, 1, 1, 0, 0, 0];
    for (answers, fault, code) in [
        (&[[0xA4, 0x00, 0x20, 1, 0, 0, 0, 0]][..], Fault::BlockSize(0), 2),
        (&[[0xA4, 0x00, 0x20, 1, 128, 0, 0, 0]], Fault::BlockSize(128), 2),
        (&[begun, [0xA2, 1, 0, 0, 0, 0, 0, 0]], Fault::BlockSize(0), 2),
        (&[begun, [0xA2, 2, 1, 0, 0, 0, 0, 0]], Fault::Sequence { sent: 1, found: 2 }, 3),
        (&[begun, [0xA1, 0, 0, 0, 0, 0, 0, 0]], Fault::Unexpected { command: 0xA1 }, 1),
    ] {
        let mut script = ClientScript::download();
        for &answer in answers {
            while script.0.poll_transmit(ms(0)).is_some() {}
            script.gets(0, answer);
        }
        assert_eq!(script.ends(), Outcome::GaveUp(fault));
        script.sends(0, [0x80, 0x00, 0x20, 1, code, 0, 4, 5]);
    }
}

#[test]
fn download_without_progress_ends() {
    let mut script = ClientScript::download();
    script.sends(0, BEGIN_DOWN);
    script.gets(0, [0xA4, 0x00, 0x20, 1, 3, 0, 0, 0]);
    for _ in 0..4 {
        while script.0.poll_transmit(ms(0)).is_some() {}
        script.gets(0, [0xA2, 0, 3, 0, 0, 0, 0, 0]);
    }
    assert_eq!(script.ends(), Outcome::GaveUp(Fault::NoProgress(4)));
}

/// 7.2.4.3.12…15.
#[test]
fn upload() {
    let mut script = ClientScript::upload();
    script.sends(0, BEGIN_UP);
    script.gets(0, [0xC6, 0x00, 0x20, 1, 20, 0, 0, 0]);
    script.sends(0, [0xA3, 0, 0, 0, 0, 0, 0, 0]);
    script.gets(0, segment(1, 1));
    script.gets(0, segment(2, 8));
    script.sends_nothing(0);
    script.gets(0, segment(0x83, 15));
    script.sends(0, [0xA2, 3, 3, 0, 0, 0, 0, 0]);
    let [low, high] = crc(&data());
    script.gets(0, [0xC5, low, high, 0, 0, 0, 0, 0]);
    script.sends(0, [0xA1, 0, 0, 0, 0, 0, 0, 0]);
    let finished = script.0.poll_event().unwrap();
    assert_eq!((finished.outcome, finished.buffer), (Outcome::Done(20), data()));
}

/// The second segment is lost, then the end of the sub-block: the client asks after half its time-out.
#[test]
fn upload_asks_again_for_what_was_lost() {
    let mut script = ClientScript::upload();
    script.sends(0, BEGIN_UP);
    script.gets(0, [0xC6, 0x00, 0x20, 1, 20, 0, 0, 0]);
    script.sends(0, [0xA3, 0, 0, 0, 0, 0, 0, 0]);
    script.gets(0, segment(1, 1));
    script.gets(0, segment(0x83, 15));
    script.sends(0, [0xA2, 1, 3, 0, 0, 0, 0, 0]);
    script.gets(0, segment(1, 8));
    assert_eq!(script.0.poll_timeout(), Some(ms(50)));
    script.0.handle_timeout(ms(50));
    script.sends(50, [0xA2, 1, 3, 0, 0, 0, 0, 0]);
    script.gets(50, segment(0x81, 15));
    script.sends(50, [0xA2, 1, 3, 0, 0, 0, 0, 0]);
    let [low, high] = crc(&data());
    script.gets(50, [0xC5, low, high, 0, 0, 0, 0, 0]);
    assert_eq!(script.ends(), Outcome::Done(20));
}

#[test]
fn upload_crc_fault() {
    let mut script = ClientScript::upload();
    script.sends(0, BEGIN_UP);
    script.gets(0, [0xC6, 0x00, 0x20, 1, 20, 0, 0, 0]);
    script.sends(0, [0xA3, 0, 0, 0, 0, 0, 0, 0]);
    script.gets(0, segment(1, 1));
    script.gets(0, segment(2, 9));
    script.gets(0, segment(0x83, 15));
    script.sends(0, [0xA2, 3, 3, 0, 0, 0, 0, 0]);
    let [low, high] = crc(&data());
    script.gets(0, [0xC5, low, high, 0, 0, 0, 0, 0]);
    assert!(
        matches!(script.ends(), Outcome::GaveUp(Fault::Crc { found, .. }) if found.to_le_bytes() == [low, high])
    );
    script.sends(0, [0x80, 0x00, 0x20, 1, 4, 0, 4, 5]);
}

/// The server may abort in the middle of a sub-block: 80h is no segment.
#[test]
fn upload_aborted_in_a_sub_block() {
    let mut script = ClientScript::upload();
    script.sends(0, BEGIN_UP);
    script.gets(0, [0xC6, 0x00, 0x20, 1, 20, 0, 0, 0]);
    script.sends(0, [0xA3, 0, 0, 0, 0, 0, 0, 0]);
    script.gets(0, segment(1, 1));
    script.gets(0, [0x80, 0x00, 0x20, 1, 0x24, 0, 0, 8]);
    assert_eq!(script.ends(), Outcome::Aborted(canopen_master::sdo::AbortCode::NO_DATA));
}

/// 7.2.4.2.12: a server may change to the plain upload. One that has no blocks does so above the
/// threshold, too, as python-canopen's; with threshold 0 that is a fault.
#[test]
fn upload_switched_above_the_threshold() {
    for threshold in [1, 21] {
        let mut client = Client::new(CHANNEL);
        let block = Block { threshold, ..Block::default() };
        client.upload(AT, Vec::new(), &Options { block: Some(block), ..options() }).unwrap();
        let mut script = ClientScript(client);
        script.sends(0, [0xA4, 0x00, 0x20, 1, 127, threshold, 0, 0]);
        script.gets(0, [0x41, 0x00, 0x20, 1, 25, 0, 0, 0]);
        for (toggle, last) in [(0, 0), (0x10, 0), (0, 0), (0x10, 7)] {
            script.sends(0, [0x60 | toggle, 0, 0, 0, 0, 0, 0, 0]);
            script.gets(0, [toggle | last, 9, 9, 9, 9, 9, 9, 9]);
        }
        let finished = script.0.poll_event().expect("an outcome");
        assert_eq!((finished.outcome, finished.buffer), (Outcome::Done(25), vec![9; 25]));
        script.sends_nothing(0);
    }
    let mut script = ClientScript::upload();
    script.sends(0, BEGIN_UP);
    script.gets(0, [0x41, 0x00, 0x20, 1, 25, 0, 0, 0]);
    assert_eq!(script.ends(), Outcome::GaveUp(Fault::Unexpected { command: 0x41 }));
    script.sends(0, [0x80, 0x00, 0x20, 1, 1, 0, 4, 5]);
}

struct ServerScript {
    server: Server,
    objects: Objects,
}

impl ServerScript {
    fn new(data: Vec<u8>) -> Self {
        let mut objects = Objects::default();
        objects.map.insert(AT, Object { data, unsized_: false });
        Self { server: Server::new(CHANNEL, NEXT_REQUEST).with_block_size(3), objects }
    }

    fn gets(&mut self, bytes: [u8; 8]) {
        self.server.handle_frame(ms(0), &Frame::standard(CHANNEL.request, bytes), &mut self.objects);
    }

    #[track_caller]
    fn sends(&mut self, bytes: [u8; 8]) {
        let sent = self.server.poll_transmit(ms(0), &mut self.objects);
        assert_eq!(sent, Some(Frame::standard(CHANNEL.response, bytes)));
    }

    #[track_caller]
    fn sends_nothing(&mut self) {
        assert_eq!(self.server.poll_transmit(ms(0), &mut self.objects), None);
    }
}

#[test]
fn server_upload_with_changing_block_size_and_loss() {
    let mut script = ServerScript::new(data());
    script.gets([0xA4, 0x00, 0x20, 1, 2, 0, 0, 0]);
    script.sends([0xC6, 0x00, 0x20, 1, 20, 0, 0, 0]);
    script.gets([0xA3, 0, 0, 0, 0, 0, 0, 0]);
    script.sends(segment(1, 1));
    script.sends(segment(2, 8));
    script.sends_nothing();
    script.gets([0xA2, 1, 127, 0, 0, 0, 0, 0]);
    script.sends(segment(1, 8));
    script.sends(segment(0x82, 15));
    script.sends_nothing();
    script.gets([0xA2, 2, 127, 0, 0, 0, 0, 0]);
    let [low, high] = crc(&data());
    script.sends([0xC5, low, high, 0, 0, 0, 0, 0]);
    script.gets([0xA1, 0, 0, 0, 0, 0, 0, 0]);
    assert!(script.server.is_idle() && script.server.poll_timeout().is_none());
}

#[test]
fn server_download_with_loss() {
    let mut script = ServerScript::new(Vec::new());
    script.gets(BEGIN_DOWN);
    script.sends([0xA4, 0x00, 0x20, 1, 3, 0, 0, 0]);
    script.gets(segment(1, 1));
    script.gets(segment(0x83, 15));
    script.sends([0xA2, 1, 3, 0, 0, 0, 0, 0]);
    script.gets(segment(1, 8));
    script.server.handle_timeout(NEXT_REQUEST / 2, &mut script.objects);
    script.sends([0xA2, 1, 3, 0, 0, 0, 0, 0]);
    script.gets(segment(0x81, 15));
    script.sends([0xA2, 1, 3, 0, 0, 0, 0, 0]);
    assert!(script.objects.map[&AT].data.is_empty(), "not before the CRC is right");
    let [low, high] = crc(&data());
    script.gets([0xC5, low, high, 0, 0, 0, 0, 0]);
    script.sends([0xA1, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(script.objects.map[&AT].data, data());
}

/// Wrong CRC, wrong sizes, wrong block size, aborted: each with its code, and nothing is stored.
#[test]
fn server_faults() {
    let [low, high] = crc(&data());
    let all = [BEGIN_DOWN, segment(1, 1), segment(2, 8), segment(0x83, 15)];
    for (last, code) in [
        ([0xC5, low ^ 1, high, 0, 0, 0, 0, 0], Some([4, 0, 4, 5])),
        ([0xC1, low, high, 0, 0, 0, 0, 0], Some([0x12, 0, 7, 6])),
        ([0xC9, low, high, 0, 0, 0, 0, 0], Some([0x13, 0, 7, 6])),
        ([0xA3, 0, 0, 0, 0, 0, 0, 0], Some([1, 0, 4, 5])),
        ([0x80, 0x00, 0x20, 1, 0, 0, 4, 5], None),
    ] {
        let mut script = ServerScript::new(vec![9]);
        for frame in all {
            script.gets(frame);
            while script.server.poll_transmit(ms(0), &mut script.objects).is_some() {}
        }
        script.gets(last);
        if let Some([a, b, c, d]) = code {
            script.sends([0x80, 0x00, 0x20, 1, a, b, c, d]);
        } else {
            script.sends_nothing();
        }
        assert_eq!((script.objects.map[&AT].data.as_slice(), script.objects.abandoned), (&[9][..], 1));
    }
    let mut script = ServerScript::new(data());
    script.gets([0xA4, 0x00, 0x20, 1, 128, 0, 0, 0]);
    script.sends([0x80, 0x00, 0x20, 1, 2, 0, 4, 5]);
}
