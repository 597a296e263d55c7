//! Recorded conversations.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use yarp_testing::from_hex;

/// A recorded scenario.
#[derive(Clone, Debug)]
pub struct Capture {
    /// Description of the recording.
    pub what: String,
    /// TCP connections, in the order in which they began.
    pub streams: Vec<Stream>,
}

/// One TCP connection.
#[derive(Clone, Debug)]
pub struct Stream {
    /// TCP port that listened.
    pub port: u16,
    /// Data, alternating between the directions.
    pub runs: Vec<Run>,
}

/// Bytes sent in one direction.
#[derive(Clone, Debug)]
pub struct Run {
    /// True if the connecting side sent them.
    pub sent: bool,
    /// Seconds since the start of the recording.
    pub time: f64,
    /// Bytes.
    pub bytes: Vec<u8>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Line {
    Head {
        what: String,
    },
    Run {
        stream: i64,
        proto: String,
        dir: String,
        port: u16,
        t: f64,
        hex: String,
    },
}

impl Capture {
    /// Reads `vectors/GENERATION/SCENARIO.jsonl`.
    ///
    /// # Panics
    ///
    /// If the file does not exist or has another form than its README describes.
    pub fn load(generation: &str, scenario: &str) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("vectors")
            .join(generation)
            .join(format!("{scenario}.jsonl"));
        let text = std::fs::read_to_string(&path)
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut what = String::new();
        let mut streams: BTreeMap<i64, Stream> = BTreeMap::new();
        for line in text.lines() {
            let line = serde_json::from_str(line)
                .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            match line {
                Line::Head { what: title } => what = title,
                Line::Run { proto, .. } if proto != "tcp" => {}
                Line::Run {
                    stream,
                    dir,
                    port,
                    t,
                    hex,
                    ..
                } => {
                    let stream = streams.entry(stream).or_insert_with(|| Stream {
                        port,
                        runs: Vec::new(),
                    });
                    stream.runs.push(Run {
                        sent: dir == ">",
                        time: t,
                        bytes: from_hex(&hex),
                    });
                }
            }
        }
        let mut streams: Vec<Stream> = streams.into_values().collect();
        streams.sort_by(|a, b| a.runs[0].time.total_cmp(&b.runs[0].time));
        Self { what, streams }
    }

    /// Returns the connections to one listening port.
    pub fn to(&self, port: u16) -> impl Iterator<Item = &Stream> {
        self.streams
            .iter()
            .filter(move |stream| stream.port == port)
    }

    /// Returns true if a structured list in the recording contains the port `name`, though nothing
    /// in the recording registers it.
    pub fn mentions(&self, name: &str) -> bool {
        let says = |text: &str, sent: bool| {
            let runs = self.streams.iter().flat_map(|stream| &stream.runs);
            runs.filter(|run| run.sent == sent)
                .any(|run| String::from_utf8_lossy(&run.bytes).contains(text))
        };
        let listed = says(&format!("(name \"{name}\")"), false);
        let registered = |name| says(&format!("SERVER register {name}"), true);
        listed && !registered(name) && !registered("...")
    }

    /// Returns the number that the recorded name server assigned to the port `name`.
    ///
    /// # Panics
    ///
    /// If no answer in the recording contains it.
    pub fn number_of(&self, name: &str) -> u16 {
        let start = format!("registration name {name} ip ");
        let runs = self.streams.iter().flat_map(|stream| &stream.runs);
        runs.filter(|run| !run.sent)
            .find_map(|run| {
                let text = String::from_utf8_lossy(&run.bytes).into_owned();
                let line = text.lines().find(|line| line.starts_with(&start))?;
                line.split_whitespace().nth(6)?.parse().ok()
            })
            .unwrap_or_else(|| panic!("the recording does not place {name}"))
    }
}
