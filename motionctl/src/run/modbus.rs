//! Modbus TCP in the extension slot (manual A 6.9.4, Ethernet): the process image as registers.
//!
//! Input registers (function 04h) are the output image, what the controller says; holding registers
//! (03h, 06h, 10h) are the input image, what it is told. Register n holds bytes 2n and 2n + 1, the first
//! one as its high byte. What lies beyond the sizes `[060]`, `[061]` is refused as an illegal data address.

use core::net::SocketAddr;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;
use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

use motion_core::io::{BusKind, FieldBus, MAX_IMAGE};

use crate::exit::Exit;

/// Bytes before the part that the header's length counts.
const HEADER: usize = 6;
/// Longest request or answer of Modbus TCP.
const LONGEST: usize = 260;
/// Exception code of a register that there is not.
const ILLEGAL_ADDRESS: u8 = 2;
/// Clients at one time.
const CLIENTS: usize = 8;
/// How long a client may take to accept an answer.
const PATIENCE: Duration = Duration::from_secs(1);
/// How long a thread waits before it looks whether it is to end.
const LOOK: Duration = Duration::from_millis(100);

#[derive(Debug)]
struct Images {
    /// From the bus to the controller; as long as `[060]` says.
    input: [u8; MAX_IMAGE],
    output: [u8; MAX_IMAGE],
    sizes: (usize, usize),
    /// The last request.
    heard: Option<Instant>,
}

/// The server, until dropped.
#[derive(Debug)]
pub(super) struct Server {
    images: Arc<Mutex<Images>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    address: SocketAddr,
    /// Without a request for so long the bus is not in data exchange.
    watchdog: Duration,
}

fn lock(images: &Mutex<Images>) -> std::sync::MutexGuard<'_, Images> {
    images.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Server {
    /// Listens at `HOST:PORT` as this unit; 0 answers every unit number.
    pub(super) fn listen(address: &str, unit: u8, watchdog: Duration) -> Result<Self, Exit> {
        let trouble = |error: io::Error| match error.kind() {
            io::ErrorKind::InvalidInput => {
                Exit::usage(format!("[extension] listen = {address:?}: HOST:PORT expected, {error}"))
            }
            _ => Exit::file(&format!("Modbus TCP at {address}"), &error),
        };
        let listener = TcpListener::bind(address).map_err(trouble)?;
        listener.set_nonblocking(true).map_err(trouble)?;
        let bound = listener.local_addr().map_err(trouble)?;
        let images = Images { input: [0; MAX_IMAGE], output: [0; MAX_IMAGE], sizes: (0, 0), heard: None };
        let images = Arc::new(Mutex::new(images));
        let stop = Arc::new(AtomicBool::new(false));
        let (shared, flag) = (Arc::clone(&images), Arc::clone(&stop));
        let thread = std::thread::spawn(move || accept(&listener, unit, &shared, &flag));
        Ok(Self { images, stop, thread: Some(thread), address: bound, watchdog })
    }

    /// Where it listens.
    pub(super) const fn address(&self) -> SocketAddr {
        self.address
    }
}

impl FieldBus for Server {
    fn kind(&self) -> BusKind {
        BusKind::Ethernet
    }

