//! Columns and numbers of a line.

/// Between the columns of a row, and between a keyword and its value.
pub(super) fn is_separator(character: char) -> bool {
    matches!(character, ',' | ';' | '\t')
}

/// A hex number as files have it: with or without `h` or `0x`, of up to `digits` digits.
pub(super) fn hex(text: &str, digits: usize) -> Option<u32> {
    let text = text.trim();
    let text = text.strip_suffix(['h', 'H']).unwrap_or(text);
    let text = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")).unwrap_or(text);
    let plain = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    if !plain || text.trim_start_matches('0').len() > digits {
        return None;
    }
    u32::from_str_radix(text, 16).ok()
}

/// A header field's number: decimal, or hex with its `h` or `0x`.
pub(super) fn number(text: &str) -> Option<u32> {
    if text.ends_with(['h', 'H']) || text.starts_with("0x") { hex(text, 8) } else { text.parse().ok() }
}

/// One column of a parameter row, counted from 1.
pub(super) fn column(text: &str, wanted: usize) -> Option<&str> {
    let at = wanted.saturating_sub(1);
    // Blanks separate only where nothing else does: captions have them too.
    if text.contains(is_separator) {
        text.split(is_separator).nth(at)
    } else {
        text.split_whitespace().nth(at)
    }
}

/// The values of a curve's row.
pub(super) fn values(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| is_separator(c) || c == ' ').filter(|word| !word.is_empty())
}
