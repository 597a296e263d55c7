//! YARP ports on tokio: open, connect, read, write, call
