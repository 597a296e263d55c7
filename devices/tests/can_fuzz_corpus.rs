//! Every file of the fuzz corpora of the CAN bus goes through its target once, also with a byte changed.

use crate::can_fuzz as fuzz;
use crate::corpus;

#[test]
fn every_frame_passes() {
    corpus::replay("puck_frame", fuzz::puck_frame, 256);
}

#[test]
fn every_conversation_passes() {
    corpus::replay("pucks", fuzz::pucks, 64);
}
