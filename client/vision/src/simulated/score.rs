//! Detections matched to the truth: counts per class, position errors, times.

use nalgebra::Point3;
use serde::Serialize;
use yarp_table::{Class, GroundTruth, ObjectTruth, Shape};

use crate::FoundObject;
use crate::evaluation::Counts;

/// Smallest part of a present object's pixels that show it.
pub const MIN_VISIBLE: f64 = 0.5;
/// Largest distance of a correct detection from its object's upper face, m.
pub const MATCH_DISTANCE: f64 = 0.015;

/// Classes of objects as the methods of the thesis find them.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum ObjectClass {
    /// Printed objects.
    Sift,
    /// Round objects.
    Circles,
    /// Objects with straight sides.
    Polygons,
}

impl ObjectClass {
    fn of_detection(found: &FoundObject) -> Self {
        match found.detection.shape {
            crate::Shape::Textured { .. } => Self::Sift,
            crate::Shape::Cylinder { .. } => Self::Circles,
            crate::Shape::Polygon(_) => Self::Polygons,
        }
    }

    fn of_truth(class: Class) -> Option<Self> {
        match class {
            Class::Brick => Some(Self::Sift),
            Class::Glass | Class::Plate => Some(Self::Circles),
            Class::Box | Class::Prism => Some(Self::Polygons),
            Class::Board | Class::Clutter => None,
        }
    }
}

/// Targets of a row.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Targets {
    /// Smallest correct / present.
    pub recall: f64,
    /// Largest false / all detections.
    pub false_share: f64,
}

/// Results of one class.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Present objects, correct and false detections.
    pub counts: Counts,
    /// Correct / present.
    pub recall: f64,
    /// False / all detections.
    pub false_share: f64,
    /// Targets.
    pub target: Targets,
    /// True if the targets are reached.
    pub passed: bool,
}

/// Detections of any number of scenes against their truth.
///
/// An object is *present* if at least half of its pixels show it ([`ObjectTruth::visible`]) and it lies wholly within
/// the image. Others may be found but need not be. A detection is correct if it names the kind of an object whose
/// upper face is within 15 mm, each object once; every other detection is false.
#[derive(Clone, Debug, Default)]
pub struct Evaluation {
    counts: [Counts; 3],
    /// Distances of correct detections from the truth in the arm's base frame, m.
    errors: Vec<f64>,
    times: Vec<f64>,
    scenes: usize,
    /// Descriptions of misses and false detections.
    mistakes: Vec<String>,
}

impl Evaluation {
    /// Adds the detections of a scene, which took `milliseconds`.
    pub fn add(
        &mut self,
        name: &str,
        truth: &GroundTruth,
        found: &[FoundObject],
        milliseconds: f64,
    ) {
        self.scenes += 1;
        self.times.push(milliseconds);
        let mut pairs = Vec::new();
        for (index, object) in found.iter().enumerate() {
            for (other, target) in truth.objects.iter().enumerate() {
                let distance = distance(object, target);
                if kind_of(target) == Some(object.kind.as_str()) && distance <= MATCH_DISTANCE {
                    pairs.push((distance, index, other));
                }
            }
        }
        pairs.sort_by(|one, other| one.0.total_cmp(&other.0));
        let mut target_of = vec![None; found.len()];
        let mut is_found = vec![false; truth.objects.len()];
        for (distance, index, other) in pairs {
            if target_of[index].is_none() && !is_found[other] {
                target_of[index] = Some((other, distance));
                is_found[other] = true;
            }
        }
        for (object, target) in found.iter().zip(&target_of) {
            let counts = &mut self.counts[ObjectClass::of_detection(object) as usize];
            match target {
                Some((target, _)) if !is_present(&truth.objects[*target]) => continue,
                Some((target, distance)) => {
                    counts.correct += 1;
                    self.errors.push(*distance);
                    if *distance > 0.004 {
                        self.mistakes.push(format!(
                            "{name}: {:.1} mm off: {}, {:.0} % visible",
                            distance * 1e3,
                            described(object),
                            truth.objects[*target].visible * 100.0
                        ));
                    }
                }
                None => {
                    counts.false_detections += 1;
                    self.mistakes
                        .push(format!("{name}: false {}", described(object)));
                }
            }
            counts.detections += 1;
        }
        for (target, is_found) in truth.objects.iter().zip(is_found) {
            let class = ObjectClass::of_truth(target.object.class());
            let Some(class) = class.filter(|_| is_present(target)) else {
                continue;
            };
            self.counts[class as usize].targets += 1;
            if !is_found {
                let place = target.object.pose.translation.vector;
                self.mistakes.push(format!(
                    "{name}: missed {} at ({:.3}, {:.3}), {:.0} % visible",
                    kind_of(target).unwrap_or("?"),
                    place.x,
                    place.y,
                    target.visible * 100.0
                ));
            }
        }
    }

