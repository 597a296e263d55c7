//! A `yarp up` that is attacked.

use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::process::Stdio;
use std::time::Duration;

use tokio::process::{Child, Command};
use yarp_ports::Network;

use crate::Failure;

/// Time within which `yarp up` serves its arm, and ends after SIGTERM.
const START_TIMEOUT: Duration = Duration::from_secs(60);
/// Interval between two queries for the arm's port.
const QUERY_INTERVAL: Duration = Duration::from_millis(50);

/// Addresses that attackers connect to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Targets {
    /// The name server.
    pub(crate) names: SocketAddr,
    /// The port that takes requests to the arm.
    pub(crate) arm: SocketAddr,
    /// A port that belongs to no device.
    pub(crate) plain: SocketAddr,
}

/// A running `yarp up` in a configuration directory of its own; killed when dropped.
pub(crate) struct Victim {
    child: Child,
    home: PathBuf,
    port: u16,
    arm: SocketAddr,
    plain: SocketAddr,
}

impl Victim {
    /// Starts `yarp up` and waits until the arm is served; with `descriptors`, the process may have so many.
    pub(crate) async fn start(yarp: &str, descriptors: Option<u32>) -> Result<Self, Failure> {
        let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
        let home = std::env::temp_dir().join(format!("yarp-abuse-{}-{port}", std::process::id()));
        std::fs::create_dir_all(&home)?;
        std::fs::write(home.join("yarp.conf"), format!("127.0.0.1 {port} yarp\n"))?;
        let limit = descriptors.map_or_else(String::new, |number| format!("ulimit -n {number}; "));
        let mut command = Command::new("sh");
        command
            .args(["-c", &format!("{limit}exec \"$0\" up"), yarp])
            .env("YARP_CONFIG_HOME", &home)
            .env("YARP_DATA_HOME", &home)
            .env("YARP_FORWARD_LOG_ENABLE", "0")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .kill_on_drop(true);
        let mut victim = Self {
            child: command.spawn()?,
            home,
            port,
            arm: SocketAddr::from(([127, 0, 0, 1], 0)),
            plain: SocketAddr::from(([127, 0, 0, 1], 0)),
        };
        let served = async {
            let arm = victim.served("/wam/rpc:i").await?;
            // The last of the board's ports.
            victim.served("/wam/stateExt:o").await?;
            Ok::<_, Failure>((arm, victim.served("/wam/view/in:i").await?))
        };
        let served = tokio::time::timeout(START_TIMEOUT, served).await;
        let served =
            served.map_err(|_| format!("`{yarp} up` did not serve its arm within 60 s"))?;
        (victim.arm, victim.plain) = served?;
        Ok(victim)
    }

    /// Waits until the port is registered; returns its address.
    async fn served(&mut self, port: &str) -> Result<SocketAddr, Failure> {
        loop {
            if let Some(status) = self.child.try_wait()? {
                return Err(format!("`yarp up` ended: {status}").into());
            }
            if let Ok(contact) = self.network().query(port).await {
                let address = format!("{}:{}", contact.host, contact.port);
                return Ok(address.parse()?);
            }
            tokio::time::sleep(QUERY_INTERVAL).await;
        }
    }

    /// Returns the network that the process made.
    pub(crate) fn network(&self) -> Network {
        Network::at("127.0.0.1", self.port)
    }

    pub(crate) fn targets(&self) -> Targets {
        Targets {
            names: SocketAddr::from(([127, 0, 0, 1], self.port)),
            arm: self.arm,
            plain: self.plain,
        }
    }

    fn process_file(&self, name: &str) -> Result<PathBuf, Failure> {
        let id = self.child.id().ok_or("`yarp up` has ended")?;
        Ok(PathBuf::from(format!("/proc/{id}/{name}")))
    }

    /// Forgets the peak memory; returns the bytes of memory now.
    pub(crate) fn reset_peak(&self) -> Result<u64, Failure> {
        std::fs::write(self.process_file("clear_refs")?, "5")?;
        self.memory("VmRSS:")
    }

    /// Returns the bytes of memory that the process held at most since [`Self::reset_peak`].
    pub(crate) fn peak(&self) -> Result<u64, Failure> {
        self.memory("VmHWM:")
    }

    fn memory(&self, row: &str) -> Result<u64, Failure> {
        let status = std::fs::read_to_string(self.process_file("status")?)?;
        let line = status.lines().find_map(|line| line.strip_prefix(row));
        let kilobytes = line.and_then(|line| line.split_whitespace().next());
        Ok(kilobytes.ok_or("no such row in status")?.parse::<u64>()? << 10)
    }

    /// Returns the number of open descriptors.
    pub(crate) fn descriptors(&self) -> Result<usize, Failure> {
        Ok(std::fs::read_dir(self.process_file("fd")?)?.count())
    }

    /// Asks the process to end, and checks that it does so without a panic.
    pub(crate) async fn stop(mut self) -> Result<(), Failure> {
        let id = self.child.id().ok_or("`yarp up` ended during the attack")?;
        Command::new("kill").arg(id.to_string()).status().await?;
        let ended = tokio::time::timeout(START_TIMEOUT, self.child.wait()).await;
        let status = ended.map_err(|_| "`yarp up` did not end within 60 s of SIGTERM")??;
        match status.success() {
            true => Ok(()),
            false => Err(format!("`yarp up` ended with {status}").into()),
        }
    }
}

impl Drop for Victim {
    fn drop(&mut self) {
        // Left over in the temporary folder at worst.
        let _ = std::fs::remove_dir_all(&self.home);
    }
}
