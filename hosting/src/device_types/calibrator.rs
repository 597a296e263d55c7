//! The calibrator that a robot's actions name; the board calibrates and parks itself.

use super::{OpenResult, Opening};
use crate::{Future, Hosted};

pub(super) async fn open(_: Opening<'_>) -> OpenResult {
    Ok(Box::new(Calibrator))
}

struct Calibrator;

impl Hosted for Calibrator {
    fn is_calibrator(&self) -> bool {
        true
    }

    fn close(self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async {})
    }
}
