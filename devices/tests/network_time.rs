//! Waits, timers and simulated arms in the time of a clock on the network.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::task::{Context, Poll, Wake, Waker};
use std::thread;
use std::time::{Duration, Instant};

use yarp_devices::clock::{NetworkTime, TimeSource, TimeWait};
use yarp_devices::periodic_timer::{MissedCycles, PeriodicTimer};
use yarp_devices::simulation::SimulatorOptions;
use yarp_devices::wam::can::CanOptions;
use yarp_devices::wam::{DynamicWam, SimulatedCanWam, SimulatedWam, WamModel, parameters};
use yarp_devices::{
    Axes, ControlMode, DeviceError, EncoderReading, Encoders, Mode, PositionControl,
    VelocityControl,
};

/// Longer than any step takes on a busy machine.
const TIMEOUT: Duration = Duration::from_secs(60);

fn started(seconds: i64) -> Arc<NetworkTime> {
    let time = Arc::new(NetworkTime::new("/clock"));
    time.tick(seconds, 0).expect("test data is valid");
    time
}

/// Counts its calls.
#[derive(Default)]
struct Count(AtomicU64);

impl Wake for Count {
    fn wake(self: Arc<Self>) {
        self.0.fetch_add(1, Ordering::SeqCst);
    }
}

#[test]
fn a_wait_ends_with_the_tick_that_reaches_it_and_not_before() {
    let time = started(100);
    let count = Arc::new(Count::default());
    let waker = Waker::from(Arc::clone(&count));
    let mut context = Context::from_waker(&waker);
    let deadline = time.instant() + Duration::from_secs(2);
    let mut wait = Box::pin(TimeWait::new(Arc::clone(&time), deadline));
    let mut cancelled = Box::pin(TimeWait::new(Arc::clone(&time), deadline));
    for _ in 0..3 {
        assert_eq!(wait.as_mut().poll(&mut context), Poll::Pending);
    }
    assert_eq!(cancelled.as_mut().poll(&mut context), Poll::Pending);
    drop(cancelled);
    time.tick(101, 999_999_999).unwrap();
    assert_eq!(count.0.load(Ordering::SeqCst), 0);
    time.tick(102, 0).unwrap();
    assert_eq!(
        count.0.load(Ordering::SeqCst),
        1,
        "once, and not for the cancelled one"
    );
    assert_eq!(wait.as_mut().poll(&mut context), Poll::Ready(()));
}

#[test]
fn a_clock_that_jumps_back_prolongs_no_wait() {
    let time = started(1000);
    let source = TimeSource::Network(Arc::clone(&time));
    let mut timer = PeriodicTimer::on(source.clone(), Duration::from_secs(1), MissedCycles::Skip);
    time.tick(0, 0).unwrap();
    assert_eq!(source.now(), 0.0);
    assert!(source.instant() < timer.next());
    time.tick(1, 0).unwrap();
    assert!(timer.wait(|| false));
}

#[test]
fn a_timer_cycles_once_for_the_deadlines_that_one_step_passes() {
    let time = started(0);
    let source = TimeSource::Network(Arc::clone(&time));
    let period = Duration::from_millis(10);
    let mut timer = PeriodicTimer::on(source, period, MissedCycles::Skip);
    time.tick(1, 0).unwrap();
    assert!(timer.wait(|| false));
    assert_eq!(
        (timer.statistics().cycles, timer.statistics().missed),
        (1, 99)
    );
}

#[test]
fn a_thread_that_waits_for_a_paused_clock_ends_when_it_is_told() {
    let time = started(0);
    let source = TimeSource::Network(Arc::clone(&time));
    let mut timer = PeriodicTimer::on(source, Duration::from_secs(1000), MissedCycles::Skip);
    let ending = Arc::new(AtomicBool::new(false));
    let theirs = Arc::clone(&ending);
    let waiting = thread::spawn(move || timer.wait(|| theirs.load(Ordering::Acquire)));
    ending.store(true, Ordering::Release);
    waiting.thread().unpark();
    assert!(!waiting.join().unwrap());
}

