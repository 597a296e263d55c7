//! A loudspeaker without output.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use crate::iface::{Audio, AudioBufferSize, AudioRender};
use crate::{Device, DeviceError};

/// Moments that it holds.
const CAPACITY: usize = 160_000;

/// A loudspeaker that takes as long as playing takes, without output.
#[derive(Debug)]
pub struct FakeSpeaker {
    channels: usize,
    rate: u32,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// Moments that were still to be played then.
    unplayed: f64,
    /// Since when they are played.
    since: Option<Instant>,
}

impl State {
    /// Moments that are still to be played now.
    fn advance(&mut self, rate: u32) -> f64 {
        if let Some(since) = self.since {
            let now = Instant::now();
            let played = (now - since).as_secs_f64() * f64::from(rate);
            self.unplayed = (self.unplayed - played).max(0.0);
            self.since = Some(now);
        }
        self.unplayed
    }
}

impl FakeSpeaker {
    /// Creates a loudspeaker with so many channels, and so many samples a second. It does not play yet.
    pub fn new(channels: usize, rate: u32) -> Self {
        Self {
            channels,
            rate,
            state: Mutex::default(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl AudioRender for FakeSpeaker {
    fn render(&self, sound: &Audio) -> Result<(), DeviceError> {
        if (sound.channels, sound.rate) != (self.channels, self.rate) {
            return Err(DeviceError::Unsuitable {
                what: "sound of channels and rate",
                asked: format!("{} and {}", sound.channels, sound.rate),
                expected: format!("{} and {}", self.channels, self.rate),
            });
        }
        let mut state = self.state();
        let room = CAPACITY as f64 - state.advance(self.rate);
        if sound.len() as f64 > room {
            return Err(DeviceError::Unsuitable {
                what: "sound of samples:",
                asked: sound.len().to_string(),
                expected: format!("up to {room:.0}, which there is room for"),
            });
        }
        state.unplayed += sound.len() as f64;
        Ok(())
    }

    fn set_playing(&self, playing: bool) -> Result<(), DeviceError> {
        let mut state = self.state();
        state.advance(self.rate);
        state.since = playing.then(Instant::now);
        Ok(())
    }

    fn is_playing(&self) -> Result<bool, DeviceError> {
        Ok(self.state().since.is_some())
    }

    fn playback_capacity(&self) -> Result<AudioBufferSize, DeviceError> {
        Ok(AudioBufferSize {
            samples: CAPACITY,
            channels: self.channels,
        })
    }

    fn unplayed(&self) -> Result<AudioBufferSize, DeviceError> {
        Ok(AudioBufferSize {
            samples: self.state().advance(self.rate).ceil() as usize,
            channels: self.channels,
        })
    }

    fn reset_playback(&self) -> Result<(), DeviceError> {
        let mut state = self.state();
        state.advance(self.rate);
        state.unplayed = 0.0;
        Ok(())
    }
}

impl Device for FakeSpeaker {
    fn audio_render(&self) -> Option<&dyn AudioRender> {
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn sound(samples: usize) -> Audio {
        Audio {
            channels: 2,
            rate: 8_000,
            samples: vec![0; samples * 2],
        }
    }

    #[test]
    fn playing_takes_time_and_ends() {
        let speaker = FakeSpeaker::new(2, 8_000);
        speaker.render(&sound(80)).unwrap();
        assert_eq!(
            speaker.unplayed().unwrap().samples,
            80,
            "it does not play yet"
        );
        let begun = Instant::now();
        speaker.set_playing(true).unwrap();
        while speaker.unplayed().unwrap().samples > 0 {
            assert!(begun.elapsed() < Duration::from_secs(60));
            std::thread::yield_now();
        }
        assert!(
            begun.elapsed() >= Duration::from_millis(9),
            "eighty moments are ten milliseconds"
        );
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let speaker = FakeSpeaker::new(2, 8_000);
        assert!(speaker.render(&sound(CAPACITY + 1)).is_err());
        let other = Audio {
            rate: 1,
            ..sound(1)
        };
        assert!(speaker.render(&other).is_err());
        speaker.render(&sound(CAPACITY)).unwrap();
        assert!(speaker.render(&sound(1)).is_err());
        speaker.reset_playback().unwrap();
        speaker.render(&sound(1)).unwrap();
    }
}
