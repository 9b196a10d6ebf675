//! A node with the objects of a device file (EDS, DCF, XDD).

use canopen_master::data_type::DataType;
use canopen_master::eds::{self, Access, ObjectType};
use canopen_master::lss::Identity;
use pdo::{Address, NodeId};

use super::common::{MAPPED, PDOS, objects};
use super::objects::{Entry, Objects, Rights};
use super::{Context, Device, Node, Settings};

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
        let id = node.map(NodeId::raw);
        for object in &device.objects {
            if object.is_composed() {
                for entry in object.entries() {
                    add(&mut objects, object.index, entry.subindex, &device, entry, id);
                }
            } else {
                add(&mut objects, object.index, 0, &device, &object.own, id);
            }
        }
        Ok(Node::new(Settings { node, identity }, Self, objects))
    }
}

fn add(
    objects: &mut Objects,
    index: u16,
    sub: u8,
    device: &eds::Device,
    entry: &eds::Entry,
    node: Option<u8>,
) {
    // Sub-indices that the node itself lives by keep their rights: identity, PDOs, the store.
    let own = matches!(index, 0x1003 | 0x1010 | 0x1011 | 0x1018 | 0x2000);
    let beyond = matches!(index & 0xFC00, 0x1400 | 0x1800) && index & 0x1FF >= PDOS;
    let mapping = matches!(index & 0xFE00, 0x1600 | 0x1A00);
    if beyond || (own && objects.entry(Address::new(index, sub)).is_some()) || (mapping && sub > MAPPED) {
        return;
    }
    let data_type = entry.data_type.map_or(DataType::DOMAIN, |own| DataType(device.base_type(own).0));
    let value =
        [entry.value_bytes(node), entry.default_bytes(node)].into_iter().flatten().find_map(Result::ok);
    let rights = rights(entry);
    let mut new = match data_type.size() {
        Some(_) => Entry::number(data_type, rights, 0),
        None => Entry { data_type, rights, value: Vec::new(), longest: LONGEST, limits: None },
    };
    if let Some(value) =
        value.filter(|value| data_type.size().is_none_or(|size| value.len() == usize::from(size)))
    {
        new.value = value;
    }
    if entry.object_type == ObjectType::DOMAIN && data_type == DataType::DOMAIN {
        new.longest = LONGEST;
    }
    if let (Some(low), Some(high)) = entry.limits(node)
        && low <= high
    {
        new.limits = Some((low, high));
    }
    // PDO objects of the file as they are, writable so that a master can set them up.
    if mapping || matches!(index & 0xFE00, 0x1400 | 0x1800) {
        new.rights.write |= sub != 0 || mapping;
        new.limits = None;
    }
    objects.insert(index, sub, new);
}

fn rights(entry: &eds::Entry) -> Rights {
    let mappable = entry.is_mappable();
    let (read, write) = match entry.access {
        Some(Access::WriteOnly) => (false, true),
        Some(Access::ReadOnly | Access::Const) | None => (true, false),
        Some(_) => (true, true),
    };
    Rights { read, write, transmit: mappable && read, receive: mappable && write }
}

impl Device for FileNode {
    fn written(&mut self, _context: &mut Context<'_>, _at: Address) {}

    fn update(&mut self, _context: &mut Context<'_>) {}
}
