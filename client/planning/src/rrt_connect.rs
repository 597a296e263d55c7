//! Bidirectional rapidly exploring random trees.
//!
//! Kuffner and LaValle, "RRT-Connect: An efficient approach to single-query path planning" (ICRA 2000): a tree from the start
//! and one from the goals; each grows a step towards a random posture, and the other is then extended towards the new
//! posture as far as it goes.

use yarp_devices::kinematics::Joints;
use yarp_devices::pseudo_random::Random;

use crate::collision::CollisionModel;

/// Largest distance of one extension, in rad of the weighted joint distance.
const MAX_EXTENSION: f64 = 0.8;
/// Weight of each joint in the distance: how far the arm moves with it, relative to the first.
const WEIGHTS: [f64; 7] = [1.0, 1.0, 0.7, 0.6, 0.25, 0.25, 0.1];

/// Returns the weighted distance of two postures.
pub(crate) fn distance(one: &Joints<7>, other: &Joints<7>) -> f64 {
    let mut sum = 0.0;
    for joint in 0..7 {
        let difference = WEIGHTS[joint] * (one[joint] - other[joint]);
        sum += difference * difference;
    }
    sum.sqrt()
}

/// The postures reached from one end, each with the one that it was reached from.
struct Tree {
    postures: Vec<Joints<7>>,
    parents: Vec<usize>,
}

/// The outcome of an extension.
enum Extension {
    /// The target was reached, by the posture of this index.
    Reached(usize),
    /// A new posture of this index is closer to it.
    Advanced(usize),
    /// Something is in the way.
    Trapped,
}

impl Tree {
    fn new(roots: &[Joints<7>]) -> Self {
        Self {
            postures: roots.to_vec(),
            parents: (0..roots.len()).collect(),
        }
    }

    fn nearest(&self, target: &Joints<7>) -> usize {
        let mut best = (0, f64::INFINITY);
        for (index, posture) in self.postures.iter().enumerate() {
            let distance = distance(posture, target);
            if distance < best.1 {
                best = (index, distance);
            }
        }
        best.0
    }

    fn extend_from(
        &mut self,
        index: usize,
        target: &Joints<7>,
        model: &CollisionModel,
    ) -> Extension {
        let from = self.postures[index];
        let length = distance(&from, target);
        let last = length <= MAX_EXTENSION;
        let posture = match last {
            true => *target,
            false => from.lerp(target, MAX_EXTENSION / length),
        };
        if !model.is_motion_free(&from, &posture) {
            return Extension::Trapped;
        }
        self.postures.push(posture);
        self.parents.push(index);
        let new = self.postures.len() - 1;
        match last {
            true => Extension::Reached(new),
            false => Extension::Advanced(new),
        }
    }

    /// Extends the tree towards a posture as far as it goes.
    fn connect(&mut self, target: &Joints<7>, model: &CollisionModel) -> Option<usize> {
        let mut index = self.nearest(target);
        loop {
            match self.extend_from(index, target, model) {
                Extension::Reached(new) => return Some(new),
                Extension::Advanced(new) => index = new,
                Extension::Trapped => return None,
            }
        }
    }

    /// Returns the postures from a root to this one.
    fn branch(&self, mut index: usize) -> Vec<Joints<7>> {
        let mut branch = vec![self.postures[index]];
        while self.parents[index] != index {
            index = self.parents[index];
            branch.push(self.postures[index]);
        }
        branch.reverse();
        branch
    }
}

/// Searches for a path from `start` to one of `goals`; `None` after `max_iterations` random postures.
///
/// Start and goals are free of collisions.
pub(crate) fn search(
    model: &CollisionModel,
    start: &Joints<7>,
    goals: &[Joints<7>],
    max_iterations: usize,
    random: &mut Random,
) -> Option<Vec<Joints<7>>> {
    for goal in goals {
        if model.is_motion_free(start, goal) {
            return Some(vec![*start, *goal]);
        }
    }
    let mut trees = [Tree::new(&[*start]), Tree::new(goals)];
    let limits = *model.chain().limits();
    for iteration in 0..max_iterations {
        let growing = iteration % 2;
        let sample =
            Joints::<7>::from_fn(|joint, _| random.between(limits[joint].min, limits[joint].max));
        let nearest = trees[growing].nearest(&sample);
        let new = match trees[growing].extend_from(nearest, &sample, model) {
            Extension::Trapped => continue,
            Extension::Advanced(new) | Extension::Reached(new) => new,
        };
        let posture = trees[growing].postures[new];
        if let Some(met) = trees[1 - growing].connect(&posture, model) {
            let [from_start, from_goal] = match growing {
                0 => [new, met],
                _ => [met, new],
            };
            let mut path = trees[0].branch(from_start);
            let mut rest = trees[1].branch(from_goal);
            // Both branches end in the posture where they meet.
            rest.pop();
            path.extend(rest.into_iter().rev());
            return Some(path);
        }
    }
    None
}
