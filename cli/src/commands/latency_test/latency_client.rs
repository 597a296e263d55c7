//! Client of the latency test.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::process::ExitCode;
use std::time::Duration;

use tokio::time::timeout;
use yarp_devices::clock::wall_clock;
use yarp_ports::{Network, Port, PortError, PortOptions, Queue};
use yarp_wire::carrier::{Carrier, CarrierSpec};
use yarp_wire::{Bottle, Value};

use super::{CLIENT, EXIT_FAILED, SERVER, Sizes, sleep_between_frames};
use crate::commands::argument_words::Options;
use crate::error::Result;
use crate::network_access;
use crate::port_connections::{self, Verbosity};
use crate::signals::Interrupt;
use crate::stock_format::{complain, general, statistics};

/// Delay between two attempts to reach the server.
const RETRY_DELAY: Duration = Duration::from_millis(500);
/// Timeout for a frame.
const FRAME_TIMEOUT: Duration = Duration::from_secs(60);
/// Maximum number of frames of a test.
const MAX_FRAMES: i32 = 10_000_000;

/// Ports and direction of the frames.
struct Route<'a> {
    carrier: &'a str,
    /// True if frames come back as replies.
    replies: bool,
}

/// Measurements of one frame.
struct Frame {
    /// Round trip in milliseconds, without the time of the server.
    latency: f64,
    /// Seconds that the server took to create the text.
    copy: f64,
}

/// Runs one test per size.
pub(super) async fn measure(
    options: &Options,
    sizes: &Sizes,
    out: &mut dyn Write,
) -> Result<ExitCode> {
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    let frames = options.value("nframes").and_then(|value| value.as_i32());
    let Some(frames) = frames.filter(|frames| (1..=MAX_FRAMES).contains(frames)) else {
        complain(out, &format!("nframes must be 1 to {MAX_FRAMES}"))?;
        return Ok(ExitCode::from(EXIT_FAILED));
    };
    let mut code = sizes.code;
    for size in &sizes.sizes {
        let Some(size) = size else {
            complain(
                out,
                "Syntax error. Invalid value for customtest. See available options with yarp latency-test",
            )?;
            continue;
        };
        let reading = PortOptions::new().queue(Queue::Wait(1));
        let Some(port) = network_access::open(&network, CLIENT, reading).await? else {
            return Ok(ExitCode::from(EXIT_FAILED));
        };
        let test = test(&network, &port, options, (frames, *size), out);
        let done = tokio::select! {
            biased;
            () = interrupt.interrupted() => Ok(None),
            done = test => done,
        };
        port.close().await;
        match done? {
            Some(Ok(measured)) if measured.is_empty() => {
                complain(out, "No frame was measured.")?;
                code = EXIT_FAILED;
            }
            Some(Ok(measured)) => print_results(&measured, *size, options, out)?,
            Some(Err(failed)) => code = failed,
            None => return Ok(ExitCode::FAILURE),
        }
    }
    Ok(ExitCode::from(code))
}

/// Runs one test; returns the measurements, or an exit code.
async fn test(
    network: &Network,
    port: &Port,
    options: &Options,
    (frames, size): (i32, i32),
    out: &mut dyn Write,
) -> Result<Option<std::result::Result<Vec<Frame>, u8>>> {
    let named = options.text("protocol").unwrap_or_else(|| "tcp".to_owned());
    let spec = named.parse::<CarrierSpec>().ok();
    let Some(carrier) = spec.as_ref().and_then(Carrier::of) else {
        tracing::error!(target: "yarp.os.Carriers", "Could not find carrier \"{named}\"");
        return Ok(Some(Err(1)));
    };
    let way = Route {
        carrier: &named,
        replies: !carrier.connectionless && carrier.push && !options.has("no-reply"),
    };
    connect_when_possible(network, port.name(), SERVER, &way, out).await?;
    if !way.replies {
        connect_when_possible(network, SERVER, port.name(), &way, out).await?;
    }
    let start = [
        Value::from("start"),
        size.into(),
        i32::from(way.replies).into(),
    ];
    port.write(&Bottle::from_iter(start)).await;
    let measured = match exchange(port, options, &way, frames, out).await? {
        Ok(measured) => measured,
        Err(error) => {
            complain(
                out,
                &format!("The server does not answer: {}", error.error_chain()),
            )?;
            return Ok(Some(Err(EXIT_FAILED)));
        }
    };
    port.write(&Bottle::of("stop")).await;
    port.flush().await;
    // As in stock: the server must be ready again for the next test, and the end of datagrams takes
    // another path, on which it may overtake them.
    tokio::time::sleep(RETRY_DELAY).await;
    Ok(Some(Ok(measured)))
}

