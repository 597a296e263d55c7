//! Runs the phases of a robot's life.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use tokio::task::JoinSet;
use yarp_devices::{Device, DeviceError};
use yarp_ports::{Network, Port, error_chain, remote_admin};

use super::action_targets::{AttachTargets, STORAGE, need};
use super::{
    Action, ActionKind, DeviceDescription, DeviceEntry, Param, Phase, Robot, SharedDescriptions,
    open_description_port,
};
use crate::{Attached, Hosted, Parts, RunningService, device_types, open, park};

/// Port at which `yarpmotorgui` of YARP 4.0 looks for the parts of a robot.
const DESCRIPTION_PORT: &str = "/yarpRobotInterface/devices/rpc";

/// Progress of a robot, shared with other tasks.
#[derive(Clone, Debug, Default)]
pub struct Progress(Arc<State>);

#[derive(Debug, Default)]
struct State {
    phase: Mutex<Option<Phase>>,
    level: AtomicU32,
    interrupted: AtomicBool,
}

impl Progress {
    /// Ends the startup before its next action; an action in progress is completed.
    pub fn interrupt(&self) {
        self.0.interrupted.store(true, Ordering::Relaxed);
    }

    fn may_continue(&self, phase: Phase) -> bool {
        phase != Phase::Startup || !self.0.interrupted.load(Ordering::Relaxed)
    }

    /// Returns the current phase; `None` before the first.
    pub fn phase(&self) -> Option<Phase> {
        *self.0.phase.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the level of the latest actions in this phase.
    pub fn level(&self) -> u32 {
        self.0.level.load(Ordering::Relaxed)
    }

    fn enter(&self, phase: Phase) {
        *self.0.phase.lock().unwrap_or_else(PoisonError::into_inner) = Some(phase);
        self.0.level.store(0, Ordering::Relaxed);
    }
}

/// A robot whose devices are open.
///
/// It ends with [`shut_down`](Self::shut_down); dropping it runs no action.
pub struct RunningRobot {
    robot: Robot,
    devices: Vec<(DeviceEntry, Box<dyn Hosted>)>,
    /// Services of the devices, in their order.
    services: Vec<RunningService>,
    /// True if a service did not start.
    lacks_service: bool,
    progress: Progress,
    /// True if all actions of the startup succeeded.
    ready: bool,
    /// Port that tells other programs of the devices.
    description: Option<Port>,
}

impl RunningRobot {
    /// Opens all devices in order, and runs the actions of the startup.
    ///
    /// Errors are logged, with file and line. If there are unknown device types, each is logged once and
    /// nothing is opened. If a device does not open, the others are tried, then
    /// all are closed and the result is `None`. If an action fails, the others are run, and the
    /// robot is not [`ready`](Self::is_ready). A service that does not start is logged, and the robot runs without it.
    pub async fn start(network: &Network, robot: Robot, progress: Progress) -> Option<Self> {
        progress.enter(Phase::Startup);
        tracing::info!("startup phase starting...");
        let unknown = robot.unknown_types();
        if !unknown.is_empty() {
            for problem in unknown {
                tracing::error!("{problem}");
            }
            tracing::error!("One or more devices failed opening");
            return None;
        }
        let mut running = Self {
            devices: Vec::new(),
            services: Vec::new(),
            lacks_service: false,
            progress,
            ready: false,
            description: None,
            robot,
        };
        let mut whole = true;
        for entry in running.robot.devices.clone() {
            if !running.progress.may_continue(Phase::Startup) {
                whole = false;
                break;
            }
            match running.open(network, &entry).await {
                Ok(device) => running.devices.push((entry, device)),
                Err(reason) => {
                    tracing::error!("{reason}");
                    tracing::warn!("Cannot open device {}", entry.name);
                    whole = false;
                }
            }
        }
        if !whole {
            tracing::error!("One or more devices failed opening");
            running.close().await;
            return None;
        }
        running.start_up().await;
        running.describe(network).await;
        if running.ready {
            tracing::info!("startup phase finished.");
            running.progress.enter(Phase::Run);
        }
        Some(running)
    }

