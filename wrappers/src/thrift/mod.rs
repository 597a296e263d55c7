//! Calls of Thrift services as YARP encodes them, which the wrappers of 4.0 use.
//!
//! ```text
//! call    int32 256  int32 n   string NAME  arguments..
//! reply   int32 256  int32 1   vocab CODE                            only a return value
//!         int32 256  int32 n   list (vocab CODE)  results..          with results
//!         [fail]                                                     the call was not understood
//! ```
//!
//! The bytes are those of a bottle, with lists that are specialised only where the type requires it. So calls and
//! replies are read as bottles and written as [`Message`]s.
//!
//! Source: `WireWriter.cpp`, `ReturnValue.cpp` and the generated code of YARP 4.0; recorded traffic of 4.0.0.

mod return_code;
mod service_version;
mod thrift_item;

pub use return_code::ReturnCode;
pub use service_version::{GET_VERSION, ServiceVersion};
pub use thrift_item::{Item, Message};
