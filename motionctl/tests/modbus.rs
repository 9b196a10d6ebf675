//! A soft controller that a Modbus TCP client moves.
#![cfg(unix)]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};

const CONFIG: &str = r#"
[extension]
kind = "modbus-tcp"
listen = "127.0.0.1:0"
watchdog = 0.5

[parameters]
0 = 1
108 = 0
109 = 0
601 = 0
602 = 0
56 = 1
60 = 12
61 = 12
642 = 100000
654 = 100
648 = 300
708 = 20
714 = 20

[[simulate]]
kind = "plant"
block = 1
drive = "first-order"
speed = 100000
tau = 0.005
"#;

struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

struct Client(TcpStream);

impl Client {
    fn ask(&mut self, request: &[u8]) -> Vec<u8> {
        let mut whole = vec![0, 1, 0, 0, 0, request.len() as u8];
        whole.extend(request);
        self.0.write_all(&whole).unwrap();
        let mut header = [0; 6];
        self.0.read_exact(&mut header).unwrap();
        let mut answer = vec![0; usize::from(header[5])];
        self.0.read_exact(&mut answer).unwrap();
        answer
    }

    /// Control word, position, velocity.
    fn command(&mut self, control: u16, position: i32, velocity: i32) {
        let mut request = vec![1, 16, 0, 0, 0, 6, 12];
        request.extend(control.to_be_bytes());
        request.extend([0, 0]);
        request.extend(position.to_be_bytes());
        request.extend(velocity.to_be_bytes());
        assert_eq!(self.ask(&request), [1, 16, 0, 0, 0, 6]);
    }

    /// Status word, error, position.
    fn status(&mut self) -> (u16, u16, i32) {
        let answer = self.ask(&[1, 4, 0, 0, 0, 6]);
        assert_eq!(answer[..3], [1, 4, 12]);
        let word = |at: usize| u16::from_be_bytes([answer[at], answer[at + 1]]);
        (word(3), word(5), i32::from_be_bytes([answer[7], answer[8], answer[9], answer[10]]))
    }

    /// Asks until it is so. The controller's end, which closes the connection, is the limit.
    fn until(&mut self, what: &str, mut done: impl FnMut((u16, u16, i32)) -> bool) {
        println!("waits for: {what}");
        while !done(self.status()) {}
    }
}

#[test]
fn a_client_moves_an_axis_and_its_loss_halts_it() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("run.toml"), CONFIG).unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_motionctl"))
        .args(["run", "run.toml", "--for", "60"])
        .current_dir(directory.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stdout.take().unwrap()).lines();
    let _running = Running(child);
    let line = said.next().unwrap().unwrap();
    let address = line.strip_prefix("Modbus TCP at ").unwrap_or_else(|| panic!("{line}")).to_string();

    let mut client = Client(TcpStream::connect(&address).unwrap());
    assert_eq!(client.ask(&[1, 3, 0, 6, 0, 1])[1..], [0x83, 2], "only what [060] says");
    client.command(1, 0, 0);
    client.until("enabled at standstill", |(status, ..)| status & 0b11 == 0b11);
    client.command(0b11, 30_000, 0);
    client.until("at the target", |(status, error, position)| {
        assert_eq!(error, 0);
        status & 1 << 6 != 0 && status & 1 << 3 != 0 && (29_980..=30_020).contains(&position)
    });
    // Away, slowly, and then silence: the axis is halted.
    client.command(1, 0, 0);
    client.until("the end of the order is seen", |(status, ..)| status & 1 << 6 == 0);
    client.command(0b11, -2_000_000, 1000);
    client.until("moving", |(status, ..)| status & 1 << 2 != 0);
    drop(client);
    let mut lines = said.map_while(Result::ok).filter(|line| line.contains("axis 1: "));
    let mut next = |words: &str| lines.any(|line| line.contains(words));
    assert!(next("discrete-motion") && next("standstill") && next("discrete-motion") && next("standstill"));
    let mut client = Client(TcpStream::connect(&address).unwrap());
    client.until("halted on the way", |(status, _, position)| status & 0b11 == 0b11 && position > -2_000_000);
    // The order that still stands in the image moves nothing.
    let (_, _, before) = client.status();
    for _ in 0..50 {
        assert_eq!(client.status(), (0b11, 0, before));
    }
}
