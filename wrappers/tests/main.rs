//! One program of all tests of this crate, one file per behaviour: it is compiled and linked once, and its tests run side by side.
//! A test that needs a process of its own has an entry in `Cargo.toml` instead.

#[allow(unreachable_pub)]
#[path = "../fuzz/src/lib.rs"]
mod fuzz;
mod support;

mod calls_from_async_code;
mod camera_with_sound;
mod command_queue_of_slow_device;
mod control_board_loss;
mod embedded_arm_over_network;
mod fuzz_corpus;
mod inertial_server;
mod many_clients;
mod modification_of_devices;
mod motion_completion_events;
mod network_time;
mod open_ports_all_or_nothing;
mod oversized_requests;
mod remote_analog_sensor;
mod remote_analog_sensors;
mod remote_battery;
mod remote_camera_checks;
mod remote_cartesian_checks;
mod remote_control_board_checks;
mod remote_gaze;
mod remote_hand_checks;
mod remote_hand_control_board;
mod remote_torque_control;
mod software_stop_port;
mod state_publisher;
