//! The drive.

use core::time::Duration;
use std::collections::BTreeMap;

use linmot::curve::{INFO_WORDS, InfoBlock, SETPOINT_SIZE};
use linmot::drive::{Block, Drive, LoggedError, Parameter, Progress};
use linmot::table::{Entry, Presence};
use linmot::upid::{Layer, Upid, Usage};

use super::flash::{Curves, Flash, ImageError, StoredCurve, Table};

/// Errors that the log keeps.
const LOG: usize = 25;

/// How long what takes its time takes (project-defined; the LinRS manual says about 3 s for a start).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Times {
    /// From restart or power on to the first answer.
    pub restart: Duration,
    /// Starting MC and application software.
    pub start: Duration,
    /// Writing curves or command table to flash.
    pub flash: Duration,
}

impl Default for Times {
    fn default() -> Self {
        Self {
            restart: Duration::from_millis(800),
            start: Duration::from_millis(300),
            flash: Duration::from_millis(400),
        }
    }
}

#[derive(Debug, Clone)]
enum Job {
    Start,
    Curves(Curves),
    Table(Table),
}

/// A virtual drive.
#[derive(Debug, Clone)]
pub struct VirtualDrive {
    tree: BTreeMap<u16, Parameter>,
    times: Times,
    flash: Flash,
    ram: BTreeMap<u16, u32>,
    curves: Curves,
    table: Table,
    open: Option<(u16, StoredCurve)>,
    errors: Vec<LoggedError>,
    occurred: u16,
    stopped: bool,
    away_until: Option<Duration>,
    job: Option<(Duration, Job)>,
    writes: u64,
}

impl VirtualDrive {
    /// A drive as delivered, ready: ROM values are the defaults, no curves, no command table.
    #[must_use]
    pub fn new(tree: impl IntoIterator<Item = Parameter>, times: Times) -> Self {
        let tree: BTreeMap<u16, Parameter> = tree.into_iter().map(|p| (p.upid.0, p)).collect();
        let rom = tree.iter().map(|(upid, parameter)| (*upid, parameter.default)).collect();
        let flash = Flash { rom, curves: Some(Curves::new()), table: Some(Table::new()) };
        let mut drive = Self {
            tree,
            times,
            flash,
            ram: BTreeMap::new(),
            curves: Curves::new(),
            table: Table::new(),
            open: None,
            errors: Vec::new(),
            occurred: 0,
            stopped: false,
            away_until: None,
            job: None,
            writes: 0,
        };
        drive.load();
        drive
    }

    /// Replaces the non-volatile memory by an [`image`](Self::image), and starts from it.
    ///
    /// # Errors
    /// The bytes are no image.
    pub fn load_image(&mut self, bytes: &[u8]) -> Result<(), ImageError> {
        let mut flash = Flash::from_bytes(bytes)?;
        flash.rom.retain(|upid, _| self.tree.contains_key(upid));
        for (upid, parameter) in &self.tree {
            flash.rom.entry(*upid).or_insert(parameter.default);
        }
        self.flash = flash;
        self.load();
        Ok(())
    }

    /// The non-volatile memory as bytes.
    #[must_use]
    pub fn image(&self) -> Vec<u8> {
        self.flash.to_bytes()
    }

    /// How often non-volatile memory was written.
    #[must_use]
    pub const fn writes(&self) -> u64 {
        self.writes
    }

    /// Changes how long what begins from now on takes.
    pub const fn set_times(&mut self, times: Times) {
        self.times = times;
    }

    /// Adds an error to the log.
    pub fn log_error(&mut self, error: LoggedError) {
        self.occurred = self.occurred.wrapping_add(1);
        self.errors.truncate(LOG - 1);
        self.errors.insert(0, error);
    }

    /// The curve in RAM.
    #[must_use]
    pub fn curve_in_ram(&self, id: u16) -> Option<&StoredCurve> {
        self.curves.get(&id)
    }

    /// Power fails at `now` and comes back at once. What was being written to flash is lost.
    pub fn power_cycle(&mut self, now: Duration) {
        self.advance(now);
        // `advance` has left a job only if it has not ended.
        match self.job.take() {
            Some((_, Job::Curves(_))) => self.flash.curves = None,
            Some((_, Job::Table(_))) => self.flash.table = None,
            Some((_, Job::Start)) | None => {}
        }
        self.boot(now);
    }

    fn boot(&mut self, now: Duration) {
        self.away_until = Some(now.saturating_add(self.times.restart));
        self.load();
    }

    /// ROM and flash to RAM; a torn area is empty.
    fn load(&mut self) {
        self.ram.clone_from(&self.flash.rom);
        self.curves = self.flash.curves.clone().unwrap_or_default();
        self.table = self.flash.table.clone().unwrap_or_default();
        self.open = None;
        self.stopped = false;
    }

    fn begin(&mut self, now: Duration, time: Duration, job: Job) -> Progress {
        self.job = Some((now.saturating_add(time), job));
        if time.is_zero() {
            self.advance(now);
            return Progress::Done;
        }
        Progress::Running
    }
}

impl Drive for VirtualDrive {
    fn parameter(&self, upid: Upid) -> Option<Parameter> {
        self.tree.get(&upid.0).copied()
    }

    fn next_parameter(&self, from: Upid) -> Option<Parameter> {
        self.tree.range(from.0..).next().map(|(_, parameter)| *parameter)
    }

    fn rom(&self, upid: Upid) -> u32 {
        self.flash.rom.get(&upid.0).copied().unwrap_or(0)
    }

