//! Commands of the page: moves, control modes, and the emergency stop.
//!
//! ```text
//! move JOINT DEGREES     moves a joint of the arm, at its speed for moves
//! hand AXIS DEGREES      moves an axis of the hand
//! guide X Y Z            moves the arm so that its tool plate comes to a place: m, in the frame of the base
//! mode WORD              sets the control mode of all joints: pos, vel, torq, idl
//! halt                   ends all moves; the robot stays where it is and can be moved again
//! stop                   emergency stop
//! release                ends the emergency stop
//! ```
//!
//! The reply is `ok`, or `refused` with the reason. An emergency stop ends all moves of arm and hand, sets the joints of the arm idle, so
//! that the board refuses the commands of every program, and refuses those of the page until it is released. The fingers stay where they
//! are. It passes the commands before it: page and view keep connections ready that carry nothing but stops. It is software: it does not
//! replace the switch on the robot.

use std::sync::Arc;
use std::time::Duration;

use serde_json::Value as Json;
use yarp_ports::{Network, Port};
use yarp_wire::{Bottle, Value, Vocab32};

use crate::board_client::{BoardClient, BoardError};
use crate::guiding::Guide;
use crate::log_lines::LogLevel;
use crate::view_model::Model;

/// Maximum number of joints of the arm.
const JOINTS: usize = 7;
/// Axes of the hand.
const HAND_AXES: usize = 4;
/// Interval between two checks of the connections for stops.
const PREPARE_INTERVAL: Duration = Duration::from_millis(500);
/// Modes that the page may set.
const MODES: [&str; 4] = ["pos", "vel", "torq", "idl"];

/// Clients of the boards.
#[derive(Debug)]
pub(crate) struct Control {
    arm: BoardClient,
    hand: Option<BoardClient>,
    /// Connections for stops alone.
    stop_arm: BoardClient,
    stop_hand: Option<BoardClient>,
    guide: Guide,
    model: Arc<Model>,
}

/// A command of the page.
#[derive(Clone, Debug, PartialEq)]
enum Command {
    Move { axis: usize, degrees: f64 },
    Hand { axis: usize, degrees: f64 },
    Guide { place: [f64; 3] },
    Mode(&'static str),
    Halt,
    Stop,
    Release,
}

impl Command {
    /// Reads a command; the error says what was expected.
    fn read(bottle: &Bottle) -> Result<Self, String> {
        let word = bottle.get(0).and_then(Value::as_str).unwrap_or_default();
        let axis = |most: usize| {
            let index = bottle.get(1).and_then(Value::as_i64);
            let index = index.and_then(|index| usize::try_from(index).ok());
            let degrees = bottle
                .get(2)
                .and_then(Value::as_f64)
                .filter(|degrees| degrees.is_finite());
            match (index.filter(|index| *index < most), degrees) {
                (Some(index), Some(degrees)) => Ok((index, degrees)),
                _ => Err(format!(
                    "{word}: expected an axis from 0 to {} and degrees",
                    most - 1
                )),
            }
        };
        match word {
            "move" => axis(JOINTS).map(|(axis, degrees)| Self::Move { axis, degrees }),
            "hand" => axis(HAND_AXES).map(|(axis, degrees)| Self::Hand { axis, degrees }),
            "guide" => {
                let number = |index| {
                    let value = bottle.get(index).and_then(Value::as_f64);
                    value.filter(|value| value.is_finite())
                };
                match [1, 2, 3].map(number) {
                    [Some(x), Some(y), Some(z)] => Ok(Self::Guide { place: [x, y, z] }),
                    _ => Err("guide: expected a place: x, y and z in metres".to_owned()),
                }
            }
            "mode" => {
                let asked = bottle.get(1).and_then(Value::as_str);
                let known = MODES.into_iter().find(|mode| Some(*mode) == asked);
                known
                    .map(Self::Mode)
                    .ok_or_else(|| format!("mode: expected one of {}", MODES.join(", ")))
            }
            "halt" => Ok(Self::Halt),
            "stop" => Ok(Self::Stop),
            "release" => Ok(Self::Release),
            _ => Err("expected move, hand, guide, mode, halt, stop or release".to_owned()),
        }
    }
}

impl Control {
    pub(crate) fn new(network: &Network, arm: &str, hand: Option<&str>, model: Arc<Model>) -> Self {
        let client = |prefix: &str| BoardClient::new(network, prefix);
        Self {
            arm: client(arm),
            hand: hand.map(client),
            stop_arm: client(arm),
            stop_hand: hand.map(client),
            guide: Guide::new(),
            model,
        }
    }

