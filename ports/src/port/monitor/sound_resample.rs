//! `soundfilter_resample`: one channel of a sound, louder or quieter, with another number of samples a second.
//!
//! `channel` selects a channel (all by default), `gain_percent` multiplies, `frequency` is the new number of samples a second.
//! As in stock, messages that are no sounds are stopped. Unlike stock, whose filter drops sounds of several channels, all
//! channels are resampled; samples beyond the range of 16 bits are clipped, not wrapped; a channel that a sound does not have
//! stops it.
//!
//! Stock resamples with libsoxr in its low quality. The filter here is a windowed sinc of its own, which passes frequencies
//! up to 0.9 of half the lower sampling rate; the number of samples is stock's, their values are not the same to the bit.
//!
//! Source: `SoundFilter_resample.cpp`, `SoundFilters.cpp` and `Sound.cpp` of YARP 4.0.

use std::f64::consts::PI;
use std::sync::Arc;

use bytes::BytesMut;
use yarp_wire::WireVersion;
use yarp_wire::message::{Form, Payload, ReadObject, WireObject};
use yarp_wire::typed::Sound;

use super::{Made, Monitor, MonitorSetup, Passing};

/// Maximum sampling rate, samples a second.
const MAX_FREQUENCY: i32 = 384_000;
/// Maximum number of samples of a result, all channels; larger ones are stopped.
const MAX_SAMPLES: usize = 1 << 20;
/// Maximum gain, percent.
const MAX_GAIN: f64 = 100_000.0;
/// Maximum channel, as stock reads it.
const MAX_CHANNEL: f64 = 127.0;
/// Zero crossings of the filter on each side.
const ZERO_CROSSINGS: f64 = 32.0;
/// Middle of the filter's edge, as a part of half the lower sampling rate.
const CUTOFF: f64 = 0.95;
/// Shape of the Kaiser window: about 90 dB between what passes and what does not.
const WINDOW_SHAPE: f64 = 9.0;

/// `soundfilter_resample`.
#[derive(Debug)]
pub(super) struct Resample {
    channel: Option<usize>,
    gain: Option<f64>,
    frequency: Option<i32>,
}

impl Resample {
    pub(super) fn make(setup: &MonitorSetup) -> Made {
        // Numbers below 0 are as none, as in stock.
        let number = |name: &str, most: f64| match setup.number(name)? {
            Some(number) if number > most => {
                Err(format!("{name} is {number}, expected at most {most}"))
            }
            number => Ok(number.filter(|number| *number >= 0.0)),
        };
        let frequency = number("frequency", f64::from(MAX_FREQUENCY))?;
        let frequency = frequency.map(|frequency| frequency as i32);
        if frequency == Some(0) {
            return Err("frequency is 0, expected samples a second".to_owned());
        }
        Ok(Arc::new(Self {
            channel: number("channel", MAX_CHANNEL)?.map(|channel| channel as usize),
            gain: number("gain_percent", MAX_GAIN)?.map(|percent| percent / 100.0),
            frequency,
        }))
    }

    fn apply(&self, mut sound: Sound) -> Option<Sound> {
        if let Some(channel) = self.channel {
            let samples = sound.channel(channel)?.to_vec();
            sound = Sound::new(1, sound.frequency(), samples).ok()?;
        }
        if let Some(gain) = self.gain {
            let amplified = |sample: &i16| (f64::from(*sample) * gain) as i16;
            let samples = sound.samples().iter().map(amplified).collect();
            let markers = std::mem::take(&mut sound.markers);
            sound = Sound::new(sound.channels(), sound.frequency(), samples).ok()?;
            sound.markers = markers;
        }
        let wanted = self.frequency.filter(|wanted| *wanted != sound.frequency());
        match wanted {
            Some(wanted) => resampled(&sound, wanted),
            None => Some(sound),
        }
    }
}

