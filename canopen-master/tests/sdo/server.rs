//! The server, byte by byte.

use canopen_master::Frame;
use canopen_master::sdo::{NEXT_REQUEST, Server};

use super::pair::{AT, CHANNEL, Object, Objects, ms};

struct Script {
    server: Server,
    objects: Objects,
}

impl Script {
    fn new(data: &[u8]) -> Self {
        let mut objects = Objects::default();
        objects.map.insert(AT, Object { data: data.to_vec(), unsized_: false });
        Self { server: Server::new(CHANNEL, NEXT_REQUEST), objects }
    }

    #[track_caller]
    fn answers(&mut self, request: [u8; 8], response: [u8; 8]) {
        self.server.handle_frame(ms(0), &Frame::standard(CHANNEL.request, request), &mut self.objects);
        self.sends(response);
    }

    #[track_caller]
    fn sends(&mut self, response: [u8; 8]) {
        let sent = self.server.poll_transmit(ms(0), &mut self.objects);
        assert_eq!(sent, Some(Frame::standard(CHANNEL.response, response)));
    }

    #[track_caller]
    fn silent(&mut self, request: [u8; 8]) {
        self.server.handle_frame(ms(0), &Frame::standard(CHANNEL.request, request), &mut self.objects);
        assert_eq!(self.server.poll_transmit(ms(0), &mut self.objects), None);
    }
}

#[test]
fn expedited() {
    let mut script = Script::new(&[1, 2]);
    script.answers([0x40, 0x00, 0x20, 1, 0, 0, 0, 0], [0x4B, 0x00, 0x20, 1, 1, 2, 0, 0]);
    script.answers([0x2F, 0x00, 0x20, 1, 9, 0xFF, 0xFF, 0xFF], [0x60, 0x00, 0x20, 1, 0, 0, 0, 0]);
    assert_eq!(script.objects.map[&AT].data, [9]);
    assert_eq!(script.server.poll_timeout(), None);
}

#[test]
fn toggle_fault() {
    let mut script = Script::new(&[0; 20]);
    script.answers([0x40, 0x00, 0x20, 1, 0, 0, 0, 0], [0x41, 0x00, 0x20, 1, 20, 0, 0, 0]);
    script.answers([0x70, 0, 0, 0, 0, 0, 0, 0], [0x80, 0x00, 0x20, 1, 0, 0, 3, 5]);
    script.answers([0x21, 0x00, 0x20, 1, 20, 0, 0, 0], [0x60, 0x00, 0x20, 1, 0, 0, 0, 0]);
    script.answers([0x10, 0, 0, 0, 0, 0, 0, 0], [0x80, 0x00, 0x20, 1, 0, 0, 3, 5]);
    assert_eq!(script.objects.abandoned, 1);
}

/// More and fewer bytes than the client said.
#[test]
fn size_faults() {
    for (segments, code) in [
        (&[[0x00, 1, 2, 3, 4, 5, 6, 7], [0x10, 1, 2, 3, 4, 5, 6, 7]][..], [0x12, 0, 7, 6]),
        (&[[0x01, 1, 2, 3, 4, 5, 6, 7]], [0x13, 0, 7, 6]),
    ] {
        let mut script = Script::new(&[]);
        script.answers([0x21, 0x00, 0x20, 1, 9, 0, 0, 0], [0x60, 0x00, 0x20, 1, 0, 0, 0, 0]);
        let (last, first) = segments.split_last().unwrap();
        for &segment in first {
            script.answers(segment, [0x20 | segment[0] & 0x10, 0, 0, 0, 0, 0, 0, 0]);
        }
        let [a, b, c, d] = code;
        script.answers(*last, [0x80, 0x00, 0x20, 1, a, b, c, d]);
        assert_eq!(script.objects.abandoned, 1);
    }
}

#[test]
fn a_silent_client_is_given_up() {
    let mut script = Script::new(&[0; 20]);
    script.answers([0x21, 0x00, 0x20, 1, 9, 0, 0, 0], [0x60, 0x00, 0x20, 1, 0, 0, 0, 0]);
    assert_eq!(script.server.poll_timeout(), Some(NEXT_REQUEST));
    script.server.handle_timeout(NEXT_REQUEST - ms(1), &mut script.objects);
    assert!(!script.server.is_idle());
    script.server.handle_timeout(NEXT_REQUEST, &mut script.objects);
    script.sends([0x80, 0x00, 0x20, 1, 0, 0, 4, 5]);
    assert_eq!((script.objects.abandoned, script.server.poll_timeout()), (1, None));
}

#[test]
fn an_abort_is_not_answered_and_a_new_request_replaces_the_old() {
    let mut script = Script::new(&[0; 20]);
    script.answers([0x21, 0x00, 0x20, 1, 9, 0, 0, 0], [0x60, 0x00, 0x20, 1, 0, 0, 0, 0]);
    script.silent([0x80, 0x00, 0x20, 1, 0, 0, 4, 5]);
    assert!(script.server.is_idle());
    script.answers([0x21, 0x00, 0x20, 1, 9, 0, 0, 0], [0x60, 0x00, 0x20, 1, 0, 0, 0, 0]);
    script.answers([0x40, 0x00, 0x20, 1, 0, 0, 0, 0], [0x41, 0x00, 0x20, 1, 20, 0, 0, 0]);
    assert_eq!(script.objects.abandoned, 2);
}

/// An abort for a frame out of place names no object, so that it cannot hit the next transfer.
#[test]
fn nonsense_is_refused() {
    let mut script = Script::new(&[1, 2]);
    script.answers([0x40, 0x00, 0x20, 1, 0, 0, 0, 0], [0x4B, 0x00, 0x20, 1, 1, 2, 0, 0]);
    script.answers([0x60, 0, 0, 0, 0, 0, 0, 0], [0x80, 0, 0, 0, 1, 0, 4, 5]);
    script.answers([0xFF; 8], [0x80, 0, 0, 0, 1, 0, 4, 5]);
}