/// Connects two ports as soon as possible.
async fn connect_when_possible(
    network: &Network,
    from: &str,
    to: &str,
    way: &Route<'_>,
    out: &mut dyn Write,
) -> Result<()> {
    while !port_connections::connect(
        network,
        from,
        to,
        Some(way.carrier),
        Verbosity::FailuresOnly,
    )
    .await
    {
        writeln!(out, "Waiting for connection..")?;
        out.flush()?;
        tokio::time::sleep(RETRY_DELAY).await;
    }
    Ok(())
}

/// Sends frames, each after the previous one has come back.
async fn exchange(
    port: &Port,
    options: &Options,
    way: &Route<'_>,
    frames: i32,
    out: &mut dyn Write,
) -> Result<std::result::Result<Vec<Frame>, PortError>> {
    let pause = options.number("client_wait").unwrap_or(0.0);
    let mut measured = Vec::new();
    for number in 0..frames {
        let sent = wall_clock();
        let frame = Bottle::from_iter([Value::Int32(number), Value::Float64(sent)]);
        let reply: std::result::Result<Bottle, PortError> = if way.replies {
            port.call_within(&frame, FRAME_TIMEOUT).await
        } else {
            port.write(&frame).await;
            match timeout(FRAME_TIMEOUT, port.read()).await {
                Ok(received) => received.map(|received| received.bottle().unwrap_or_default()),
                Err(_) => Err(PortError::Timeout {
                    peer: SERVER.to_owned(),
                    step: "frame",
                    seconds: FRAME_TIMEOUT.as_secs_f64(),
                }),
            }
        };
        let now = wall_clock();
        let reply = match reply {
            Ok(reply) => reply,
            Err(error) => return Ok(Err(error)),
        };
        let Some(sent) = reply.get(1).and_then(Value::as_f64) else {
            complain(
                out,
                &format!(
                    "Frame {number} is not counted: the reply of {SERVER} does not hold the time that was sent; run the test again"
                ),
            )?;
            continue;
        };
        let copy = reply.get(3).and_then(Value::as_f64).unwrap_or(0.0);
        measured.push(Frame {
            latency: (now - sent - copy) * 1000.0,
            copy,
        });
        if options.has("details") {
            let size = reply.get(2).and_then(Value::as_str).map_or(0, str::len);
            writeln!(out, "Received a payload of {size} bytes")?;
            writeln!(
                out,
                "latency for frame {number} is: {:.6} ms",
                (now - sent) * 1000.0
            )?;
        }
        sleep_between_frames(pause).await;
    }
    Ok(Ok(measured))
}

/// Prints the measurements, and writes them to a file.
fn print_results(
    measured: &[Frame],
    size: i32,
    options: &Options,
    out: &mut dyn Write,
) -> Result<()> {
    let latencies: Vec<f64> = measured.iter().map(|frame| frame.latency).collect();
    let (mean, deviation) = statistics(&latencies);
    let max = latencies.iter().copied().fold(0.0, f64::max);
    let min = latencies.iter().copied().fold(f64::INFINITY, f64::min);
    let count = measured.len();
    writeln!(
        out,
        "Processed {count} frames of {size} bytes, average latency {mean:.3}[ms], max {max:.3}[ms], min {min:.3}[ms], stdev {deviation:.3}[ms]"
    )?;
    let prefix = options.text("logfile").unwrap_or_else(|| "log_".to_owned());
    let name = format!("{prefix}{size}.txt");
    match write_results(&name, measured) {
        Ok(()) => writeln!(out, "Test complete. Data saved to file: {name}")?,
        Err(error) => complain(out, &format!("Cannot write {name}: {error}"))?,
    }
    Ok(())
}

fn write_results(name: &str, measured: &[Frame]) -> std::io::Result<()> {
    let mut file = BufWriter::new(File::create(name)?);
    for Frame { latency, copy } in measured {
        writeln!(file, "{} {}", general(*latency), general(*copy))?;
    }
    file.flush()
}
