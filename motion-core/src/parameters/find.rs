//! Parameters by name.

use alloc::string::String;
use alloc::vec::Vec;

use super::{Entry, Family, get, iter};

/// Why a key names no parameter.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FindError {
    /// The number is not in use.
    #[error("there is no parameter [{index:03}]")]
    Unused {
        /// The number given.
        index: u16,
    },
    /// The name stands for several parameters.
    #[error("{key:?} names {} parameters: {}; a number, or a name with what stands behind its comma, expected", .candidates.len(), list(.candidates))]
    Ambiguous {
        /// What was asked for.
        key: String,
        /// All that it names.
        candidates: Vec<Entry>,
    },
    /// No parameter has this name.
    #[error("no parameter is called {key:?}; nearest: {}", names(.nearest))]
    Unknown {
        /// What was asked for.
        key: String,
        /// Names most like it, best first.
        nearest: Vec<&'static str>,
    },
}

fn list(entries: &[Entry]) -> String {
    let shown: Vec<String> = entries.iter().take(8).map(|entry| alloc::format!("{entry}")).collect();
    let more = if entries.len() > 8 { "; …" } else { "" };
    shown.join("; ") + more
}

fn names(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| alloc::format!("{name:?}")).collect();
    quoted.join(", ")
}

/// The parameter that a person means: `642`, `[642]`, or a name, with its instance where there is
/// more than one: `V max.@1`, `v max@axis 1`, `Node address@CAN 2 Object/PDO IN 1`; or what
/// [`Entry`] displays, with its number or without: `[642] V max., Axis 1`. Case, blanks and points do
/// not count. The name alone will do for a single parameter.
///
/// # Errors
/// [`FindError`] lists the candidates of an ambiguous name and the names nearest to an unknown one.
pub fn find(key: &str) -> Result<Entry, FindError> {
    let key = key.trim();
    let (number, name) = match key.strip_prefix('[').and_then(|key| key.split_once(']')) {
        Some((number, name)) => (number.trim(), name.trim()),
        None => (key, ""),
    };
    if let Ok(index) = number.parse::<u16>() {
        let entry = get(index).ok_or(FindError::Unused { index })?;
        return if name.is_empty() || plain(key) == plain(&alloc::format!("{entry}")) {
            Ok(entry)
        } else {
            Err(FindError::Unknown { key: key.into(), nearest: alloc::vec![entry.name()] })
        };
    }
    let called = |name: &str| {
        let name = plain(name);
        iter().filter(|entry| plain(entry.name()) == name).collect::<Vec<_>>()
    };
    // A comma may stand in a name as well.
    let (name, instance) = match key.rsplit_once('@').or_else(|| key.rsplit_once(',')) {
        Some((name, instance)) if !called(name).is_empty() => (plain(name), plain(instance)),
        _ => (plain(key), String::new()),
    };
    let mut candidates = called(&name);
    if candidates.is_empty() {
        return Err(FindError::Unknown { key: key.into(), nearest: nearest(&name) });
    }
    if !instance.is_empty() {
        let of = |entry: &Entry| {
            let number = match entry.row().family {
                // Eight objects on each of two buses: a bare number would not say which.
                Family::Single | Family::Can1Object | Family::Can2Object => String::new(),
                _ => alloc::format!("{}", entry.instance() + 1),
            };
            instance == number || instance == plain(entry.group())
        };
        candidates.retain(of);
    }
    match candidates.as_slice() {
        [one] => Ok(*one),
        [] => Err(FindError::Ambiguous { key: key.into(), candidates: called(&name) }),
        _ => Err(FindError::Ambiguous { key: key.into(), candidates }),
    }
}

fn plain(text: &str) -> String {
    text.chars().filter(|c| !matches!(c, ' ' | '.' | '_')).flat_map(char::to_lowercase).collect()
}

/// Up to five names by edit distance, at most half of the name's length away.
fn nearest(name: &str) -> Vec<&'static str> {
    let mut names: Vec<(usize, &'static str)> = Vec::new();
    for row in &super::TABLE {
        if names.iter().all(|(_, known)| *known != row.name) {
            let other = plain(row.name);
            let distance = if other.contains(name) && name.len() > 2 { 1 } else { distance(name, &other) };
            names.push((distance, row.name));
        }
    }
    names.sort_by_key(|(distance, _)| *distance);
    let far = names.first().map_or(0, |(best, _)| best + 2).max(2);
    names.into_iter().filter(|(distance, _)| *distance <= far).take(5).map(|(_, name)| name).collect()
}

/// Levenshtein distance.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut line: Vec<usize> = (0..=b.len()).collect();
    for (row, from) in a.chars().enumerate() {
        let mut corner = row;
        let mut left = row + 1;
        for (to, above) in b.iter().zip(line.iter_mut().skip(1)) {
            let cost = (corner + usize::from(from != *to)).min(left + 1).min(*above + 1);
            corner = *above;
            *above = cost;
            left = cost;
        }
        if let Some(first) = line.first_mut() {
            *first = row + 1;
        }
    }
    line.last().copied().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    #[test]
    fn numbers_names_and_instances() {
        assert_eq!(find("642").unwrap().index(), 642);
        assert_eq!(find(" [005] ").unwrap().index(), 5);
        assert_eq!(find("device number").unwrap().index(), 5);
        assert_eq!(find("v max@1").unwrap().index(), 642);
        assert_eq!(find("V max.@Axis 2").unwrap().index(), 643);
        assert_eq!(find("node address@can 2 object/pdo out 1").unwrap().index(), 346);
        assert_eq!(find("baud rate@com 2").unwrap().index(), 8);
        assert_eq!(find("50"), Err(FindError::Unused { index: 50 }));
    }

    #[test]
    fn every_parameter_is_found_as_it_is_displayed() {
        for entry in iter() {
            let shown = entry.to_string();
            assert_eq!(find(&shown).unwrap(), entry, "{shown}");
            let name = shown.split_once("] ").unwrap().1;
            match find(name) {
                Ok(found) => assert_eq!(found, entry, "{name}"),
                // Two parameters of the manual that share name and group: the number tells them apart.
                Err(FindError::Ambiguous { candidates, .. }) => {
                    assert!(candidates.contains(&entry), "{name}");
                }
                Err(error) => panic!("{name}: {error}"),
            }
        }
        assert_eq!(find("CAN Link, CAN 1"), find("CAN Link@CAN 1"));
        assert!(matches!(find("[642] V max., Axis 2"), Err(FindError::Unknown { .. })));
        assert!(matches!(find("V mix., Axis 2"), Err(FindError::Unknown { .. })));
    }

    #[test]
    fn ambiguous_and_unknown_names_say_what_was_meant() {
        let error = find("V max.").unwrap_err();
        assert!(
            error.to_string().starts_with("\"V max.\" names 6 parameters: [642] V max., Axis 1; "),
            "{error}"
        );
        assert!(
            matches!(find("state@9"), Err(FindError::Ambiguous { candidates, .. }) if candidates.len() == 13)
        );
        let error = find("Devise numbr").unwrap_err();
        assert!(error.to_string().contains("nearest: \"Device number\""), "{error}");
        let error = find("jog slow").unwrap_err();
        assert!(error.to_string().contains("\"V jog slow forward\""), "{error}");
    }
}
