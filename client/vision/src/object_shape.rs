//! Shapes that the recogniser names, and detections.

use serde::Serialize;

/// Shape of an object as the camera sees its upper face (figure 22 of the thesis).
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Shape {
    /// A printed object of the model database.
    Textured {
        /// Name of the model: the stem of its file.
        model: String,
    },
    /// A glass, a plate, or anything else with a round upper face.
    Cylinder {
        /// Radius of the upper face in pixels.
        radius: f64,
    },
    /// An upper face with straight sides.
    Polygon(Polygon),
}

/// Polygons that the recogniser names.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Polygon {
    /// A rectangle.
    Rectangle {
        /// Longer and shorter side in pixels.
        sides: [f64; 2],
        /// Direction of the longer side in the image, rad, from the x axis towards the y axis, in -π/2..=π/2.
        angle: f64,
    },
    /// A triangle.
    Triangle {
        /// Mean length of the sides in pixels.
        side: f64,
        /// Direction of the longest side in the image, rad, in -π/2..=π/2.
        angle: f64,
    },
}

impl Shape {
    /// Returns the word for the shape: the model's name, `cylinder`, `rectangle` or `triangle`.
    pub fn label(&self) -> &str {
        match self {
            Self::Textured { model } => model,
            Self::Cylinder { .. } => "cylinder",
            Self::Polygon(Polygon::Rectangle { .. }) => "rectangle",
            Self::Polygon(Polygon::Triangle { .. }) => "triangle",
        }
    }
}

/// An object found in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Detection {
    /// Shape and its size.
    pub shape: Shape,
    /// Centre of the upper face in pixels.
    pub centre: [f64; 2],
    /// Outline of the upper face in pixels, in order.
    pub contour: Vec<[f64; 2]>,
    /// Confidence, larger is better: inliers of the homography for textured objects, supported part of the outline (0 to
    /// 1) for the others.
    pub score: f64,
}

impl Detection {
    /// Returns whether a pixel lies within the outline.
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        let mut inside = false;
        for (index, a) in self.contour.iter().enumerate() {
            let b = self.contour[(index + 1) % self.contour.len()];
            if (a[1] > y) != (b[1] > y) {
                let crossing = a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
                inside ^= x < crossing;
            }
        }
        inside
    }

    /// Returns the area within the outline in square pixels.
    pub fn area(&self) -> f64 {
        polygon_area(&self.contour)
    }
}

/// Returns the area of a simple polygon.
pub(crate) fn polygon_area(corners: &[[f64; 2]]) -> f64 {
    let cross = |index: usize| {
        let (a, b) = (corners[index], corners[(index + 1) % corners.len()]);
        a[0] * b[1] - a[1] * b[0]
    };
    ((0..corners.len()).map(cross).sum::<f64>() / 2.0).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outline_knows_its_inside_and_its_area() {
        let detection = Detection {
            shape: Shape::Cylinder { radius: 1.0 },
            centre: [1.0, 1.0],
            contour: vec![[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]],
            score: 1.0,
        };
        assert_eq!(detection.area(), 8.0);
        assert!(detection.contains([3.9, 1.9]));
        assert!(!detection.contains([4.1, 1.0]) && !detection.contains([1.0, -0.1]));
    }
}
