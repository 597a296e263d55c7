//! A microphone that records one tone.

use std::f64::consts::TAU;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::iface::{Audio, AudioBufferSize, AudioGrabber};
use crate::{Device, DeviceError};

/// Moments a second.
const RATE: u32 = 16_000;
/// Default tone, hertz.
const DEFAULT_TONE: f64 = 440.0;
/// Default loudness, of 32767.
const DEFAULT_LOUDNESS: f64 = 8_000.0;
/// Moments that it holds: ten seconds.
const CAPACITY: usize = 10 * RATE as usize;

/// A microphone with one channel that records a tone, in real time: one of 440 Hz unless set otherwise.
///
/// Samples that are not fetched within ten seconds are dropped, the oldest first.
#[derive(Debug)]
pub struct FakeMicrophone {
    tone: f64,
    loudness: f64,
    state: Mutex<State>,
    /// Recording ended, or began.
    changed: Condvar,
}

#[derive(Debug)]
struct State {
    /// Since when it records.
    since: Option<Instant>,
    /// Samples that were recorded before that.
    heard: u64,
    /// Moments that were fetched or forgotten.
    gone: u64,
    gain: f64,
}

impl Default for State {
    fn default() -> Self {
        Self {
            since: None,
            heard: 0,
            gone: 0,
            gain: 1.0,
        }
    }
}

impl State {
    /// Records samples up to now; drops those that exceed the capacity.
    fn advance(&mut self, now: Instant) -> u64 {
        let recording = self.since.map_or(Duration::ZERO, |since| now - since);
        let heard = self.heard + (recording.as_secs_f64() * f64::from(RATE)) as u64;
        self.gone = self.gone.max(heard.saturating_sub(CAPACITY as u64));
        heard
    }
}

impl Default for FakeMicrophone {
    fn default() -> Self {
        Self::new()
    }
}

impl FakeMicrophone {
    /// A microphone that does not record yet.
    pub fn new() -> Self {
        Self::with_tone(DEFAULT_TONE, DEFAULT_LOUDNESS)
    }

