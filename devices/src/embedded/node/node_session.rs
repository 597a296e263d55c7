//! One client from its connection to its end.

use std::fmt;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use tracing::{debug, info};

use super::node_arm::ServedArm;
use super::node_motion_completion::Ended;
use super::{NodeOptions, Shared};
use crate::embedded::link_error::{LinkError, LinkErrorKind};
use crate::embedded::link_setup::{LinkConnector, SocketPair};
use crate::embedded::protocol::{ARM, Packet, Reply, Request, RequestReader, TRAJECTORY};

/// Timeout of a read, after which the motion is checked.
const READ_INTERVAL: Duration = Duration::from_millis(5);

/// Reasons why a session ended.
#[derive(Debug)]
pub(super) enum End {
    /// `shu`, or the server itself ends.
    Shutdown,
    /// Otherwise.
    Lost(LinkError),
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shutdown => f.write_str("closed as agreed (shu)"),
            Self::Lost(error) => error.fmt(f),
        }
    }
}

/// A client, in the hands of the server's thread.
pub(super) struct Session<'a> {
    shared: &'a Shared,
    connector: &'a LinkConnector,
    arm: &'a mut dyn ServedArm,
    options: &'a NodeOptions,
    stream: TcpStream,
    packets: TcpStream,
    reader: RequestReader,
    served: u64,
    replies: i32,
    heard: Instant,
}

impl<'a> Session<'a> {
    /// Serves; how many requests were answered, and the end.
    pub(super) fn run(
        shared: &'a Shared,
        connector: &'a LinkConnector,
        arm: &'a mut dyn ServedArm,
        options: &'a NodeOptions,
        pair: SocketPair,
    ) -> (u64, End) {
        let joints = arm.joints();
        let mut session = Self {
            shared,
            connector,
            arm,
            options,
            stream: pair.arm,
            packets: pair.packets,
            reader: RequestReader::new(joints),
            served: 0,
            replies: 0,
            heard: Instant::now(),
        };
        let end = session.serve().map_or_else(End::Lost, |()| End::Shutdown);
        (session.served, end)
    }

    fn serve(&mut self) -> Result<(), LinkError> {
        let prepare = || {
            self.stream.set_read_timeout(Some(READ_INTERVAL))?;
            self.stream.set_write_timeout(Some(self.options.timeout))?;
            self.packets.set_write_timeout(Some(self.options.timeout))?;
            self.stream.peer_addr()
        };
        let peer = prepare().map_err(|error| self.broken("opening the connection", &error))?;
        info!(%peer, "a client is connected");
        let mut piece = [0; 512];
        while !self.shared.ending.load(Ordering::Acquire) {
            match self.stream.read(&mut piece) {
                Ok(0) => return Err(self.error(&self.waiting(), LinkErrorKind::Closed)),
                Ok(length) => {
                    self.heard = Instant::now();
                    self.reader.push(&piece[..length]);
                    if self.answer_all()? {
                        return Ok(());
                    }
                }
                Err(error)
                    if matches!(
                        error.kind(),
                        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                    ) =>
                {
                    self.check_idle_timeout()?;
                }
                Err(error) => return Err(self.broken(&self.waiting(), &error)),
            }
            while let Some(ended) = self.arm.look() {
                self.tell(&ended)?;
            }
            self.connector.reject_pending();
        }
        Ok(())
    }

    /// Answers what has come; whether it was the last.
    fn answer_all(&mut self) -> Result<bool, LinkError> {
        loop {
            let request = match self.reader.next_request() {
                Ok(Some(request)) => request,
                Ok(None) => return Ok(false),
                Err(error) => {
                    // The rest of the stream cannot be parsed.
                    self.reply("refusing an unknown request", &Reply::Refused)?;
                    return Err(self.error("reading a request", error.into()));
                }
            };
            let step = request.kind().step();
            let reply = self.arm.obey(&request).unwrap_or_else(|refusal| {
                info!(step, %refusal, "refused");
                self.shared.status().refused += 1;
                Reply::Refused
            });
            self.served += 1;
            self.shared.status().served += 1;
            self.reply(&format!("answering: {step}"), &reply)?;
            if request == Request::Shutdown {
                return Ok(true);
            }
        }
    }

    /// Neither an incomplete request nor an idle connection may last for ever.
    fn check_idle_timeout(&mut self) -> Result<(), LinkError> {
        let silence = self.heard.elapsed();
        let unfinished = self.reader.unfinished();
        if unfinished > 0 && silence > self.options.timeout {
            self.reply("refusing half a request", &Reply::Refused)?;
            let step =
                format!("waiting for the rest of a request of which {unfinished} bytes came");
            return Err(self.error(&step, LinkErrorKind::Silent(self.options.timeout)));
        }
        if silence > self.options.idle_timeout {
            return Err(self.error(
                &self.waiting(),
                LinkErrorKind::Silent(self.options.idle_timeout),
            ));
        }
        Ok(())
    }

    fn reply(&mut self, step: &str, reply: &Reply) -> Result<(), LinkError> {
        self.stream
            .write_all(&reply.to_bytes())
            .map_err(|error| self.broken(step, &error))
    }

    fn tell(&mut self, ended: &Ended) -> Result<(), LinkError> {
        for &query in &ended.questions {
            self.replies = self.replies.wrapping_add(1);
            let packet = Packet {
                sender: ARM,
                query,
                reply: self.replies,
                kind: TRAJECTORY,
                done: ended.reason.is_empty(),
                reason: ended.reason.clone(),
            };
            debug!(?packet, "the move has ended");
            self.packets
                .write_all(&packet.to_bytes())
                .map_err(|error| self.broken("sending an asynchronous packet", &error))?;
        }
        Ok(())
    }

    fn waiting(&self) -> String {
        match self.reader.unfinished() {
            0 => "waiting for a request".to_owned(),
            unfinished => format!("reading a request of which {unfinished} bytes came"),
        }
    }

    fn broken(&self, step: &str, error: &std::io::Error) -> LinkError {
        self.error(step, LinkErrorKind::io(error, self.options.timeout))
    }

    fn error(&self, step: &str, cause: LinkErrorKind) -> LinkError {
        LinkError {
            step: step.to_owned(),
            cause,
        }
    }
}
