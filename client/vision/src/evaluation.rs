//! Evaluation of detections against ground truth (section 6.5.2 of the thesis): counts, ROC curve, equal-error point.

use serde::Serialize;

use crate::Detection;

/// An object that is in an image, as ground truth gives it.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Label that a correct detection has.
    pub label: String,
    /// Centre of the upper face in pixels.
    pub centre: [f64; 2],
    /// Largest distance of a correct detection's centre from `centre`, pixels.
    pub tolerance: f64,
    /// False for objects that may be found but need not be, such as hidden ones.
    pub required: bool,
}

/// Numbers of detections and targets, over any number of images.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq, Serialize)]
pub struct Counts {
    /// Required targets.
    pub targets: usize,
    /// Required targets that were found.
    pub correct: usize,
    /// Detections of no target, or of one that another detection has found.
    pub false_detections: usize,
    /// All detections but those of targets that are not required.
    pub detections: usize,
}

impl Counts {
    /// Counts the detections of one image; each target belongs to the nearest detection of its label.
    pub fn of_image(detections: &[Detection], targets: &[Target]) -> Self {
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (index, detection) in detections.iter().enumerate() {
            for (other, target) in targets.iter().enumerate() {
                let [x, y] = [0, 1].map(|axis| detection.centre[axis] - target.centre[axis]);
                let distance = x.hypot(y);
                if detection.shape.label() == target.label && distance <= target.tolerance {
                    pairs.push((distance, index, other));
                }
            }
        }
        pairs.sort_by(|one, other| one.0.total_cmp(&other.0));
        let mut target_of = vec![None; detections.len()];
        let mut found = vec![false; targets.len()];
        for (_, detection, target) in pairs {
            if target_of[detection].is_none() && !found[target] {
                target_of[detection] = Some(target);
                found[target] = true;
            }
        }
        let mut counts = Self {
            targets: targets.iter().filter(|target| target.required).count(),
            ..Self::default()
        };
        for target in target_of {
            match target {
                Some(target) if !targets[target].required => continue,
                Some(_) => counts.correct += 1,
                None => counts.false_detections += 1,
            }
            counts.detections += 1;
        }
        counts
    }

    /// Adds the counts of other images.
    pub fn add(&mut self, other: &Self) {
        self.targets += other.targets;
        self.correct += other.correct;
        self.false_detections += other.false_detections;
        self.detections += other.detections;
    }

    /// Returns correct detections / targets; 1 without targets.
    pub fn recall(&self) -> f64 {
        ratio(self.correct, self.targets, 1.0)
    }

    /// Returns false detections / detections; 0 without detections.
    pub fn false_share(&self) -> f64 {
        ratio(self.false_detections, self.detections, 0.0)
    }
}

fn ratio(part: usize, whole: usize, otherwise: f64) -> f64 {
    if whole == 0 {
        return otherwise;
    }
    part as f64 / whole as f64
}

/// A point of a ROC curve: a value of the parameter, and the counts with it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RocPoint {
    /// Value of the parameter.
    pub value: f64,
    /// Counts over the images of the split.
    pub counts: Counts,
}

/// A ROC curve over one parameter: correct / truth against false / detections (figure 34 of the thesis).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Roc {
    /// Points in the order in which their values were tried.
    pub points: Vec<RocPoint>,
}

impl Roc {
    /// Evaluates each value of a parameter.
    ///
    /// Errors: the first error of `evaluate`.
    pub fn over<E>(
        values: &[f64],
        mut evaluate: impl FnMut(f64) -> Result<Counts, E>,
    ) -> Result<Self, E> {
        let point = |&value: &f64| {
            let counts = evaluate(value)?;
            Ok(RocPoint { value, counts })
        };
        let points = values.iter().map(point).collect::<Result<_, E>>()?;
        Ok(Self { points })
    }

    /// Returns the equal-error point: the one at which missed targets / targets and false / detections differ least.
    pub fn equal_error(&self) -> Option<&RocPoint> {
        let error =
            |point: &RocPoint| (1.0 - point.counts.recall() - point.counts.false_share()).abs();
        self.points
            .iter()
            .min_by(|one, other| error(one).total_cmp(&error(other)))
    }

    /// Returns the point with the most correct detections among those with at most this share of false ones; the one with
    /// the smallest share if none has so few.
    pub fn best(&self, max_false_share: f64) -> Option<&RocPoint> {
        let share = |point: &RocPoint| point.counts.false_share();
        let allowed = self
            .points
            .iter()
            .filter(|point| share(point) <= max_false_share);
        allowed
            .max_by(|one, other| one.counts.recall().total_cmp(&other.counts.recall()))
            .or_else(|| {
                self.points
                    .iter()
                    .min_by(|one, other| share(one).total_cmp(&share(other)))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Shape;

    fn found(x: f64) -> Detection {
        Detection {
            shape: Shape::Cylinder { radius: 5.0 },
            centre: [x, 0.0],
            contour: vec![[x, 0.0]],
            score: 1.0,
        }
    }

    fn target(x: f64, label: &str, required: bool) -> Target {
        Target {
            label: label.to_owned(),
            centre: [x, 0.0],
            tolerance: 3.0,
            required,
        }
    }

    #[test]
    fn each_target_counts_once_and_optional_ones_not_at_all() {
        let targets = [
            target(0.0, "cylinder", true),
            target(50.0, "triangle", true),
            target(100.0, "cylinder", false),
        ];
        // One right, a second of the same, one with a wrong label, one of an optional target.
        let detections = [found(1.0), found(-2.0), found(50.0), found(100.0)];
        let counts = Counts::of_image(&detections, &targets);
        let expected = Counts {
            targets: 2,
            correct: 1,
            false_detections: 2,
            detections: 3,
        };
        assert_eq!(counts, expected);
        assert_eq!((counts.recall(), counts.false_share()), (0.5, 2.0 / 3.0));
    }

    #[test]
    fn curve_knows_its_best_and_its_equal_error_point() {
        let counts = |correct, false_detections| Counts {
            targets: 100,
            correct,
            false_detections,
            detections: correct + false_detections,
        };
        let table = [counts(99, 30), counts(90, 10), counts(80, 0), counts(70, 0)];
        let roc = Roc::over(&[0.0, 1.0, 2.0, 3.0], |value| {
            Ok::<_, ()>(table[value as usize])
        });
        let roc = roc.unwrap();
        assert_eq!(roc.equal_error().unwrap().value, 1.0);
        assert_eq!(roc.best(0.01).unwrap().value, 2.0);
        assert_eq!(roc.best(0.5).unwrap().value, 0.0);
        assert_eq!(Roc::default().best(0.01), None);
    }
}