    /// Keeps the connections for stops ready while somebody watches; runs until it is aborted.
    pub(crate) async fn keep_ready(self: Arc<Self>, page: Arc<Port>) {
        loop {
            tokio::time::sleep(PREPARE_INTERVAL).await;
            if page.outputs().is_empty() {
                continue;
            }
            for client in [Some(&self.stop_arm), self.stop_hand.as_ref()]
                .into_iter()
                .flatten()
            {
                if let Err(error) = client.prepare().await {
                    tracing::debug!("a stop would have to connect first: {error}");
                }
            }
        }
    }

    /// Executes a command of a page and returns the reply.
    pub(crate) async fn execute(&self, command: &Bottle) -> Bottle {
        let refused = |reason: String| {
            self.model.log.add(LogLevel::Warning, "view", &reason);
            Bottle::of("refused").with(reason)
        };
        let command = match Command::read(command) {
            Ok(command) => command,
            Err(reason) => return refused(reason),
        };
        let is_allowed = matches!(command, Command::Halt | Command::Stop | Command::Release);
        if !is_allowed && self.model.latest().stopped {
            return refused("the emergency stop is active; release it first".to_owned());
        }
        match self.perform(command).await {
            Ok(()) => Bottle::of("ok"),
            Err(error) => refused(error.to_string()),
        }
    }

    async fn perform(&self, command: Command) -> Result<(), BoardError> {
        match command {
            Command::Move { axis, degrees } => self.arm.send(&[set_position(axis, degrees)]).await,
            Command::Hand { axis, degrees } => match &self.hand {
                Some(hand) => hand.send(&[set_position(axis, degrees)]).await,
                None => Ok(()),
            },
            Command::Guide { place } => {
                let targets = self
                    .present()
                    .and_then(|present| self.guide.towards(&present, place));
                match targets {
                    Some(targets) => self.arm.send(&[set_positions(&targets)]).await,
                    None => Err(BoardError::NoState),
                }
            }
            Command::Mode(mode) => {
                self.model
                    .log
                    .add(LogLevel::Info, "view", &format!("control mode {mode}"));
                self.arm.send(&[set_modes(mode, self.joints())]).await
            }
            Command::Halt => {
                let request = [stop()];
                let (arm, hand) = tokio::join!(
                    self.arm.send(&request),
                    send_hand(self.hand.as_ref(), &request)
                );
                arm.and(hand)
            }
            Command::Stop => {
                // Before anything else, so that no later command of a page passes it.
                self.model.latest().stopped = true;
                self.model
                    .log
                    .add(LogLevel::Error, "view", "emergency stop");
                let (arm, hand) = ([stop(), set_modes("idl", self.joints())], [stop()]);
                let (arm, hand) = tokio::join!(
                    self.stop_arm.send(&arm),
                    send_hand(self.stop_hand.as_ref(), &hand)
                );
                arm.and(hand)
            }
            Command::Release => {
                let modes = set_modes("pos", self.joints());
                self.stop_arm.send(&[modes]).await?;
                self.model.latest().stopped = false;
                self.model
                    .log
                    .add(LogLevel::Info, "view", "emergency stop released");
                Ok(())
            }
        }
    }

