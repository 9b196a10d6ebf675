//! `motionctl`: LB2 functions, parameters, and virtual devices, from the command line.
//!
//! Exit status: 0 done or equal, 1 differs or a check failed, 2 usage, 3 no answer in time, 4 refused
//! by the device, 5 port or file trouble.

// The program, with motion-io, is what reads the machine's clock.
#![allow(clippy::disallowed_methods)]

/// As std's, but that nobody reads to the end, as with `| head`, is no trouble, and what it says is
/// [`harmless`](output::harmless).
macro_rules! println {
    ($($words:tt)*) => { $crate::output::put_text(&format!("{}\n", format_args!($($words)*))) };
}

/// As std's, but that nobody listens is no trouble, and what it says is [`harmless`](output::harmless).
macro_rules! eprintln {
    ($($words:tt)*) => {
        $crate::output::complain(&$crate::output::harmless(&format!("{}\n", format_args!($($words)*))))
    };
}

mod can;
mod cli;
mod conform;
mod connect;
mod decode;
mod demo;
mod eds;
mod exit;
mod image;
mod lb2;
mod linmot;
mod monitor;
mod output;
mod params;
mod plot;
mod run;
mod sim;
mod storage;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};
use cli::{Cli, Command};

fn main() -> ExitCode {
    let cli = Cli::parse();
    let out = output::Output::new(&cli.global);
    let done = match cli.command {
        Command::Demo(arguments) => demo::run(&out, &arguments),
        Command::Plot(arguments) => plot::run(&out, &arguments),
        Command::Run(arguments) => run::run(&out, &arguments),
        Command::Sim { command } => sim::start(&out, &cli.global, &command),
        Command::Can { command } => can::run(&out, &cli.global, &command),
        Command::Conform(arguments) => conform::run(&out, &cli.global, &arguments),
        Command::Bus(arguments) => can::bus::run(&out, &arguments),
        Command::Ports => ports(&out),
        Command::Lb2 { command } => lb2::run(&out, &cli.global, &command),
        Command::Linmot { command } => linmot::run(&out, &cli.global, &command),
        Command::Params { command } => params::run(&out, &cli.global, &command),
        Command::Monitor(args) => monitor::run(&out, &cli.global, &args),
        Command::Decode(args) => decode::run(&out, &args),
        Command::Eds { command } => eds::run(&out, cli.global.dry_run, &command),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "motionctl", &mut script);
            output::put(script);
            Ok(())
        }
        Command::Man { output: Some(folder) }
            if out.only_plans(|| format!("would write manual pages into {}", folder.display())) =>
        {
            Ok(())
        }
        Command::Man { output: Some(folder) } => clap_mangen::generate_to(Cli::command(), &folder)
            .map_err(|error| exit::Exit::file(&folder.display().to_string(), &error)),
        Command::Man { output: None } => {
            let mut page = Vec::new();
            let rendered = clap_mangen::Man::new(Cli::command()).render(&mut page);
            output::put(page);
            rendered.map_err(|error| exit::Exit::file("the manual page", &error))
        }
    };
    // A result that nobody could read is none.
    let troubles = [done, output::lost()].into_iter().filter_map(Result::err);
    let status = troubles.inspect(|exit| out.failed(exit)).last().map(|exit| exit.status);
    status.map_or(ExitCode::SUCCESS, ExitCode::from)
}

fn ports(out: &output::Output) -> Result<(), exit::Exit> {
    let ports = motion_io::port::list().map_err(|error| exit::Exit::file("serial ports", &error))?;
    let interfaces =
        motion_io::can::interfaces().map_err(|error| exit::Exit::file("CAN interfaces", &error))?;
    let serial = ports.iter().map(|(name, text)| serde_json::json!({ "name": name, "description": text }));
    let can = interfaces.iter().map(
        |(name, up)| serde_json::json!({ "name": name, "endpoint": format!("socketcan:{name}"), "up": up }),
    );
    let document =
        serde_json::json!({ "serial": serial.collect::<Vec<_>>(), "can": can.collect::<Vec<_>>() });
    out.document(document, || {
        if ports.is_empty() {
            println!("no serial ports found");
        }
        for (name, text) in &ports {
            println!("{name}  {text}");
        }
        if interfaces.is_empty() {
            println!("no CAN interfaces found");
        }
        for (name, up) in &interfaces {
            println!("socketcan:{name}  {}", if *up { "up" } else { "down" });
        }
    });
    Ok(())
}
