//! What a device description says, whatever the format it is written in.

use alloc::borrow::ToOwned;
use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use super::types::{Access, List, ObjectType, PdoMapping, length_in_bits};
use super::value::{Number, ValueError, to_bytes};
use crate::data_type::DataType;

/// Keys and values in their order; keys compare without regard to case.
#[derive(Clone, Default)]
pub struct Fields {
    pairs: Vec<(String, String)>,
    /// Where each key stands first, in lower case; only of many keys, which would be slow to look
    /// through.
    places: BTreeMap<String, usize>,
}

/// Keys that are looked through one by one.
const FEW: usize = 64;

impl Fields {
    fn place(&self, key: &str) -> Option<usize> {
        if self.places.is_empty() {
            return self.pairs.iter().position(|(have, _)| have.eq_ignore_ascii_case(key));
        }
        self.places.get(&key.to_ascii_lowercase()).copied()
    }

    fn push(&mut self, key: String, value: String) {
        self.pairs.push((key, value));
        let new = match self.pairs.len() {
            ..=FEW => return,
            len if self.places.is_empty() => 0..len,
            len => len - 1..len,
        };
        for (at, (key, _)) in self.pairs.iter().enumerate().take(new.end).skip(new.start) {
            self.places.entry(key.to_ascii_lowercase()).or_insert(at);
        }
    }

    /// The value of a key.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<&str> {
        self.pairs.get(self.place(key)?).map(|(_, value)| value.as_str())
    }

    /// The value of a key as a number.
    #[must_use]
    pub fn number(&self, key: &str) -> Option<i128> {
        Number::parse(self.get(key)?)?.resolve(None).ok()
    }

    /// The value of a key as a number that fits `T`.
    #[must_use]
    pub fn int<T: TryFrom<i128>>(&self, key: &str) -> Option<T> {
        T::try_from(self.number(key)?).ok()
    }

    /// Whether the key's value is a number other than 0.
    #[must_use]
    pub fn flag(&self, key: &str) -> bool {
        self.number(key).is_some_and(|number| number != 0)
    }

    /// Sets a key: in its place, or as the last one. Returns whether it was there.
    pub fn set(&mut self, key: &str, value: impl Into<String>) -> bool {
        match self.place(key).and_then(|at| self.pairs.get_mut(at)) {
            Some((_, old)) => {
                *old = value.into();
                true
            }
            None => {
                self.push(key.to_owned(), value.into());
                false
            }
        }
    }

    /// Brings the keys into alphabetical order.
    fn sort(&mut self) {
        let mut pairs = core::mem::take(self).pairs;
        pairs.sort();
        *self = pairs.into_iter().collect();
    }

    /// Keys and values in their order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (&str, &str)> {
        self.pairs.iter().map(|(key, value)| (key.as_str(), value.as_str()))
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }
}

impl PartialEq for Fields {
    fn eq(&self, other: &Self) -> bool {
        self.pairs == other.pairs
    }
}

impl Eq for Fields {}

impl fmt::Debug for Fields {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map().entries(self.iter()).finish()
    }
}

impl<K: Into<String>, V: Into<String>> FromIterator<(K, V)> for Fields {
    fn from_iter<I: IntoIterator<Item = (K, V)>>(pairs: I) -> Self {
        let mut fields = Self::default();
        pairs.into_iter().for_each(|(key, value)| fields.push(key.into(), value.into()));
        fields
    }
}

/// A section with a name of its own.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Section {
    /// Between the brackets.
    pub name: String,
    /// Its entries.
    pub fields: Fields,
}

/// A sub-object, or what an object's own section says.
///
/// Values are texts as the file has them, because a default may depend on the node ID; the methods
/// evaluate them.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Entry {
    /// Sub-index; 0 for an object's own description.
    pub subindex: u8,
    /// `ParameterName`.
    pub name: String,
    /// `ObjectType`; VAR where the file does not say.
    pub object_type: ObjectType,
    /// `DataType`.
    pub data_type: Option<DataType>,
    /// `AccessType`.
    pub access: Option<Access>,
    /// `PDOMapping`; `None` where the file does not say, which means no.
    pub pdo_mapping: Option<PdoMapping>,
    /// `DefaultValue`: the value after power-on of a device that was never configured.
    pub default: Option<String>,
    /// `LowLimit`.
    pub low_limit: Option<String>,
    /// `HighLimit`.
    pub high_limit: Option<String>,
    /// `ParameterValue` of a DCF: the configured value.
    pub value: Option<String>,
    /// `ParameterRefName` of a DCF.
    pub ref_name: Option<String>,
    /// `Denotation` of a DCF: what the value is for in the application.
    pub denotation: Option<String>,
    /// `ObjFlags`: bit 0 refuse on write, bit 1 refuse on scan.
    pub flags: Option<u32>,
    /// Everything else, such as `UploadFile`, `Unit`, or values that could not be read.
    pub other: Fields,
}

