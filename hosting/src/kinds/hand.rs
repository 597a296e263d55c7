//! The BarrettHand on its serial line, as a board of four axes.

use yarp_devices::hand::{BarrettHand, HandBoard, HandOptions};
use yarp_devices::{DeviceError, Hand};

use super::local::{self, Local};
use super::{Opening, Outcome};

/// What a hand that was reset speaks, bits per second.
const USUAL_BAUD: usize = 9600;

/// The hand is initialised first: its fingers open.
pub(super) async fn open(opening: Opening<'_>) -> Outcome {
    let parameters = opening.parameters;
    let path: String = parameters.need("serial")?;
    let baud = parameters.get_or("baud", USUAL_BAUD)?;
    let baud = u32::try_from(baud)
        .map_err(|_| parameters.refuse("baud", "the speed of the line, bits per second"))?;
    let start = move || -> Result<HandBoard, DeviceError> {
        let options = HandOptions::new(&path).baud(baud);
        let hand = BarrettHand::open(options).map_err(|error| error.at(&path))?;
        let board = HandBoard::start(hand)?;
        board.initialise()?;
        Ok(board)
    };
    let board = local::start(parameters, start).await?;
    Ok(Box::new(Local::machine(board)))
}
