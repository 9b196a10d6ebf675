//! LB2 on the serial endpoints: a thread for each line, which keeps waiting off the control cycle.

use core::time::Duration;
use std::io;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use lb2::device::{Device, DeviceEngine};
use motion_io::lb2::TIMES;
use motion_io::port::Port;

/// Longest time that an answer waits for its line.
const TURN: Duration = Duration::from_millis(2);

/// One line with its LB2 engine.
pub(super) struct Line {
    engine: DeviceEngine,
    received: Receiver<io::Result<Vec<u8>>>,
    answers: Option<Sender<Vec<u8>>>,
    thread: Option<JoinHandle<()>>,
}

impl Line {
    pub(super) fn new(mut port: Box<dyn Port>) -> Self {
        let (to_control, received) = channel();
        let (answers, from_control) = channel::<Vec<u8>>();
        let thread = std::thread::spawn(move || {
            let mut buffer = [0; 512];
            let mut turn = || {
                loop {
                    match from_control.try_recv() {
                        Ok(answer) => port.send(&answer)?,
                        Err(std::sync::mpsc::TryRecvError::Empty) => break,
                        Err(std::sync::mpsc::TryRecvError::Disconnected) => return Ok(None),
                    }
                }
                port.receive(&mut buffer, TURN).map(|len| Some(buffer[..len].to_vec()))
            };
            loop {
                match turn() {
                    Ok(None) => break,
                    Ok(Some(bytes)) if bytes.is_empty() => {}
                    Ok(Some(bytes)) => {
                        if to_control.send(Ok(bytes)).is_err() {
                            break;
                        }
                    }
                    Err(error) => {
                        // Nobody listens any more when the program ends.
                        let _ = to_control.send(Err(error));
                        break;
                    }
                }
            }
        });
        Self {
            engine: DeviceEngine::new(TIMES.inter_byte),
            received,
            answers: Some(answers),
            thread: Some(thread),
        }
    }

    /// Takes what has come and answers it.
    pub(super) fn serve(&mut self, now: Duration, device: &mut impl Device) -> io::Result<()> {
        self.engine.handle_timeout(now, device);
        while let Ok(bytes) = self.received.try_recv() {
            self.engine.handle_bytes(now, &bytes?, device);
            while let Some(answer) = self.engine.poll_transmit(now) {
                if let Some(answers) = &self.answers {
                    // A thread that has ended has told why, or will with the next turn.
                    let _ = answers.send(answer.to_vec());
                }
            }
        }
        Ok(())
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        // Without a sender the thread ends with its next turn.
        self.answers = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
