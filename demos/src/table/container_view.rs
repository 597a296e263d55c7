//! Measures the containers by depth sensors on the network.

use std::time::Duration;

use nalgebra::Point3;
use yarp_client::{Camera, Network};
use yarp_table::{DEPTH_FROM, DEPTH_STEP, Scene};

use super::fresh_image::{NoImage, connect_resting, fresh_images};

/// Maximum wait for images that are newer than a request: without them the heights are estimates.
const IMAGE_TIMEOUT: Duration = Duration::from_secs(5);

/// Depth sensors above the containers of a table.
#[derive(Debug)]
pub struct ContainerView {
    cameras: [Camera; 2],
    places: [yarp_table::Camera; 2],
}

impl ContainerView {
    /// Names of the sensors' ports, after the prefix of the table.
    pub const NAMES: [&'static str; 2] = ["baskets/right", "baskets/left"];

    /// Connects to the sensors of a table.
    ///
    /// Errors: those of [`Camera::connect_on`].
    pub fn connect(network: &Network, prefix: &str) -> yarp_client::Result<Self> {
        let [right, left] = Self::NAMES.map(|name| format!("{prefix}/{name}"));
        let cameras = [
            connect_resting(network, &right)?,
            connect_resting(network, &left)?,
        ];
        Ok(Self {
            cameras,
            places: Scene::empty().basket_cameras(),
        })
    }

    /// Returns points on the surfaces that the sensors see now; none of a sensor that delivers nothing new.
    pub fn look(&mut self) -> Vec<Point3<f64>> {
        let frames = fresh_images(self.cameras.each_ref(), IMAGE_TIMEOUT);
        let mut points = Vec::new();
        for ((camera, place), frame) in self.cameras.iter().zip(&self.places).zip(frames) {
            let grey = frame.and_then(|frame| frame.to_mono().map_err(NoImage::Failed));
            match grey {
                Ok(frame) => add_points(&frame.image, place, &mut points),
                Err(error) => tracing::warn!(
                    camera = camera.remote(),
                    %error,
                    "no new depth image; the heights in the containers are estimates"
                ),
            }
        }
        points
    }
}

/// Adds the points of a grey depth image, whose value 0 is no measurement.
fn add_points(
    grey: &yarp_devices::image::Image,
    place: &yarp_table::Camera,
    points: &mut Vec<Point3<f64>>,
) {
    // Another size is that of another sensor, whose directions are not known.
    if [grey.width(), grey.height()] != [place.lens.width, place.lens.height] {
        return;
    }
    for (index, value) in grey.pixels().iter().enumerate() {
        if *value > 0 {
            let pixel = [index % grey.width(), index / grey.width()].map(|at| at as f64);
            let depth = f64::from(DEPTH_FROM + DEPTH_STEP * f32::from(*value));
            points.push(place.pose * Point3::from(place.lens.direction(pixel) * depth));
        }
    }
}

#[cfg(test)]
mod tests {
    use yarp_devices::image::{Image, PixelFormat};

    use super::*;

    #[test]
    fn grey_values_become_points_and_other_images_none() {
        let place = Scene::empty().basket_cameras()[0];
        let [width, height] = [place.lens.width, place.lens.height];
        let mut values = vec![0; width * height];
        let middle = height / 2 * width + width / 2;
        values[middle] = 200;
        let image = |width, height, values| Image::new(PixelFormat::Mono, width, height, values);
        let mut points = Vec::new();
        add_points(&image(width, height, values).unwrap(), &place, &mut points);
        let [point] = points[..] else {
            panic!("{points:?}");
        };
        let camera = place.pose.translation.vector;
        // 0.25 m + 200 * 0.003 m below the camera.
        assert!((point.z - (camera.z - 0.85)).abs() < 1e-4, "{point}");
        assert!((point.coords - camera).xy().norm() < 0.005, "{point}");
        points.clear();
        add_points(&image(2, 2, vec![200; 4]).unwrap(), &place, &mut points);
        assert!(points.is_empty());
    }
}
