//! The YARP name server
