//! A processor of images that is the processor of this machine.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::image::{Image, MAX_IMAGE_SIDE, PixelFormat};
use crate::{Device, DeviceError, GpuArgument, GpuDevice, GpuProgram};

/// Maximum number of loaded programs; the interface of stock cannot unload any.
const MAX_LOADED_PROGRAMS: usize = 64;

/// A built-in program.
#[derive(Debug)]
struct Builtin {
    name: &'static str,
    /// Name, default, least and largest value of its argument.
    argument: (&'static str, f32, f32, f32),
    run: Run,
}

/// The work of a program on each byte of the pixels, with its argument.
#[derive(Debug)]
enum Run {
    OnOne(fn(u8, f32) -> u8),
    OnTwo(fn(u8, u8, f32) -> u8),
}

const PROGRAMS: [Builtin; 4] = [
    Builtin {
        name: "threshold",
        argument: ("level", 128.0, 0.0, 255.0),
        run: Run::OnOne(|byte, level| if f32::from(byte) >= level { 255 } else { 0 }),
    },
    Builtin {
        name: "gain",
        argument: ("factor", 1.0, 0.0, 255.0),
        // The cast saturates.
        run: Run::OnOne(|byte, factor| (f32::from(byte) * factor).round() as u8),
    },
    Builtin {
        name: "blend",
        argument: ("weight", 0.5, 0.0, 1.0),
        run: Run::OnTwo(|one, other, weight| {
            (f32::from(one) * (1.0 - weight) + f32::from(other) * weight).round() as u8
        }),
    },
    Builtin {
        name: "difference",
        argument: ("factor", 1.0, 0.0, 255.0),
        run: Run::OnTwo(|one, other, factor| {
            (f32::from(one.abs_diff(other)) * factor).round() as u8
        }),
    },
];

/// A device with the interface of graphics processors that runs built-in programs on the processor of this machine. It is slower than a
/// graphics processor, and shows programs what one does.
///
/// | program | images | argument | result, byte by byte |
/// | --- | --- | --- | --- |
/// | `threshold` | 1 | `level`, 0 to 255, default 128 | 255 from the level on, otherwise 0 |
/// | `gain` | 1 | `factor`, 0 to 255, default 1 | the byte times the factor, at most 255 |
/// | `blend` | 2 | `weight`, 0 to 1, default 0.5 | the mean of both, of which the second has this weight |
/// | `difference` | 2 | `factor`, 0 to 255, default 1 | the difference of both times the factor, at most 255 |
///
/// The workspace has 256 x 256 pixels of red, green and blue at first. 64 programs can be loaded.
///
/// ```
/// use yarp_devices::fake::SimulatedGpu;
/// use yarp_devices::image::{Image, PixelFormat};
/// use yarp_devices::{GpuArgument, GpuDevice};
///
/// # fn main() -> Result<(), yarp_devices::DeviceError> {
/// let gpu = SimulatedGpu::new();
/// gpu.set_workspace_size(2, 1)?;
/// gpu.set_pixel_format(PixelFormat::Mono)?;
/// let threshold = gpu.load_program("threshold")?;
/// gpu.set_argument(threshold, GpuArgument::Named("level"), &[100.0])?;
/// let image = Image::new(PixelFormat::Mono, 2, 1, vec![99, 100])?;
/// assert_eq!(gpu.execute(threshold, &image)?.pixels()[..], [0, 255]);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct SimulatedGpu(Mutex<Workspace>);

#[derive(Debug)]
struct Workspace {
    size: (usize, usize),
    format: PixelFormat,
    /// Places in [`PROGRAMS`] and values of the arguments.
    loaded: Vec<(usize, f32)>,
}

impl Default for SimulatedGpu {
    fn default() -> Self {
        Self::new()
    }
}

impl SimulatedGpu {
    /// Creates a device without loaded programs.
    pub fn new() -> Self {
        Self(Mutex::new(Workspace {
            size: (256, 256),
            format: PixelFormat::Rgb,
            loaded: Vec::new(),
        }))
    }

    fn workspace(&self) -> MutexGuard<'_, Workspace> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Workspace {
    fn program(&self, program: GpuProgram) -> Result<(&'static Builtin, f32), DeviceError> {
        let loaded = usize::try_from(program.0).ok();
        let loaded = loaded.and_then(|place| self.loaded.get(place));
        let (place, value) = loaded.ok_or_else(|| DeviceError::Unsuitable {
            what: "program",
            asked: program.0.to_string(),
            expected: format!(
                "one of {} that are loaded, counted from 0",
                self.loaded.len()
            ),
        })?;
        Ok((&PROGRAMS[*place], *value))
    }

