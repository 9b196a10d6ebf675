//! SDO transfers, and frames of none.

use core::fmt::Write as _;
use core::time::Duration;

use canopen_master::sdo::message::{Content as Carried, Request, Response};
use canopen_master::trace::{
    Content, Direction, Mode, Outcome, SdoFrame, ShortFrame, Transfer, Way, WrongCrc,
};
use canopen_master::{Address, ds402};
use motion_io::capture::Time;

use super::super::names::bytes;
use super::repeats::Cycle;
use super::{Story, VALUES, who};

impl Story<'_> {
    /// A frame that is part of no transfer.
    pub(super) fn stray(
        &mut self,
        time: Option<i64>,
        bus: Option<&str>,
        number: u16,
        sdo: &SdoFrame,
        data: &[u8],
    ) {
        let node = sdo.node;
        let late = self.late(number, sdo, time);
        let answer = late.as_deref().unwrap_or("answer to no request in the capture");
        let what = match sdo.content {
            Content::Response(Response::InitiateUpload { at, content: Carried::Expedited { data, .. } }) => {
                let object = self.names.object(node, at);
                let value = self.names.words(node, at, data.padded().get(..data.len()).unwrap_or(&[]));
                format!("read  {object} = {value}, {answer}")
            }
            Content::Response(Response::InitiateDownload { at }) => {
                format!("write {} is confirmed: {answer}", self.names.object(node, at))
            }
            Content::Response(Response::Abort { at, code }) => {
                let why = late.as_deref().unwrap_or("no transfer of it is open");
                format!("ABORTS {}, {code}: {why}", self.names.object(node, at))
            }
            Content::Request(Request::Abort { at, code }) => {
                let object = self.names.object(node, at);
                format!("{object}: the client ABORTS, {code}: no transfer of it is open")
            }
            Content::Response(
                Response::InitiateUpload { at, .. }
                | Response::InitiateBlockUpload { at, .. }
                | Response::InitiateBlockDownload { at, .. },
            ) if late.is_some() => {
                format!("begins a transfer of {}: {answer}", self.names.object(node, at))
            }
            _ => {
                if !self.cycle(Cycle::Stray(number, node), time, &[]).0 {
                    return;
                }
                format!("SDO frame that fits no transfer: {}", bytes(data))
            }
        };
        let fault = ShortFrame::of(sdo.way, data).map(short_words).unwrap_or_default();
        self.say(time, bus, &who(node), &format!("{what}{fault}"));
    }

    /// Of an answer to a request that the client has given up: how late it is.
    fn late(&self, bus: u16, sdo: &SdoFrame, time: Option<i64>) -> Option<String> {
        let at = sdo.at.filter(|_| sdo.way == Way::Response)?;
        let given_up = self.given_up.get(&(bus, sdo.node, at))?;
        let now = time.filter(|time| *time >= 0).map(|time| Time(time).since_zero());
        let before = ms(*given_up, now).map_or_else(String::new, |ms| format!(" {ms}"));
        Some(format!("late answer: the client had given up{before} before"))
    }

    /// A transfer that has ended; `remark` stands behind it.
    pub(super) fn tell(&mut self, transfer: &Transfer, bus: Option<&str>, remark: &str) {
        let Transfer { node, at, .. } = *transfer;
        if transfer.is_done() {
            self.names.heard(node, at, &transfer.data);
        }
        match transfer.outcome {
            Outcome::Aborted { by: Way::Request, .. } => {
                self.given_up.insert((transfer.bus, node, at), transfer.ended)
            }
            _ => self.given_up.remove(&(transfer.bus, node, at)),
        };
        let upload = transfer.direction == Direction::Upload;
        let news =
            transfer.is_done() && !transfer.late && self.is_news(transfer.bus, node, at, &transfer.data);
        let told = self.objects.entry((transfer.bus, node, at, upload)).or_default();
        let faults = faults(transfer);
        let same = told.outcome == Some(transfer.outcome)
            && told.data == transfer.data
            && told.faults == faults
            && told.values + told.failures > 0;
        // What goes wrong is counted by itself: any number of good ones do not hide it.
        let failed = !transfer.is_done() || !faults.is_empty();
        let count = if failed { &mut told.failures } else { &mut told.values };
        let enough = *count >= VALUES;
        let writes_state = !upload && matches!(at.index, ds402::CONTROL_WORD | ds402::MODE);
        if !news && !writes_state && (same || enough) {
            told.again += 1;
            return;
        }
        *count += 1;
        let last = *count == VALUES && !news && !writes_state;
        told.outcome = Some(transfer.outcome);
        told.data.clone_from(&transfer.data);
        told.faults.clone_from(&faults);
        let more = if last { " (and so on)" } else { "" };
        let object = match transfer.late && at == Address::new(0, 0) {
            true => "an object that is not named".into(),
            false => self.names.object(node, at),
        };
        let value = self.names.words(node, at, &transfer.data);
        let verb = if upload { "read" } else { "write" };
        let how = match transfer.mode {
            Mode::Expedited => String::new(),
            mode => {
                let mode = if mode == Mode::Block { "block" } else { "segmented" };
                let time =
                    ms(transfer.began, transfer.ended).map_or_else(String::new, |ms| format!(" in {ms}"));
                format!("  [{mode}, {} bytes{time}]", transfer.size)
            }
        };
        let what = match transfer.outcome {
            Outcome::Done => format!("{verb:<5} {object} = {value}{how}"),
            Outcome::Aborted { by: Way::Response, code } if upload => {
                format!("{verb:<5} {object}: REFUSED, {code}{how}")
            }
            Outcome::Aborted { by: Way::Response, code } => {
                format!("{verb:<5} {object} = {value}: REFUSED, {code}{how}")
            }
            Outcome::Aborted { by: Way::Request, code } => {
                format!("{verb:<5} {object}: the client gave up, {code}{how}")
            }
            Outcome::Incomplete if transfer.frames == 1 && !transfer.late => {
                format!("{verb:<5} {object}: NO ANSWER")
            }
            Outcome::Incomplete if transfer.lacking && !transfer.late => {
                format!("{verb:<5} {object}: frames are missing in the capture behind {value}{how}")
            }
            Outcome::Incomplete => format!("{verb:<5} {object}: unfinished, {value}{how}"),
        };
        let ended = transfer.ended.map(|time| Time::from_zero(time).0);
        // That nothing more came shows later, and is told where it shows.
        let (time, since) = match self.latest.filter(|latest| ended.is_some_and(|ended| ended < *latest)) {
            Some(latest) => {
                (self.last_time.max(Some(latest)), format!(", last heard at {}", self.clock(ended)))
            }
            None => (ended, String::new()),
        };
        self.say(time, bus, &who(node), &format!("{what}{faults}{since}{remark}{more}"));
    }
}

/// What is wrong with a transfer, to stand behind it.
fn faults(transfer: &Transfer) -> String {
    let mut faults = transfer.short.map(short_words).unwrap_or_default();
    if let Some(announced) = transfer.misannounced() {
        let _ = write!(faults, ", {announced} bytes announced");
    }
    if let Some(WrongCrc { found, computed }) = transfer.wrong_crc {
        let _ = write!(faults, ", CRC WRONG: {found:04X}h came, {computed:04X}h computed");
    }
    faults
}

fn short_words(frame: ShortFrame) -> String {
    let what = if frame.way == Way::Request { "request" } else { "answer" };
    format!(", {what} of {} bytes, 8 expected", frame.len)
}

/// Milliseconds from one time to another, where they differ.
fn ms(from: Option<Duration>, to: Option<Duration>) -> Option<String> {
    let time = to?.checked_sub(from?).filter(|time| !time.is_zero())?;
    Some(format!("{:.1} ms", time.as_secs_f64() * 1e3))
}
