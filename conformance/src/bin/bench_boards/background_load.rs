//! Background load of the machine.

use std::hint::black_box;
use std::process::{Child, Command, Stdio};
use std::thread::available_parallelism;

use crate::Failure;

/// Level of background load.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Load {
    /// None.
    Quiet,
    /// One computing process.
    Mild,
    /// Two computing processes per processor, and one that copies memory.
    Intensive,
}

impl Load {
    pub(crate) const ALL: [Self; 3] = [Self::Quiet, Self::Mild, Self::Intensive];

    pub(crate) fn label(self) -> &'static str {
        match self {
            Self::Quiet => "quiet",
            Self::Mild => "mild",
            Self::Intensive => "intensive",
        }
    }

    /// Starts the load, which runs until the returned value is dropped.
    pub(crate) fn start(self) -> Result<RunningLoad, Failure> {
        let cores = available_parallelism()?.get();
        let (busy, copying) = match self {
            Self::Quiet => (0, 0),
            Self::Mild => (1, 0),
            Self::Intensive => (2 * cores, 1),
        };
        let mut burden = RunningLoad(Vec::new());
        for word in [vec!["busy"; busy], vec!["copy"; copying]].concat() {
            let mut command = Command::new(std::env::current_exe()?);
            burden
                .0
                .push(command.arg(word).stdin(Stdio::null()).spawn()?);
        }
        Ok(burden)
    }
}

/// Running load processes.
#[derive(Debug)]
pub(crate) struct RunningLoad(Vec<Child>);

impl Drop for RunningLoad {
    fn drop(&mut self) {
        for child in &mut self.0 {
            // They end in no other way.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Computes forever.
pub(crate) fn busy() -> Result<(), Failure> {
    busy_while(|| true);
    Ok(())
}

/// Computes while `goes_on` returns true.
pub(crate) fn busy_while(goes_on: impl Fn() -> bool) {
    let mut number = 1_u64;
    while goes_on() {
        number = black_box(number.wrapping_mul(3));
    }
}

/// Copies memory that exceeds every cache, forever.
pub(crate) fn copy() -> Result<(), Failure> {
    let from = vec![1_u8; 64 << 20];
    let mut to = vec![0_u8; from.len()];
    loop {
        to.copy_from_slice(black_box(&from));
        black_box(&to);
    }
}
