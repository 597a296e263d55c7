//! Recorded traffic and live peers against our server, ports and wrappers
