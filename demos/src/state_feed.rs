//! Measures repeatability, straightness and the state feed: tables 5 and 6 and figure 13 of the thesis, with plots.
//!
//! Tables 5 and figure 13 come from [`crate::repeatability`] and
//! [`crate::joint_synchronisation`]. For table 6 a reader measures the time between two states of an arm, while the arm moves and
//! while other clients ask it for its position all the time besides.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use tokio::task::JoinSet;
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Network, Port, PortOptions, Queue, remote_admin};
use yarp_wire::Bottle;
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};

use crate::svg_plot::{Plot, Series};
use crate::{DemoArm, DemoError, joint_synchronisation, repeatability};

/// Clients that ask for the position all the time during the intensive part.
const CLIENTS: usize = 8;
/// Timeout of a request to the arm, and of the wait for the next state.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Interval between two moves.
const MOVE_INTERVAL: Duration = Duration::from_millis(700);
/// Degrees of the elbow that the moves go between.
const ELBOW: [f64; 2] = [150.0, 120.0];

/// Options of the demo.
#[derive(Clone, Debug)]
pub struct StateFeedOptions {
    /// Number of visits to each pose of table 5.
    pub repeat: usize,
    /// Duration of each measurement of table 6.
    pub duration: Duration,
    /// Prefix of an arm on the network; without it a simulated one is started, on a network of its own.
    pub arm: Option<String>,
    /// Simulated arm of the tables, and of the state feed without an arm on the network.
    pub simulation: DemoArm,
    /// Folder of the plots.
    pub folder: PathBuf,
}

/// A row of table 6: rate in packets per second, and delays in ms.
struct Row {
    name: &'static str,
    rate: f64,
    least: f64,
    mean: f64,
    most: f64,
}

/// Table 6 of the thesis, on one computer and distributed.
const THESIS: [[Row; 2]; 2] = [
    [
        row("mild exercise", 49.95, 4.11, 20.02, 33.14),
        row("intensive activity", 49.98, 1.47, 20.01, 30.18),
    ],
    [
        row("mild exercise", 50.02, 1.32, 19.99, 25.02),
        row("intensive activity", 50.05, 2.11, 19.98, 29.27),
    ],
];

const fn row(name: &'static str, rate: f64, least: f64, mean: f64, most: f64) -> Row {
    Row {
        name,
        rate,
        least,
        mean,
        most,
    }
}

/// Repeats the experiments, writes the tables with the thesis's values beside ours, and the plots to files.
///
/// Errors: those of `out` and of the folder, [`DemoError::Network`] without the arm, [`DemoError::Silent`] if it publishes no state.
pub async fn run(
    options: &StateFeedOptions,
    network: Option<Network>,
    out: &mut dyn Write,
) -> Result<(), DemoError> {
    if let (Some(arm), Some(network)) = (&options.arm, &network) {
        check_arm(network, arm).await?;
    }
    std::fs::create_dir_all(&options.folder)?;
    writeln!(out, "Table 5: repeatability\n")?;
    let mut text = Vec::new();
    // The simulated arm computes for seconds, and is no work for the executor.
    let offsets = tokio::task::block_in_place(|| {
        repeatability::run_with_offsets(options.repeat, options.simulation, &mut text)
    })?;
    out.write_all(&text)?;
    let series = offsets
        .into_iter()
        .enumerate()
        .map(|(index, points)| Series {
            name: format!("point {}", index + 1),
            points,
            connected: false,
        });
    let plot = Plot {
        title: "Distance of each visit from its target".to_owned(),
        axes: ["visit".to_owned(), "mm".to_owned()],
        series: series.collect(),
    };
    save(&options.folder, "table-5.svg", &plot, out)?;
    writeln!(out, "\nFigure 13: joint synchronisation\n")?;
    let mut text = Vec::new();
    let paths = tokio::task::block_in_place(|| {
        joint_synchronisation::run_with_paths(options.simulation, &mut text)
    })?;
    out.write_all(&text)?;
    for (name, axes) in [("figure-13-xz.svg", [0, 2]), ("figure-13-yz.svg", [1, 2])] {
        save(&options.folder, name, &projection(&paths, axes), out)?;
    }
    writeln!(out, "\nTable 6: time between two states\n")?;
    let (place, measured) = measure(options, network).await?;
    table(place, &measured, out)?;
    let plot = Plot {
        title: "Time between two states".to_owned(),
        axes: ["s".to_owned(), "ms".to_owned()],
        series: measured.iter().map(|part| part.series()).collect(),
    };
    save(&options.folder, "table-6.svg", &plot, out)?;
    save(&options.folder, "figure-19.svg", &densities(&measured), out)?;
    Ok(())
}

