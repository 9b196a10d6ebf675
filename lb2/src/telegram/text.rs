//! Texts of 31h and 33h: ISO 8859-1, zero-terminated (decision 6).

use core::fmt;

/// A text as the device sends it: ISO 8859-1 bytes without the terminating zero.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Text<'a>(&'a [u8]);

impl<'a> Text<'a> {
    /// The text up to the first zero byte, or all of `bytes` where there is none.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
        Self(bytes.get(..end).unwrap_or(&[]))
    }

    /// The first `max` characters of [`Text::new`].
    #[must_use]
    pub(super) fn limited(bytes: &'a [u8], max: usize) -> Self {
        Self::new(bytes.get(..max).unwrap_or(bytes))
    }

    /// The ISO 8859-1 bytes, one a character, without terminating zero.
    #[must_use]
    pub const fn as_bytes(&self) -> &'a [u8] {
        self.0
    }

    /// The characters; every ISO 8859-1 byte is the Unicode character of the same number.
    pub fn chars(&self) -> impl Iterator<Item = char> + 'a {
        self.0.iter().map(|&b| char::from(b))
    }

    /// Whether there is no character.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<'a> From<&'a str> for Text<'a> {
    /// Takes ASCII text as it is. Text beyond ASCII must be given as ISO 8859-1 bytes to
    /// [`Text::new`]: in UTF-8 it would come out wrong, character by character.
    fn from(text: &'a str) -> Self {
        Self::new(text.as_bytes())
    }
}

impl fmt::Display for Text<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use fmt::Write;
        self.chars().try_for_each(|c| f.write_char(c))
    }
}

impl fmt::Debug for Text<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\"{self}\"")
    }
}