    /// Returns true if all actions of the startup succeeded.
    pub fn is_ready(&self) -> bool {
        self.ready
    }

    /// Returns whether one of the devices is a machine that moves.
    pub fn has_machine(&self) -> bool {
        self.devices
            .iter()
            .any(|(_, device)| device.machine().is_some())
    }

    /// Runs `interrupt1` and `shutdown`, parks local devices that no action parked, and closes the
    /// devices in reverse order. Returns true if everything succeeded.
    ///
    /// * `parks`: parks devices without an action that says so. If the startup failed, none is
    ///   parked.
    /// * Cancelling skips all remaining steps; then [`close`](Self::close) must be called.
    pub async fn shut_down(&mut self, parks: bool) -> bool {
        let mut well = true;
        for phase in [Phase::Interrupt1, Phase::Shutdown] {
            self.progress.enter(phase);
            well &= self.actions(phase).await;
            if phase == Phase::Interrupt1 && parks && self.ready {
                well &= self.park_remaining().await;
            }
        }
        well
    }

    /// Runs the actions of a phase: of a later interrupt, or of the shutdown after one.
    pub async fn phase(&mut self, phase: Phase) -> bool {
        self.progress.enter(phase);
        self.actions(phase).await
    }

    /// Stops the services of the devices and closes the devices, in reverse order. Returns false if a service did not start, failed or did
    /// not stop.
    pub async fn close(&mut self) -> bool {
        let mut succeeded = !std::mem::take(&mut self.lacks_service);
        while let Some(service) = self.services.pop() {
            succeeded &= service.stop().await;
        }
        if let Some(port) = self.description.take() {
            port.close().await;
        }
        while let Some((_, device)) = self.devices.pop() {
            device.close().await;
        }
        succeeded
    }

    /// Opens the port that tells of the devices, unless the robot has one itself, or another robot has its name.
    async fn describe(&mut self, network: &Network) {
        let mut entries = self.devices.iter();
        if entries.any(|(entry, _)| entry.kind == device_types::ROBOT_DESCRIPTION) {
            return;
        }
        // A robot that was killed leaves the name behind.
        if remote_admin::exists(network, DESCRIPTION_PORT)
            .await
            .unwrap_or_default()
        {
            tracing::info!(
                "there is a port {DESCRIPTION_PORT} already: this robot does not open one"
            );
            return;
        }
        let devices = SharedDescriptions::new(Mutex::new(Some(self.descriptions())));
        match open_description_port(network, DESCRIPTION_PORT, devices).await {
            Ok(port) => self.description = Some(port),
            Err(error) => tracing::warn!("{}", error_chain(&error)),
        }
    }

    /// Runs the actions of the startup and, if they succeed, starts the services.
    async fn start_up(&mut self) {
        self.ready = self.actions(Phase::Startup).await;
        if self.ready {
            self.start_services().await;
        }
    }

    /// Starts the services of the devices. The robot runs without those that do not start: its machines still park at the end.
    async fn start_services(&mut self) {
        for (entry, device) in &self.devices {
            let Some(service) = device.service() else {
                continue;
            };
            match RunningService::start(&entry.name, service).await {
                Ok(running) => self.services.push(running),
                Err(error) => {
                    tracing::error!("{}", error_chain(&error));
                    self.lacks_service = true;
                }
            }
        }
    }

    /// Returns the open devices with their parameters.
    fn descriptions(&self) -> Arc<[DeviceDescription]> {
        let described = self.devices.iter().map(|(entry, _)| {
            let parameters = self.robot.parameters(entry);
            let text = parameters.map(|known| known.settings().to_bottle().to_string());
            DeviceDescription {
                name: entry.name.clone(),
                kind: entry.kind.clone(),
                configuration: text.unwrap_or_default(),
            }
        });
        described.collect()
    }

