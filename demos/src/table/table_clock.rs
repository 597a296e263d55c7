//! The clock of a table: time that passed on it, for clients of a simulation that is faster or slower than real time.

use std::sync::Arc;
use std::time::Duration;

use yarp_ports::Port;
use yarp_table::LiveTable;
use yarp_wire::Bottle;

/// Interval between two times, in real time.
const INTERVAL: Duration = Duration::from_millis(2);

/// Publishes the time as clocks for `YARP_CLOCK` do while somebody reads it; runs until it is aborted.
pub(super) async fn publish(table: Arc<LiveTable>, port: Arc<Port>) {
    let mut ticks = tokio::time::interval(INTERVAL);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        ticks.tick().await;
        if !port.outputs().is_empty() {
            port.write_if_idle(&message(table.statistics().simulated), None);
        }
    }
}

/// Returns the message for a time: whole seconds and nanoseconds.
fn message(time: Duration) -> Bottle {
    let seconds = i32::try_from(time.as_secs()).unwrap_or(i32::MAX);
    let nanoseconds = time.subsec_nanos() as i32;
    Bottle::new().with(seconds).with(nanoseconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_whole_seconds_and_nanoseconds() {
        let time = Duration::from_micros(2_500_001);
        assert_eq!(message(time).to_string(), "2 500001000");
    }
}
