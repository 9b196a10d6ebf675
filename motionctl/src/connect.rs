//! From the command line to a device that can be called.

use motion_io::endpoint::Endpoint;
use motion_io::lb2::{Client, Remark, TIMES};
use motion_io::port::{Role, open};

use crate::cli::{Global, Line};
use crate::exit::Exit;
use crate::output::Output;

/// Reads are repeated so often.
const RETRIES: u8 = 2;

/// Which kind of endpoint a command needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ChoiceOf {
    /// `--port`, MOTIONCTL_PORT, `port`.
    Port,
    /// `--can`, MOTIONCTL_CAN, `can`.
    Can,
}

/// What the command line, the environment or the configuration names, as an endpoint's text; none, if nothing
/// is named.
pub(crate) fn named(global: &Global, given: Option<&str>, what: ChoiceOf) -> Result<Option<String>, Exit> {
    let config = match &global.config {
        Some(path) => {
            let name = path.display().to_string();
            let text = std::fs::read_to_string(path).map_err(|error| Exit::file(&name, &error))?;
            text.parse::<toml_edit::DocumentMut>().map_err(|error| Exit::file(&name, &error))?
        }
        None => toml_edit::DocumentMut::new(),
    };
    let key = match what {
        ChoiceOf::Port => "port",
        ChoiceOf::Can => "can",
    };
    let default = config.get(key).and_then(|item| item.as_str());
    let Some(written) = given.or(default) else { return Ok(None) };
    let named = config.get("endpoints").and_then(|table| table.get(written)).and_then(|item| item.as_str());
    Ok(Some(named.unwrap_or(written).to_owned()))
}

/// The same where something must be named.
pub(crate) fn choose(global: &Global, given: Option<&str>, what: ChoiceOf) -> Result<String, Exit> {
    let missing = match what {
        ChoiceOf::Port => "no port: --port EP, MOTIONCTL_PORT or `port` in the configuration file expected",
        ChoiceOf::Can => {
            "no CAN endpoint: --can EP, MOTIONCTL_CAN or `can` in the configuration file expected"
        }
    };
    named(global, given, what)?.ok_or_else(|| Exit::usage(missing))
}

/// The serial endpoint that `--port`, the environment or the configuration names.
pub(crate) fn endpoint(global: &Global, line: &Line) -> Result<Endpoint, Exit> {
    choose(global, line.port.as_deref(), ChoiceOf::Port)?
        .parse()
        .map_err(|error: motion_io::endpoint::EndpointError| Exit::usage(error.to_string()))
}

/// Opens the port and selects the device.
pub(crate) fn connect(out: &Output, global: &Global, line: &Line) -> Result<Client, Exit> {
    let endpoint = endpoint(global, line)?;
    let mut times = TIMES;
    times.answer = global.timeout.unwrap_or(times.answer);
    let port = open(&endpoint, Role::Master).map_err(|error| Exit::trouble(error.to_string()))?;
    let mut client = Client::new(port, times, RETRIES);
    if let Some(device) = line.device {
        client.select(device).map_err(|error| Exit::from(error).context(&format!("device {device}")))?;
    }
    remarks(out, &mut client);
    Ok(client)
}

/// Passes on what the line had to remark.
pub(crate) fn remarks(out: &Output, client: &mut Client) {
    for remark in client.take_remarks() {
        out.remark(match remark {
            Remark::SecondAnswer => {
                "two devices answered: a device with number 0 always does, or two have the same number"
            }
            _ => "an answer came after its time; a longer --timeout may help",
        });
    }
}
