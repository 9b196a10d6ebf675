//! `motionctl can sdo …`: objects, read and written.

use serde_json::json;

use super::cli::{Object, Sdo};
use super::session::{Session, TransferError, node_id};
use super::value::{address, data_type, decode, device, encode, hex};
use crate::cli::Global;
use crate::exit::Exit;
use crate::output::{Output, counted};

pub(crate) fn run(out: &Output, global: &Global, command: &Sdo) -> Result<(), Exit> {
    match command {
        Sdo::Read { object, output } => {
            let (at, data_type) = resolve(object)?;
            let mut session = Session::open(global, &object.line)?;
            session.stop_transfers()?;
            let read = session.upload(node_id(object.node)?, at, object.block)?;
            let (data, mode) = read.map_err(|error| tell(out, error))?;
            if let Some(path) = output {
                std::fs::write(path, &data)
                    .map_err(|error| Exit::file(&path.display().to_string(), &error))?;
            }
            let value = data_type.map(|data_type| decode(&data, data_type)).transpose()?;
            let mut document = json!({
                "node": object.node,
                "index": at.index,
                "subindex": at.sub,
                "mode": mode.name(),
                "size": data.len(),
                "data": hex(&data),
            });
            if let Some(value) = &value {
                document["value"] = value.clone();
            }
            out.document(document, || match (&value, output) {
                (_, Some(path)) => {
                    println!("{} written to {}", counted(data.len(), "byte", "bytes"), path.display());
                }
                (Some(serde_json::Value::String(text)), None) => println!("{text}"),
                (Some(value), None) => println!("{value}"),
                (None, None) => println!("{}", hex(&data)),
            });
            Ok(())
        }
        Sdo::Write { object, value, file } => {
            let (at, data_type) = resolve(object)?;
            let data = match (value, file) {
                (_, Some(path)) => {
                    std::fs::read(path).map_err(|error| Exit::file(&path.display().to_string(), &error))?
                }
                (Some(value), None) => {
                    let data_type = data_type.ok_or_else(|| {
                        Exit::usage("the value's type is not known: --type T, or --eds FILE that has the object, expected")
                    })?;
                    encode(value, data_type)?
                }
                (None, None) => return Err(Exit::usage("a value or --file expected")),
            };
            let bytes = counted(data.len(), "byte", "bytes");
            if out.only_plans(|| format!("would write {bytes} to {at} of node {}", object.node)) {
                return Ok(());
            }
            let mut session = Session::open(global, &object.line)?;
            session.stop_transfers()?;
            let size = data.len();
            let shown = hex(&data);
            let written = session.download(node_id(object.node)?, at, data, object.block)?;
            let mode = written.map_err(|error| tell(out, error))?;
            let document = json!({
                "node": object.node,
                "index": at.index,
                "subindex": at.sub,
                "mode": mode.name(),
                "size": size,
                "data": shown,
            });
            out.document(document, || {
                out.say(&format!("{bytes} written to {at} of node {}", object.node));
            });
            Ok(())
        }
    }
}

/// JSON readers get the codes, too.
pub(crate) fn tell(out: &Output, error: TransferError) -> Exit {
    out.document(error.json(), || {});
    error.into()
}

fn resolve(
    object: &Object,
) -> Result<(canopen_master::Address, Option<canopen_master::data_type::DataType>), Exit> {
    let device = device(object.eds.as_deref())?;
    let at = address(&object.object, device.as_ref())?;
    Ok((at, data_type(object.data_type.as_deref(), device.as_ref(), at)?))
}
