//! Both ends of the protocol of the embedded PC, and peers that misbehave.
#![allow(dead_code, reason = "each test file uses a part of it")]

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::time::Duration;

use yarp_devices::embedded::protocol::{ARM, Packet, Reply, Request, RequestReader, TRAJECTORY};
use yarp_devices::embedded::{
    DriverOptions, EmbeddedWam, LinkAddresses, LinkMode, NodeOptions, WamNode,
};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{Axes, Device, Encoders, PositionControl};
#[allow(unused_imports, reason = "each test file uses a part of it")]
pub(crate) use yarp_testing::eventually;

/// Longer than anything here takes on a busy machine.
pub(crate) const TEST_TIMEOUT: Duration = Duration::from_secs(60);

/// A driver that waits on free ports, patient with a busy machine and quick to come back.
pub(crate) fn driver_options(link_mode: LinkMode) -> DriverOptions {
    DriverOptions {
        period: Duration::from_millis(5),
        timeout: Duration::from_secs(20),
        max_state_age: Duration::from_secs(30),
        initial_backoff: Duration::from_millis(1),
        max_backoff: Duration::from_millis(20),
        ..DriverOptions::new(link_mode)
    }
}

/// Returns the node's options, with the timeouts of [`driver_options`].
pub(crate) fn node_options(link_mode: LinkMode) -> NodeOptions {
    NodeOptions {
        timeout: Duration::from_secs(20),
        idle_timeout: Duration::from_secs(60),
        initial_backoff: Duration::from_millis(1),
        max_backoff: Duration::from_millis(20),
        ..NodeOptions::new(link_mode)
    }
}

pub(crate) fn driver() -> EmbeddedWam {
    EmbeddedWam::start(driver_options(LinkMode::listen_on_loopback())).expect("there are ports")
}

pub(crate) fn ideal_arm() -> Arc<SimulatedWam> {
    Arc::new(SimulatedWam::new())
}

/// The end that listens.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Listens {
    Driver,
    Node,
}

/// A driver and a node of `arm`, connected and at rest.
pub(crate) fn connected(arm: Arc<dyn Device>, listens: Listens) -> (EmbeddedWam, WamNode) {
    let start_node = |link_mode| WamNode::start(arm, node_options(link_mode)).expect("it starts");
    let start = |link_mode| EmbeddedWam::start(driver_options(link_mode)).expect("it starts");
    let (driver, node) = match listens {
        Listens::Driver => {
            let driver = start(LinkMode::listen_on_loopback());
            let node = start_node(LinkMode::Connect(driver.addresses()));
            (driver, node)
        }
        Listens::Node => {
            let node = start_node(LinkMode::listen_on_loopback());
            (start(LinkMode::Connect(node.addresses())), node)
        }
    };
    at_rest(&driver);
    (driver, node)
}

/// Waits until there is a connection and the arm is at rest.
pub(crate) fn at_rest(driver: &EmbeddedWam) {
    eventually("an arm at rest", || {
        matches!(driver.motion_done(Axes::All), Ok(true))
    });
}

pub(crate) fn place(arm: &dyn Encoders, joint: usize) -> f64 {
    arm.encoder_readings(Axes::One(joint.into()))
        .expect("it has readings")[0]
        .position
}

/// Closes a connection: orderly, or with a reset.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Cut {
    Fin,
    Reset,
}

impl Cut {
    pub(crate) const BOTH: [Self; 2] = [Self::Fin, Self::Reset];

    pub(crate) fn close(self, stream: TcpStream) {
        if let Self::Reset = self {
            let linger = socket2::SockRef::from(&stream).set_linger(Some(Duration::ZERO));
            linger.expect("the system can reset");
        }
        drop(stream);
    }
}

/// Connects to both ports.
pub(crate) fn connect(places: LinkAddresses) -> (TcpStream, TcpStream) {
    let connect = |place: SocketAddr| {
        let stream = TcpStream::connect(place).expect("it listens");
        stream.set_nodelay(true).expect("the system can");
        stream
            .set_read_timeout(Some(TEST_TIMEOUT))
            .expect("the system can");
        stream
    };
    (connect(places.arm), connect(places.packets))
}