/// Returns a sound with another sampling rate; `None` for a sound without one, and for a result that is too large.
fn resampled(sound: &Sound, frequency: i32) -> Option<Sound> {
    if !(1..=MAX_FREQUENCY).contains(&sound.frequency()) || sound.is_empty() {
        return None;
    }
    let ratio = f64::from(frequency) / f64::from(sound.frequency());
    let length = (sound.len() as f64 * ratio + 0.5) as usize;
    if length.checked_mul(sound.channels())? > MAX_SAMPLES {
        return None;
    }
    let channels = (0..sound.channels()).filter_map(|channel| sound.channel(channel));
    let samples = channels.flat_map(|channel| resampled_channel(channel, ratio, length));
    Sound::new(sound.channels(), frequency, samples.collect()).ok()
}

/// Returns `length` samples of a signal at `ratio` times its sampling rate; before and after it is 0.
fn resampled_channel(samples: &[i16], ratio: f64, length: usize) -> impl Iterator<Item = i16> {
    // Cycles per sample, times two.
    let cutoff = CUTOFF * ratio.min(1.0);
    let reach = ZERO_CROSSINGS / cutoff;
    let window_scale = 1.0 / bessel(WINDOW_SHAPE);
    (0..length).map(move |place| {
        let middle = place as f64 / ratio;
        let first = (middle - reach).ceil().max(0.0) as usize;
        let last = ((middle + reach).floor() as usize).min(samples.len().saturating_sub(1));
        let near = samples.get(first..=last).unwrap_or_default();
        let sum: f64 = near
            .iter()
            .zip(first..)
            .map(|(sample, at)| {
                let distance = at as f64 - middle;
                let edge = distance / reach;
                let window = bessel(WINDOW_SHAPE * (1.0 - edge * edge).max(0.0).sqrt());
                f64::from(*sample) * sinc(cutoff * distance) * window
            })
            .sum();
        // Converting to an integer clips.
        (sum * cutoff * window_scale).round() as i16
    })
}

fn sinc(x: f64) -> f64 {
    match x.abs() < 1e-9 {
        true => 1.0,
        false => (PI * x).sin() / (PI * x),
    }
}

/// Modified Bessel function of the first kind, order 0, by its series.
fn bessel(x: f64) -> f64 {
    let quarter = x * x / 4.0;
    let (mut sum, mut term, mut n) = (1.0, 1.0, 1.0);
    while term > 1e-12 * sum {
        term *= quarter / (n * n);
        sum += term;
        n += 1.0;
    }
    sum
}

impl Monitor for Resample {
    fn update(&self, message: Passing) -> Option<Passing> {
        let sound = Sound::read(&message.payload).ok()?;
        let sound = self.apply(sound)?;
        let wire_version = WireVersion::default();
        let mut bytes = BytesMut::new();
        sound.write_binary(&mut bytes, wire_version);
        let payload = Payload::new(bytes.freeze(), Form::Binary(wire_version));
        Some(message.with(payload))
    }
}

#[cfg(test)]
mod tests {
    use yarp_wire::Bottle;

    use super::super::{MonitorSide, of_bottle};
    use super::*;

    fn made(options: &str) -> Made {
        let options = Bottle::parse(options).unwrap();
        Resample::make(&MonitorSetup::new(
            MonitorSide::Receive,
            "/w",
            "/r",
            options,
        ))
    }

    fn through(options: &str, sound: &Sound) -> Option<Sound> {
        let wire_version = WireVersion::default();
        let mut bytes = BytesMut::new();
        sound.write_binary(&mut bytes, wire_version);
        let payload = Payload::new(bytes.freeze(), Form::Binary(wire_version));
        let passed = made(options).unwrap().update(Passing::new(payload))?;
        Some(Sound::read(&passed.payload).unwrap())
    }

    fn sine(hertz: f64, frequency: i32, length: usize) -> Vec<i16> {
        let step = 2.0 * PI * hertz / f64::from(frequency);
        (0..length)
            .map(|place| ((place as f64 * step).sin() * 10_000.0).round() as i16)
            .collect()
    }

