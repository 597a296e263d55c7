//! A program goes by a clock on the network beside its own time.

mod support;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use support::{name_server, registered};
use yarp_client::prelude::*;
use yarp_client::{Error, RemoteClock};
use yarp_devices::DeviceError;

/// A clock that advances by 0.1 s every 5 ms while it runs, and repeats its time otherwise.
struct TestClock {
    running: Arc<AtomicBool>,
    ending: Arc<AtomicBool>,
    thread: Option<thread::JoinHandle<()>>,
}

impl TestClock {
    fn start(network: &Network) -> Self {
        let port = Publisher::<Bottle>::open_on(network, "/table/clock:o").unwrap();
        let running = Arc::new(AtomicBool::new(true));
        let ending = Arc::new(AtomicBool::new(false));
        let flags = (running.clone(), ending.clone());
        let thread = thread::spawn(move || {
            let mut tenths = 0;
            while !flags.1.load(Ordering::Relaxed) {
                tenths += i32::from(flags.0.load(Ordering::Relaxed));
                port.publish(&bottle![tenths / 10, (tenths % 10) * 100_000_000]);
                thread::sleep(Duration::from_millis(5));
            }
        });
        Self {
            running,
            ending,
            thread: Some(thread),
        }
    }
}

impl Drop for TestClock {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}

#[test]
fn a_sleep_lasts_until_the_clock_says_so() {
    let (names, network) = name_server();
    let published = TestClock::start(&network);
    let clock = RemoteClock::connect_on(&network, "/table/clock:o").unwrap();
    let begin = clock.instant();
    let deadline = begin + Duration::from_secs(10);
    clock.sleep_until(deadline).unwrap();
    assert!(clock.instant() >= deadline);
    // What is over is not waited for.
    clock.sleep_until(begin).unwrap();
    drop((clock, published));
    assert_eq!(registered(&names), Vec::<String>::new());
}

#[test]
fn a_clock_that_stands_still_is_an_error() {
    let (_names, network) = name_server();
    let published = TestClock::start(&network);
    let clock = RemoteClock::connect_on(&network, "/table/clock:o").unwrap();
    published.running.store(false, Ordering::Relaxed);
    let far = clock.instant() + Duration::from_secs(100);
    match clock.sleep_until(far) {
        Err(DeviceError::Stale { age, .. }) => assert!(age >= Duration::from_secs(5), "{age:?}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_clock_that_is_not_there_is_an_error() {
    let (_names, network) = name_server();
    let error = RemoteClock::connect_on(&network, "/nowhere").unwrap_err();
    assert!(matches!(error, Error::Clock(_)), "{error:?}");
}