    fn ram(&self, upid: Upid) -> u32 {
        self.ram.get(&upid.0).copied().unwrap_or(0)
    }

    fn set_rom(&mut self, upid: Upid, value: u32) {
        self.writes += 1;
        self.flash.rom.insert(upid.0, value);
    }

    fn set_ram(&mut self, upid: Upid, value: u32) {
        self.ram.insert(upid.0, value);
    }

    fn defaults(&mut self, layer: Layer) {
        self.writes += 1;
        for (upid, parameter) in &self.tree {
            if parameter.upid.layer() == Some(layer) && parameter.usage.contains(Usage::ROM_WRITE) {
                self.flash.rom.insert(*upid, parameter.default);
            }
        }
    }

    fn restart(&mut self, now: Duration) {
        self.advance(now);
        self.job = None;
        self.boot(now);
    }

    fn is_restarting(&self, now: Duration) -> bool {
        self.away_until.is_some_and(|until| until > now)
    }

    fn stop(&mut self, now: Duration) -> Progress {
        self.advance(now);
        self.stopped = true;
        Progress::Done
    }

    fn start(&mut self, now: Duration) -> Progress {
        self.advance(now);
        if !self.stopped {
            return Progress::Done;
        }
        // A start of the firmware copies its ROM values too (manual B 2.3).
        for (upid, value) in &self.flash.rom {
            if matches!(Upid(*upid).layer(), Some(Layer::MotionControl | Layer::Application)) {
                self.ram.insert(*upid, *value);
            }
        }
        self.begin(now, self.times.start, Job::Start)
    }

    fn is_stopped(&self) -> bool {
        self.stopped
    }

    fn is_busy(&self, now: Duration) -> bool {
        self.job.as_ref().is_some_and(|(until, _)| *until > now)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        let job = self.job.as_ref().map(|(until, _)| *until);
        [job, self.away_until].into_iter().flatten().min()
    }

    fn advance(&mut self, now: Duration) {
        if let Some((_, job)) = self.job.take_if(|(until, _)| *until <= now) {
            self.writes += u64::from(!matches!(job, Job::Start));
            match job {
                Job::Start => self.stopped = false,
                Job::Curves(curves) => self.flash.curves = Some(curves),
                Job::Table(table) => self.flash.table = Some(table),
            }
        }
        self.away_until.take_if(|until| *until <= now);
    }

    fn curve(&self, id: u16) -> Option<(u16, u16)> {
        let curve = self.curves.get(&id)?;
        Some((linmot::curve::INFO_SIZE, u16::try_from(curve.data.len() * usize::from(SETPOINT_SIZE)).ok()?))
    }

    fn curve_word(&self, id: u16, block: Block, word: u16) -> u32 {
        let Some(curve) = self.curves.get(&id) else { return 0 };
        let words: &[u32] = match block {
            Block::Info => &curve.info,
            Block::Data => &curve.data,
        };
        words.get(usize::from(word)).copied().unwrap_or(0)
    }

    fn open_curve(&mut self, id: u16, data_size: u16, modify: bool) -> bool {
        let blank =
            || StoredCurve { info: [0; INFO_WORDS], data: vec![0; usize::from(data_size / SETPOINT_SIZE)] };
        let existing = if modify { self.curves.get(&id).cloned() } else { None };
        self.open = Some((id, existing.unwrap_or_else(blank)));
        true
    }

    fn put_curve_word(&mut self, block: Block, word: u16, value: u32) {
        let Some((_, curve)) = &mut self.open else { return };
        let words: &mut [u32] = match block {
            Block::Info => &mut curve.info,
            Block::Data => &mut curve.data,
        };
        if let Some(room) = words.get_mut(usize::from(word)) {
            *room = value;
        }
    }

    fn commit_curve(&mut self) -> bool {
        let Some((id, curve)) = &self.open else { return false };
        let info = InfoBlock::parse(&curve.info);
        let agrees =
            info.check().is_ok() && info.id == *id && usize::from(info.setpoints) == curve.data.len();
        if agrees {
            self.curves.insert(*id, curve.clone());
        }
        agrees
    }

    fn delete_curves(&mut self) {
        self.open = None;
        self.curves.clear();
    }

    fn save_curves(&mut self, now: Duration) -> Progress {
        self.advance(now);
        self.begin(now, self.times.flash, Job::Curves(self.curves.clone()))
    }

    fn error_counts(&self) -> (u16, u16) {
        (self.errors.len() as u16, self.occurred)
    }

    fn error(&self, entry: u16) -> Option<LoggedError> {
        self.errors.get(usize::from(entry)).copied()
    }

    fn error_text(&self, code: u16) -> &[u8] {
        match code {
            0x01 => b"Err: X4 Logic Supply Too Low",
            0x03 => b"Err: X1 Pwr Voltage Too Low",
            0x0B => b"Err: Position Lag Always Too Big",
            0x64 => b"Cfg Err: No Motor Defined",
            _ => b"Unknown Error",
        }
    }

    fn presence(&self) -> Presence {
        let mut presence = Presence::default();
        self.table.keys().for_each(|entry| presence.set(*entry, true));
        presence
    }

    fn entry(&self, entry: u16) -> Option<Entry> {
        self.table.get(&entry).copied()
    }

    fn set_entry(&mut self, entry: u16, content: Option<Entry>) {
        match content {
            Some(content) => self.table.insert(entry, content),
            None => self.table.remove(&entry),
        };
    }

    fn save_table(&mut self, now: Duration) -> Progress {
        self.advance(now);
        self.begin(now, self.times.flash, Job::Table(self.table.clone()))
    }
}