    async fn open(
        &self,
        network: &Network,
        entry: &DeviceEntry,
    ) -> Result<Box<dyn Hosted>, String> {
        let parameters = self
            .robot
            .parameters(entry)
            .map_err(|error| error.to_string())?;
        let device = open(network, &entry.kind, &parameters).await;
        let device = device.map_err(|error| error_chain(&error))?;
        for (name, origin) in parameters.unused() {
            tracing::warn!("{origin}: device {} ignores parameter {name}", entry.name);
        }
        Ok(device)
    }

    /// Runs the actions level by level; each level ends when its calibrations and parkings are
    /// complete.
    async fn actions(&mut self, phase: Phase) -> bool {
        let mut actions: Vec<(usize, Action)> = Vec::new();
        for (at, (entry, _)) in self.devices.iter().enumerate() {
            let ours = entry.actions.iter().filter(|action| action.phase == phase);
            actions.extend(ours.map(|action| (at, action.clone())));
        }
        let mut levels: Vec<u32> = actions.iter().map(|(_, action)| action.level).collect();
        levels.sort_unstable();
        levels.dedup();
        if self.robot.reversed && !matches!(phase, Phase::Startup | Phase::Run) {
            levels.reverse();
        }
        let mut well = true;
        for level in levels {
            self.progress.0.level.store(level, Ordering::Relaxed);
            tracing::info!("Entering action level {level} of phase {phase}");
            let mut moving = JoinSet::new();
            for (at, action) in actions.iter().filter(|(_, action)| action.level == level) {
                if !self.progress.may_continue(phase) {
                    well = false;
                    break;
                }
                if let Err(reason) = self.run_action(*at, action, &mut moving).await {
                    let (name, kind) = (&self.devices[*at].0.name, action.kind);
                    let origin = &action.origin;
                    tracing::error!(
                        "{origin}: cannot run {kind} action on device {name}: {reason}"
                    );
                    well = false;
                }
            }
            while let Some(ended) = moving.join_next().await {
                match ended {
                    Ok(Ok(())) => {}
                    Ok(Err(reason)) => {
                        tracing::error!("{reason}");
                        well = false;
                    }
                    Err(panicked) => std::panic::resume_unwind(panicked.into_panic()),
                }
            }
            tracing::info!("All actions for action level {level} of {phase} phase finished.");
        }
        well
    }

    async fn run_action(
        &mut self,
        at: usize,
        action: &Action,
        moving: &mut JoinSet<Result<(), String>>,
    ) -> Result<(), String> {
        let said = |error: crate::HostError| error_chain(&error);
        match action.kind {
            ActionKind::Attach => {
                let others = self.others(&action.params)?;
                self.devices[at].1.attach(others).await.map_err(said)
            }
            ActionKind::Detach => self.devices[at].1.detach().await.map_err(said),
            ActionKind::Calibrate | ActionKind::Park => {
                if !self.devices[at].1.is_calibrator() {
                    return Err(
                        "it is no calibrator, expected a device of type boardCalibrator".to_owned(),
                    );
                }
                let name = need(&action.params, "target")?;
                let board = self.device(&name)?.parts().board;
                let board = board.ok_or_else(|| format!("{name} has no joints"))?;
                let (origin, kind) = (action.origin.clone(), action.kind);
                moving.spawn(async move {
                    let done = match kind {
                        ActionKind::Park => park(board).await,
                        _ => calibrate(board).await,
                    };
                    done.map_err(|error| {
                        format!("{origin}: cannot {kind} {name}: {}", error_chain(&error))
                    })
                });
                Ok(())
            }
            ActionKind::Configure | ActionKind::Abort | ActionKind::Custom => {
                tracing::warn!("{}: action {} does nothing", action.origin, action.kind);
                Ok(())
            }
        }
    }