    /// A microphone that hears a tone of `frequency` hertz, as loud as `amplitude` of 32767.
    pub fn with_tone(frequency: f64, amplitude: f64) -> Self {
        Self {
            tone: frequency,
            loudness: amplitude,
            state: Mutex::default(),
            changed: Condvar::new(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl AudioGrabber for FakeMicrophone {
    fn sound(
        &self,
        at_least: usize,
        at_most: usize,
        timeout: Duration,
    ) -> Result<Audio, DeviceError> {
        if at_least > at_most || at_least > CAPACITY {
            return Err(DeviceError::Unsuitable {
                what: "so many samples at least:",
                asked: at_least.to_string(),
                expected: format!("up to {}", at_most.min(CAPACITY)),
            });
        }
        let begun = Instant::now();
        let mut state = self.state();
        loop {
            let there = state.advance(Instant::now()) - state.gone;
            let missing = (at_least as u64).saturating_sub(there);
            let left = timeout.saturating_sub(begun.elapsed());
            if missing == 0 || left.is_zero() {
                let count = there.min(at_most as u64);
                let moments = state.gone..state.gone + count;
                let gain = state.gain * self.loudness;
                let sample = |moment: u64| {
                    let phase = moment as f64 * self.tone / f64::from(RATE);
                    (gain * (TAU * phase).sin()) as i16
                };
                state.gone += count;
                return Ok(Audio {
                    channels: 1,
                    rate: RATE,
                    samples: moments.map(sample).collect(),
                });
            }
            let needed = match state.since {
                Some(_) => Duration::from_secs_f64(missing as f64 / f64::from(RATE)),
                None => left,
            };
            let waiting = self.changed.wait_timeout(state, needed.min(left));
            state = waiting.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn set_recording(&self, recording: bool) -> Result<(), DeviceError> {
        let mut state = self.state();
        if recording != state.since.is_some() {
            let now = Instant::now();
            state.heard = state.advance(now);
            state.since = recording.then_some(now);
            self.changed.notify_all();
        }
        Ok(())
    }

    fn is_recording(&self) -> Result<bool, DeviceError> {
        Ok(self.state().since.is_some())
    }

    fn recording_capacity(&self) -> Result<AudioBufferSize, DeviceError> {
        Ok(AudioBufferSize {
            samples: CAPACITY,
            channels: 1,
        })
    }

    fn recorded(&self) -> Result<AudioBufferSize, DeviceError> {
        let mut state = self.state();
        let heard = state.advance(Instant::now());
        Ok(AudioBufferSize {
            samples: (heard - state.gone) as usize,
            channels: 1,
        })
    }

    fn reset_recording(&self) -> Result<(), DeviceError> {
        let mut state = self.state();
        state.gone = state.advance(Instant::now());
        Ok(())
    }

    fn set_software_gain(&self, gain: f64) -> Result<(), DeviceError> {
        if !gain.is_finite() || gain < 0.0 {
            return Err(DeviceError::Unsuitable {
                what: "gain",
                asked: gain.to_string(),
                expected: "0 or more".to_owned(),
            });
        }
        self.state().gain = gain;
        Ok(())
    }

    /// There is no hardware.
    fn set_hardware_gain(&self, _: f64) -> Result<(), DeviceError> {
        Err(DeviceError::NotSupported {
            what: "hardware gain".to_owned(),
        })
    }
}

impl Device for FakeMicrophone {
    fn audio_grabber(&self) -> Option<&dyn AudioGrabber> {
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEST_TIMEOUT: Duration = Duration::from_secs(60);

    #[test]
    fn it_hears_a_tone_while_it_records() {
        let microphone = FakeMicrophone::new();
        let nothing = microphone.sound(1, 100, Duration::ZERO).unwrap();
        assert!(nothing.is_empty());
        microphone.set_recording(true).unwrap();
        let heard = microphone.sound(160, 160, TEST_TIMEOUT).unwrap();
        assert_eq!((heard.len(), heard.channels, heard.rate), (160, 1, 16_000));
        let loudest = heard.samples.iter().max().unwrap();
        assert!((7_900..=8_000).contains(loudest), "{loudest}");
        microphone.set_recording(false).unwrap();
        assert!(!microphone.is_recording().unwrap());
        microphone.reset_recording().unwrap();
        assert_eq!(microphone.recorded().unwrap().samples, 0);
    }

    #[test]
    fn the_tone_is_as_asked() {
        let microphone = FakeMicrophone::with_tone(4_000.0, 100.0);
        microphone.set_recording(true).unwrap();
        let heard = microphone.sound(8, 8, TEST_TIMEOUT).unwrap();
        assert_eq!(heard.samples, [0, 100, 0, -100, 0, 100, 0, -100]);
    }

    #[test]
    fn what_follows_goes_on_where_the_last_ended() {
        let microphone = FakeMicrophone::new();
        microphone.set_recording(true).unwrap();
        while microphone.recorded().unwrap().samples < 800 {
            std::thread::yield_now();
        }
        // However long the machine forgets about us, nothing is lost from here on.
        microphone.set_recording(false).unwrap();
        let one = microphone.sound(400, 400, TEST_TIMEOUT).unwrap();
        let other = microphone.sound(400, 400, TEST_TIMEOUT).unwrap();
        // 400 moments are eleven periods of the tone.
        assert!(
            one.samples
                .iter()
                .zip(&other.samples)
                .all(|(a, b)| a.abs_diff(*b) <= 1)
        );
    }

    #[test]
    fn more_than_it_can_hold_is_refused() {
        let microphone = FakeMicrophone::new();
        assert!(microphone.sound(5, 4, TEST_TIMEOUT).is_err());
        assert!(
            microphone
                .sound(CAPACITY + 1, usize::MAX, TEST_TIMEOUT)
                .is_err()
        );
        assert!(microphone.set_software_gain(f64::NAN).is_err());
    }

    /// The concert pitch: 440 Hz, which are eleven periods in 400 samples of 16 kHz.
    #[test]
    fn the_tone_is_that_of_a_tuning_fork() {
        let microphone = FakeMicrophone::new();
        microphone.set_recording(true).unwrap();
        let heard = microphone.sound(401, 401, TEST_TIMEOUT).unwrap();
        let rises = heard.samples.windows(2);
        let rises = rises.filter(|pair| pair[0] <= 0 && pair[1] > 0).count();
        assert!((11..=12).contains(&rises), "{rises} periods");
        assert!(heard.samples[400].abs() < 100, "{}", heard.samples[400]);
    }
}
