//! A soft controller that a Modbus TCP client moves.
#![cfg(unix)]

use std::io::{BufRead, BufReader, Lines, Read, Write};
use std::net::TcpStream;
use std::process::{Child, ChildStdout, Command, Stdio};

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

/// Runs the configuration; what it says, and where its Modbus server is.
fn start() -> (Running, Lines<BufReader<ChildStdout>>, String) {
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
    let line = said.next().unwrap().unwrap();
    let address = line.strip_prefix("Modbus TCP at ").unwrap_or_else(|| panic!("{line}")).to_string();
    (Running(child), said, address)
}

#[test]
fn a_client_moves_an_axis_and_its_loss_halts_it() {
    let (_running, said, address) = start();

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

/// FFFFFFFFh is no velocity, as 7FFFFFFFh is none: the axis stays where it is, with error 106h.
#[test]
fn a_negative_velocity_is_out_of_range() {
    let (_running, _said, address) = start();
    let mut client = Client(TcpStream::connect(&address).unwrap());
    for velocity in [-1, i32::MAX, i32::MIN] {
        client.command(1, 0, 0);
        client.until("no order, no error", |(status, error, _)| status & 0b11 == 0b11 && error == 0);
        client.command(0b11, 30_000, velocity);
        client.until("refused", |(status, error, position)| {
            assert_eq!(position, 0, "{velocity}");
            status & 1 << 7 != 0 && error == 0x106
        });
    }
}

#[test]
fn the_port_is_in_the_stream_and_images_without_bytes_are_noted() {
    let directory = tempfile::tempdir().unwrap();
    let config = directory.path().join("run.toml");
    let run = |text: &str, json: &[&str]| {
        std::fs::write(&config, text).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_motionctl"));
        command.arg("run").arg(&config).args(["--for", "0.05"]).args(json).output().unwrap()
    };
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    let said = text(&run(CONFIG, &["--json"]).stdout);
    let first: serde_json::Value = serde_json::from_str(said.lines().next().unwrap()).unwrap();
    assert_eq!(first["event"], "modbus");
    let address: core::net::SocketAddr = first["address"].as_str().unwrap().parse().unwrap();
    assert_ne!(address.port(), 0);
    let note = "every Modbus request is refused";
    assert!(!text(&run(CONFIG, &[]).stderr).contains(note));
    let (without, _) = CONFIG.split_once("[parameters]").unwrap();
    assert!(text(&run(without, &[]).stderr).contains(note));
}

/// Random bytes, requests cut short, wrong lengths, connections that end in the middle: each ends its own
/// connection at most; another client is served all the while, and the axis does not move.
#[test]
fn garbage_disturbs_nobody() {
    let (_running, _said, address) = start();
    let connect = || TcpStream::connect(&address).unwrap();
    let mut good = Client(connect());
    good.command(1, 0, 0);
    good.until("enabled at standstill", |(status, ..)| status & 0b11 == 0b11);
    let mut random = 7u32;
    let mut next = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 24) as u8
    };
    let shapes: [&[u8]; 7] = [
        b"GET / HTTP/1.1\r\nHost: x\r\n\r\n",
        &[0, 1, 0, 0, 0, 6, 1, 3, 0],
        &[0, 1, 0, 0, 0, 0],
        &[0, 1, 0, 0, 0xFF, 0xFF, 1, 3],
        &[0, 1, 0x55, 0xAA, 0, 6, 1, 3, 0, 0, 0, 1],
        &[0, 1, 0, 0, 0, 2, 1, 0x83],
        &[0],
    ];
    let mut open = Vec::new();
    for round in 0..60 {
        let mut stream = connect();
        let bytes = match shapes.get(round % 9) {
            Some(shape) => shape.to_vec(),
            None => (0..400).map(|_| next()).collect(),
        };
        // A server that has closed already is no failure here.
        let _ = stream.write_all(&bytes);
        // Every third one stays, with what it began.
        if round % 3 == 0 {
            open.push(stream);
        }
        assert_eq!(good.status(), (0b11, 0, 0), "round {round}");
    }
    // Exceptions leave a connection as it is.
    let mut client = Client(connect());
    for (request, exception) in [
        (&[1, 1, 0, 0, 0, 1][..], [0x81, 1]),
        (&[1, 99], [0xE3, 1]),
        (&[1, 3, 0xFF, 0xFF, 0, 1], [0x83, 2]),
        (&[1, 3, 0, 0, 0, 0], [0x83, 3]),
        (&[1, 16, 0, 0, 0, 1, 2, 1], [0x90, 3]),
    ] {
        assert_eq!(client.ask(request)[1..], exception, "{request:?}");
    }
    assert_eq!(client.status(), (0b11, 0, 0));
}

/// One client too many takes the place of the one that has been silent for longest.
#[test]
fn silent_clients_do_not_lock_others_out() {
    let (_running, _said, address) = start();
    let mut first = Client(TcpStream::connect(&address).unwrap());
    first.status();
    let silent: Vec<_> = (0..20)
        .map(|_| {
            first.status();
            TcpStream::connect(&address).unwrap()
        })
        .collect();
    let mut late = Client(TcpStream::connect(&address).unwrap());
    late.status();
    first.status();
    // The first of the silent ones has been closed.
    assert!(matches!((&silent[0]).read(&mut [0]), Ok(0) | Err(_)));
}

/// A client that asks without end and never reads does not keep the controller from ending.
#[test]
fn a_client_that_does_not_read_does_not_hold_the_end_up() {
    let (mut running, said, address) = start();
    let mut stream = TcpStream::connect(&address).unwrap();
    let request = [0, 1, 0, 0, 0, 6, 1, 4, 0, 0, 0, 6].repeat(100);
    stream.set_write_timeout(Some(core::time::Duration::from_millis(300))).unwrap();
    // Until both ways are full, or the server has given up.
    while stream.write_all(&request).is_ok() {}
    let pid = running.0.id().to_string();
    assert!(Command::new("kill").args(["-TERM", &pid]).status().unwrap().success());
    // Its output ends with it.
    assert!(said.map_while(Result::ok).last().is_some());
    assert!(running.0.wait().unwrap().success());
}
