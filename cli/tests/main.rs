//! One program of all tests of this crate, one file per behaviour: it is compiled and linked once, and its tests run side by side.
//! A test that needs a process of its own has an entry in `Cargo.toml` instead.

mod common;

mod argument_errors;
mod bringing_up_guide;
mod camera_command;
mod clock_command;
mod conf_and_namespace_commands;
mod control_board_failures;
mod datagram_writer_liveness;
mod demo_command;
mod dev_command;
mod embedded_arm_processes;
mod encryption;
mod existing_connections;
mod guarded_servers;
mod hand_commands;
mod idle_client_timeouts;
mod keys_and_roles;
mod killed_readers_and_writers;
mod latency_test_command;
mod log_forwarding;
mod name_conflicts;
mod name_server_failures;
mod name_server_kill_durability;
mod output_that_nobody_reads;
mod persistent_connections_recover;
mod plugin_command;
mod priority_commands;
mod read_write_rpc_commands;
mod record_command;
mod requests_over_http;
mod resource_command;
mod robotinterface_command;
mod run_command;
mod sample_command;
mod server_bind_address;
mod software_stop_ports;
mod split_command;
mod strict_robot_files;
mod teach_command;
mod ten_thousand_names;
mod termination_signals;
mod trafficgen_and_stats_commands;
mod up_command;
mod without_name_server;
