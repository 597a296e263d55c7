//! A program follows a clock on the network, whatever the clock does.

use crate::support;

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use support::{Stage, TEST_TIMEOUT};
use tracing_subscriber::fmt::MakeWriter;
use yarp_devices::clock::TimeSource;
use yarp_ports::{Port, PortOptions};
use yarp_wire::Bottle;
use yarp_wrappers::network_time::{ClockError, ClockFollower, FollowOptions, sleep_until};

fn options() -> FollowOptions {
    FollowOptions::new()
        .port_name("/follower/clock:i")
        .first_tick_timeout(TEST_TIMEOUT)
        .check_interval(Duration::from_millis(5))
}

async fn clock(stage: &Stage) -> Port {
    Port::open(&stage.network, "/clock", PortOptions::new())
        .await
        .expect("the clock's port opens")
}

async fn follower(stage: &Stage, options: &FollowOptions) -> ClockFollower {
    ClockFollower::open(&stage.network, "/clock", options)
        .await
        .expect("the follower's port opens")
}

async fn send(clock: &Port, text: &str) {
    let message = Bottle::parse(text).expect("test data is valid");
    clock.write(&message).await;
}

/// Sends a time until the follower has it.
async fn reach(clock: &Port, follower: &ClockFollower, seconds: i32) {
    let begun = Instant::now();
    while follower.time().time() != Some(f64::from(seconds)) {
        send(clock, &format!("{seconds} 0")).await;
        tokio::time::sleep(Duration::from_millis(1)).await;
        assert!(
            begun.elapsed() < TEST_TIMEOUT,
            "it does not get {seconds} s"
        );
    }
}

#[test]
fn a_missing_clock_is_an_error_that_says_what_to_do() {
    let stage = Stage::new();
    stage.runtime.block_on(async {
        let follower = follower(&stage, &options()).await;
        let waiting = follower.wait_first_tick(Duration::from_millis(50));
        let error = waiting.await.expect_err("there is no clock");
        assert!(matches!(error, ClockError::NoTick { .. }));
        let text = error.to_string();
        for word in [
            "YARP_CLOCK",
            "/clock",
            "yarp clock --name /clock",
            "0.05 s",
            "unset",
        ] {
            assert!(text.contains(word), "no {word:?} in {text:?}");
        }
        follower.close().await;
        assert!(
            stage.network.query("/follower/clock:i").await.is_err(),
            "the name stays"
        );
    });
}

#[test]
fn a_clock_that_sends_nothing_is_named_as_the_reason() {
    let stage = Stage::new();
    stage.runtime.block_on(async {
        let clock = clock(&stage).await;
        let follower = follower(&stage, &options()).await;
        let begun = Instant::now();
        while clock.outputs().is_empty() {
            tokio::time::sleep(Duration::from_millis(1)).await;
            assert!(begun.elapsed() < TEST_TIMEOUT, "it is not connected");
        }
        let waiting = follower.wait_first_tick(Duration::from_millis(20));
        let text = waiting.await.expect_err("it sends nothing").to_string();
        assert!(text.contains("has sent no valid time"), "{text}");
    });
}

#[test]
fn a_clock_that_comes_late_dies_and_returns_is_followed() {
    let stage = Stage::new();
    stage.runtime.block_on(async {
        let follower = follower(&stage, &options()).await;
        for (seconds, elapsed) in [(100, 0), (7, 0), (9, 2)] {
            let clock = clock(&stage).await;
            reach(&clock, &follower, seconds).await;
            follower.wait_first_tick(TEST_TIMEOUT).await.unwrap();
            assert_eq!(follower.time().elapsed(), Duration::from_secs(elapsed));
            clock.close().await;
        }
    });
}

