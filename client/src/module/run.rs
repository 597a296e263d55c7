//! The life of a module.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use yarp_devices::clock::TimeSource;
use yarp_ports::Network;
use yarp_wire::{Bottle, Value, Vocab32, bottle};

use super::{Context, Flow, Module, StopHandle};
use crate::{Result, RpcServer};

/// Runs a module until it stops, with the command line of the process.
///
/// Opens its RPC port `/NAME/rpc:i`, configures it, updates it every [`period`](Module::period), closes it, closes the
/// port. The main configuration file is `NAME.ini` unless `--from` names another; it need not exist.
///
/// Errors: those of the module, [`Error::Config`](crate::Error::Config) for a file of `--from` that does not exist,
/// [`Error::Network`](crate::Error::Network) when the RPC port cannot be opened.
pub fn run(module: impl Module, default_name: &str) -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    run_with(module, &Network::from_process()?, &arguments, default_name)
}

/// Runs a module until it stops, on the given network and with the given command line.
pub fn run_with(
    module: impl Module,
    network: &Network,
    arguments: &[String],
    default_name: &str,
) -> Result<()> {
    let stop = StopHandle::default();
    stop.on_signals()?;
    let file = format!("{default_name}.ini");
    let context = Context::new(network, arguments, default_name, Some(&file), stop.clone())?;
    let module = Arc::new(Mutex::new(module));
    lock(&module).configure(&context)?;
    let rpc = open_rpc(&module, network, &context);
    let outcome = match rpc {
        Ok(rpc) => {
            let outcome = update(&module, &stop);
            // Requests end before the module closes.
            drop(rpc);
            outcome
        }
        Err(error) => Err(error),
    };
    lock(&module).close();
    outcome
}

fn open_rpc<M: Module>(
    module: &Arc<Mutex<M>>,
    network: &Network,
    context: &Context,
) -> Result<RpcServer> {
    let stop = context.stop_handle();
    let module = module.clone();
    RpcServer::open_on(
        network,
        &context.port_name("rpc:i"),
        move |request: Bottle| respond(&mut *lock(&module), &request, &stop),
    )
}

/// Updates the module every period, of the clock that the process follows, until it stops.
fn update<M: Module>(module: &Mutex<M>, stop: &StopHandle) -> Result<()> {
    let source = TimeSource::current();
    let mut next = source.instant();
    while !stop.wait_until(&source, next) {
        let (flow, period) = {
            let mut module = lock(module);
            (module.update()?, module.period())
        };
        if flow == Flow::Stop {
            stop.stop();
        }
        // A late update does not make the following ones come faster.
        next = (next + period).max(source.instant());
    }
    Ok(())
}

fn respond(module: &mut impl Module, request: &Bottle, stop: &StopHandle) -> Bottle {
    match request.get(0).and_then(Value::as_str) {
        Some("help") => {
            let own = ["help: lists the requests", "quit: closes the module"].map(str::to_owned);
            let lines = own.into_iter().chain(module.help());
            std::iter::once(Value::from(Vocab32::new("many")))
                .chain(lines.map(|line| Value::from(line.as_str())))
                .collect()
        }
        Some("quit") => {
            stop.stop();
            bottle!["bye"]
        }
        _ => module.respond(request).unwrap_or_else(|| {
            bottle![
                Vocab32::FAIL,
                format!("unknown request {request}; try help")
            ]
        }),
    }
}

fn lock<M>(module: &Mutex<M>) -> MutexGuard<'_, M> {
    // A module that panicked while it answered a request is still closed.
    module.lock().unwrap_or_else(PoisonError::into_inner)
}
