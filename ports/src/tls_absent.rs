//! Stand-in for encrypted connections in a build without the feature `tls`: there are none.

use std::convert::Infallible;
use std::io::{self, IoSlice};
use std::net::IpAddr;
use std::os::fd::{AsFd, BorrowedFd};
use std::path::Path;

use bytes::BufMut;

use crate::config::ConfigError;
use crate::latency::Tcp;

/// The name of the file that would say how connections are encrypted.
pub(crate) const FILE: &str = "tls.conf";

/// Settings for encrypted connections, which nobody can have here.
#[derive(Clone, Debug)]
pub struct Tls(Infallible);

/// An error of encrypting a connection.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TlsError {
    /// The peer did not encrypt where it has to.
    #[error("it is not encrypted, and tls.conf requires that between hosts")]
    Plain,
    /// This program cannot.
    #[error("this program was built without the feature tls")]
    NotConfigured,
    /// The connection or the system failed.
    #[error(transparent)]
    Failed(#[from] io::Error),
}

/// An encrypted stream, of which there are none.
#[derive(Debug)]
pub(crate) struct TlsStream(Infallible);

impl Tls {
    pub(crate) fn concerns(&self, _local: IpAddr, _peer: IpAddr) -> bool {
        match self.0 {}
    }
}

/// Refuses the file: who has it wants encrypted connections.
pub(crate) fn load(
    file: &Path,
    _text: &str,
    _find: impl Fn(&Path) -> Result<Option<String>, ConfigError>,
) -> Result<Tls, ConfigError> {
    Err(ConfigError::Read {
        file: file.to_owned(),
        source: io::Error::new(io::ErrorKind::Unsupported, TlsError::NotConfigured),
    })
}

pub(crate) fn is_hello(_byte: u8) -> bool {
    false
}

pub(crate) async fn accept(_stream: Tcp, tls: &Tls) -> Result<TlsStream, TlsError> {
    match tls.0 {}
}

pub(crate) async fn initiate(_stream: Tcp, _host: &str, tls: &Tls) -> Result<TlsStream, TlsError> {
    match tls.0 {}
}

impl TlsStream {
    pub(crate) fn tcp(&self) -> &Tcp {
        match self.0 {}
    }

    pub(crate) async fn readable(&self) -> io::Result<()> {
        match self.0 {}
    }

    pub(crate) async fn writable(&self) -> io::Result<()> {
        match self.0 {}
    }

    pub(crate) fn try_read_buf(&self, _buffer: &mut impl BufMut) -> io::Result<usize> {
        match self.0 {}
    }

    pub(crate) fn peek_now(&self, _bytes: &mut [u8]) -> io::Result<usize> {
        match self.0 {}
    }

    pub(crate) fn try_write_vectored(&self, _chunks: &[IoSlice<'_>]) -> io::Result<usize> {
        match self.0 {}
    }
}

impl AsFd for TlsStream {
    fn as_fd(&self) -> BorrowedFd<'_> {
        match self.0 {}
    }
}
