//! The log of this process in a view.

use std::sync::OnceLock;

use tracing::{Event, Level, Subscriber};
use tracing_subscriber::layer::{Context, Layer};
use yarp_view::{LogLevel, LogLines};

use super::text_of;

static SHOWN_IN: OnceLock<LogLines> = OnceLock::new();

/// Returns the log that a view of this process shows; from now on it gets the lines of this process.
pub(crate) fn show_in() -> LogLines {
    SHOWN_IN.get_or_init(LogLines::new).clone()
}

/// Copies lines to the log of [`show_in`].
pub(super) struct ShownLog;

impl<S: Subscriber> Layer<S> for ShownLog {
    fn on_event(&self, event: &Event<'_>, _context: Context<'_, S>) {
        let Some(shown) = SHOWN_IN.get() else {
            return;
        };
        let level = match *event.metadata().level() {
            Level::ERROR => LogLevel::Error,
            Level::WARN => LogLevel::Warning,
            Level::INFO => LogLevel::Info,
            _ => LogLevel::Debug,
        };
        let (component, message) = text_of(event);
        shown.add(level, &component, &message);
    }
}
