//! The BarrettHand on a serial port, as a board of four axes.

use std::sync::Arc;

use yarp_devices::hand::{BarrettHand, HandBoard, HandOptions};
use yarp_devices::{Device, DeviceError, Hand};

use super::local_device::{self, LocalDevice};
use super::{OpenResult, Opening};

/// Baud rate of a hand after its reset.
const DEFAULT_BAUD: usize = 9600;

/// Opens the hand, which is initialised first: its fingers open.
pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let path: String = parameters.need("serial")?;
    let baud = parameters.get_or("baud", DEFAULT_BAUD)?;
    let baud = u32::try_from(baud)
        .map_err(|_| parameters.refuse("baud", "the speed of the line, bits per second"))?;
    let start = move || -> Result<Arc<dyn Device>, DeviceError> {
        let options = HandOptions::new(&path).baud(baud);
        let hand = BarrettHand::open(options).map_err(|error| error.at(&path))?;
        let board = HandBoard::start(hand)?;
        board.initialise()?;
        Ok(Arc::new(board.guarded()?))
    };
    let board = local_device::start_shared(parameters, start).await?;
    Ok(Box::new(LocalDevice::machine(board)))
}
