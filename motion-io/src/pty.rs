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
    _claim: Option<Claim>,
}

impl Pty {
    /// Makes a raw pseudo-terminal and links its other end at `link`. A symbolic link that is there, left by a
    /// program that was killed, is replaced; one whose program runs, and anything else, is not touched.
    pub(crate) fn create(link: &Path) -> io::Result<Self> {
        let claim = claim(link)?;
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
                let text = "taken by a file that is no link to a terminal";
                return Err(io::Error::other(text));
            }
            Err(_) => {}
        }
        // A full line must not hold the writer for ever.
        rustix::io::ioctl_fionbio(&end, true)?;
        std::os::unix::fs::symlink(&other_path, link)?;
        Ok(Self { end: File::from(end), _other: other, other_path, link: link.to_path_buf(), _claim: claim })
    }
}

/// The right to a link, which ends with the program that has it however that ends: a socket whose name stands for
/// the link's place. The number of a terminal does not tell, as the system gives it to the next one.
#[cfg(target_os = "linux")]
type Claim = std::os::unix::net::UnixDatagram;

/// A claim outlives its pseudo-terminal by the moment that a program which is just being started, and began as a
/// copy of this one, still has it: so it is tried for half a second.
#[cfg(target_os = "linux")]
const TRIES: u32 = 100;
#[cfg(target_os = "linux")]
const RETRY: Duration = Duration::from_millis(5);

#[cfg(target_os = "linux")]
fn claim(link: &Path) -> io::Result<Option<Claim>> {
    use core::hash::{Hash as _, Hasher as _};
    use std::hash::DefaultHasher;
    use std::os::linux::net::SocketAddrExt as _;
    use std::os::unix::fs::MetadataExt as _;
    use std::os::unix::net::SocketAddr;

    let directory = directory(link)?;
    let mut hasher = DefaultHasher::new();
    (directory.dev(), directory.ino(), link.file_name()).hash(&mut hasher);
    let address = SocketAddr::from_abstract_name(format!("motion-io pty {:016x}", hasher.finish()))?;
    for _ in 0..TRIES {
        match Claim::bind_addr(&address) {
            Ok(claim) => return Ok(Some(claim)),
            Err(error) if error.kind() == io::ErrorKind::AddrInUse => std::thread::sleep(RETRY),
            // A system that has no such sockets.
            Err(_) => return Ok(None),
        }
    }
    Err(io::Error::other("in use by another program"))
}

#[cfg(not(target_os = "linux"))]
type Claim = ();

#[cfg(not(target_os = "linux"))]
fn claim(link: &Path) -> io::Result<Option<Claim>> {
    directory(link).map(|_| None)
}

/// Where the link is to be.
fn directory(link: &Path) -> io::Result<std::fs::Metadata> {
    let directory = link.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let directory = std::fs::metadata(directory);
    let missing = |error: &io::Error| error.kind() == io::ErrorKind::NotFound;
    directory.map_err(|error| match missing(&error) {
        true => io::Error::other("the directory of the link does not exist"),
        false => error,
    })
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
