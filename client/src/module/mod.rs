//! Programs with a name, parameters, an RPC port and a periodic update, as stock's `RFModule`.
//!
//! | file | content |
//! | --- | --- |
//! | `context` | name, parameters and files of the program |
//! | `run` | configuration, periodic updates, end |
//! | `module_stop` | signals and other requests to stop |

mod context;
mod module_stop;
mod run;

use std::time::Duration;

use yarp_wire::Bottle;

use crate::Result;

pub use context::Context;
pub use module_stop::StopHandle;
pub use run::{run, run_with};

/// True if a module continues.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Flow {
    /// The module is updated again after its period.
    Continue,
    /// The module closes.
    Stop,
}

/// A program with a name, parameters, an RPC port and a periodic update (stock: `RFModule`).
///
/// [`run`] drives it. The module closes when [`update`](Self::update) returns [`Flow::Stop`], when somebody sends `quit`
/// to its RPC port `/NAME/rpc:i`, and on SIGINT, SIGTERM and SIGHUP; its ports are then closed and their names
/// unregistered. One second signal after two seconds ends the process at once.
///
/// ```no_run
/// use yarp_client::prelude::*;
///
/// struct Counter { publisher: Option<Publisher<Bottle>>, count: i32 }
///
/// impl Module for Counter {
///     fn configure(&mut self, context: &Context) -> Result<()> {
///         self.count = context.get_or("start", 0)?;
///         self.publisher = Some(Publisher::open(&context.port_name("count:o"))?);
///         Ok(())
///     }
///
///     fn update(&mut self) -> Result<Flow> {
///         self.count += 1;
///         if let Some(publisher) = &self.publisher {
///             publisher.publish(&bottle![self.count]);
///         }
///         Ok(Flow::Continue)
///     }
/// }
///
/// fn main() -> Result<()> {
///     run(Counter { publisher: None, count: 0 }, "counter")
/// }
/// ```
pub trait Module: Send + 'static {
    /// Reads parameters and opens ports, once, before the first update.
    ///
    /// Errors end the program.
    fn configure(&mut self, context: &Context) -> Result<()>;

    /// Does one step.
    ///
    /// Errors end the program; [`run`] returns them.
    fn update(&mut self) -> Result<Flow>;

    /// Returns the time between two updates; 1 s by default, as in stock.
    fn period(&self) -> Duration {
        Duration::from_secs(1)
    }

    /// Answers a request at the RPC port; `None` for a request that it does not know.
    ///
    /// `help` and `quit` are answered before this is called. Runs between two updates.
    fn respond(&mut self, request: &Bottle) -> Option<Bottle> {
        let _ = request;
        None
    }

    /// Returns the lines that `help` lists for the requests of [`respond`](Self::respond).
    fn help(&self) -> Vec<String> {
        Vec::new()
    }

    /// Releases what was opened, once, after the last update.
    fn close(&mut self) {}
}