    /// Returns the devices that an attach action names.
    fn others(&self, params: &[Param]) -> Result<Vec<Attached>, String> {
        let one = |device: String, network: String| {
            let parts = match device.as_str() {
                STORAGE => Parts {
                    robot: Some(self.descriptions()),
                    ..Parts::default()
                },
                name => self.device(name)?.parts(),
            };
            Ok(Attached {
                device,
                network,
                parts,
            })
        };
        match AttachTargets::of(params)? {
            AttachTargets::Named(named) => named
                .into_iter()
                .map(|(device, network)| one(device, network))
                .collect(),
            AttachTargets::All => {
                let all = self.devices.iter().map(|(entry, device)| Attached {
                    device: entry.name.clone(),
                    network: "all".to_owned(),
                    parts: device.parts(),
                });
                Ok(all.collect())
            }
        }
    }

    fn device(&self, name: &str) -> Result<&dyn Hosted, String> {
        let found = self.devices.iter().find(|(entry, _)| entry.name == name);
        match found {
            Some((_, device)) => Ok(device.as_ref()),
            None => {
                let known: Vec<_> = self
                    .devices
                    .iter()
                    .map(|(entry, _)| entry.name.as_str())
                    .collect();
                Err(format!(
                    "there is no device {name}, only {}",
                    known.join(", ")
                ))
            }
        }
    }

    /// Parks the devices that no action parks.
    async fn park_remaining(&mut self) -> bool {
        let ends = |action: &&Action| {
            let end = matches!(action.phase, Phase::Interrupt1 | Phase::Shutdown);
            end && action.kind == ActionKind::Park
        };
        let entries = self.devices.iter().map(|(entry, _)| entry);
        let actions = entries.flat_map(|entry| entry.actions.iter().filter(ends));
        if actions.count() > 0 {
            // The description says which devices are parked, and when.
            return true;
        }
        let mut moving = JoinSet::new();
        for (entry, device) in &self.devices {
            if let Some(machine) = device.machine() {
                let name = entry.name.clone();
                moving.spawn(async move { (name, park(machine).await) });
            }
        }
        let mut well = true;
        while let Some(ended) = moving.join_next().await {
            match ended {
                Ok((_, Ok(()))) => {}
                Ok((name, Err(error))) => {
                    tracing::error!("cannot park {name}: {}", error_chain(&error));
                    well = false;
                }
                // The other joints are still moving.
                Err(panicked) => {
                    tracing::error!("cannot park a device: {panicked}");
                    well = false;
                }
            }
        }
        well
    }
}

async fn calibrate(board: Arc<dyn Device>) -> Result<(), DeviceError> {
    let work = tokio::task::spawn_blocking(move || {
        let Some(calibration) = board.control_calibration() else {
            return Err(DeviceError::NotSupported {
                what: "calibration".to_owned(),
            });
        };
        calibration.calibrate_robot()
    });
    work.await
        .unwrap_or_else(|panicked| std::panic::resume_unwind(panicked.into_panic()))
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;

    use yarp_devices::{
        AxisIndex, AxisInfo, CalibrationParameters, ControlCalibration, Service, ServiceStart,
        ServiceUpdate,
    };
    use yarp_testing::eventually;
    use yarp_wire::settings::Origin;

    use super::*;
    use crate::Future;

    /// An arm that counts its parkings.
    #[derive(Default)]
    struct Arm(AtomicUsize);

    impl AxisInfo for Arm {
        fn axes(&self) -> usize {
            1
        }
        fn axis_name(&self, _: AxisIndex) -> Result<String, DeviceError> {
            Ok("a".to_owned())
        }
        fn joint_type(&self, _: AxisIndex) -> Result<yarp_devices::JointType, DeviceError> {
            Ok(yarp_devices::JointType::Revolute)
        }
    }

    impl ControlCalibration for Arm {
        fn calibrate_axis(&self, _: AxisIndex, _: u32, _: [f64; 3]) -> Result<(), DeviceError> {
            Ok(())
        }
        fn set_calibration_parameters(
            &self,
            _: AxisIndex,
            _: CalibrationParameters,
        ) -> Result<(), DeviceError> {
            Ok(())
        }
        fn calibration_done(&self, _: AxisIndex) -> Result<bool, DeviceError> {
            Ok(true)
        }
        fn calibrate_robot(&self) -> Result<(), DeviceError> {
            Ok(())
        }
        fn park_robot(&self, _: bool) -> Result<(), DeviceError> {
            self.0.fetch_add(1, Ordering::SeqCst);
            Ok(())
        }
        fn abort_calibration(&self) -> Result<(), DeviceError> {
            Ok(())
        }
        fn abort_park(&self) -> Result<(), DeviceError> {
            Ok(())
        }
    }

    impl Device for Arm {
        yarp_devices::offers! { axis_info: AxisInfo, control_calibration: ControlCalibration }
    }

    /// A service that does not start, or fails at its first update.
    #[derive(Default)]
    struct Failing {
        starts: bool,
        stops: AtomicUsize,
    }

    fn failure() -> DeviceError {
        DeviceError::NotSupported {
            what: "it".to_owned(),
        }
    }

    impl Service for Failing {
        fn start_service(&self) -> Result<ServiceStart, DeviceError> {
            match self.starts {
                true => Ok(ServiceStart::NeedsUpdates),
                false => Err(failure()),
            }
        }
        fn update_service(&self) -> Result<ServiceUpdate, DeviceError> {
            Err(failure())
        }
        fn stop_service(&self) -> Result<(), DeviceError> {
            self.stops.fetch_add(1, Ordering::SeqCst);
            Ok(())
        }
    }

    impl Device for Failing {
        yarp_devices::offers! { service: Service }
    }

    #[derive(Default)]
    struct HostedParts {
        machine: Option<Arc<dyn Device>>,
        service: Option<Arc<dyn Device>>,
    }

    impl Hosted for HostedParts {
        fn machine(&self) -> Option<Arc<dyn Device>> {
            self.machine.clone()
        }
        fn service(&self) -> Option<Arc<dyn Device>> {
            self.service.clone()
        }
        fn close(self: Box<Self>) -> Future<'static, ()> {
            Box::pin(async {})
        }
    }

