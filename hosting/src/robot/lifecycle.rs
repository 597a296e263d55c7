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
use crate::{Attached, Hosted, Parts, device_types, open, park};

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
    /// robot is not [`ready`](Self::is_ready).
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
        running.ready = running.actions(Phase::Startup).await;
        running.describe(network).await;
        if running.ready {
            tracing::info!("startup phase finished.");
            running.progress.enter(Phase::Run);
        }
        Some(running)
    }

    /// Returns true if the startup succeeded.
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

    /// Closes the devices in reverse order.
    pub async fn close(&mut self) {
        if let Some(port) = self.description.take() {
            port.close().await;
        }
        while let Some((_, device)) = self.devices.pop() {
            device.close().await;
        }
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