    fn check_image(&self, image: &Image) -> Result<(), DeviceError> {
        let (size, format) = ((image.width(), image.height()), image.format());
        if (size, format) == (self.size, self.format) {
            return Ok(());
        }
        let said = |(width, height), format| format!("{width} x {height} {format:?}");
        Err(DeviceError::Unsuitable {
            what: "image",
            asked: said(size, format),
            expected: format!("that of the workspace, {}", said(self.size, self.format)),
        })
    }
}

impl Builtin {
    fn wrong_count(&self, images: usize) -> DeviceError {
        DeviceError::Unsuitable {
            what: "number of images",
            asked: images.to_string(),
            expected: format!("{} for program {}", 3 - images, self.name),
        }
    }
}

impl GpuDevice for SimulatedGpu {
    fn workspace_size(&self) -> (usize, usize) {
        self.workspace().size
    }

    fn set_workspace_size(&self, width: usize, height: usize) -> Result<(), DeviceError> {
        let sides = 1..=MAX_IMAGE_SIDE;
        if !sides.contains(&width) || !sides.contains(&height) {
            return Err(DeviceError::Unsuitable {
                what: "size of the workspace",
                asked: format!("{width} x {height}"),
                expected: format!("sides of 1 to {MAX_IMAGE_SIDE}"),
            });
        }
        self.workspace().size = (width, height);
        Ok(())
    }

    fn pixel_format(&self) -> PixelFormat {
        self.workspace().format
    }

    fn set_pixel_format(&self, format: PixelFormat) -> Result<(), DeviceError> {
        if format.bytes().is_none() {
            return Err(DeviceError::Unsuitable {
                what: "pixel format",
                asked: format!("{format:?}"),
                expected: "Mono, Rgb or Bgr".to_owned(),
            });
        }
        self.workspace().format = format;
        Ok(())
    }

    fn load_program(&self, name: &str) -> Result<GpuProgram, DeviceError> {
        let place = PROGRAMS.iter().position(|program| program.name == name);
        let place = place.ok_or_else(|| DeviceError::Unsuitable {
            what: "program",
            asked: name.to_owned(),
            expected: format!("one of {}", PROGRAMS.map(|program| program.name).join(", ")),
        })?;
        let mut workspace = self.workspace();
        if workspace.loaded.len() == MAX_LOADED_PROGRAMS {
            return Err(DeviceError::Unsuitable {
                what: "another program,",
                asked: name.to_owned(),
                expected: format!("at most {MAX_LOADED_PROGRAMS}"),
            });
        }
        workspace.loaded.push((place, PROGRAMS[place].argument.1));
        Ok(GpuProgram(workspace.loaded.len() as u32 - 1))
    }

    fn set_argument(
        &self,
        program: GpuProgram,
        argument: GpuArgument<'_>,
        values: &[f32],
    ) -> Result<(), DeviceError> {
        let mut workspace = self.workspace();
        let (builtin, _) = workspace.program(program)?;
        let (name, _, least, largest) = builtin.argument;
        match argument {
            GpuArgument::Named(asked) if asked != name => {
                return Err(DeviceError::Unsuitable {
                    what: "argument",
                    asked: asked.to_owned(),
                    expected: name.to_owned(),
                });
            }
            _ => {}
        }
        match *values {
            [value] if (least..=largest).contains(&value) => {
                workspace.loaded[program.0 as usize].1 = value;
                Ok(())
            }
            _ => Err(DeviceError::Unsuitable {
                what: "value of an argument",
                asked: format!("{values:?}"),
                expected: format!("one number, {least} to {largest}, for {name}"),
            }),
        }
    }

    fn execute(&self, program: GpuProgram, image: &Image) -> Result<Image, DeviceError> {
        let (builtin, value) = {
            let workspace = self.workspace();
            workspace.check_image(image)?;
            workspace.program(program)?
        };
        let Run::OnOne(run) = builtin.run else {
            return Err(builtin.wrong_count(1));
        };
        let pixels: Vec<u8> = image
            .pixels()
            .iter()
            .map(|byte| run(*byte, value))
            .collect();
        Image::new(image.format(), image.width(), image.height(), pixels)
    }

