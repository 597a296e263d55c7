//! The state of the board, every period.

use std::io;
use std::sync::Arc;
use std::time::{Duration, Instant};

use yarp_devices::{Axes, EncoderReading};
use yarp_ports::Port;
use yarp_wire::Stamp;
use yarp_wire::float_vector::Vector;

use super::super::messages::{Field, JointData};
use super::board_request_handler::RequestHandler;
use super::deadline_monitor::DeadlineMonitor;
use crate::periodic_thread::PeriodicThread;
use yarp_devices::clock::{self, TimeSource};

/// Maximum backlog of a reader that still gets the next state.
const MAX_BACKLOG: Duration = Duration::from_millis(20);
/// Maximum difference between the times of joints, in seconds. Source: stock from 3.7 on.
const MAX_TIME_SPREAD: f64 = 1.0;

/// Starts publishing on `[state, extended]`.
pub(super) fn start(
    board: Arc<RequestHandler>,
    [state, extended]: [Arc<Port>; 2],
    period: Duration,
) -> io::Result<PeriodicThread> {
    let mut deadline_monitor = DeadlineMonitor::new(period);
    let mut cycle = Cycle::new(board, [state, extended], backlog(period));
    PeriodicThread::start("control-board", period, move || {
        // The periods of a clock on the network are as long as its steps and its pauses.
        if !TimeSource::current().is_network()
            && let Some(missed) = deadline_monitor.period_began(Instant::now())
        {
            tracing::warn!(board = %cycle.board.name(), "{missed}");
        }
        cycle.publish();
    })
}

/// One reading of the board after the other, in buffers that stay.
struct Cycle {
    board: Arc<RequestHandler>,
    state: Arc<Port>,
    extended: Arc<Port>,
    readings: Vec<EncoderReading>,
    positions: Vector,
    data: JointData,
    stamp: Stamp,
    /// Maximum number of states in a reader's queue.
    backlog: usize,
}

impl Cycle {
    fn new(board: Arc<RequestHandler>, [state, extended]: [Arc<Port>; 2], backlog: usize) -> Self {
        let axes = board.axes();
        Self {
            board,
            state,
            extended,
            readings: vec![EncoderReading::default(); axes],
            positions: Vector(vec![0.0; axes]),
            data: JointData::unknown(axes),
            // Stock counts from 0.
            stamp: Stamp::new(-1, 0.0),
            backlog,
        }
    }

    fn publish(&mut self) {
        let measured = self.measure();
        let time = if measured {
            match common_time(&self.readings) {
                Some(time) => time,
                None => {
                    tracing::debug!("the times of the joints differ too much: state skipped");
                    return;
                }
            }
        } else {
            clock::now()
        };
        self.read_modes();
        self.read_motors();
        self.stamp = self.stamp.next(time);
        if measured {
            self.state
                .try_write(&self.positions, Some(self.stamp.into()), self.backlog);
        }
        self.extended
            .try_write(&self.data, Some(self.stamp.into()), self.backlog);
    }

    /// Reads the joints into the buffers; returns whether that worked.
    fn measure(&mut self) -> bool {
        let read = self.board.encoders().is_ok_and(|encoders| {
            encoders
                .read_encoders(Axes::All, &mut self.readings)
                .is_ok()
        });
        let data = &mut self.data;
        if read {
            for (joint, reading) in self.readings.iter().enumerate() {
                self.positions.0[joint] = reading.position;
                data.positions.values[joint] = reading.position;
                data.velocities.values[joint] = known_or_zero(reading.speed);
                data.accelerations.values[joint] = known_or_zero(reading.acceleration);
            }
        }
        let all = |known: fn(&EncoderReading) -> f64| {
            read && self.readings.iter().all(|reading| !known(reading).is_nan())
        };
        data.positions.valid = read;
        data.velocities.valid = all(|reading| reading.speed);
        data.accelerations.valid = all(|reading| reading.acceleration);
        read
    }

    /// Reads the motors; values that the device does not have stay invalid.
    fn read_motors(&mut self) {
        let (board, data) = (&self.board, &mut self.data);
        let axes = Axes::All;
        let readings = board
            .motor_encoders()
            .ok()
            .and_then(|motors| motors.motor_readings(axes).ok());
        let part = |part: fn(&EncoderReading) -> f64| {
            let readings = readings.as_ref()?;
            Some(readings.iter().map(part).collect())
        };
        fill(&mut data.motor_positions, part(|reading| reading.position));
        fill(&mut data.motor_velocities, part(|reading| reading.speed));
        fill(
            &mut data.motor_accelerations,
            part(|reading| reading.acceleration),
        );
        let torques = board.torque_control().ok();
        fill(
            &mut data.torques,
            torques.and_then(|torque| torque.torques(axes).ok()),
        );
        let pwm = board.pwm_control().ok();
        fill(
            &mut data.duty_cycles,
            pwm.and_then(|pwm| pwm.duty_cycles(axes).ok()),
        );
        let currents = board.current_control().ok();
        fill(
            &mut data.currents,
            currents.and_then(|current| current.currents(axes).ok()),
        );
        let motor = board.motor().ok();
        fill(
            &mut data.temperatures,
            motor.and_then(|motor| motor.temperatures(axes).ok()),
        );
        let interaction = board.interaction_mode().ok();
        let interactions = interaction.and_then(|interaction| interaction.interactions(axes).ok());
        data.interaction_modes.valid = interactions.is_some();
        if let Some(interactions) = interactions {
            data.interaction_modes.values = interactions;
        }
    }

    fn read_modes(&mut self) {
        let modes = &mut self.data.control_modes;
        modes.valid = self.board.control_mode().is_ok_and(|control| {
            control
                .read_control_modes(Axes::All, &mut modes.values)
                .is_ok()
        });
    }
}

/// Returns the number of states, at one every `period`, that are not more than [`MAX_BACKLOG`].
fn backlog(period: Duration) -> usize {
    (MAX_BACKLOG.as_nanos() / period.as_nanos().max(1)) as usize
}

/// Copies the measurements; unknown parts are zeros, and marked invalid.
fn fill(field: &mut Field<f64>, measured: Option<Vec<f64>>) {
    let measured = measured.filter(|values| {
        let known = values.iter().all(|value| !value.is_nan());
        known && values.len() == field.values.len()
    });
    field.valid = measured.is_some();
    match measured {
        Some(values) => field.values = values,
        None => field.values.fill(0.0),
    }
}

/// A device that does not measure a speed gives NaN for it.
fn known_or_zero(value: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value }
}

/// The mean of the times, unless they are too far apart.
fn common_time(readings: &[EncoderReading]) -> Option<f64> {
    let first = readings.first()?.time;
    let mut sum = 0.0;
    for reading in readings {
        let apart = reading.time - first;
        if apart.abs() > MAX_TIME_SPREAD {
            return None;
        }
        // Relative to the first, so that the sum keeps the microseconds.
        sum += apart;
    }
    Some(first + sum / readings.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_is_the_mean_unless_joints_disagree() {
        let check = |times: &[f64], expected: Option<f64>| {
            let readings: Vec<_> = times
                .iter()
                .map(|&time| EncoderReading {
                    time,
                    ..EncoderReading::default()
                })
                .collect();
            assert_eq!(common_time(&readings), expected);
        };
        check(&[10.0, 10.5], Some(10.25));
        check(&[10.0, 10.5, 11.5], None);
        check(&[7.0], Some(7.0));
        check(&[], None);
    }
}
