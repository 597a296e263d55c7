//! Images and sound without hardware: a camera with a microphone, a microphone, a loudspeaker, and a folder of images.

use std::path::PathBuf;
use std::sync::Arc;

use yarp_devices::camera::{
    CameraWithMicrophone, ImageFolderOptions, ImageFolderWriter, SimulatedCamera,
};
use yarp_devices::fake::{FakeMicrophone, FakeSpeaker};
use yarp_wire::settings::Parameters;

use super::camera_devices::simulated_options;
use super::local_device::{self, LocalDevice};
use super::{OpenResult, Opening};
use crate::HostError;

/// Defaults of stock's microphone of 4.0.
const DEFAULT_TONE: f64 = 440.0;
const DEFAULT_AMPLITUDE: f64 = 32_000.0;
/// Highest tone, hertz: half of the samples a second.
const MAX_TONE: f64 = 8_000.0;
/// Maximum number of channels of a loudspeaker.
const MAX_CHANNELS: usize = 16;
/// Maximum number of samples a second of a loudspeaker.
const MAX_RATE: usize = 192_000;
/// Samples a second of the microphone, which a loudspeaker plays unless told otherwise.
const DEFAULT_RATE: usize = 16_000;
/// Maximum number of images that can be asked for.
const MAX_IMAGES: usize = 999_999;
/// Maximum size of the sound, and of all files, that can be asked for, bytes. A WAV file holds 4 GiB at most.
const MAX_SOUND_BYTES: u64 = 4_294_967_000;
const MAX_BYTES: u64 = 1 << 40;

/// Opens a simulated camera with a microphone.
pub(super) async fn camera_with_microphone(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let options = simulated_options(parameters)?;
    let device = local_device::start(parameters, move || {
        let camera = SimulatedCamera::start(options)?;
        CameraWithMicrophone::new(Arc::new(camera), Arc::new(FakeMicrophone::new()))
    });
    let device = LocalDevice::camera(device.await?);
    Ok(Box::new(device.also(|parts| &mut parts.other)))
}

/// Opens a microphone with the parameters of stock's `fakeMicrophone`; the wave is a sine.
pub(super) async fn microphone(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let tone = parameters.get_or("signal_frequency", DEFAULT_TONE)?;
    if !(tone > 0.0 && tone <= MAX_TONE) {
        let expected = format!("more than 0 and up to {MAX_TONE} Hz");
        return Err(parameters.refuse("signal_frequency", expected).into());
    }
    let amplitude = parameters.get_or("signal_amplitude", DEFAULT_AMPLITUDE)?;
    if !(0.0..=f64::from(i16::MAX)).contains(&amplitude) {
        let expected = format!("0 to {}", i16::MAX);
        return Err(parameters.refuse("signal_amplitude", expected).into());
    }
    let waveform = parameters.get_or("waveform", "sine".to_owned())?;
    if waveform != "sine" {
        return Err(parameters.refuse("waveform", "sine").into());
    }
    // It records in real time, without steps.
    for name in ["period", "driver_frame_size"] {
        parameters.has(name);
    }
    let microphone = Arc::new(FakeMicrophone::with_tone(tone, amplitude));
    Ok(Box::new(LocalDevice::other(microphone)))
}

/// Opens a loudspeaker without output.
pub(super) async fn speaker(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let channels = parameters.get_or("channels", 1)?;
    if !(1..=MAX_CHANNELS).contains(&channels) {
        let expected = format!("1 to {MAX_CHANNELS}");
        return Err(parameters.refuse("channels", expected).into());
    }
    let rate = parameters.get_or("rate", DEFAULT_RATE)?;
    if !(1..=MAX_RATE).contains(&rate) {
        let expected = format!("1 to {MAX_RATE} samples a second");
        return Err(parameters.refuse("rate", expected).into());
    }
    // It plays in real time, without steps.
    parameters.has("period");
    let speaker = Arc::new(FakeSpeaker::new(channels, rate as u32));
    Ok(Box::new(LocalDevice::other(speaker)))
}

/// Opens a folder that images and sound are written to.
pub(super) async fn image_folder_writer(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let folder: String = parameters.need("folder")?;
    let mut options = ImageFolderOptions::new();
    if let Some(images) = parameters.get::<usize>("max_images")? {
        if !(1..=MAX_IMAGES).contains(&images) {
            let expected = format!("1 to {MAX_IMAGES} images");
            return Err(parameters.refuse("max_images", expected).into());
        }
        options = options.max_images(images as u64);
    }
    if let Some(bytes) = bytes(parameters, "max_sound_bytes", MAX_SOUND_BYTES)? {
        options = options.max_sound_bytes(bytes as u32);
    }
    if let Some(bytes) = bytes(parameters, "max_bytes", MAX_BYTES)? {
        options = options.max_bytes(bytes);
    }
    let open = move || ImageFolderWriter::open(&PathBuf::from(folder), options);
    let writer = local_device::start(parameters, open).await?;
    Ok(Box::new(LocalDevice::other(writer)))
}

/// Reads a number of bytes, which may have more than 32 bits.
fn bytes(parameters: &Parameters, name: &str, most: u64) -> Result<Option<u64>, HostError> {
    let Some(bytes) = parameters.get::<f64>(name)? else {
        return Ok(None);
    };
    match bytes.fract() == 0.0 && (1.0..=most as f64).contains(&bytes) {
        true => Ok(Some(bytes as u64)),
        false => Err(parameters.refuse(name, format!("1 to {most} bytes")).into()),
    }
}