    fn exchange(&mut self, output: &[u8], input: &mut [u8]) -> bool {
        let mut images = lock(&self.images);
        images.sizes = (input.len(), output.len());
        images.output.iter_mut().zip(output).for_each(|(to, from)| *to = *from);
        input.iter_mut().zip(&images.input).for_each(|(to, from)| *to = *from);
        images.heard.is_some_and(|heard| heard.elapsed() < self.watchdog)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A client that is being served.
struct Client {
    thread: JoinHandle<()>,
    /// Ends this client alone.
    stop: Arc<AtomicBool>,
    /// Its last request, ms since the server's start and one; 0 = none yet.
    heard: Arc<AtomicU64>,
}

/// Takes clients until the flag is set. One too many takes the place of the one that has been silent for
/// longest (Modbus messaging on TCP/IP implementation guide, 4.3.1.1): a client that has lost its power
/// never closes its connection.
fn accept(listener: &TcpListener, unit: u8, images: &Arc<Mutex<Images>>, stop: &AtomicBool) {
    let start = Instant::now();
    let mut clients: Vec<Client> = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        clients.retain(|client| !client.thread.is_finished());
        let Ok((stream, _)) = listener.accept() else {
            std::thread::sleep(LOOK);
            continue;
        };
        let going = |client: &&Client| !client.stop.load(Ordering::Relaxed);
        if clients.iter().filter(going).count() >= CLIENTS {
            let silent =
                clients.iter().filter(going).min_by_key(|client| client.heard.load(Ordering::Relaxed));
            silent.inspect(|client| client.stop.store(true, Ordering::Relaxed));
        }
        let now = move || start.elapsed().as_millis() as u64 + 1;
        let (own, heard) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let (images, ends, hears) = (Arc::clone(images), Arc::clone(&own), Arc::clone(&heard));
        let thread = std::thread::spawn(move || {
            // A client that goes, in whatever way, is gone.
            let _ = serve(stream, unit, &images, &ends, || hears.store(now(), Ordering::Relaxed));
        });
        clients.push(Client { thread, stop: own, heard });
    }
    // All at once: each may take its time.
    clients.iter().for_each(|client| client.stop.store(true, Ordering::Relaxed));
    for client in clients {
        let _ = client.thread.join();
    }
}

/// Fills `buffer`; false when the client has gone or the server ends.
fn fill(stream: &mut TcpStream, buffer: &mut [u8], stop: &AtomicBool) -> io::Result<bool> {
    let mut filled = 0;
    while let Some(rest) = buffer.get_mut(filled..).filter(|rest| !rest.is_empty()) {
        match stream.read(rest) {
            Ok(0) => return Ok(false),
            Ok(count) => filled += count,
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                if stop.load(Ordering::Relaxed) {
                    return Ok(false);
                }
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(true)
}

fn serve(
    mut stream: TcpStream,
    unit: u8,
    images: &Mutex<Images>,
    stop: &AtomicBool,
    heard: impl Fn(),
) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(LOOK))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    stream.set_nodelay(true)?;
    let mut request = [0; LONGEST];
    loop {
        let (header, _) = request.split_at_mut(HEADER);
        if !fill(&mut stream, header, stop)? {
            return Ok(());
        }
        let len = usize::from(u16::from_be_bytes([request[4], request[5]]));
        let Some(rest) = request.get_mut(HEADER..HEADER + len).filter(|_| len >= 2) else {
            // Where the next request begins cannot be known.
            return Ok(());
        };
        if !fill(&mut stream, rest, stop)? {
            return Ok(());
        }
        let Some(request) = request.get(..HEADER + len) else { return Ok(()) };
        let Some(answer) = answer(request, unit, images) else { return Ok(()) };
        heard();
        stream.write_all(&answer)?;
        if stop.load(Ordering::Relaxed) {
            return Ok(());
        }
    }
}

/// The answer to a request; empty for one to another unit, `None` where it is no Modbus.
fn answer(request: &[u8], unit: u8, images: &Mutex<Images>) -> Option<Vec<u8>> {
    let (&[t0, t1, 0, 0, _, _, asked], request) = request.split_first_chunk()? else { return None };
    if unit != 0 && asked != unit {
        return Some(Vec::new());
    }
    let function = request.first()?;
    let body = carry_out(request, &mut lock(images)).unwrap_or_else(|code| vec![function | 0x80, code]);
    // At most 253 bytes, as a request has.
    let mut answer = vec![t0, t1, 0, 0, 0, body.len() as u8 + 1, asked];
    answer.extend(body);
    Some(answer)
}

/// Reads or writes registers: function and data of the answer, or the exception code.
fn carry_out(request: &[u8], images: &mut Images) -> Result<Vec<u8>, u8> {
    if let Some(code) = misshapen(request) {
        return Err(code);
    }
    images.heard = Some(Instant::now());
    let word = |at: usize| u16::from_be_bytes([request[at], request[at + 1]]);
    let function = request[0];
    let count = if function == 6 { 1 } else { word(3) };
    let (image, size) = match function {
        4 => (&mut images.output, images.sizes.1),
        _ => (&mut images.input, images.sizes.0),
    };
    let registers =
        place(word(1), count, size).and_then(|place| image.get_mut(place)).ok_or(ILLEGAL_ADDRESS)?;
    match function {
        3 | 4 => Ok([&[function, registers.len() as u8], &*registers].concat()),
        6 => {
            registers.copy_from_slice(&request[3..]);
            Ok(request.to_vec())
        }
        _ => {
            registers.copy_from_slice(&request[6..]);
            Ok(request[..5].to_vec())
        }
    }
}

/// The exception code that a request earns by its shape alone: a function that there is not (1), a count
/// or a length that does not fit (3).
fn misshapen(request: &[u8]) -> Option<u8> {
    let count = request.get(3..5).and_then(|count| count.try_into().ok()).map(u16::from_be_bytes);
    let good = match (request.first()?, count) {
        (3 | 4, Some(1..=125)) | (6, Some(_)) => request.len() == 5,
        (16, Some(count @ 1..=123)) => {
            let bytes = 2 * usize::from(count);
            request.get(5).map(|bytes| usize::from(*bytes)) == Some(bytes) && request.len() == 6 + bytes
        }
        (3 | 4 | 6 | 16, _) => false,
        _ => return Some(1),
    };
    (!good).then_some(3)
}

/// Bytes of `count` registers from `address` on, if they are within an image of `size` bytes.
fn place(address: u16, count: u16, size: usize) -> Option<core::ops::Range<usize>> {
    let begin = 2 * usize::from(address);
    let end = begin + 2 * usize::from(count);
    (end <= size.next_multiple_of(2)).then_some(begin..end)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn images(input: usize, output: usize) -> Mutex<Images> {
        let mut images =
            Images { input: [0; MAX_IMAGE], output: [0; MAX_IMAGE], sizes: (input, output), heard: None };
        images.output[..4].copy_from_slice(&[1, 2, 3, 4]);
        Mutex::new(images)
    }

    fn ask(images: &Mutex<Images>, unit: u8, request: &[u8]) -> Vec<u8> {
        let mut whole = vec![0, 7, 0, 0, 0, request.len() as u8];
        whole.extend(request);
        let answer = answer(&whole, unit, images).unwrap();
        answer.get(HEADER..).unwrap_or(&[]).to_vec()
    }

    /// Application protocol specification 1.1b3, 6.3 to 6.12.
    #[test]
    fn registers_are_the_images() {
        let images = images(4, 4);
        assert_eq!(ask(&images, 1, &[1, 4, 0, 0, 0, 2]), [1, 4, 4, 1, 2, 3, 4]);
        assert_eq!(
            ask(&images, 1, &[1, 16, 0, 0, 0, 2, 4, 9, 8, 7, 6]),
            [1, 16, 0, 0, 0, 2],
            "written as a whole"
        );
        assert_eq!(ask(&images, 1, &[1, 6, 0, 1, 5, 5]), [1, 6, 0, 1, 5, 5]);
        assert_eq!(ask(&images, 1, &[1, 3, 0, 0, 0, 2]), [1, 3, 4, 9, 8, 5, 5]);
        assert_eq!(lock(&images).input[..4], [9, 8, 5, 5]);
        assert!(lock(&images).heard.is_some());
    }

    #[test]
    fn what_is_not_there_is_an_exception_and_changes_nothing() {
        let images = images(4, 3);
        assert_eq!(ask(&images, 1, &[1, 3, 0, 1, 0, 2]), [1, 0x83, 2], "one register beyond");
        assert_eq!(
            ask(&images, 1, &[1, 4, 0, 0, 0, 2]),
            [1, 4, 4, 1, 2, 3, 4],
            "an odd size: half a register"
        );
        assert_eq!(ask(&images, 1, &[1, 16, 0, 1, 0, 2, 4, 1, 1, 1, 1]), [1, 0x90, 2]);
        assert_eq!(ask(&images, 1, &[1, 6, 0xFF, 0xFF, 1, 1]), [1, 0x86, 2]);
        assert_eq!(ask(&images, 1, &[1, 1, 0, 0, 0, 1]), [1, 0x81, 1], "no coils");
        assert_eq!(ask(&images, 1, &[1, 43, 14, 1, 0]), [1, 0xAB, 1], "unknown function");
        assert_eq!(ask(&images, 1, &[1, 3, 0, 0, 0, 126]), [1, 0x83, 3], "more than fits an answer");
        assert_eq!(
            ask(&images, 1, &[1, 16, 0, 0, 0, 2, 200, 1, 2, 3, 4]),
            [1, 0x90, 3],
            "bytes that are not there"
        );
        assert_eq!(lock(&images).input[..4], [0; 4]);
        assert!(ask(&images, 1, &[2, 3, 0, 0, 0, 1]).is_empty(), "another unit");
        assert_eq!(ask(&images, 0, &[2, 3, 0, 0, 0, 1]), [2, 3, 2, 0, 0], "0 answers all");
    }

    /// 123 registers are as many as one request writes: 259 bytes.
    #[test]
    fn the_longest_request_is_carried_out() {
        let images = images(512, 512);
        for count in 121..=123_u8 {
            let data: Vec<u8> = (0..2 * count).collect();
            let request = [&[1, 16, 0, 0, 0, count, 2 * count][..], &data].concat();
            assert_eq!(ask(&images, 1, &request), [1, 16, 0, 0, 0, count], "{count} registers");
            assert_eq!(lock(&images).input[..data.len()], data);
        }
        assert_eq!(ask(&images, 1, &[1, 3, 0, 0, 0, 125]).len(), 253);
        assert_eq!(ask(&images, 0, &[0, 3, 0, 0, 0, 1]), [0, 3, 2, 0, 1], "0 is a unit too");
    }

    #[test]
    fn no_request_is_too_wild() {
        let images = images(512, 512);
        let mut random = 1u32;
        for _ in 0..200_000 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let mut request = random.to_be_bytes().repeat(4);
            request.truncate(2 + (random >> 8) as usize % 14);
            request[0] = 1;
            request[1] %= 18;
            let mut whole = vec![0, 7, 0, 0, 0, request.len() as u8];
            whole.extend(&request);
            let _ = answer(&whole, 1, &images);
        }
    }
}
