//! `motionctl conform`: a small conformance test of one node.

mod tell;

use core::time::Duration;
use std::path::PathBuf;

use canopen_master::eds;
use clap::Args;
use conformance::node::{Config, Line, TestError, checks, test};
use conformance::report::{Case, Outcome, counts, json as report_json, junit};
use motion_io::endpoint::CanEndpoint;
use serde_json::json;

use crate::can::cli::CanLine;
use crate::can::session::{answer_time, connect, endpoint, gone, node_id};
use crate::cli::Global;
use crate::exit::Exit;
use crate::output::{Output, apart, writable, write_beside};
use tell::Teller;

#[derive(Debug, Clone, Args)]
pub(crate) struct Conform {
    #[command(flatten)]
    line: CanLine,
    /// Node ID
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=127))]
    node: u8,
    /// Its device file: EDS, DCF or XDD
    #[arg(long, value_name = "FILE")]
    eds: PathBuf,
    /// Write the report as JUnit XML, too
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
}

pub(crate) fn run(out: &Output, global: &Global, arguments: &Conform) -> Result<(), Exit> {
    let name = arguments.eds.display().to_string();
    if let Some(junit) = &arguments.junit {
        apart(("--eds", &arguments.eds), ("--junit", junit))?;
    }
    let bytes = crate::eds::bytes(&arguments.eds)?;
    let device = eds::read(&bytes).map_err(|error| Exit::file(&name, &error))?.device;
    if global.dry_run {
        plan(out, arguments.node, &device);
        return Ok(());
    }
    let config = Config {
        node: node_id(arguments.node)?,
        device: &device,
        answer: answer_time(global),
        permitted: global.yes,
    };
    let endpoint = endpoint(global, &arguments.line)?;
    if let Some(path) = &arguments.junit {
        writable(path)?;
    }
    let mut cases = Vec::new();
    let mut teller = Teller::new(out);
    let ended = test_over(&endpoint, &config, |case| {
        teller.tell(case);
        cases.push(case.clone());
    });
    teller.finish();
    // A report of what came to no end says so, that nobody takes an older one for it.
    if let Err(exit) = &ended {
        cases.push(Case {
            id: "conform.ended".into(),
            title: "The test comes to its end".into(),
            clause: String::new(),
            outcome: Outcome::Failed(exit.message.clone()),
            time: Duration::ZERO,
        });
    }
    if let Some(path) = &arguments.junit {
        write_beside(path, junit(&format!("node {}", arguments.node), &cases).as_bytes())?;
    }
    let (passed, failed, skipped) = counts(&cases);
    let document = json!({
        "node": arguments.node,
        "eds": name,
        "passed": passed,
        "failed": failed,
        "skipped": skipped,
        "cases": report_json(&cases),
    });
    out.document(document, || {
        if ended.is_ok() {
            println!("{passed} passed, {failed} failed, {skipped} skipped");
        }
    });
    ended?;
    if failed == 0 { Ok(()) } else { Err(Exit::check(format!("{failed} of {} cases failed", cases.len()))) }
}

fn test_over(endpoint: &CanEndpoint, config: &Config<'_>, told: impl FnMut(&Case)) -> Result<(), Exit> {
    match test(&mut Line::new(connect(endpoint)?), config, told) {
        Ok(_) => Ok(()),
        Err(TestError::Io(error)) => Err(gone(&error)),
        Err(error @ TestError::Silent(_)) => Err(Exit { status: 3, message: error.to_string() }),
        Err(error) => Err(Exit::usage(format!("{error}: --yes gives it"))),
    }
}

fn plan(out: &Output, node: u8, device: &eds::Device) {
    let values: usize = device.objects.iter().map(|object| object.entries().len()).sum();
    let list: Vec<_> = checks()
        .iter()
        .map(|check| {
            json!({ "id": check.id, "title": check.title, "clause": check.clause, "touches": check.touches })
        })
        .collect();
    out.document(json!({ "node": node, "objects": values, "checks": list }), || {
        println!("would test node {node}:");
        for check in checks() {
            let touches = if check.touches.is_empty() { "only reads" } else { check.touches };
            println!("  {}: {} ({})\n    {touches}", check.id, check.title, check.clause);
        }
        println!(
            "  and each of {values} values of the device file, compared, read and written as its access says"
        );
        println!("    writes nothing but what it has read; outside 1000h to 1FFFh only with --yes");
    });
}