/// An embedded PC that a test controls. Answers as an arm at home would.
pub(crate) struct Peer {
    pub(crate) arm: TcpStream,
    pub(crate) packets: TcpStream,
    reader: RequestReader,
    queries: i32,
}

impl Peer {
    pub(crate) fn new((arm, packets): (TcpStream, TcpStream)) -> Self {
        Self {
            arm,
            packets,
            reader: RequestReader::new(7),
            queries: 0,
        }
    }

    /// The next whole request; `None` if the driver has disconnected.
    pub(crate) fn request(&mut self) -> Option<Request> {
        loop {
            let next = self
                .reader
                .next_request()
                .expect("our driver is understood");
            if next.is_some() {
                return next;
            }
            // A byte at a time, so that nothing of the next request is taken.
            let mut byte = [0];
            match self.arm.read(&mut byte) {
                Ok(1) => self.reader.push(&byte),
                _ => return None,
            }
        }
    }

    /// Reads so many bytes of a request that begins with `header`, answering all other requests; `None` if the driver
    /// has disconnected.
    ///
    /// The bytes must distinguish it from the driver's other requests.
    pub(crate) fn part_of(&mut self, header: &[u8; 3], length: usize) -> Option<()> {
        loop {
            let mut matched = 0;
            while matched < length {
                let mut byte = [0];
                self.arm.read_exact(&mut byte).ok()?;
                if header.get(matched).is_some_and(|letter| *letter != byte[0]) {
                    self.reader.push(&header[..matched]);
                    self.reader.push(&byte);
                    break;
                }
                matched += 1;
            }
            if matched == length {
                return Some(());
            }
            let request = self.request()?;
            self.answer(&request).ok()?;
        }
    }

    /// Returns the reply of an arm at home.
    pub(crate) fn reply(request: &Request) -> Reply {
        match request {
            Request::Joints => Reply::Joints(HOME.to_vec()),
            Request::Pose => Reply::Pose([0.0; 6]),
            _ => Reply::Done,
        }
    }

    /// Answers, and reports the end of a move at once.
    pub(crate) fn answer(&mut self, request: &Request) -> std::io::Result<()> {
        self.arm.write_all(&Self::reply(request).to_bytes())?;
        if *request == Request::TellFinish {
            self.queries += 1;
            self.tell(self.queries, true)?;
        }
        Ok(())
    }

    /// An asynchronous packet.
    pub(crate) fn tell(&mut self, query: i32, done: bool) -> std::io::Result<()> {
        let packet = Packet {
            sender: ARM,
            query,
            reply: query,
            kind: TRAJECTORY,
            done,
            reason: if done { "" } else { "fault" }.to_owned(),
        };
        self.packets.write_all(&packet.to_bytes())
    }
}

/// The pose at home, rad.
pub(crate) const HOME: [f64; 7] = [0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0];

/// Listeners for a driver that connects.
pub(crate) struct Listeners {
    arm: TcpListener,
    packets: TcpListener,
}

impl Listeners {
    pub(crate) fn new() -> Self {
        let listen = || {
            let listener = TcpListener::bind("127.0.0.1:0").expect("there are ports");
            // On Linux this is for accepting too.
            socket2::SockRef::from(&listener)
                .set_read_timeout(Some(TEST_TIMEOUT))
                .expect("the system can");
            listener
        };
        Self {
            arm: listen(),
            packets: listen(),
        }
    }

    pub(crate) fn addresses(&self) -> LinkAddresses {
        let place = |listener: &TcpListener| listener.local_addr().expect("it has an address");
        LinkAddresses {
            arm: place(&self.arm),
            packets: place(&self.packets),
        }
    }

    /// The next driver that comes.
    pub(crate) fn accept(&self) -> Peer {
        let accept = |listener: &TcpListener| {
            let stream = listener.accept().expect("a driver comes").0;
            stream.set_nodelay(true).expect("the system can");
            stream
                .set_read_timeout(Some(TEST_TIMEOUT))
                .expect("the system can");
            stream
        };
        Peer::new((accept(&self.arm), accept(&self.packets)))
    }
}
