//! Scenes of the simulated table as both sensors see them.

use yarp_table::{DepthNoise, Effects, Renderer, Scene};
use yarp_vision::{DepthImage, Image};

/// Renders the colour image, without effects, and the depth image.
pub(crate) fn rendered(scene: &Scene) -> (Image, DepthImage) {
    let renderer = Renderer::new();
    let shot = renderer.render(scene, &scene.camera(), &Effects::none());
    let depth = renderer.depth(scene, &scene.depth_camera(), &DepthNoise::default());
    let depth = DepthImage::new(depth.width, depth.height, depth.metres);
    (shot.image, depth.expect("as large as stated"))
}
