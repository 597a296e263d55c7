//! The scene without what moves in front of it.

use crate::{Image, PixelFormat, Result};

/// Maximum number of images that are kept.
const MAX_IMAGES: usize = 31;

/// Images of one camera in which an arm is somewhere else each time.
#[derive(Clone, Debug, Default)]
pub struct StaticScene {
    images: Vec<Image>,
}

impl StaticScene {
    /// Adds an image; after 31 further ones are ignored, as are those of another size than the first.
    ///
    /// Errors: [`VisionError::Device`](crate::VisionError::Device) for an image that cannot be converted to grey.
    pub fn add(&mut self, image: &Image) -> Result<()> {
        let size = |image: &Image| [image.width(), image.height()];
        let fits = self
            .images
            .first()
            .is_none_or(|first| size(first) == size(image));
        if fits && self.images.len() < MAX_IMAGES {
            self.images.push(image.to_mono()?);
        }
        Ok(())
    }

    /// Returns the median of each pixel in grey: what is in the same place in most images. `None` without images.
    pub fn median(&self) -> Option<Image> {
        let first = self.images.first()?;
        let middle = self.images.len() / 2;
        let mut values = vec![0; self.images.len()];
        let pixels: Vec<u8> = (0..first.pixels().len())
            .map(|index| {
                for (value, image) in values.iter_mut().zip(&self.images) {
                    *value = image.pixels()[index];
                }
                *values.select_nth_unstable(middle).1
            })
            .collect();
        Image::new(PixelFormat::Mono, first.width(), first.height(), pixels).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(pixels: [u8; 4]) -> Image {
        Image::new(PixelFormat::Mono, 2, 2, pixels.to_vec()).unwrap()
    }

    #[test]
    fn what_is_elsewhere_in_each_image_is_left_out() {
        let mut scene = StaticScene::default();
        assert!(scene.median().is_none());
        for pixels in [[9, 20, 30, 40], [10, 99, 30, 40], [11, 20, 99, 40]] {
            scene.add(&image(pixels)).unwrap();
        }
        let small = Image::new(PixelFormat::Mono, 1, 1, vec![99]).unwrap();
        scene.add(&small).unwrap();
        assert_eq!(scene.median(), Some(image([10, 20, 30, 40])));
    }

    #[test]
    fn the_number_of_images_is_bounded() {
        let mut scene = StaticScene::default();
        for _ in 0..=MAX_IMAGES {
            scene.add(&image([0; 4])).unwrap();
        }
        assert_eq!(scene.images.len(), MAX_IMAGES);
    }
}