    /// Returns a robot of an arm and a device with a service.
    fn robot(arm: &Arc<Arm>, service: &Arc<Failing>) -> RunningRobot {
        let entry = |name: &str| DeviceEntry {
            name: name.to_owned(),
            kind: name.to_owned(),
            params: Vec::new(),
            actions: Vec::new(),
            origin: Origin::line("r.xml", 1),
        };
        let hosted = |parts: HostedParts| Box::new(parts) as Box<dyn Hosted>;
        let arm = hosted(HostedParts {
            machine: Some(arm.clone()),
            ..HostedParts::default()
        });
        let service = hosted(HostedParts {
            service: Some(service.clone()),
            ..HostedParts::default()
        });
        RunningRobot {
            robot: Robot {
                name: "r".to_owned(),
                build: 1,
                port_prefix: "r".to_owned(),
                reversed: false,
                params: Vec::new(),
                shares_params: false,
                devices: Vec::new(),
            },
            devices: vec![(entry("arm"), arm), (entry("recorder"), service)],
            services: Vec::new(),
            lacks_service: false,
            progress: Progress::default(),
            ready: false,
            description: None,
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_robot_whose_service_does_not_start_or_fails_parks_its_arm_and_reports_it() {
        for starts in [false, true] {
            let arm = Arc::new(Arm::default());
            let service = Arc::new(Failing {
                starts,
                ..Failing::default()
            });
            let mut robot = robot(&arm, &service);
            robot.start_up().await;
            assert!(robot.is_ready());
            let stops = usize::from(starts);
            eventually("the stop of the service that failed", || {
                service.stops.load(Ordering::SeqCst) == stops
            });
            assert!(robot.shut_down(true).await);
            assert_eq!(arm.0.load(Ordering::SeqCst), 1);
            assert!(!robot.close().await);
        }
    }
}
