//! A complete robot program, run against a simulated arm.

use std::sync::Arc;
use std::time::Duration;

use yarp_client::{Axes, ControlMode, DeviceError, Error, Mode, OpenError, PositionControl, Robot};
use yarp_devices::wam::SimulatedWam;
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::blocking::wait;
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};

#[test]
fn a_joint_moves_and_is_awaited() {
    let (names, board) = wait(async {
        let names = Server::start(ServerOptions::default().at("127.0.0.1", 0)).await;
        let names = names.expect("a name server starts");
        let arm = Arc::new(SimulatedWam::new());
        let options = ControlBoardOptions::new();
        let board = ControlBoardServer::open(&names.network(), arm, "/wam", options).await;
        (names, board.expect("it is served"))
    });
    let missing = Robot::connect_on(&names.network(), "/hand");
    assert!(matches!(
        missing,
        Err(Error::Open(OpenError::NoRemote { .. }))
    ));

    let arm = Robot::connect_on(&names.network(), "/wam").expect("it is there");
    let again = Robot::connect_on(&names.network(), "/wam").expect("two are no problem");
    let elbow = Axes::One(3.into());
    arm.set_control_modes(elbow, &[Mode::Position])
        .expect("it has it");
    arm.set_reference_speeds(elbow, &[60.0]).expect("allowed");
    arm.position_move(elbow, &[170.0]).expect("allowed");
    assert!(
        !arm.wait_motion_done(elbow, Duration::ZERO)
            .expect("it answers")
    );
    assert!(
        arm.wait_motion_done(elbow, Duration::from_secs(30))
            .expect("it answers")
    );
    while (again.positions().expect("fresh")[3] - 170.0).abs() > 1e-9 {
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(matches!(
        arm.position_move(elbow, &[1000.0]),
        Err(DeviceError::Refused { .. })
    ));
    let device = arm.device();
    assert_eq!(device.axis_info().map(|info| info.axes()), Some(7));
    drop((arm, again, device));
    wait(board.close());
    let left = names.registrations().into_iter().map(|place| place.name);
    let left: Vec<String> = left.filter(|name| name.contains("wam")).collect();
    assert!(left.is_empty(), "{left:?}");
}
