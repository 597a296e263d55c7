//! Stand-in for shared memory in a build without the feature `shmem`: there is none.

use std::convert::Infallible;
use std::io::{self, IoSlice};

use bytes::BufMut;
use tokio::net::TcpStream;

/// A stream through shared memory, of which there are none.
#[derive(Debug)]
pub(crate) struct ShmemStream(Infallible);

/// The prepared resources of an acceptor, which cannot be prepared.
#[derive(Debug)]
pub(crate) struct Offer(Infallible);

/// Returns the error of every attempt.
fn unsupported() -> io::Error {
    let text = "this program was built without the feature shmem";
    io::Error::new(io::ErrorKind::Unsupported, text)
}

/// Refuses the connection.
pub(crate) async fn connect(_header: &TcpStream, _number: u16) -> io::Result<ShmemStream> {
    Err(unsupported())
}

impl Offer {
    pub(crate) async fn new(_header: &TcpStream) -> io::Result<Self> {
        Err(unsupported())
    }

    pub(crate) fn number(&self) -> u16 {
        match self.0 {}
    }

    pub(crate) async fn accept(self) -> io::Result<ShmemStream> {
        match self.0 {}
    }
}

impl ShmemStream {
    pub(crate) fn tcp(&self) -> &TcpStream {
        match self.0 {}
    }

    pub(crate) fn try_read_buf(&self, _buffer: &mut impl BufMut) -> io::Result<usize> {
        match self.0 {}
    }

    pub(crate) fn try_read(&self, _out: &mut impl BufMut, _most: usize) -> io::Result<usize> {
        match self.0 {}
    }

    pub(crate) fn try_write_vectored(&self, _chunks: &[IoSlice<'_>]) -> io::Result<usize> {
        match self.0 {}
    }

    pub(crate) async fn readable(&self) -> io::Result<()> {
        match self.0 {}
    }

    pub(crate) async fn writable(&self) -> io::Result<()> {
        match self.0 {}
    }
}