    /// Returns the counts of a class, or of all.
    pub fn counts(&self, class: Option<ObjectClass>) -> Counts {
        match class {
            Some(class) => self.counts[class as usize],
            None => self
                .counts
                .iter()
                .fold(Counts::default(), |mut sum, counts| {
                    sum.add(counts);
                    sum
                }),
        }
    }

    /// Returns the result of a class, or of all, against the project's targets.
    pub fn row(&self, class: Option<ObjectClass>) -> Row {
        let target = Targets {
            recall: match class {
                Some(ObjectClass::Sift | ObjectClass::Circles) => 0.99,
                Some(ObjectClass::Polygons) | None => 0.97,
            },
            false_share: 0.01,
        };
        let counts = self.counts(class);
        let (recall, false_share) = (counts.recall(), counts.false_share());
        Row {
            counts,
            recall,
            false_share,
            target,
            passed: recall >= target.recall && false_share <= target.false_share,
        }
    }

    /// Returns the number of scenes.
    pub fn scenes(&self) -> usize {
        self.scenes
    }

    /// Returns median and maximum of the position errors of correct detections, m; 0 without any.
    pub fn position_error(&self) -> [f64; 2] {
        [0.5, 1.0].map(|part| quantile(&self.errors, part))
    }

    /// Returns median and 99th percentile of the detection times, ms; 0 without any.
    pub fn milliseconds(&self) -> [f64; 2] {
        [0.5, 0.99].map(|part| quantile(&self.times, part))
    }

    /// Returns descriptions of misses, false detections and positions that are more than 4 mm off.
    pub fn mistakes(&self) -> &[String] {
        &self.mistakes
    }
}

/// Returns whether a detector has to find an object.
fn is_present(target: &ObjectTruth) -> bool {
    target.visible >= MIN_VISIBLE && !target.truncated
}

fn kind_of(target: &ObjectTruth) -> Option<&'static str> {
    match target.object.shape {
        Shape::Brick { kind } => Some(kind.name()),
        Shape::Board { .. } | Shape::Clutter { .. } => None,
        _ => Some(target.object.class().word()),
    }
}

/// Returns the distance between the upper faces' middles, m.
fn distance(found: &FoundObject, target: &ObjectTruth) -> f64 {
    let half = target.object.shape.half_height();
    let top = target.object.pose * Point3::new(0.0, 0.0, half);
    let place = found.pose.map(|pose| pose.position);
    place.map_or(f64::INFINITY, |place| (place - top).norm())
}

fn described(object: &FoundObject) -> String {
    let millimetres = |value: f64| value * 1e3;
    let place = object.pose.map(|pose| pose.position).unwrap_or_default();
    let size = object.size.unwrap_or_default();
    format!(
        "{} at ({:.3}, {:.3}), {:.0} x {:.0} x {:.0} mm, score {:.2}",
        object.kind,
        place.x,
        place.y,
        millimetres(size[0]),
        millimetres(size[1]),
        millimetres(object.height.unwrap_or_default()),
        object.detection.score
    )
}

fn quantile(values: &[f64], part: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    let index = (part * last as f64).ceil() as usize;
    sorted.get(index).copied().unwrap_or(0.0)
}
