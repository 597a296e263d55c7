//! Processors of images.

use crate::DeviceError;
use crate::image::{Image, PixelFormat};

/// A processor that runs programs on images, such as a graphics processor (stock: `IGPUDevice`, which no stock device has).
///
/// All images have the size and the pixel format of the workspace. Stock's calls on bare memory are those on images here, whose size is
/// checked.
pub trait GpuDevice: Send + Sync {
    /// Returns width and height of the workspace, in pixels (`width`, `height`).
    fn workspace_size(&self) -> (usize, usize);

    /// Sets the size of the workspace (`resize`).
    ///
    /// * Errors: [`DeviceError::Unsuitable`] for a size that it does not have.
    fn set_workspace_size(&self, width: usize, height: usize) -> Result<(), DeviceError>;

    /// Returns the pixel format of the workspace.
    fn pixel_format(&self) -> PixelFormat;

    /// Sets the pixel format of the workspace, and with it the bytes of a pixel (`changetype`, `changebpp`).
    ///
    /// * Errors: [`DeviceError::Unsuitable`] for a format that it does not have.
    fn set_pixel_format(&self, format: PixelFormat) -> Result<(), DeviceError>;

    /// Loads a program by its name (`load`); its arguments have their defaults.
    ///
    /// * Errors: [`DeviceError::Unsuitable`] for an unknown name, or when no more programs fit.
    fn load_program(&self, name: &str) -> Result<GpuProgram, DeviceError>;

    /// Sets an argument of a program for the executions from now on (`setargument`).
    ///
    /// * Errors: [`DeviceError::Unsuitable`] for a program or an argument that does not exist, or values that it does not take.
    fn set_argument(
        &self,
        program: GpuProgram,
        argument: GpuArgument<'_>,
        values: &[f32],
    ) -> Result<(), DeviceError>;

    /// Runs a program on one image and returns the result (`execute`); blocks until the program has ended.
    ///
    /// * Errors: [`DeviceError::Unsuitable`] for a program that does not exist or takes two images, or for an image that does not fit the
    ///   workspace.
    fn execute(&self, program: GpuProgram, image: &Image) -> Result<Image, DeviceError>;

    /// Runs a program on two images and returns the result (`execute`); blocks until the program has ended.
    ///
    /// * Errors: [`DeviceError::Unsuitable`] for a program that does not exist or takes one image, or for an image that does not fit the
    ///   workspace.
    fn execute_on_two(
        &self,
        program: GpuProgram,
        first: &Image,
        second: &Image,
    ) -> Result<Image, DeviceError>;
}

/// Number of a loaded program, valid for the device that loaded it.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub struct GpuProgram(pub u32);

/// Argument of a program.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum GpuArgument<'a> {
    /// The only one (stock: `setargument` without a name).
    Only,
    /// The one with this name.
    Named(&'a str),
}