#[test]
fn a_thread_is_woken_by_a_thousand_ticks_per_second() {
    let time = started(0);
    let source = TimeSource::Network(Arc::clone(&time));
    let mut timer = PeriodicTimer::on(source, Duration::from_millis(1), MissedCycles::Skip);
    let done = Arc::new(AtomicBool::new(false));
    let ending = Arc::clone(&done);
    let waiting = thread::spawn(move || {
        while timer.wait(|| ending.load(Ordering::Acquire)) {}
        timer.statistics()
    });
    // As fast as it goes: the thread may miss deadlines, but no time is lost.
    for millisecond in 1..=5000_i64 {
        time.tick(millisecond / 1000, millisecond % 1000 * 1_000_000)
            .unwrap();
    }
    assert_eq!(time.elapsed(), Duration::from_secs(5));
    done.store(true, Ordering::Release);
    waiting.thread().unpark();
    let statistics = waiting.join().unwrap();
    assert!(
        statistics.cycles + statistics.missed <= 5000,
        "{statistics:?}"
    );
}

fn elbow(arm: &impl Encoders) -> Result<EncoderReading, DeviceError> {
    Ok(arm.encoder_readings(Axes::One(3.into()))?[0])
}

#[test]
fn the_ideal_arm_moves_with_the_clock_alone() {
    let time = started(50);
    let source = TimeSource::Network(Arc::clone(&time));
    let arm = SimulatedWam::with_axes_on(source, parameters());
    let axis = Axes::One(3.into());
    let start = elbow(&arm).unwrap();
    assert_eq!(start.time, 50.0);
    arm.set_reference_speeds(axis, &[10.0]).unwrap();
    arm.position_move(axis, &[start.position - 20.0]).unwrap();
    for _ in 0..100 {
        assert_eq!(elbow(&arm).unwrap().position, start.position);
    }
    time.tick(51, 0).unwrap();
    let moving = elbow(&arm).unwrap();
    assert!((moving.position - start.position).abs() > 1.0, "{moving:?}");
    assert!(!arm.motion_done(axis).unwrap());
    // The clock starts anew: the arm does not go back, and goes on from there.
    time.tick(0, 0).unwrap();
    assert_eq!(elbow(&arm).unwrap().position, moving.position);
    time.tick(10, 0).unwrap();
    assert!(arm.motion_done(axis).unwrap());
    assert_eq!(elbow(&arm).unwrap().position, start.position - 20.0);
}

#[test]
fn the_dynamic_arm_makes_up_for_a_step_of_the_clock() {
    let time = started(0);
    let source = TimeSource::Network(Arc::clone(&time));
    let (model, options) = (WamModel::<7>::new(), SimulatorOptions::default());
    let arm = DynamicWam::start_on(source, model, options).unwrap();
    let axis = Axes::One(3.into());
    let start = elbow(&arm).unwrap().position;
    arm.set_control_modes(axis, &[Mode::Velocity]).unwrap();
    arm.velocity_move(axis, &[-10.0]).unwrap();
    // One step of two seconds: about 20 degrees, though real time hardly passes.
    time.tick(2, 0).unwrap();
    let begun = Instant::now();
    while (elbow(&arm).unwrap().position - start).abs() < 10.0 {
        assert!(begun.elapsed() < TIMEOUT, "the arm stays behind the clock");
        thread::sleep(Duration::from_millis(1));
    }
    // It ends although its clock stands.
    drop(arm);
}

/// It ignored the clock, and moved while the rest of the simulation stood.
#[test]
fn the_arm_behind_its_driver_refuses_a_clock_and_names_the_one_that_follows_it() {
    let (model, options) = (WamModel::<7>::new(), CanOptions::default());
    let source = TimeSource::Network(started(0));
    let simulator = SimulatorOptions::real_arm();
    let refused = SimulatedCanWam::start_on(source, model, options, simulator, |_| None);
    let Err(DeviceError::Start { source, .. }) = refused else {
        panic!("it started: {refused:?}");
    };
    let why = source.to_string();
    assert!(
        why.contains("YARP_CLOCK") && why.contains("dynamicWam"),
        "{why}"
    );
}

#[test]
fn messages_that_are_no_time_are_refused_and_change_nothing() {
    let time = started(7);
    for (seconds, nanoseconds) in [
        (-1, 0),
        (8, -1),
        (8, 1_000_000_000),
        (i64::from(u32::MAX) + 1, 0),
        (i64::MAX, 0),
    ] {
        let refused = time.tick(seconds, nanoseconds).unwrap_err();
        assert_eq!(
            (refused.seconds, refused.nanoseconds),
            (seconds, nanoseconds)
        );
        assert_eq!(time.time(), Some(7.0));
    }
    for (seconds, nanoseconds) in [(8, 999_999_999), (i64::from(u32::MAX), 0)] {
        time.tick(seconds, nanoseconds).unwrap();
    }
    assert_eq!(time.time(), Some(f64::from(u32::MAX)));
}
