//! Distribution of the torques of a message to the channels of boards.

use yarp_wire::{Bottle, Value};

/// Number of channels that a server can have, as in stock.
pub(super) const MAX_CHANNELS: usize = 255;

/// Channels of the server that are those of a board.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct VirtualNetwork {
    /// Name that the server uses for the board.
    pub name: String,
    /// First and last channel of the server.
    pub channels: (usize, usize),
    /// First and last channel of the board.
    pub board: (usize, usize),
}

/// The torques of all boards.
#[derive(Debug)]
pub(super) struct Routing {
    /// Board and channel of the board, for each channel of the server.
    places: Vec<Option<(usize, usize)>>,
    /// First channel of each board.
    firsts: Vec<usize>,
    torques: Vec<Vec<f64>>,
}

/// A value of a message, counted from 1, or 0.0 for each channel of the server.
type Layout = &'static [Option<usize>];

/// Returns the layout of a message that begins with this number.
fn layout(kind: i64) -> Option<Layout> {
    match kind {
        // Arm: shoulder and elbow have four joints, the wrist's first is the fifth.
        1 => Some(&[Some(1), Some(2), Some(3), Some(4), Some(5), None]),
        // Leg.
        2 => Some(&[Some(1), Some(2), Some(3), Some(4), Some(5), Some(6)]),
        // Wrist.
        3 => Some(&[Some(6), Some(7), None, None, None, None]),
        // Torso.
        4 => Some(&[Some(1), Some(2), Some(3)]),
        _ => None,
    }
}

impl Routing {
    /// Creates torques of zero. Errors, in words: channels out of range, or more of the server than of a board.
    pub(super) fn new(networks: &[VirtualNetwork]) -> Result<Self, String> {
        let mut places = vec![None; MAX_CHANNELS];
        let mut torques = Vec::new();
        for (number, network) in networks.iter().enumerate() {
            let ((first, last), (board_first, board_last)) = (network.channels, network.board);
            if last >= MAX_CHANNELS || board_last >= MAX_CHANNELS {
                return Err(format!("channels from 0 to {}", MAX_CHANNELS - 1));
            }
            if first > last || board_first > board_last {
                return Err("first and last channel in ascending order".to_owned());
            }
            for (offset, place) in places[first..=last].iter_mut().enumerate() {
                *place = Some((number, board_first + offset));
            }
            torques.push(vec![0.0; board_last - board_first + 1]);
        }
        Ok(Self {
            places,
            firsts: networks.iter().map(|network| network.board.0).collect(),
            torques,
        })
    }

    /// Takes in a message: the number of its layout, then the torques. Errors, in words; then nothing changes.
    pub(super) fn take(&mut self, message: &Bottle) -> Result<(), String> {
        let kind = message.get(0).and_then(Value::as_i64);
        let layout = kind.and_then(layout).ok_or_else(|| {
            let first = message.get(0).map(ToString::to_string);
            format!(
                "expected 1 (arm), 2 (leg), 3 (wrist) or 4 (torso) at the beginning, got {}",
                first.unwrap_or_else(|| "nothing".to_owned())
            )
        })?;
        let mut updates = Vec::with_capacity(layout.len());
        for (channel, source) in layout.iter().enumerate() {
            let place = self.places[channel];
            let (board, address) = place.ok_or_else(|| {
                format!("expected a network for channel {channel}, which none has")
            })?;
            let torque = match source {
                None => 0.0,
                Some(at) => {
                    let value = message.get(*at).and_then(Value::as_f64);
                    let finite = value.filter(|value| value.is_finite());
                    finite.ok_or_else(|| format!("expected a finite number as value {at}"))?
                }
            };
            updates.push((board, address, torque));
        }
        for (board, address, torque) in updates {
            // Channels beyond those of the board are passed over, as in stock.
            let offset = address - self.firsts[board];
            if let Some(known) = self.torques[board].get_mut(offset) {
                *known = torque;
            }
        }
        Ok(())
    }

    /// Sets all torques to zero.
    pub(super) fn reset(&mut self) {
        for torques in &mut self.torques {
            torques.fill(0.0);
        }
    }

    /// Returns the torques of each board.
    pub(super) fn torques(&self) -> &[Vec<f64>] {
        &self.torques
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network(channels: (usize, usize), board: (usize, usize)) -> VirtualNetwork {
        VirtualNetwork {
            name: "n".to_owned(),
            channels,
            board,
        }
    }

    fn after(networks: &[VirtualNetwork], text: &str) -> Result<Vec<Vec<f64>>, String> {
        let mut routing = Routing::new(networks)?;
        routing.take(&Bottle::parse(text).unwrap())?;
        Ok(routing.torques().to_vec())
    }

    /// As in stock's `VirtualAnalogWrapper::run`.
    #[test]
    fn each_part_has_its_layout() {
        let one = [network((0, 5), (0, 5))];
        let check = |text: &str, expected: [f64; 6]| {
            assert_eq!(after(&one, text).unwrap(), [expected], "{text}");
        };
        check(
            "1 1.0 2.0 3.0 4.0 5.0 6.0 7.0",
            [1.0, 2.0, 3.0, 4.0, 5.0, 0.0],
        );
        check("2 1.0 2.0 3.0 4.0 5.0 6.0", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        check(
            "3 1.0 2.0 3.0 4.0 5.0 6.0 7.0",
            [6.0, 7.0, 0.0, 0.0, 0.0, 0.0],
        );
        check("4 1.0 2.0 3.0", [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn channels_go_to_their_boards() {
        let two = [network((0, 3), (0, 3)), network((4, 5), (0, 1))];
        let text = "2 1 2 3 4 5 6";
        let expected = vec![vec![1.0, 2.0, 3.0, 4.0], vec![5.0, 6.0]];
        assert_eq!(after(&two, text).unwrap(), expected);
        // Channels beyond those of a board are passed over; the first of the board need not be 0.
        let narrow = [network((0, 5), (2, 4))];
        assert_eq!(after(&narrow, text).unwrap(), [[1.0, 2.0, 3.0]]);
    }

    #[test]
    fn invalid_messages_change_nothing() {
        let mut routing = Routing::new(&[network((0, 2), (0, 2))]).unwrap();
        routing.take(&Bottle::parse("4 1 2 3").unwrap()).unwrap();
        for text in [
            "",
            "0 1 2 3",
            "5 1 2 3",
            "a 1 2 3",
            "4 1 2",
            "4 1 2 x",
            "4 1 2 nan",
            "1 9 9 9 9 9",
        ] {
            assert!(
                routing.take(&Bottle::parse(text).unwrap()).is_err(),
                "{text}"
            );
            assert_eq!(routing.torques(), [[1.0, 2.0, 3.0]], "{text}");
        }
        routing.reset();
        assert_eq!(routing.torques(), [[0.0; 3]]);
    }

    #[test]
    fn ranges_are_bounded() {
        for (channels, board) in [
            ((0, 255), (0, 5)),
            ((0, 5), (0, 255)),
            ((3, 2), (0, 1)),
            ((0, 1), (3, 2)),
        ] {
            assert!(
                Routing::new(&[network(channels, board)]).is_err(),
                "{channels:?} {board:?}"
            );
        }
        assert!(Routing::new(&[network((0, 254), (0, 254))]).is_ok());
    }
}