    fn execute_on_two(
        &self,
        program: GpuProgram,
        first: &Image,
        second: &Image,
    ) -> Result<Image, DeviceError> {
        let (builtin, value) = {
            let workspace = self.workspace();
            workspace.check_image(first)?;
            workspace.check_image(second)?;
            workspace.program(program)?
        };
        let Run::OnTwo(run) = builtin.run else {
            return Err(builtin.wrong_count(2));
        };
        let pairs = first.pixels().iter().zip(second.pixels());
        let pixels: Vec<u8> = pairs.map(|(one, other)| run(*one, *other, value)).collect();
        Image::new(first.format(), first.width(), first.height(), pixels)
    }
}

impl Device for SimulatedGpu {
    crate::offers! { gpu_device: GpuDevice }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gpu() -> SimulatedGpu {
        let gpu = SimulatedGpu::new();
        gpu.set_workspace_size(3, 1).unwrap();
        gpu.set_pixel_format(PixelFormat::Mono).unwrap();
        gpu
    }

    fn grey(pixels: [u8; 3]) -> Image {
        Image::new(PixelFormat::Mono, 3, 1, pixels.to_vec()).unwrap()
    }

    #[test]
    fn programs_run_with_their_arguments() {
        let gpu = gpu();
        let [dark, bright] = [grey([0, 100, 200]), grey([200, 150, 100])];
        let one = |name: &str, value: f32| {
            let program = gpu.load_program(name).unwrap();
            gpu.set_argument(program, GpuArgument::Only, &[value])
                .unwrap();
            gpu.execute(program, &dark).unwrap().pixels().to_vec()
        };
        assert_eq!(one("threshold", 101.0), [0, 0, 255]);
        assert_eq!(one("gain", 1.5), [0, 150, 255]);
        let two = |name: &str, value: f32| {
            let program = gpu.load_program(name).unwrap();
            let before = gpu.execute_on_two(program, &dark, &bright).unwrap();
            gpu.set_argument(program, GpuArgument::Only, &[value])
                .unwrap();
            let after = gpu.execute_on_two(program, &dark, &bright).unwrap();
            [before, after].map(|image| image.pixels().to_vec())
        };
        assert_eq!(two("blend", 0.1), [[100, 125, 150], [20, 105, 190]]);
        assert_eq!(two("difference", 2.0), [[200, 50, 100], [255, 100, 200]]);
    }

    #[test]
    fn each_load_has_arguments_of_its_own() {
        let gpu = gpu();
        let [one, other] = ["threshold"; 2].map(|name| gpu.load_program(name).unwrap());
        let argument = GpuArgument::Named("level");
        gpu.set_argument(one, argument, &[0.0]).unwrap();
        let image = grey([0, 127, 128]);
        assert_eq!(gpu.execute(one, &image).unwrap().pixels()[..], [255; 3]);
        assert_eq!(
            gpu.execute(other, &image).unwrap().pixels()[..],
            [0, 0, 255]
        );
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let gpu = gpu();
        for (width, height) in [(0, 1), (1, 0), (MAX_IMAGE_SIDE + 1, 1)] {
            assert!(gpu.set_workspace_size(width, height).is_err());
        }
        assert!(gpu.set_pixel_format(PixelFormat::Other(7)).is_err());
        assert_eq!(
            (gpu.workspace_size(), gpu.pixel_format()),
            ((3, 1), PixelFormat::Mono)
        );
        let (one, two) = (
            gpu.load_program("gain").unwrap(),
            gpu.load_program("blend").unwrap(),
        );
        let image = grey([1, 2, 3]);
        let wide = Image::new(PixelFormat::Mono, 4, 1, vec![0; 4]).unwrap();
        let colour = Image::new(PixelFormat::Rgb, 3, 1, vec![0; 9]).unwrap();
        assert!(gpu.execute(one, &wide).is_err());
        assert!(gpu.execute(one, &colour).is_err());
        assert!(gpu.execute_on_two(two, &image, &wide).is_err());
        assert!(gpu.execute(two, &image).is_err());
        assert!(gpu.execute_on_two(one, &image, &image).is_err());
        assert!(gpu.execute(GpuProgram(2), &image).is_err());
        assert!(gpu.load_program("mandelbrot").is_err());
        for values in [&[][..], &[f32::NAN], &[-0.1], &[255.1], &[1.0, 1.0]] {
            assert!(
                gpu.set_argument(one, GpuArgument::Only, values).is_err(),
                "{values:?}"
            );
        }
        let argument = GpuArgument::Named("level");
        assert!(gpu.set_argument(one, argument, &[1.0]).is_err());
    }

    #[test]
    fn loaded_programs_are_bounded() {
        let gpu = gpu();
        for _ in 0..MAX_LOADED_PROGRAMS {
            gpu.load_program("gain").unwrap();
        }
        assert!(gpu.load_program("gain").is_err());
    }
}