/// Checks that an arm publishes its state, before anything is measured.
async fn check_arm(network: &Network, arm: &str) -> Result<(), DemoError> {
    let port = format!("{arm}/stateExt:o");
    let reason = match remote_admin::exists(network, &port).await {
        Ok(true) => return Ok(()),
        Ok(false) => "the port is not registered or does not answer".to_owned(),
        Err(error) => error.to_string(),
    };
    Err(DemoError::Connect { port, reason })
}

fn save(folder: &Path, name: &str, plot: &Plot, out: &mut dyn Write) -> Result<(), DemoError> {
    let path = folder.join(name);
    std::fs::write(&path, plot.to_svg())?;
    writeln!(out, "Plot: {}", path.display())?;
    Ok(())
}

/// Returns the paths of the tool and their regression line, on a plane.
fn projection(paths: &[joint_synchronisation::ToolPath], [across, up]: [usize; 2]) -> Plot {
    let name = |axis: usize| ["x", "y", "z"][axis];
    let mut series = Vec::new();
    for path in paths {
        series.push(Series {
            name: path.name.to_owned(),
            points: path
                .places
                .iter()
                .map(|place| [place[across], place[up]])
                .collect(),
            connected: false,
        });
    }
    if let Some(path) = paths.first() {
        series.push(Series {
            name: "regression line".to_owned(),
            points: path
                .regression
                .iter()
                .map(|place| [place[across], place[up]])
                .collect(),
            connected: true,
        });
    }
    Plot {
        title: format!(
            "Figure 13: path of the tool, {}{} projection",
            name(across).to_uppercase(),
            name(up).to_uppercase()
        ),
        axes: [across, up].map(|axis| format!("{} [mm]", name(axis))),
        series,
    }
}

/// One measurement: the moment and the time since the state before, both in seconds.
struct Measured {
    name: &'static str,
    delays: Vec<[f64; 2]>,
}

impl Measured {
    fn row(&self) -> Row {
        let delays = || self.delays.iter().map(|delay| delay[1] * 1e3);
        let sum: f64 = delays().sum();
        let mean = sum / self.delays.len().max(1) as f64;
        row(
            self.name,
            1e3 / mean,
            delays().fold(f64::INFINITY, f64::min),
            mean,
            delays().fold(0.0, f64::max),
        )
    }

    fn series(&self) -> Series {
        Series {
            name: self.name.to_owned(),
            points: self
                .delays
                .iter()
                .map(|[at, delay]| [*at, delay * 1e3])
                .collect(),
            connected: true,
        }
    }
}

/// Measures an arm of the network, or a simulated one; returns the row of the thesis to compare with.
async fn measure(
    options: &StateFeedOptions,
    network: Option<Network>,
) -> Result<(usize, Vec<Measured>), DemoError> {
    if let (Some(arm), Some(network)) = (&options.arm, network) {
        return Ok((1, exercise(&network, arm, options.duration).await?));
    }
    let server = Server::start(ServerOptions::default().at("127.0.0.1", 0)).await?;
    let network = server.network();
    let arm = tokio::task::block_in_place(|| options.simulation.start())?;
    let board = ControlBoardServer::open(&network, arm, "/wam", ControlBoardOptions::new()).await?;
    let measured = exercise(&network, "/wam", options.duration).await;
    board.close().await;
    server.close().await;
    Ok((0, measured?))
}

/// Moves the arm and measures its state feed, without and with many other clients.
async fn exercise(
    network: &Network,
    arm: &str,
    duration: Duration,
) -> Result<Vec<Measured>, DemoError> {
    let reader = PortOptions::new().input_only().queue(Queue::Strict);
    let reader = Port::open(network, "...", reader).await?;
    let state = format!("{arm}/stateExt:o");
    remote_admin::connect(network, &state, reader.name(), None)
        .await
        .map_err(|error| DemoError::Connect {
            port: state.clone(),
            reason: error.to_string(),
        })?;
    let mut measured = Vec::new();
    for (name, clients) in [("mild exercise", 0), ("intensive activity", CLIENTS)] {
        let mut load = JoinSet::new();
        let mover = client(network, arm).await?;
        load.spawn(move_elbow(mover));
        for _ in 0..clients {
            load.spawn(ask_positions(client(network, arm).await?));
        }
        let delays = delays(&reader, duration, &state).await;
        load.shutdown().await;
        measured.push(Measured {
            name,
            delays: delays?,
        });
    }
    reader.close().await;
    Ok(measured)
}

async fn client(network: &Network, arm: &str) -> Result<Port, DemoError> {
    let port = Port::open(network, "...", PortOptions::new().rpc_client()).await?;
    port.connect(&format!("{arm}/rpc:i")).await?;
    Ok(port)
}

