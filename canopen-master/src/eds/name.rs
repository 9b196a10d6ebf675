//! What a section is by its name (CiA 306-1, 6.6.3.2, 6.6.3.4, 7.3, 8.3).

use super::model::strip_prefix;
use super::types::List;

/// Sections of an object.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) enum Part {
    /// `[1018]`
    Own,
    /// `[1018sub1]`
    Sub(u8),
    /// `[1018Name]`, names of compact sub-objects.
    Names,
    /// `[1018Value]`, their values.
    Values,
    /// `[1018Denotation]`, their denotations.
    Denotations,
    /// `[1018ObjectLinks]`
    Links,
}

/// Sections of a module.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum ModulePart {
    Info,
    Comments,
    FixedObjects,
    Fixed(u16, Part),
    SubExtends,
    SubExt(u16, Part),
}

/// All sections.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Name {
    FileInfo,
    DeviceInfo,
    /// `[DeviceComissioning]`; false where it is spelled with two m.
    Commissioning(bool),
    DummyUsage,
    Comments,
    List(List),
    Object(u16, Part),
    Module(u16, ModulePart),
    Other,
}

impl Name {
    pub(crate) fn parse(name: &str) -> Self {
        if let Some((index, part)) = object(name) {
            return Self::Object(index, part);
        }
        let is = |other: &str| name.eq_ignore_ascii_case(other);
        if is("FileInfo") {
            Self::FileInfo
        } else if is("DeviceInfo") {
            Self::DeviceInfo
        } else if is("DeviceComissioning") {
            Self::Commissioning(true)
        } else if is("DeviceCommissioning") {
            Self::Commissioning(false)
        } else if is("DummyUsage") {
            Self::DummyUsage
        } else if is("Comments") {
            Self::Comments
        } else if let Some(list) = List::parse(name) {
            Self::List(list)
        } else {
            module(name).map_or(Self::Other, |(number, part)| Self::Module(number, part))
        }
    }
}

fn object(name: &str) -> Option<(u16, Part)> {
    let digits = name.get(..4).filter(|digits| digits.bytes().all(|byte| byte.is_ascii_hexdigit()))?;
    let index = u16::from_str_radix(digits, 16).ok()?;
    let rest = name.get(4..)?;
    let part = if rest.is_empty() {
        Part::Own
    } else if let Some(sub) = strip_prefix(rest, "sub") {
        if !sub.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return None;
        }
        Part::Sub(u8::from_str_radix(sub, 16).ok()?)
    } else if rest.eq_ignore_ascii_case("Name") {
        Part::Names
    } else if rest.eq_ignore_ascii_case("Value") {
        Part::Values
    } else if rest.eq_ignore_ascii_case("Denotation") {
        Part::Denotations
    } else if rest.eq_ignore_ascii_case("ObjectLinks") {
        Part::Links
    } else {
        return None;
    };
    Some((index, part))
}

fn module(name: &str) -> Option<(u16, ModulePart)> {
    let rest = strip_prefix(name, "M")?;
    let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
    let number = rest.get(..digits)?.parse().ok()?;
    let rest = rest.get(digits..)?;
    let part = if rest.eq_ignore_ascii_case("ModuleInfo") {
        ModulePart::Info
    } else if rest.eq_ignore_ascii_case("Comments") {
        ModulePart::Comments
    } else if rest.eq_ignore_ascii_case("FixedObjects") {
        ModulePart::FixedObjects
    } else if rest.eq_ignore_ascii_case("SubExtends") {
        ModulePart::SubExtends
    } else if let Some((index, part)) = strip_prefix(rest, "Fixed").and_then(object) {
        ModulePart::Fixed(index, part)
    } else {
        let (index, part) = strip_prefix(rest, "SubExt").and_then(object)?;
        ModulePart::SubExt(index, part)
    };
    Some((number, part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_any_case() {
        assert_eq!(Name::parse("1018"), Name::Object(0x1018, Part::Own));
        assert_eq!(Name::parse("1a00SUB0B"), Name::Object(0x1A00, Part::Sub(0x0B)));
        assert_eq!(Name::parse("1003Value"), Name::Object(0x1003, Part::Values));
        assert_eq!(Name::parse("DEVICECOMMISSIONING"), Name::Commissioning(false));
        assert_eq!(
            Name::parse("M12Fixed6000sub1"),
            Name::Module(12, ModulePart::Fixed(0x6000, Part::Sub(1)))
        );
        assert_eq!(Name::parse("M1SubExt6000"), Name::Module(1, ModulePart::SubExt(0x6000, Part::Own)));
        for other in ["1018sub100", "1018sub", "1018sub+1", "10180", "Face", "M", "Mx", "", "ß018"] {
            let expected = if other == "Face" { Name::Object(0xFACE, Part::Own) } else { Name::Other };
            assert_eq!(Name::parse(other), expected, "{other}");
        }
    }
}