impl Entry {
    /// An entry of which nothing but the sub-index is known.
    #[must_use]
    pub fn new(subindex: u8) -> Self {
        Self {
            subindex,
            name: String::new(),
            object_type: ObjectType::VAR,
            data_type: None,
            access: None,
            pdo_mapping: None,
            default: None,
            low_limit: None,
            high_limit: None,
            value: None,
            ref_name: None,
            denotation: None,
            flags: None,
            other: Fields::default(),
        }
    }

    /// Bytes of its texts.
    pub(crate) fn text_length(&self) -> usize {
        let texts =
            [&self.default, &self.low_limit, &self.high_limit, &self.value, &self.ref_name, &self.denotation];
        texts.into_iter().flatten().map(String::len).sum::<usize>() + self.name.len()
    }

    /// Whether the value can be mapped into a PDO.
    #[must_use]
    pub fn is_mappable(&self) -> bool {
        self.pdo_mapping.is_some_and(PdoMapping::is_mappable)
    }

    /// The default as the bytes that SDO transfers; `None` where there is none, or an empty one.
    ///
    /// # Errors
    /// [`ValueError`] where the text is no value of the entry's data type.
    pub fn default_bytes(&self, node_id: Option<u8>) -> Option<Result<Vec<u8>, ValueError>> {
        self.bytes(self.default.as_deref(), node_id)
    }

    /// The configured value of a DCF as the bytes that SDO transfers; `None` where there is none, or
    /// an empty one.
    ///
    /// # Errors
    /// [`ValueError`] where the text is no value of the entry's data type.
    pub fn value_bytes(&self, node_id: Option<u8>) -> Option<Result<Vec<u8>, ValueError>> {
        self.bytes(self.value.as_deref(), node_id)
    }

    /// The text of the value that the device has after configuration: the configured one, or the default. An
    /// empty `ParameterValue` configures nothing.
    pub(crate) fn in_force(&self) -> Option<&str> {
        let configured = self.value.as_deref().filter(|value| !value.trim().is_empty());
        configured.or(self.default.as_deref())
    }

    /// Lowest and highest value of an integer; `None` where not given or no number.
    #[must_use]
    pub fn limits(&self, node_id: Option<u8>) -> (Option<i128>, Option<i128>) {
        let limit = |text: &Option<String>| {
            let number = Number::parse(text.as_deref()?)?.resolve(node_id).ok()?;
            super::value::fit(number, self.data_type?)
        };
        (limit(&self.low_limit), limit(&self.high_limit))
    }

    fn bytes(&self, text: Option<&str>, node_id: Option<u8>) -> Option<Result<Vec<u8>, ValueError>> {
        let text = text.filter(|text| !text.is_empty())?;
        Some(to_bytes(text, self.data_type?, node_id))
    }
}

/// An object of the dictionary.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Object {
    /// Index.
    pub index: u16,
    /// The list that names it.
    pub list: List,
    /// What the object's own section says. For a VAR or DOMAIN that is the value at sub-index 0; with
    /// [`Self::compact`] it describes sub-indices 1 and up.
    pub own: Entry,
    /// Sub-objects in ascending order, those of compact storage included.
    pub subs: Vec<Entry>,
    /// `CompactSubObj`: sub-indices 1 to this number are stored together.
    pub compact: Option<u8>,
    /// `ObjectLinks`.
    pub links: Vec<u16>,
}

impl Object {
    fn sort_keys(&mut self) {
        self.own.other.sort();
        self.subs.iter_mut().for_each(|entry| entry.other.sort());
    }

    /// An object of which nothing but the index is known.
    #[must_use]
    pub fn new(index: u16) -> Self {
        let list = List::of(index);
        Self { index, list, own: Entry::new(0), subs: Vec::new(), compact: None, links: Vec::new() }
    }