    /// Worked out by hand from stock's sources.
    #[test]
    fn channels_and_gains_are_stocks() {
        let stereo = Sound::new(2, 16_000, vec![1, 2, 3, -5, -6, 20_000]).unwrap();
        assert_eq!(through("", &stereo).unwrap(), stereo);
        let right = Sound::new(1, 16_000, vec![-5, -6, 20_000]).unwrap();
        assert_eq!(through("(channel 1)", &stereo).unwrap(), right);
        assert_eq!(
            through("(channel 1) (frequency 16000)", &stereo).unwrap(),
            right
        );
        assert_eq!(through("(channel 2)", &stereo), None);
        // Fractions are cut off; stock wraps what is too loud.
        let half = Sound::new(2, 16_000, vec![0, 1, 1, -2, -3, 10_000]).unwrap();
        assert_eq!(through("(gain_percent 50)", &stereo).unwrap(), half);
        let loud = through("(channel 1) (gain_percent 200)", &stereo).unwrap();
        assert_eq!(loud.samples(), [-10, -12, i16::MAX]);
        // Numbers below 0 are as none.
        assert_eq!(
            through("(channel -1) (gain_percent -1) (frequency -1)", &stereo).unwrap(),
            stereo
        );
    }

    /// The number of samples is stock's: `length * new / old + 0.5`, rounded down.
    #[test]
    fn the_signal_stays_and_what_is_too_high_goes() {
        for (from, to) in [
            (48_000, 16_000),
            (16_000, 48_000),
            (44_100, 16_000),
            (8_000, 8_001),
        ] {
            let sound = Sound::new(1, from, sine(1000.0, from, 4801)).unwrap();
            let got = through(&format!("(frequency {to})"), &sound).unwrap();
            let length = (4801.0 * f64::from(to) / f64::from(from) + 0.5) as usize;
            assert_eq!((got.frequency(), got.len()), (to, length));
            let expected = sine(1000.0, to, length);
            // Beside the ends, where the signal begins and stops.
            for place in length / 5..length - length / 5 {
                let (got, expected) = (got.samples()[place], expected[place]);
                assert!(
                    got.abs_diff(expected) <= 3,
                    "{from} {to} {place}: {got}, {expected}"
                );
            }
        }
        let high = Sound::new(1, 48_000, sine(10_000.0, 48_000, 4801)).unwrap();
        let got = through("(frequency 16000)", &high).unwrap();
        let middle = &got.samples()[400..1200];
        assert!(middle.iter().all(|sample| sample.abs() <= 3), "{middle:?}");
    }

    #[test]
    fn each_channel_is_resampled() {
        let mut samples = sine(500.0, 16_000, 1600);
        samples.extend(vec![700; 1600]);
        let got = through("(frequency 8000)", &Sound::new(2, 16_000, samples).unwrap()).unwrap();
        assert_eq!((got.channels(), got.len()), (2, 800));
        assert!(
            got.channel(1).unwrap()[200..600]
                .iter()
                .all(|sample| sample.abs_diff(700) <= 1)
        );
        let expected = sine(500.0, 8_000, 800);
        assert!(got.channel(0).unwrap()[400].abs_diff(expected[400]) <= 3);
    }

    #[test]
    fn results_are_bounded_and_other_messages_stopped() {
        let slow = Sound::new(1, 1, vec![0; 30]).unwrap();
        assert_eq!(through("(frequency 36000)", &slow), None);
        assert!(through("(frequency 34000)", &slow).is_some());
        for frequency in [0, -1, 384_001] {
            let sound = Sound::new(1, frequency, vec![1; 30]).unwrap();
            assert_eq!(through("(frequency 8000)", &sound), None, "{frequency}");
        }
        let other = of_bottle(&Bottle::parse("hello").unwrap());
        assert!(made("").unwrap().update(Passing::new(other)).is_none());
        for options in [
            "(frequency 0)",
            "(frequency 384001)",
            "(frequency x)",
            "(channel 128)",
            "(gain_percent 100001)",
        ] {
            assert!(made(options).is_err(), "{options}");
        }
    }
}
