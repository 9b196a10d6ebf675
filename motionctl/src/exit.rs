//! How a command ends when it does not end well.

use motion_io::lb2::CallError;

/// Exit status and what to tell the person.
#[derive(Debug)]
pub(crate) struct Exit {
    pub(crate) status: u8,
    pub(crate) message: String,
}

impl Exit {
    /// 1: differs, or a check failed.
    pub(crate) fn check(message: impl Into<String>) -> Self {
        Self { status: 1, message: message.into() }
    }

    /// 2: the command line is wrong.
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self { status: 2, message: message.into() }
    }

    /// 4: refused by the device.
    pub(crate) fn refused(message: impl Into<String>) -> Self {
        Self { status: 4, message: message.into() }
    }

    /// 5: port or file trouble.
    pub(crate) fn trouble(message: impl Into<String>) -> Self {
        Self { status: 5, message: message.into() }
    }

    /// 5: a file could not be read or written.
    pub(crate) fn file(path: &str, error: &dyn core::fmt::Display) -> Self {
        Self::trouble(format!("{path}: {error}"))
    }

    /// The same with words before the message.
    pub(crate) fn context(mut self, words: &str) -> Self {
        self.message = format!("{words}: {}", self.message);
        self
    }
}

impl From<CallError> for Exit {
    fn from(error: CallError) -> Self {
        let status = match error {
            CallError::NoAnswer { .. } => 3,
            CallError::Refused { .. } | CallError::WrongEcho(_) => 4,
            CallError::Submit(_) => 2,
            _ => 5,
        };
        Self { status, message: error.to_string() }
    }
}