/// Moves the elbow to and fro, until it is aborted or the arm is gone.
async fn move_elbow(port: Port) {
    for target in ELBOW.into_iter().cycle() {
        let request = Bottle::parse(&format!("[set] [pos] 3 {target:.1}")).unwrap_or_default();
        if port.call_within::<Bottle>(&request, TIMEOUT).await.is_err() {
            return;
        }
        tokio::time::sleep(MOVE_INTERVAL).await;
    }
}

async fn ask_positions(port: Port) {
    let request = Bottle::parse("[get] [encs]").unwrap_or_default();
    while port.call_within::<Bottle>(&request, TIMEOUT).await.is_ok() {}
}

/// Returns the times between states for `duration`, after one state that counts for none.
async fn delays(
    reader: &Port,
    duration: Duration,
    source: &str,
) -> Result<Vec<[f64; 2]>, DemoError> {
    let silent = |_| DemoError::Silent {
        port: source.to_owned(),
    };
    while reader.try_read().is_some() {}
    let start = Instant::now();
    let mut last = None;
    let mut delays = Vec::new();
    while start.elapsed() < duration || delays.is_empty() {
        tokio::time::timeout(TIMEOUT, reader.read())
            .await
            .map_err(silent)??;
        let now = Instant::now();
        if let Some(last) = last.replace(now) {
            delays.push([(now - start).as_secs_f64(), (now - last).as_secs_f64()]);
        }
    }
    Ok(delays)
}

fn table(place: usize, measured: &[Measured], out: &mut dyn Write) -> Result<(), DemoError> {
    let titles = ["rate", "least", "mean", "most"];
    let heads: String = titles
        .iter()
        .chain(&titles)
        .map(|title| format!("{title:>8}"))
        .collect();
    writeln!(
        out,
        "{:<20} {:<32} here [1/s, ms, ms, ms]",
        " ", "thesis [1/s, ms, ms, ms]"
    )?;
    writeln!(out, "{:<20}{heads}", ["one computer", "distributed"][place])?;
    for (thesis, ours) in THESIS[place].iter().zip(measured) {
        let ours = ours.row();
        let numbers = |row: &Row| {
            format!(
                "{:>8.2}{:>8.2}{:>8.2}{:>8.2}",
                row.rate, row.least, row.mean, row.most
            )
        };
        writeln!(
            out,
            "{:<20}{}{}",
            thesis.name,
            numbers(thesis),
            numbers(&ours)
        )?;
    }
    writeln!(
        out,
        "\nIntensive: {CLIENTS} clients ask for the position without pause. The rate that the arm publishes at is 50 Hz."
    )?;
    if place == 0 {
        writeln!(
            out,
            "For the distributed rows run it on another computer than the arm, with --arm /wam."
        )?;
    }
    Ok(())
}

/// Returns the shares of delays per millisecond, as figure 19 of the thesis.
fn densities(measured: &[Measured]) -> Plot {
    let series = measured.iter().map(|part| {
        let mut counts = [0_usize; 60];
        for [_, delay] in &part.delays {
            let bin = ((delay * 1e3) as usize).min(counts.len() - 1);
            counts[bin] += 1;
        }
        let all = part.delays.len().max(1) as f64;
        Series {
            name: part.name.to_owned(),
            points: counts
                .iter()
                .enumerate()
                .map(|(ms, count)| [ms as f64 + 0.5, *count as f64 / all])
                .collect(),
            connected: true,
        }
    });
    Plot {
        title: "Probability density of the time between two states".to_owned(),
        axes: ["ms".to_owned(), "1/ms".to_owned()],
        series: series.collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_and_delays_follow_from_the_measurement() {
        let measured = Measured {
            name: "x",
            delays: vec![[0.02, 0.02], [0.04, 0.02], [0.05, 0.01], [0.08, 0.03]],
        };
        let found = measured.row();
        assert!((found.rate - 50.0).abs() < 1e-9 && (found.mean - 20.0).abs() < 1e-9);
        assert!((found.least - 10.0).abs() < 1e-9 && (found.most - 30.0).abs() < 1e-9);
    }

    #[test]
    fn an_arm_that_does_not_exist_is_named() {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .unwrap();
        runtime.block_on(async {
            let server = Server::start(ServerOptions::default().at("127.0.0.1", 0))
                .await
                .unwrap();
            let error = exercise(&server.network(), "/nobody", Duration::ZERO)
                .await
                .err()
                .unwrap();
            assert!(error.to_string().contains("/nobody"), "{error}");
            server.close().await;
        });
    }
}
