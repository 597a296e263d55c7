//! The attackers' process: `abuse attack KIND NAMES ARM PLAIN CONNECTIONS BYTES`.
//!
//! It has a low priority, because attackers are other machines: what they compute must not be measured as the victim's.
//! Prints the bytes that were sent, or why they could not be, and keeps its connections open until its input ends.

use std::io::Read;
use std::process::Stdio;

use tokio::io::{AsyncBufReadExt, BufReader};
use tokio::process::{Child, Command};

use crate::Failure;
use crate::attacks::{Attack, Outcome};
use crate::victim::Targets;

/// Priority of the attackers, as `nice` takes it.
const NICENESS: &str = "15";

/// The process; its connections end when this is dropped.
pub(crate) struct Attackers {
    child: Child,
}

impl Attackers {
    /// Starts an attack on the victim.
    pub(crate) fn start(
        attack: Attack,
        targets: &Targets,
        connections: usize,
        bytes: usize,
    ) -> Result<Self, Failure> {
        let child = Command::new("nice")
            .args(["-n", NICENESS])
            .arg(std::env::current_exe()?)
            .args(["attack", attack.name()])
            .args([targets.names, targets.arm, targets.plain].map(|at| at.to_string()))
            .args([connections.to_string(), bytes.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .kill_on_drop(true)
            .spawn()?;
        Ok(Self { child })
    }

    /// Waits until everything is sent; returns the number of bytes, or why an attacker failed.
    pub(crate) async fn sent(mut self) -> Result<(Self, Result<usize, String>), Failure> {
        let output = self.child.stdout.as_mut().ok_or("no output")?;
        let mut line = String::new();
        BufReader::new(output).read_line(&mut line).await?;
        let line = line.trim();
        let sent = line.parse().map_err(|_| line.to_owned());
        Ok((self, sent))
    }
}

/// Runs the attack that the words describe.
pub(crate) fn run(mut words: impl Iterator<Item = String>) -> Result<(), Failure> {
    let mut word = || words.next().ok_or("a word is missing");
    let attack = Attack::named(&word()?)?;
    let targets = Targets {
        names: word()?.parse()?,
        arm: word()?.parse()?,
        plain: word()?.parse()?,
    };
    let connections: usize = word()?.parse()?;
    let share = word()?.parse::<usize>()? / connections.max(1);
    let outcomes: Vec<Outcome> = std::thread::scope(|scope| {
        let attackers: Vec<_> = (0..connections)
            .map(|number| scope.spawn(move || attack.run(&targets, number, connections, share)))
            .collect();
        let ended = attackers.into_iter().map(|attacker| attacker.join());
        ended.filter_map(Result::ok).collect()
    });
    let error = outcomes.iter().find_map(|outcome| outcome.error.as_ref());
    match error {
        Some(error) => println!("an attacker failed: {}", error.replace('\n', " ")),
        None => println!(
            "{}",
            outcomes.iter().map(|outcome| outcome.sent).sum::<usize>()
        ),
    }
    std::io::stdin().read_to_end(&mut Vec::new())?;
    drop(outcomes);
    Ok(())
}
