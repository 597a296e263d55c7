//! A session in RealTime mode.

use std::fmt;
use std::sync::MutexGuard;
use std::time::{Duration, Instant};

use super::gcl::{BlockError, Control, Feedback, Header, Layout};
use super::hand_error::HandError;
use super::serial_driver::{BarrettHand, LineState};

/// RealTime mode: one block to the hand, one back, as fast as the line allows.
///
/// MotorSet keep their last commanded speed. Dropping the session leaves RealTime, which stops them; that takes a few
/// seconds at the most.
pub struct RealTimeSession<'h> {
    hand: &'h BarrettHand,
    line: MutexGuard<'h, LineState>,
    layout: Layout,
    timeout: Duration,
    over: bool,
}

impl<'h> RealTimeSession<'h> {
    pub(super) fn new(
        hand: &'h BarrettHand,
        line: MutexGuard<'h, LineState>,
        layout: Layout,
        timeout: Duration,
    ) -> Self {
        Self {
            hand,
            line,
            layout,
            timeout,
            over: false,
        }
    }

    /// Returns the layout of the blocks.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Tells the motors their speeds and gains and gets what they measure.
    ///
    /// Errors: [`HandError::RealTime`] when the hand left RealTimeSession or answers something else, [`HandError::NoPrompt`]
    /// when it does not answer, [`HandError::LineLost`]; then the session has ended.
    pub fn control(&mut self, control: &Control) -> Result<Feedback, HandError> {
        self.exchange(Header::Control, control)
    }

    /// Reads the measurements of the motors.
    ///
    /// Errors: as [`control`](Self::control).
    pub fn ask(&mut self) -> Result<Feedback, HandError> {
        self.exchange(Header::Ask, &Control::default())
    }

    /// A block with any header.
    ///
    /// Errors: as [`control`](Self::control).
    pub fn exchange(&mut self, header: Header, control: &Control) -> Result<Feedback, HandError> {
        let outcome = self.blocks(header, control);
        if outcome.is_err() {
            self.over = true;
            // It may have lost its power, and with it what it was set to.
            self.line.layout = None;
        }
        outcome
    }

    fn blocks(&mut self, header: Header, control: &Control) -> Result<Feedback, HandError> {
        const STEP: &str = "exchanging blocks";
        if self.over {
            return Err(HandError::RealTime {
                step: "it was over already",
                source: BlockError::Unexpected(String::new()),
            });
        }
        let block = self.layout.write_control(header, control);
        let step = || STEP.to_owned();
        self.hand.send(&mut self.line, &block, step)?;
        let mut seen = Vec::new();
        let mut buffer = [0; 64];
        let deadline = Instant::now() + self.timeout;
        while Instant::now() < deadline {
            seen.extend_from_slice(self.hand.receive_or_abort(
                &mut self.line,
                &mut buffer,
                step,
            )?);
            match self.layout.read_feedback(header, &seen) {
                Ok(None) if seen.len() < 1024 => {}
                Ok(None) => break,
                Ok(Some(feedback)) => return Ok(feedback),
                Err(source) => return Err(HandError::RealTime { step: STEP, source }),
            }
        }
        Err(HandError::NoPrompt {
            command: "LOOP".to_owned(),
            waited: self.timeout,
            got: seen.escape_ascii().to_string(),
        })
    }

    /// Leaves RealTime: the motors stop.
    ///
    /// Errors: [`HandError::LineLost`], [`HandError::NoHand`].
    pub fn end(mut self) -> Result<(), HandError> {
        self.over = true;
        self.hand.leave(&mut self.line)
    }
}

impl Drop for RealTimeSession<'_> {
    fn drop(&mut self) {
        let open = self.line.port().is_some();
        if !std::mem::replace(&mut self.over, true) || open {
            // An error that cannot be reported now is reported before the next command.
            let _ = self.hand.leave(&mut self.line);
        }
    }
}

impl fmt::Debug for RealTimeSession<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RealTimeSession")
            .field("layout", &self.layout)
            .finish_non_exhaustive()
    }
}
