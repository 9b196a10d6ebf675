//! A virtual LinMot drive on pseudo-terminals, and what reaches it over each carrier.

use crate::common::{Bench, Controller, Ran};
use serde_json::Value;

/// The drive, and the arguments that reach it.
#[allow(dead_code)] // not in every test program
pub(crate) const CARRIERS: [(&str, &[&str]); 3] = [
    ("--serial=pty:LINE", &["--port", "LINE"]),
    ("--can=slcan-pty:LINE", &["--can", "slcan:LINE"]),
    ("--can=slcan-pty:LINE", &["--can", "slcan:LINE", "--carrier", "pdo"]),
];

/// Manual B, figure 13.
#[allow(dead_code)] // not in every test program
pub(crate) const CURVE: &str = "# name=Example_Curve length_ms=200 unit=0.1um\n0\n30154\n116978\n250000\n413176\n586824\n750000\n883022\n969846\n1000000\n";

pub(crate) struct Linmot<'a> {
    pub(crate) bench: &'a Bench,
    pub(crate) carrier: &'a [&'a str],
}

impl Linmot<'_> {
    pub(crate) fn run(&self, arguments: &[&str]) -> Ran {
        let mut all = vec!["linmot"];
        all.extend(arguments.iter().take_while(|argument| **argument != "--"));
        all.extend(self.carrier);
        all.extend(arguments.iter().skip_while(|argument| **argument != "--"));
        self.bench.run(&all)
    }

    #[allow(dead_code)] // not in every test program
    #[track_caller]
    pub(crate) fn json(&self, arguments: &[&str]) -> Value {
        let mut all = vec!["--json"];
        all.extend(arguments);
        self.run(&all).ends(0).json()
    }
}

/// An entry of the command table in hex, with the entry that follows it: FFFFh is none.
#[allow(dead_code)] // not in every test program
pub(crate) fn entry(link: u16, name: &str) -> String {
    let [low, high] = link.to_le_bytes();
    let name: String = name.bytes().map(|byte| format!("{byte:02X}")).collect();
    format!("01A7{low:02X}{high:02X}0001{:0<64}{name:0<32}{:0<20}", "", "")
}

#[allow(dead_code)] // not in every test program
pub(crate) fn drive(bench: &Bench, endpoint: &str) -> Controller {
    bench.device(&["sim", "linmot", endpoint, "--state", "FLASH"])
}
