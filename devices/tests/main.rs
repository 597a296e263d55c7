//! One program of all tests of this crate, one file per behaviour: it is compiled and linked once, and its tests run side by side.
//! A test that needs a process of its own has an entry in `Cargo.toml` instead.

#[path = "support/can/mod.rs"]
mod can;
#[allow(unreachable_pub)]
#[path = "../fuzz/src/can.rs"]
mod can_fuzz;
#[allow(unreachable_pub)]
#[path = "support/corpus.rs"]
mod corpus;
mod embedded;
#[allow(unreachable_pub)]
#[path = "../fuzz/src/embedded.rs"]
mod embedded_fuzz;
#[allow(unreachable_pub)]
#[path = "../fuzz/src/hand.rs"]
mod hand_fuzz;
mod hand_support;

mod arm_variables;
mod can_fuzz_corpus;
mod cartesian_controller;
mod cartesian_lead;
mod cartesian_on_every_arm;
mod cartesian_steps;
mod concurrent_calls;
mod dynamic_wam_checks;
mod dynamic_wam_motors;
mod dynamics_against_mechanics;
mod embedded_arm_checks;
mod embedded_driver_connection_loss;
mod embedded_driver_replies;
mod embedded_dynamic_arm;
mod embedded_fuzz_corpus;
mod embedded_moc_line;
mod embedded_node_client_loss;
mod embedded_noise;
mod embedded_several_clients;
mod finger_kinematics;
mod four_joint_arms;
mod gravity_procedure;
mod guards;
mod guards_by_default;
mod hand_abort;
mod hand_control_board;
mod hand_firmware;
mod hand_fuzz_corpus;
mod hand_guards;
mod hand_holding;
mod hand_node_protocol;
mod hand_serial_driver;
mod hand_serial_faults;
mod hand_stop_parameters;
mod initial_state;
mod inverse_kinematics;
mod kinematics_against_reference;
mod network_time;
mod published_numbers;
mod puck_frame_parsing;
mod refusal_messages;
mod remapper;
mod simulated_camera_checks;
mod simulated_can_wam;
mod simulated_mechanics;
mod simulated_moves;
mod simulated_sensors;
mod simulated_wam_checks;
mod simulation_effects;
mod simulation_without_effects;
mod software_stop;
mod stalled_joints;
mod stopped_commands;
mod torque_and_compliance;
mod torque_limit_of_gains;
mod wam_over_can;
mod wam_over_can_bus_loss;
mod wam_over_can_checks;
mod wam_over_can_histories;
mod wam_over_can_limits;
mod wam_over_can_noise;
mod wam_over_can_position;
mod wam_over_can_refusals;
mod wam_over_can_restart;
mod wam_over_can_wake_up;