    /// `ParameterName`.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.own.name
    }

    /// Whether it has sub-objects, and so no value of its own.
    #[must_use]
    pub fn is_composed(&self) -> bool {
        !self.subs.is_empty()
            || matches!(self.own.object_type, ObjectType::ARRAY | ObjectType::RECORD | ObjectType::DEFSTRUCT)
    }

    /// The entry at a sub-index.
    #[must_use]
    pub fn entry(&self, subindex: u8) -> Option<&Entry> {
        if self.is_composed() {
            let at = self.subs.binary_search_by_key(&subindex, |entry| entry.subindex).ok()?;
            self.subs.get(at)
        } else {
            (subindex == 0).then_some(&self.own)
        }
    }

    /// The entry at a sub-index, to change it.
    #[must_use]
    pub fn entry_mut(&mut self, subindex: u8) -> Option<&mut Entry> {
        if self.is_composed() {
            let at = self.subs.binary_search_by_key(&subindex, |entry| entry.subindex).ok()?;
            self.subs.get_mut(at)
        } else {
            (subindex == 0).then_some(&mut self.own)
        }
    }

    /// Every value that can be reached: the sub-objects, or the object itself.
    #[must_use]
    pub fn entries(&self) -> &[Entry] {
        if self.is_composed() { &self.subs } else { core::slice::from_ref(&self.own) }
    }

    /// Adds or replaces a sub-object, in its place.
    pub fn insert(&mut self, entry: Entry) {
        match self.subs.binary_search_by_key(&entry.subindex, |have| have.subindex) {
            Ok(at) => self.subs.splice(at..=at, [entry]).for_each(drop),
            Err(at) => self.subs.insert(at, entry),
        }
    }

    /// What compact storage says of a sub-index (CiA 306-1, 6.6.3.4): sub-index 0 is the number of
    /// sub-objects, the others are as the object's own section, their names numbered.
    #[must_use]
    pub(crate) fn compact_entry(&self, subindex: u8) -> Entry {
        if subindex == 0 {
            let mut entry = Entry::new(0);
            entry.name = "NrOfObjects".into();
            entry.data_type = Some(DataType::UNSIGNED8);
            entry.access = Some(Access::ReadOnly);
            entry.pdo_mapping = Some(PdoMapping::No);
            entry.default = Some(alloc::format!("{}", self.compact.unwrap_or_default()));
            return entry;
        }
        let mut entry = self.own.clone();
        entry.subindex = subindex;
        entry.name = alloc::format!("{}{subindex}", self.own.name);
        entry.object_type = ObjectType::VAR;
        entry.other = Fields::default();
        entry
    }
}

/// A module of a modular device (CiA 306-1, 8).
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Module {
    /// Its number, from 1.
    pub number: u16,
    /// `[MxModuleInfo]`: `ProductName`, `ProductVersion`, `ProductRevision`, `OrderCode`.
    pub info: Fields,
    /// `[MxComments]`.
    pub comments: Vec<String>,
    /// Objects that exist once, however many such modules are connected.
    pub fixed: Vec<Object>,
    /// Objects that get new sub-objects with every connected module; `Count` and `ObjExtend` are in
    /// their own entry's `other`.
    pub extends: Vec<Object>,
}

/// A device description: EDS, DCF, XDD or XDC.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Device {
    /// `[FileInfo]`.
    pub file_info: Fields,
    /// `[DeviceInfo]`.
    pub device_info: Fields,
    /// `[DeviceComissioning]` of a DCF.
    pub commissioning: Fields,
    /// `[DummyUsage]`: `DummyNNNN=1` where data type NNNNh fills gaps in RPDOs.
    pub dummy_usage: Fields,
    /// `[Comments]`.
    pub comments: Vec<String>,
    /// The objects in ascending order.
    pub objects: Vec<Object>,
    /// Modules that the device takes.
    pub modules: Vec<Module>,
    /// Every other section, such as `[SupportedModules]`, `[ConnectedModules]`,
    /// `[DynamicChannels]`, `[Tools]`.
    pub other: Vec<Section>,
}

impl Device {
    /// Brings the keys of every section into alphabetical order, to compare devices regardless of it.
    pub(crate) fn sort_keys(&mut self) {
        let parts =
            [&mut self.file_info, &mut self.device_info, &mut self.commissioning, &mut self.dummy_usage];
        parts.into_iter().for_each(Fields::sort);
        for module in &mut self.modules {
            module.info.sort();
            module.fixed.iter_mut().chain(&mut module.extends).for_each(Object::sort_keys);
        }
        self.objects.iter_mut().for_each(Object::sort_keys);
        self.other.iter_mut().for_each(|section| section.fields.sort());
    }

    /// The object at an index.
    #[must_use]
    pub fn object(&self, index: u16) -> Option<&Object> {
        let at = self.objects.binary_search_by_key(&index, |object| object.index).ok()?;
        self.objects.get(at)
    }

    /// The object at an index, to change it.
    #[must_use]
    pub fn object_mut(&mut self, index: u16) -> Option<&mut Object> {
        let at = self.objects.binary_search_by_key(&index, |object| object.index).ok()?;
        self.objects.get_mut(at)
    }

    /// The entry at index and sub-index.
    #[must_use]
    pub fn entry(&self, index: u16, subindex: u8) -> Option<&Entry> {
        self.object(index)?.entry(subindex)
    }

