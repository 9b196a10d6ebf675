//! Pseudo-terminals that we make, for others to open as a serial port.

use core::time::Duration;
use std::fs::File;
use std::io::{self, Read, Write};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use crate::port::{Port, poll_limit};

/// So long bytes wait for a reader before they are given up.
const UNREAD: rustix::event::Timespec = rustix::event::Timespec { tv_sec: 1, tv_nsec: 0 };

/// The controlling end of a pseudo-terminal.
#[derive(Debug)]
pub(crate) struct Pty {
    end: File,
    /// Held open so that the line stays up while nobody has the other end open.
    _other: OwnedFd,
    other_path: PathBuf,
    link: PathBuf,
}

impl Pty {
    /// Makes a raw pseudo-terminal and links its other end at `link`. A symbolic link that is there
    /// is replaced, anything else is not touched.
    pub(crate) fn create(link: &Path) -> io::Result<Self> {
        let end = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&end)?;
        unlockpt(&end)?;
        let name = ptsname(&end, Vec::new())?;
        let other = rustix::fs::open(
            name.as_c_str(),
            OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC,
            Mode::empty(),
        )?;
        let mut settings = tcgetattr(&other)?;
        settings.make_raw();
        tcsetattr(&other, OptionalActions::Now, &settings)?;
        let other_path = PathBuf::from(name.to_string_lossy().into_owned());
        match link.symlink_metadata() {
            Ok(found) if found.is_symlink() => std::fs::remove_file(link)?,
            Ok(_) => {
                let text = "the link's path is taken by a file that is no symbolic link";
                return Err(io::Error::other(text));
            }
            Err(_) => {}
        }
        // A full line must not hold the writer for ever.
        rustix::io::ioctl_fionbio(&end, true)?;
        std::os::unix::fs::symlink(&other_path, link)?;
        Ok(Self { end: File::from(end), _other: other, other_path, link: link.to_path_buf() })
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        // Only our own link: another program may have put its own there since.
        if std::fs::read_link(&self.link).is_ok_and(|target| target == self.other_path) {
            let _ = std::fs::remove_file(&self.link);
        }
    }
}

impl Port for Pty {
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut ready = [PollFd::new(&self.end, PollFlags::IN)];
        match poll(&mut ready, Some(&poll_limit(timeout))) {
            Ok(0) | Err(rustix::io::Errno::INTR) => Ok(0),
            Ok(_) => self.end.read(buffer),
            Err(error) => Err(error.into()),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut rest = bytes;
        while !rest.is_empty() {
            let mut ready = [PollFd::new(&self.end, PollFlags::OUT)];
            match poll(&mut ready, Some(&UNREAD)) {
                Ok(0) => {
                    let text = "nobody reads the other end of the pseudo-terminal";
                    return Err(io::Error::new(io::ErrorKind::TimedOut, text));
                }
                Ok(_) => {}
                Err(rustix::io::Errno::INTR) => continue,
                Err(error) => return Err(error.into()),
            }
            match self.end.write(rest) {
                Ok(len) => rest = rest.get(len..).unwrap_or(&[]),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}
