//! Settings in effect, and periods under load.

use std::fs;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use yarp_devices::real_time::RealTime;
use yarp_devices::wam::WamModel;
use yarp_devices::wam::can::{CanOptions, CanWam};

use super::can::scenarios::{activate, options};
use super::can::{Rig, until};
use super::kernel::Kernel;

/// Priority that the control thread asks for: not the default, so that it is known to come from here.
const PRIORITY: u8 = 41;
/// Periods that are watched: five seconds.
const PERIODS: u64 = 2500;
/// Number of threads of load, and bytes that each writes and reads again and again.
const LOADS: usize = 3;
const LOAD_BYTES: usize = 4 << 20;
/// Number of `SCHED_FIFO` in `/proc`.
const FIFO: u64 = 1;

/// Runs the scenarios and returns their number.
pub(crate) fn run(interface: &str) -> usize {
    let chosen = std::env::var("YARP_REALTIME_PROCESSOR").ok();
    let chosen = chosen.map(|number| number.parse().expect("a number"));
    the_kernel_is_the_expected_one();
    let rig = Kernel::start(interface);
    let settings = CanOptions {
        real_time: RealTime {
            priority: Some(PRIORITY),
            processor: Some(chosen.unwrap_or(0)),
            lock_memory: true,
        },
        ..options()
    };
    let arm = CanWam::start(WamModel::<7>::new(), settings, rig.open()).expect("the arm is found");
    activate(&rig, &arm);
    the_settings_are_in_effect(chosen);
    if chosen.is_some() {
        return 2;
    }
    let ending = AtomicBool::new(false);
    thread::scope(|scope| {
        for number in 0..LOADS {
            let ending = &ending;
            scope.spawn(move || load(number, ending));
        }
        let stop = Stop(&ending);
        periods_under_load(&arm);
        drop(stop);
    });
    3
}

/// Ends the load, also when a check has failed.
struct Stop<'a>(&'a AtomicBool);

impl Drop for Stop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// Keeps the processor, the memory and the kernel busy. It is nice: the simulated pucks must answer, and have no real-time
/// priority.
fn load(number: usize, ending: &AtomicBool) {
    rustix::process::nice(19).expect("everybody may be nice");
    let file = std::env::temp_dir().join(format!("load{number}"));
    while !ending.load(Ordering::Acquire) {
        let bytes = vec![number as u8; LOAD_BYTES];
        fs::write(&file, &bytes).expect("there is memory");
        assert_eq!(fs::read(&file).expect("it was written").len(), LOAD_BYTES);
    }
}

/// Returns a file of the kernel, or nothing.
fn read(path: &str) -> String {
    fs::read_to_string(path)
        .unwrap_or_default()
        .trim()
        .to_owned()
}

fn the_kernel_is_the_expected_one() {
    let expected = std::env::var("YARP_REALTIME_KERNEL").is_ok_and(|value| value == "1");
    println!("kernel {}", read("/proc/version"));
    let real_time = read("/sys/kernel/realtime");
    assert_eq!(
        real_time == "1",
        expected,
        "/sys/kernel/realtime says {real_time:?}"
    );
    println!("the_kernel_is_the_expected_one ok");
}

/// Returns the value of a line `NAME:   value` of a status file.
fn line(status: &str, name: &str) -> String {
    let mut lines = status.lines();
    let found = lines.find_map(|line| line.strip_prefix(name)?.strip_prefix(':'));
    found.unwrap_or_default().trim().to_owned()
}

/// * `chosen`: the processor of the control thread, if there are several.
fn the_settings_are_in_effect(chosen: Option<usize>) {
    let tasks = fs::read_dir("/proc/self/task").expect("there are tasks");
    let control = tasks
        .map(|task| task.expect("it is readable").path())
        .find(|task| read(&format!("{}/comm", task.display())) == "can-wam");
    let control = control
        .expect("there is a control thread")
        .display()
        .to_string();
    let stat = read(&format!("{control}/stat"));
    // The name is in brackets and may contain anything; the state behind it is field 3.
    let fields = stat.rsplit_once(") ").expect("a name").1;
    let field = |number: usize| -> Option<u64> {
        fields
            .split(' ')
            .nth(number - 3)
            .and_then(|text| text.parse().ok())
    };
    let running_on = field(39);
    let (priority, policy) = (field(40), field(41));
    let online = read("/sys/devices/system/cpu/online");
    let status = read(&format!("{control}/status"));
    let allowed = line(&status, "Cpus_allowed_list");
    let locked = line(&read("/proc/self/status"), "VmLck");
    println!(
        "  /proc: policy {policy:?}, priority {priority:?}, processors {allowed} of {online}, on \
         {running_on:?}, locked {locked}"
    );
    assert_eq!((policy, priority), (Some(FIFO), Some(PRIORITY.into())));
    assert_eq!(online == "0", chosen.is_none(), "processors {online}");
    let processor = chosen.unwrap_or(0);
    assert_eq!(allowed, processor.to_string());
    assert_eq!(running_on, Some(processor as u64));
    let kilobytes: u64 = locked.trim_end_matches(" kB").parse().expect("a number");
    assert!(kilobytes > 0, "{locked}");
    println!("the_settings_are_in_effect ok");
}

fn periods_under_load(arm: &CanWam) {
    let before = arm.status();
    let begin = std::time::Instant::now();
    until("periods under load", || {
        thread::sleep(Duration::from_millis(100));
        arm.status().periods > before.periods + PERIODS
    });
    let after = arm.status();
    println!(
        "  {} periods in {:.2} s of the machine, load {}; {} late, {} positions missed",
        after.periods - before.periods,
        begin.elapsed().as_secs_f64(),
        read("/proc/loadavg"),
        after.late_periods - before.late_periods,
        after.missed_replies - before.missed_replies,
    );
    println!(
        "  delays of control periods: {}; {}",
        after.delays, after.scheduling
    );
    println!("periods_under_load ok");
}
