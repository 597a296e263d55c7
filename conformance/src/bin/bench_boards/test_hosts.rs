//! Hosts of servers and clients: one, or two.

use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use std::{env, fs, thread};

use crate::Failure;

/// Timeout of every step.
pub(crate) const STEP_TIMEOUT: Duration = Duration::from_secs(20);

/// One or two hosts with a name server of ours, which ends when this is dropped.
#[derive(Debug)]
pub(crate) struct TestHosts {
    pub(crate) label: &'static str,
    home: PathBuf,
    /// Network namespaces of the server and of its clients, if there are two hosts.
    spaces: Option<[String; 2]>,
    name_server: Child,
}

/// One of the hosts.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Host {
    OfServer,
    OfClient,
}

impl TestHosts {
    /// Returns one host with its loopback interface.
    pub(crate) fn here() -> Result<Self, Failure> {
        Self::open("localhost", "127.0.0.1".into(), None)
    }

    /// Returns two hosts, if `NETWORKS` names them: two network namespaces, and the address of the
    /// first.
    pub(crate) fn apart() -> Result<Option<Self>, Failure> {
        let Ok(text) = env::var("NETWORKS") else {
            return Ok(None);
        };
        let words: Vec<String> = text.split_whitespace().map(str::to_owned).collect();
        let Ok([server, client, address]) = <[String; 3]>::try_from(words) else {
            return Err(
                format!("NETWORKS is {text:?}, expected NAMESPACE NAMESPACE ADDRESS").into(),
            );
        };
        Self::open("two hosts", address, Some([server, client])).map(Some)
    }

    fn open(
        label: &'static str,
        address: String,
        spaces: Option<[String; 2]>,
    ) -> Result<Self, Failure> {
        let home = env::temp_dir().join(format!("bench_boards.{}.{label}", std::process::id()));
        fs::create_dir_all(&home)?;
        // Below the ephemeral ports.
        let first = 20_000 + (std::process::id() % 5000) as u16;
        let free = |port: &u16| std::net::TcpListener::bind(("0.0.0.0", *port)).is_ok();
        let port = (first..30_000)
            .find(free)
            .ok_or("no free port")?
            .to_string();
        let words = [
            "server", "--local", "--memory", "--ip", &address, "--socket", &port,
        ];
        let mut command = command_in(&spaces, Host::OfServer, &yarp());
        let name_server = command
            .args(words)
            .env("YARP_CONFIG_HOME", &home)
            .env("YARP_DATA_HOME", &home)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()?;
        fs::write(home.join("yarp.conf"), format!("{address} {port} yarp\n"))?;
        let place = Self {
            label,
            home,
            spaces,
            name_server,
        };
        let end = Instant::now() + STEP_TIMEOUT;
        while !place
            .command(Host::OfClient, &yarp())
            .arg("where")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status()?
            .success()
        {
            if Instant::now() > end {
                return Err(
                    format!("no name server came up for {label} at {address}:{port}").into(),
                );
            }
            thread::sleep(Duration::from_millis(50));
        }
        Ok(place)
    }

    /// Returns the command for a program on one of the hosts, with the name server configured.
    pub(crate) fn command(&self, host: Host, program: &str) -> Command {
        let mut command = command_in(&self.spaces, host, program);
        command
            .env("YARP_CONFIG_HOME", &self.home)
            .env("YARP_DATA_HOME", &self.home)
            .env("YARP_FORWARD_LOG_ENABLE", "0")
            .stdin(Stdio::null());
        command
    }

    /// Returns the command for this program on the host of the clients.
    pub(crate) fn client(&self) -> Result<Command, Failure> {
        let program = env::current_exe()?;
        let program = program
            .to_str()
            .ok_or("the path of this program is no text")?;
        Ok(self.command(Host::OfClient, program))
    }
}

impl Drop for TestHosts {
    fn drop(&mut self) {
        // It may have ended by itself; the folder is in the directory for temporary files.
        let _ = self.name_server.kill();
        let _ = self.name_server.wait();
        let _ = fs::remove_dir_all(&self.home);
    }
}

fn command_in(spaces: &Option<[String; 2]>, host: Host, program: &str) -> Command {
    let Some(spaces) = spaces else {
        return Command::new(program);
    };
    let mut command = Command::new("ip");
    command.args(["netns", "exec", &spaces[host as usize], program]);
    command
}

/// Returns the path of our command.
pub(crate) fn yarp() -> String {
    env::var("YARP").unwrap_or_else(|_| "target/release/yarp".into())
}

/// Returns the output of a client, or its error output on failure.
pub(crate) fn output_of(mut command: Command) -> Result<String, Failure> {
    let output = command.output()?;
    if !output.status.success() {
        let words = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{command:?} ended with {}: {words}", output.status).into());
    }
    Ok(String::from_utf8(output.stdout)?)
}