#[test]
fn garbage_moves_no_time() {
    let stage = Stage::new();
    stage.runtime.block_on(async {
        let clock = clock(&stage).await;
        let follower = follower(&stage, &options()).await;
        reach(&clock, &follower, 5).await;
        for garbage in [
            "",
            "6",
            "nan 0",
            "6.5 0",
            "-6 0",
            "6 -1",
            "6 1000000000",
            "(6) (0)",
            "six zero",
        ] {
            send(&clock, garbage).await;
        }
        // Another port has no say.
        let other = Port::open(&stage.network, "/other", PortOptions::new())
            .await
            .unwrap();
        other.connect("/follower/clock:i").await.unwrap();
        send(&other, "1000 0").await;
        // Messages of one connection are in order, so that none of these is on its way after this one.
        send(&clock, "5 1").await;
        let begun = Instant::now();
        while follower.time().time() == Some(5.0) {
            tokio::time::sleep(Duration::from_millis(1)).await;
            assert!(
                begun.elapsed() < TEST_TIMEOUT,
                "the clock is not heard any more"
            );
        }
        assert_eq!(follower.time().elapsed(), Duration::from_nanos(1));
    });
}

#[test]
fn a_thousand_ticks_lose_no_time() {
    let stage = Stage::new();
    stage.runtime.block_on(async {
        let clock = clock(&stage).await;
        let follower = follower(&stage, &options()).await;
        reach(&clock, &follower, 0).await;
        let source = TimeSource::Network(Arc::clone(follower.time()));
        let deadline = source.instant() + Duration::from_secs(1);
        let sleeping = tokio::spawn(async move { sleep_until(&source, deadline).await });
        for millisecond in 1..1000 {
            send(&clock, &format!("0 {}", millisecond * 1_000_000)).await;
        }
        assert!(!sleeping.is_finished());
        reach(&clock, &follower, 1).await;
        tokio::time::timeout(TEST_TIMEOUT, sleeping)
            .await
            .unwrap()
            .unwrap();
        assert_eq!(follower.time().elapsed(), Duration::from_secs(1));
    });
}

#[test]
fn a_clock_that_stands_still_is_reported_once_and_so_is_its_end() {
    let log = Log::default();
    let subscriber = tracing_subscriber::fmt()
        .with_max_level(tracing::Level::INFO)
        .with_writer(log.clone())
        .with_ansi(false)
        .finish();
    let stage = Stage::new();
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    let _guard = tracing::subscriber::set_default(subscriber);
    runtime.block_on(async {
        let clock = clock(&stage).await;
        let options = options().stall_limit(Duration::from_millis(30));
        let follower = follower(&stage, &options).await;
        reach(&clock, &follower, 5).await;
        log.wait_for("stands still at 5.000 s").await;
        // The same time again is no progress.
        send(&clock, "5 0").await;
        tokio::time::sleep(Duration::from_millis(100)).await;
        assert_eq!(log.count("stands still"), 1);
        reach(&clock, &follower, 6).await;
        log.wait_for("goes on, at 6.000 s").await;
        log.wait_for("stands still at 6.000 s").await;
        assert_eq!(log.count("WARN"), 2, "{}", log.text());
    });
}

/// The lines of the log.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<Vec<u8>>>);

impl Log {
    fn text(&self) -> String {
        String::from_utf8_lossy(&self.0.lock().unwrap()).into_owned()
    }

    fn count(&self, word: &str) -> usize {
        self.text().matches(word).count()
    }

    async fn wait_for(&self, text: &str) {
        let begun = Instant::now();
        while self.count(text) == 0 {
            tokio::time::sleep(Duration::from_millis(1)).await;
            assert!(
                begun.elapsed() < TEST_TIMEOUT,
                "no {text:?} in {}",
                self.text()
            );
        }
    }
}

impl std::io::Write for Log {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl MakeWriter<'_> for Log {
    type Writer = Self;

    fn make_writer(&self) -> Self {
        self.clone()
    }
}

#[test]
fn the_limits_are_those_of_the_documentation() {
    let page = include_str!("../../docs/network-time.md").replace('\n', " ");
    let options = FollowOptions::new();
    for (limit, text) in [
        (
            options.first_tick_timeout,
            "After 30 s (`YARP_CLOCK_TIMEOUT`",
        ),
        (options.stall_limit, "**A clock that stands still** for 5 s"),
        (options.check_interval, "(every 500 ms)"),
    ] {
        assert!(page.contains(text), "{text}");
        let number: f64 = text
            .split(|character: char| !character.is_ascii_digit())
            .find_map(|digits| digits.parse().ok())
            .unwrap();
        let seconds = if text.contains(" ms") {
            number / 1e3
        } else {
            number
        };
        assert_eq!(limit.as_secs_f64(), seconds, "{text}");
    }
}
