//! A pseudo-terminal: this end is the simulated hand, the other end is opened by path as any serial line.

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags, fcntl_setfl};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, ioctl_tiocnxcl, tcgetattr, tcsetattr};

/// Closing it disconnects the line: the other end sees it broken.
#[derive(Debug)]
pub(super) struct Terminal {
    ours: OwnedFd,
    /// Held open, so that the line lasts when a client leaves it.
    theirs: OwnedFd,
    path: PathBuf,
    link: Option<PathBuf>,
}

impl Terminal {
    /// A new line. `link`: a path that is made to point to it, replacing any earlier link.
    pub(super) fn open(link: Option<&Path>) -> io::Result<Self> {
        let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&ours)?;
        unlockpt(&ours)?;
        let name = ptsname(&ours, Vec::new())?;
        let path = PathBuf::from(OsStr::from_bytes(name.as_bytes()));
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let theirs = rustix::fs::open(&path, flags, Mode::empty())?;
        let mut settings = tcgetattr(&theirs)?;
        settings.make_raw();
        tcsetattr(&theirs, OptionalActions::Now, &settings)?;
        fcntl_setfl(&ours, OFlags::NONBLOCK)?;
        if let Some(link) = link {
            lead(link, &path)?;
        }
        Ok(Self {
            ours,
            theirs,
            path,
            link: link.map(Path::to_owned),
        })
    }

    /// The path of the other end.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Lets the next client in.
    ///
    /// A real line releases its exclusive lock when it is closed; this one stays open here, and would refuse the next
    /// client. Clients that lock the file still keep each other out.
    pub(super) fn share(&self) {
        let _ = ioctl_tiocnxcl(&self.theirs);
    }

    /// Receives at most as many bytes as fit.
    pub(super) fn receive<'b>(&self, buffer: &'b mut [u8]) -> io::Result<&'b [u8]> {
        match rustix::io::read(&self.ours, &mut *buffer) {
            Ok(count) => Ok(&buffer[..count]),
            Err(Errno::AGAIN | Errno::INTR) => Ok(&[]),
            Err(error) => Err(error.into()),
        }
    }

    /// Sends as much as the line accepts; returns the number of bytes.
    pub(super) fn send(&self, bytes: &[u8]) -> io::Result<usize> {
        match rustix::io::write(&self.ours, bytes) {
            Ok(count) => Ok(count),
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            Err(error) => Err(error.into()),
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // Only if it still leads here.
        if let Some(link) = &self.link
            && fs::read_link(link).is_ok_and(|place| place == self.path)
        {
            let _ = fs::remove_file(link);
        }
    }
}

/// Makes `link` lead to `path`, in one step. An existing file that is not a link stays, and is an error.
fn lead(link: &Path, path: &Path) -> io::Result<()> {
    if fs::symlink_metadata(link).is_ok_and(|there| !there.is_symlink()) {
        return Err(io::ErrorKind::AlreadyExists.into());
    }
    let mut name = link.as_os_str().to_owned();
    name.push(format!(".{}", std::process::id()));
    let fresh = PathBuf::from(name);
    let _ = fs::remove_file(&fresh);
    symlink(path, &fresh)?;
    fs::rename(&fresh, link)
}