    /// Returns the latest joint positions of the arm, degrees, if it publishes all of them.
    fn present(&self) -> Option<Vec<f64>> {
        self.positions()?.iter().map(Json::as_f64).collect()
    }

    /// Returns the number of joints that the arm publishes: a board refuses modes for another number.
    fn joints(&self) -> usize {
        self.positions().map_or(JOINTS, |positions| positions.len())
    }

    /// Returns the latest joint positions of the arm as they are published: some may be no numbers.
    fn positions(&self) -> Option<Vec<Json>> {
        let latest = self.model.latest();
        latest.arm.value.as_ref()?.json["p"].as_array().cloned()
    }

    pub(crate) async fn close(&self) {
        self.arm.close().await;
        self.stop_arm.close().await;
        for hand in [&self.hand, &self.stop_hand].into_iter().flatten() {
            hand.close().await;
        }
    }
}

async fn send_hand(hand: Option<&BoardClient>, requests: &[Bottle]) -> Result<(), BoardError> {
    match hand {
        Some(hand) => hand.send(requests).await,
        None => Ok(()),
    }
}

fn vocab(word: &str) -> Vocab32 {
    Vocab32::new(word)
}

fn set_position(axis: usize, degrees: f64) -> Bottle {
    Bottle::of(vocab("set"))
        .with(vocab("pos"))
        .with(axis as i32)
        .with(degrees)
}

fn set_positions(degrees: &[f64]) -> Bottle {
    let targets: Bottle = degrees.iter().map(|&target| Value::from(target)).collect();
    Bottle::of(vocab("set")).with(vocab("poss")).with(targets)
}

fn set_modes(mode: &str, joints: usize) -> Bottle {
    let modes = (0..joints).fold(Bottle::new(), |modes, _| modes.with(vocab(mode)));
    Bottle::of(vocab("set"))
        .with(vocab("icmd"))
        .with(vocab("cmds"))
        .with(modes)
}

fn stop() -> Bottle {
    Bottle::of(vocab("set")).with(vocab("stos"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Command, String> {
        Command::read(&Bottle::parse(text).unwrap())
    }

    #[test]
    fn commands_are_read_as_documented() {
        let expected = Command::Move {
            axis: 6,
            degrees: -12.5,
        };
        assert_eq!(read("move 6 -12.5"), Ok(expected));
        let expected = Command::Hand {
            axis: 3,
            degrees: 90.0,
        };
        assert_eq!(read("hand 3 90"), Ok(expected));
        let place = [0.5, -0.1, 0.3];
        assert_eq!(read("guide 0.5 -0.1 0.3"), Ok(Command::Guide { place }));
        assert_eq!(read("mode torq"), Ok(Command::Mode("torq")));
        for bad in [
            "",
            "move",
            "move 7 1.0",
            "move -1 1.0",
            "move 0 up",
            "hand 4 1.0",
            "guide 0.5 0.1",
            "guide up 0.1 0.2",
            "mode fly",
            "fly",
            "(stop)",
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
        let infinite = Bottle::of("move").with(0).with(f64::NAN);
        assert!(Command::read(&infinite).is_err());
    }

    #[test]
    fn requests_are_those_of_a_control_board() {
        assert_eq!(set_position(3, 90.0).to_string(), "[set] [pos] 3 90.0");
        let all = set_positions(&[1.0, -2.5]);
        assert_eq!(all.to_string(), "[set] [poss] (1.0 -2.5)");
        assert_eq!(stop().to_string(), "[set] [stos]");
        let modes = "[set] [icmd] [cmds] ([idl] [idl] [idl] [idl] [idl] [idl] [idl])";
        assert_eq!(set_modes("idl", 7).to_string(), modes);
        let modes = "[set] [icmd] [cmds] ([pos] [pos] [pos] [pos])";
        assert_eq!(set_modes("pos", 4).to_string(), modes);
    }
}
