//! Conversion between our images and OpenCV's.

use opencv::core::{CV_8UC1, CV_8UC3, Mat, MatTraitConst, MatTraitConstManual};

use crate::{Image, PixelFormat, Result, VisionError};

/// Copies an image into a matrix of OpenCV: one channel if the image is grey, otherwise blue, green, red.
///
/// Errors: [`VisionError::Device`], [`VisionError::OpenCv`].
pub(crate) fn of_image(image: &Image) -> Result<Mat> {
    let failed = VisionError::cv("copy an image");
    let pixels = match image.format() {
        PixelFormat::Mono => {
            let pixels = image.pixels();
            return grey(image.width(), pixels).map_err(failed);
        }
        PixelFormat::Bgr => image.pixels().to_vec(),
        _ => {
            let colours = image.to_rgb()?;
            let pixels = colours.pixels().chunks_exact(3);
            pixels.flat_map(|rgb| [rgb[2], rgb[1], rgb[0]]).collect()
        }
    };
    colour(image.width(), image.height(), &pixels).map_err(failed)
}

/// Copies an image into a matrix of OpenCV: one channel if the image is grey, otherwise its colours in their order; red
/// first if they are in none.
///
/// Errors: [`VisionError::Device`], [`VisionError::OpenCv`].
pub(crate) fn in_order(image: &Image) -> Result<Mat> {
    match image.format() {
        PixelFormat::Mono => grey(image.width(), image.pixels()),
        PixelFormat::Rgb | PixelFormat::Bgr => {
            colour(image.width(), image.height(), image.pixels())
        }
        _ => {
            let colours = image.to_rgb()?;
            colour(image.width(), image.height(), colours.pixels())
        }
    }
    .map_err(VisionError::cv("copy an image"))
}

/// Copies an image into a grey matrix of OpenCV, with OpenCV's weights of the colours.
///
/// Errors: [`VisionError::Device`], [`VisionError::OpenCv`].
pub(crate) fn grey_of_image(image: &Image) -> Result<Mat> {
    let mat = of_image(image)?;
    if mat.channels() == 1 {
        return Ok(mat);
    }
    let mut grey = Mat::default();
    opencv::imgproc::cvt_color_def(&mat, &mut grey, opencv::imgproc::COLOR_BGR2GRAY)
        .map_err(VisionError::cv("convert an image to grey"))?;
    Ok(grey)
}

/// Copies a matrix of 8 bits with one or three channels (blue, green, red) into an image.
///
/// Errors: [`VisionError::OpenCv`], [`VisionError::Unsuitable`] for other matrices.
#[allow(dead_code, reason = "used by calibration and recognition")]
pub(crate) fn to_image(mat: &Mat) -> Result<Image> {
    let format = match mat.typ() {
        CV_8UC1 => PixelFormat::Mono,
        CV_8UC3 => PixelFormat::Bgr,
        other => {
            return Err(VisionError::Unsuitable {
                what: "matrix of OpenCV".to_owned(),
                expected: "8 bits, one or three channels".to_owned(),
                actual: format!("type {other}"),
            });
        }
    };
    let mat = mat.try_clone().map_err(VisionError::cv("copy a matrix"))?;
    let bytes = mat
        .data_bytes()
        .map_err(VisionError::cv("read a matrix"))?
        .to_vec();
    let (width, height) = (mat.cols() as usize, mat.rows() as usize);
    Ok(Image::new(format, width, height, bytes)?)
}

fn grey(width: usize, pixels: &[u8]) -> opencv::Result<Mat> {
    let row = Mat::from_slice(pixels)?;
    let shaped = row.reshape(1, (pixels.len() / width.max(1)) as i32)?;
    shaped.try_clone()
}

fn colour(width: usize, height: usize, pixels: &[u8]) -> opencv::Result<Mat> {
    debug_assert_eq!(width * height * 3, pixels.len());
    let row = Mat::from_slice(pixels)?;
    let shaped = row.reshape(3, height as i32)?;
    shaped.try_clone()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_survive_the_way_through_opencv() {
        let pixels: Vec<u8> = (0..18).collect();
        let image = Image::new(PixelFormat::Rgb, 3, 2, pixels).unwrap();
        let back = to_image(&of_image(&image).unwrap()).unwrap();
        assert_eq!(back.format(), PixelFormat::Bgr);
        assert_eq!(back.to_rgb().unwrap(), image);
        let grey = Image::new(PixelFormat::Mono, 3, 2, vec![1, 2, 3, 4, 5, 6]).unwrap();
        let mat = grey_of_image(&grey).unwrap();
        assert_eq!((mat.cols(), mat.rows()), (3, 2));
        assert_eq!(to_image(&mat).unwrap(), grey);
    }
}
