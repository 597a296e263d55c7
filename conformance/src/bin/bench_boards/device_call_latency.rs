//! Benchmarks the time until a command reaches the device: board and client are in one process, so
//! that they share a clock.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use yarp_conformance::benchmark_statistics::{median, percentiles};
use yarp_devices::{
    Axes, AxisIndex, AxisInfo, Device, DeviceError, JointType, MotionControl, PositionControl,
};
use yarp_ports::Network;
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};

use crate::Failure;
use crate::command_latency::{COMMANDS, CommandClient, Generation, WARM_UP_COMMANDS};
use crate::test_hosts::{STEP_TIMEOUT, TestHosts, output_of};

/// Measures in other processes, and prints the results.
pub(crate) fn measure(place: &TestHosts, rounds: usize) -> Result<(), Failure> {
    let mut runs = Vec::new();
    for _ in 0..rounds {
        let mut command = place.client()?;
        command.args(["device-call", &(WARM_UP_COMMANDS + COMMANDS).to_string()]);
        let text = output_of(command)?;
        let times: Vec<f64> = text.lines().filter_map(|line| line.parse().ok()).collect();
        runs.push(percentiles(
            times.get(WARM_UP_COMMANDS..).unwrap_or_default().to_vec(),
        ));
    }
    println!(
        "{:<42}{:>9.1}{:>9.1}",
        "from sending to the device call, ours",
        median(runs.iter().map(|run| run.0)),
        median(runs.iter().map(|run| run.1)),
    );
    Ok(())
}

/// Prints nanoseconds from sending a command to its arrival at the device.
pub(crate) fn run(n: &str) -> Result<(), Failure> {
    let n: usize = n.parse()?;
    // Separate runtimes, like two programs.
    let (serving, asking) = (crate::runtime()?, crate::runtime()?);
    let noted = Arc::new(RecordingDevice::default());
    let name = format!("/device-call/{}", std::process::id());
    let network = Network::from_process()?;
    let options = ControlBoardOptions::new();
    let opening = ControlBoardServer::open(&network, noted.clone(), &name, options);
    let server = serving.block_on(opening)?;
    let mut sent = Vec::with_capacity(n);
    asking.block_on(async {
        let orders = CommandClient::open(&network, &name, Generation::V3).await?;
        let giving = tokio::spawn(tokio::time::timeout(STEP_TIMEOUT, async move {
            orders.give(n, |now| sent.push(now)).await.map(|_| sent)
        }));
        let sent = giving.await???;
        let came = noted.0.lock().unwrap_or_else(PoisonError::into_inner);
        if came.len() != n {
            return Err(format!("{} orders came, expected {n}", came.len()).into());
        }
        for (sent, came) in sent.iter().zip(came.iter()) {
            println!("{}", came.saturating_duration_since(*sent).as_nanos());
        }
        Ok::<_, Failure>(())
    })?;
    serving.block_on(server.close());
    Ok(())
}

/// A joint that records the times of its commands.
#[derive(Debug, Default)]
struct RecordingDevice(Mutex<Vec<Instant>>);

impl Device for RecordingDevice {
    yarp_devices::offers! {
        axis_info: AxisInfo,
        position_control: PositionControl,
    }
}

impl AxisInfo for RecordingDevice {
    fn axes(&self) -> usize {
        1
    }

    fn axis_name(&self, _: AxisIndex) -> Result<String, DeviceError> {
        Ok("joint".into())
    }

    fn joint_type(&self, _: AxisIndex) -> Result<JointType, DeviceError> {
        Ok(JointType::Revolute)
    }
}

impl MotionControl for RecordingDevice {
    fn stop(&self, _: Axes<'_>) -> Result<(), DeviceError> {
        Ok(())
    }

    fn set_reference_accelerations(&self, _: Axes<'_>, _: &[f64]) -> Result<(), DeviceError> {
        Ok(())
    }

    fn reference_accelerations(&self, _: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        Ok(vec![1.0])
    }
}

impl PositionControl for RecordingDevice {
    fn position_move(&self, _: Axes<'_>, _: &[f64]) -> Result<(), DeviceError> {
        let now = Instant::now();
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(now);
        Ok(())
    }

    fn relative_move(&self, _: Axes<'_>, _: &[f64]) -> Result<(), DeviceError> {
        Ok(())
    }

    fn motion_done(&self, _: Axes<'_>) -> Result<bool, DeviceError> {
        Ok(true)
    }

    fn target_positions(&self, _: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        Ok(vec![0.0])
    }

    fn set_reference_speeds(&self, _: Axes<'_>, _: &[f64]) -> Result<(), DeviceError> {
        Ok(())
    }

    fn reference_speeds(&self, _: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        Ok(vec![1.0])
    }
}