    /// Index and sub-index of what a person calls by name: `Statusword`, or `Identity object.Vendor
    /// ID` for a sub-object; without regard to case. The first one of several of the same name.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<(u16, u8)> {
        for object in &self.objects {
            if object.name().eq_ignore_ascii_case(name) {
                return Some((object.index, 0));
            }
            let sub = strip_prefix(name, object.name()).and_then(|rest| rest.strip_prefix(['.', '/']));
            let hit =
                sub.and_then(|sub| object.subs.iter().find(|entry| entry.name.eq_ignore_ascii_case(sub)));
            if let Some(entry) = hit {
                return Some((object.index, entry.subindex));
            }
        }
        None
    }

    /// The basic data type behind a data type: itself, or where it is defined by the device
    /// (DEFTYPE), the type that the definition's sub-index 1 names.
    #[must_use]
    pub fn base_type(&self, data_type: DataType) -> DataType {
        let defined = || {
            let definition = self.object(data_type.0)?.entry(1)?;
            let base = Number::parse(definition.default.as_deref()?)?.resolve(None).ok()?;
            u16::try_from(base).ok().map(DataType)
        };
        if length_in_bits(data_type).is_some() { data_type } else { defined().unwrap_or(data_type) }
    }

    /// `VendorName` of `[DeviceInfo]`.
    #[must_use]
    pub fn vendor_name(&self) -> &str {
        self.device_info.get("VendorName").unwrap_or_default()
    }

    /// `VendorNumber`: the vendor ID in 1018h:01.
    #[must_use]
    pub fn vendor_number(&self) -> Option<u32> {
        self.device_info.int("VendorNumber")
    }

    /// `ProductName` of `[DeviceInfo]`.
    #[must_use]
    pub fn product_name(&self) -> &str {
        self.device_info.get("ProductName").unwrap_or_default()
    }

    /// `ProductNumber`: the product code in 1018h:02.
    #[must_use]
    pub fn product_number(&self) -> Option<u32> {
        self.device_info.int("ProductNumber")
    }

    /// `RevisionNumber`: the revision in 1018h:03.
    #[must_use]
    pub fn revision_number(&self) -> Option<u32> {
        self.device_info.int("RevisionNumber")
    }

    /// Bit rates in kbit/s that the device supports (`BaudRate_…=1`), in the file's order.
    pub fn bit_rates(&self) -> impl Iterator<Item = u16> {
        self.device_info.iter().filter_map(|(key, value)| {
            let rate = strip_prefix(key, "BaudRate_")?;
            (Number::parse(value)?.value != 0).then(|| rate.parse().ok())?
        })
    }

    /// Node ID of a DCF.
    #[must_use]
    pub fn node_id(&self) -> Option<u8> {
        self.commissioning.int("NodeID").filter(|id| (1..=127).contains(id))
    }

    /// Bit rate of a DCF in kbit/s.
    #[must_use]
    pub fn bit_rate(&self) -> Option<u16> {
        self.commissioning.int("Baudrate")
    }

    /// Data types that may fill gaps in RPDOs.
    pub fn dummies(&self) -> impl Iterator<Item = DataType> {
        self.dummy_usage.iter().filter_map(|(key, value)| {
            let index = u16::from_str_radix(strip_prefix(key, "Dummy")?, 16).ok()?;
            (Number::parse(value)?.value != 0).then_some(DataType(index))
        })
    }

    /// The other section of this name.
    #[must_use]
    pub fn section(&self, name: &str) -> Option<&Fields> {
        self.other
            .iter()
            .find(|section| section.name.eq_ignore_ascii_case(name))
            .map(|section| &section.fields)
    }

    /// Numbers of the modules that are connected, by position (`[ConnectedModules]` of a DCF).
    pub fn connected_modules(&self) -> impl Iterator<Item = u16> {
        let entries = self.section("ConnectedModules").map(Fields::iter).into_iter().flatten();
        entries
            .filter(|(key, _)| key.parse::<u16>().is_ok())
            .filter_map(|(_, value)| u16::try_from(Number::parse(value)?.value).ok())
    }

    /// Whether it configures a device (DCF, XDC) rather than describing all of its kind (EDS, XDD).
    #[must_use]
    pub fn is_configuration(&self) -> bool {
        let configured = |object: &Object| {
            object.own.value.is_some() || object.subs.iter().any(|entry| entry.value.is_some())
        };
        !self.commissioning.is_empty() || self.objects.iter().any(configured)
    }
}

pub(crate) fn strip_prefix<'a>(text: &'a str, prefix: &str) -> Option<&'a str> {
    let head = text.get(..prefix.len())?;
    head.eq_ignore_ascii_case(prefix).then(|| text.get(prefix.len()..))?
}
