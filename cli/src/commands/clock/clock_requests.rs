//! Requests to a clock.

use std::time::Instant;

use yarp_wire::{Bottle, Value, Vocab32, bottle};

use super::adjustable_clock::{AdjustableClock, MAX_STEP, RATE_RANGE, time_bottle};

/// Requests and their effects.
const HELP: [&str; 6] = [
    "get: returns seconds, nanoseconds, running or paused, and the rate",
    "pause: stops the time",
    "resume: lets the time go on",
    "step SECONDS: adds this to the time at once, paused or not",
    "rate FACTOR: sets the seconds of the clock per second",
    "help: lists the requests",
];

/// Carries out a request and returns the reply: `[ok]` and the state of the clock, or `[fail]` and the reason.
pub(super) fn answer(clock: &mut AdjustableClock, request: &Bottle, now: Instant) -> Bottle {
    if word(request) == Some("help") && request.len() == 1 {
        return std::iter::once(Value::from(Vocab32::new("many")))
            .chain(HELP.map(Value::from))
            .collect();
    }
    match carry_out(clock, request, now) {
        Ok(()) => state(clock, now),
        Err(reason) => bottle![Vocab32::FAIL, reason],
    }
}

fn carry_out(clock: &mut AdjustableClock, request: &Bottle, now: Instant) -> Result<(), String> {
    let argument = request.get(1).and_then(Value::as_f64);
    match (word(request), request.len()) {
        (Some("get"), 1) => {}
        (Some("pause"), 1) => clock.set_paused(true, now),
        (Some("resume"), 1) => clock.set_paused(false, now),
        (Some("step"), 2) => match argument {
            Some(seconds) if seconds > 0.0 && seconds <= MAX_STEP => clock.step(seconds),
            _ => {
                return Err(format!(
                    "expected step SECONDS, more than 0 and up to {MAX_STEP}"
                ));
            }
        },
        (Some("rate"), 2) => match argument {
            Some(rate) if RATE_RANGE.contains(&rate) => clock.set_rate(rate, now),
            _ => {
                let (min, max) = RATE_RANGE.into_inner();
                return Err(format!("expected rate FACTOR, {min} to {max}"));
            }
        },
        _ => {
            return Err(
                "expected get, pause, resume, step SECONDS, rate FACTOR or help".to_owned(),
            );
        }
    }
    Ok(())
}

/// Returns the first word of a request, as text or as a vocab.
fn word(request: &Bottle) -> Option<&'static str> {
    let first = request.get(0)?.to_plain_string();
    ["get", "pause", "resume", "step", "rate", "help"]
        .into_iter()
        .find(|word| *word == first || first == format!("[{word}]"))
}

fn state(clock: &AdjustableClock, now: Instant) -> Bottle {
    let running = match clock.is_paused() {
        true => "paused",
        false => "running",
    };
    std::iter::once(Value::from(Vocab32::OK))
        .chain(time_bottle(clock.time(now)).iter().cloned())
        .chain([Value::from(running), Value::from(clock.rate())])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_out_of_range_change_nothing() {
        let now = Instant::now();
        let mut clock = AdjustableClock::new(0.0, 1.0, true, now);
        let mut check = |request: &str, expected: &str| {
            let request = Bottle::parse(request).expect("test data is valid");
            let reply = answer(&mut clock, &request, now).to_string();
            assert!(reply.starts_with(expected), "{request}: {reply}");
        };
        let start = "[ok] 0 0 paused 1.0";
        check("get", start);
        for request in [
            "",
            "foo",
            "step",
            "step x",
            "step 0",
            "step -1",
            "step nan",
            "step inf",
            "step 86400.1",
            "step 1 2",
            "rate",
            "rate 0",
            "rate -1",
            "rate 0.0009",
            "rate 1000.1",
            "rate nan",
            "pause 1",
            "resume 1",
            "get 1",
            "(get)",
            "1",
        ] {
            check(request, "[fail] \"expected ");
            check("get", start);
        }
        check("step 1.5", "[ok] 1 500000000 paused 1.0");
        check("step 86400", "[ok] 86401 500000000 paused 1.0");
        check("rate 1000", "[ok] 86401 500000000 paused 1000.0");
        check("rate 0.001", "[ok] 86401 500000000 paused 0.001");
        check("[get]", "[ok] 86401 500000000 paused 0.001");
        check("resume", "[ok] 86401 500000000 running 0.001");
        check("pause", "[ok] 86401 500000000 paused 0.001");
        check("help", "[many] \"get: ");
    }
}
