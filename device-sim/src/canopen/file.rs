//! A node with the objects of a device file (EDS, DCF, XDD).

use canopen_master::data_type::DataType;
use canopen_master::eds::{self, Access};
use canopen_master::lss::Identity;
use canopen_master::od::Limits;
use pdo::mapping::Entry as Mapped;
use pdo::{Address, CobId, NodeId, Payload, Transmission};

use super::common::{MAPPED, OFF, Slot, objects};
use super::objects::{Entry, Objects};
use super::{Context, Device, Node, Pdos, Rights, Settings};

/// Longest value of a text or a domain.
const LONGEST: usize = super::STORE;

/// Why a file makes no node.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileNodeError {
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] eds::ReadError),
}

/// A device that only remembers what is written to it.
#[derive(Debug, Clone, Copy, Default)]
pub struct FileNode;

impl FileNode {
    /// The node of a file; `node` = `None`: the file's own address if it has one, otherwise it waits for
    /// one over LSS.
    ///
    /// # Errors
    /// [`FileNodeError`]: the bytes are no device file.
    pub fn node(bytes: &[u8], node: Option<NodeId>, serial: u32) -> Result<Node<Self>, FileNodeError> {
        let device = eds::read(bytes)?.device;
        let node = node.or_else(|| device.node_id().and_then(|id| NodeId::new(id).ok()));
        let number = |sub| {
            let value = device.entry(0x1018, sub)?.default_bytes(node.map(NodeId::raw))?.ok()?;
            Some(u32::from_le_bytes(value.try_into().ok()?))
        };
        let identity = Identity {
            vendor: number(1).or_else(|| device.vendor_number()).unwrap_or(0),
            product: number(2).or_else(|| device.product_number()).unwrap_or(0),
            revision: number(3).or_else(|| device.revision_number()).unwrap_or(0),
            serial: number(4).filter(|serial| *serial != 0).unwrap_or(serial),
        };
        let mut objects = objects(0, device.product_name(), identity);
        // Of what every node has, an object of the file has only its own entries.
        objects.retain(|at| device.object(at.index).is_none_or(|object| object.entry(at.sub).is_some()));
        let id = node.map(NodeId::raw);
        for object in &device.objects {
            for entry in object.entries() {
                add(&mut objects, &device, object, entry, id);
            }
        }
        let rpdos = core::array::from_fn(|number| slot(&device, 0x1400, number as u16, id));
        let tpdos = core::array::from_fn(|number| slot(&device, 0x1800, number as u16, id));
        Ok(Node::new(Settings { node, identity }, Self, objects, Pdos::new(rpdos, tpdos)))
    }
}

/// A value that the file gives, the configured one before the default.
fn value(entry: &eds::Entry, node: Option<u8>) -> Option<Vec<u8>> {
    [entry.value_bytes(node), entry.default_bytes(node)].into_iter().flatten().find_map(Result::ok)
}

/// PDO `number` (from 0) as the file says, off where it says nothing. `index`: of the communication
/// parameters of PDO 0.
fn slot(device: &eds::Device, index: u16, number: u16, node: Option<u8>) -> Slot {
    const MAPPING: u16 = 0x200;
    let read = |entry: &eds::Entry, node| Some(Payload::from_slice(&value(entry, node)?).word() as u32);
    let number_at = |index, sub| read(device.entry(index + number, sub)?, node);
    let mut slot = OFF;
    let own = &mut slot.communication;
    if let Some(entry) = device.entry(index + number, 1) {
        // Without an address yet, what depends on it can only be the predefined one.
        let raw = read(entry, node).or_else(|| Some(read(entry, Some(1))? & 0xE000_0000)).unwrap_or(0);
        own.cob_id = CobId(raw);
    }
    let transmission = number_at(index, 2).and_then(|raw| Transmission::new(raw as u8).ok());
    own.transmission = transmission.unwrap_or(own.transmission);
    own.inhibit = number_at(index, 3).map_or(0, |time| time as u16);
    own.event_timer = number_at(index, 5).map_or(0, |time| time as u16);
    own.sync_start = number_at(index, 6).map_or(0, |counter| counter as u8);
    for sub in 1..=MAPPED as u8 {
        if let Some(raw) = number_at(index + MAPPING, sub) {
            slot.mapping.set(sub, Mapped::from_raw(raw));
        }
    }
    // A count that does not fit maps nothing.
    let _ = slot.mapping.enable(number_at(index + MAPPING, 0).map_or(0, |count| count as u8));
    slot
}

fn add(
    objects: &mut Objects,
    device: &eds::Device,
    object: &eds::Object,
    entry: &eds::Entry,
    node: Option<u8>,
) {
    let at = Address::new(object.index, entry.subindex);
    // The engine's own.
    if matches!(at.index, 0x1001 | 0x1003) {
        return;
    }
    let data_type = entry.data_type.map_or(DataType::DOMAIN, |own| DataType(device.base_type(own).0));
    let rights = entry.access.map_or(Rights::Ro, Access::rights);
    let mut new = match data_type.size() {
        Some(_) => Entry::number(data_type, rights, 0),
        None => Entry { data_type, rights, ..Entry::domain(LONGEST) },
    };
    new.mappable = entry.is_mappable();
    // Beyond 64 bits with sign only the limits of a type are; what is written to 1010h and 1011h is none
    // of their values.
    if let (Some(low), Some(high)) = entry.limits(node)
        && let (Ok(low), Ok(high)) = (i64::try_from(low), i64::try_from(high))
        && low <= high
        && !matches!(at.index, 0x1010 | 0x1011)
    {
        new.limits = Some(Limits { low, high });
    }
    let fits = |value: &Vec<u8>| data_type.size().is_none_or(|size| value.len() == usize::from(size));
    let given = value(entry, node).filter(fits);
    let own = objects.entry(at).filter(|own| own.data_type == data_type).map(|own| own.value.clone());
    // LSS has the identity, too.
    let of_lss = at.index == 0x1018 && at.sub > 0;
    if let Some(value) = if of_lss { own.or(given) } else { given.or(own) } {
        new.value = value;
    } else if at.sub == 0 && object.is_composed() {
        new.set(object.entries().last().map_or(0, |last| last.subindex.into()));
    } else if let Some(Limits { low, high }) = new.limits {
        new.set(0.clamp(low, high).into());
    }
    objects.insert(at.index, at.sub, new);
}

impl Device for FileNode {
    fn written(&mut self, _context: &mut Context<'_>, _at: Address) {}

    fn update(&mut self, _context: &mut Context<'_>) {}

    fn describes_pdos(&self) -> bool {
        true
    }
}
