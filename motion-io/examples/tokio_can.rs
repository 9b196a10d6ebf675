//! A CANopen master in a task of tokio: `tokio_can can0` scans the bus and prints who is there, while another
//! task counts.

use core::time::Duration;
use std::process::ExitCode;

use canopen_master::NodeSet;
use canopen_master::master::{Config, Event, Master};
use canopen_master::{NodeId, scan};
use motion_io::can::{AsyncDriver, BusEvent, Engine};
use pdo::Frame;

/// Engines are driven by their methods' names.
struct Wire(Box<Master<'static, Vec<u8>, 127>>);

impl Engine for Wire {
    fn handle_frame(&mut self, now: Duration, frame: &Frame) {
        self.0.handle_frame(now, frame);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.0.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Duration) -> Option<Frame> {
        self.0.poll_transmit(now)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.0.poll_timeout()
    }

    fn handle_bus(&mut self, _now: Duration, event: BusEvent) {
        eprintln!("{event}");
    }
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let Some(interface) = std::env::args().nth(1) else {
        eprintln!("which interface?");
        return ExitCode::from(2);
    };
    tokio::select! {
        found = who(&interface) => match found {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("{interface}: {error}");
                ExitCode::from(5)
            }
        },
        () = count() => ExitCode::from(3),
    }
}

/// The other task of this program: ends after ten seconds.
async fn count() {
    for _ in 0..100 {
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}

async fn who(interface: &str) -> Result<(), Box<dyn core::error::Error>> {
    let mut driver = AsyncDriver::open(interface)?;
    let mut wire = Wire(Box::new(Master::new(Config::default())));
    wire.0.scan(NodeSet::up_to(NodeId::MAX), scan::Options::default())?;
    loop {
        let limit = driver.now() + Duration::from_millis(100);
        driver.turn(&mut wire, limit, |_, _, _| ()).await?;
        while let Some(event) = wire.0.poll_event() {
            let Event::Scanned { found, .. } = event else { continue };
            for node in found.iter() {
                let info = wire.0.info(node).copied().unwrap_or_default();
                println!("node {node}: {}", info.name);
            }
            return Ok(());
        }
    }
}
