//! Shorter paths, by straight motions between random places of a path.

use yarp_devices::kinematics::Joints;
use yarp_devices::pseudo_random::Random;

use super::Path;
use crate::collision::CollisionModel;
use crate::rrt_connect::distance;

/// Replaces parts of a path by straight motions that collide with nothing.
///
/// Tries `attempts` pairs of random places on the path (Geraerts and Overmars 2007, "partial shortcut" without the split by
/// joints), and removes postures that are not needed first.
pub(crate) fn shorten(
    path: Path,
    model: &CollisionModel,
    attempts: usize,
    random: &mut Random,
) -> Path {
    let mut postures = skip_postures(path.postures, model);
    for _ in 0..attempts {
        if postures.len() < 3 {
            break;
        }
        let lengths = lengths(&postures);
        let total = lengths[lengths.len() - 1];
        let (one, two) = (random.between(0.0, total), random.between(0.0, total));
        let (from, to) = (
            at(&postures, &lengths, one.min(two)),
            at(&postures, &lengths, one.max(two)),
        );
        if from.0 == to.0 || !model.is_motion_free(&from.1, &to.1) {
            continue;
        }
        // `from` lies behind posture `from.0`, `to` before posture `to.0 + 1`.
        postures.splice(from.0 + 1..=to.0, [from.1, to.1]);
    }
    Path::new(postures)
}

/// Removes postures that a straight motion between others makes unnecessary, the longest motions first.
fn skip_postures(postures: Vec<Joints<7>>, model: &CollisionModel) -> Vec<Joints<7>> {
    let mut kept = vec![postures[0]];
    let mut index = 0;
    while index + 1 < postures.len() {
        let next = (index + 2..postures.len())
            .rev()
            .find(|&far| model.is_motion_free(&postures[index], &postures[far]))
            .unwrap_or(index + 1);
        kept.push(postures[next]);
        index = next;
    }
    kept
}

/// Returns the length of the path up to each posture.
fn lengths(postures: &[Joints<7>]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut lengths = vec![0.0];
    for pair in postures.windows(2) {
        sum += distance(&pair[0], &pair[1]);
        lengths.push(sum);
    }
    lengths
}

/// Returns the posture after this length, and the index of the posture before it.
fn at(postures: &[Joints<7>], lengths: &[f64], length: f64) -> (usize, Joints<7>) {
    let after = lengths.partition_point(|&reached| reached <= length);
    let index = after.clamp(1, postures.len() - 1) - 1;
    let part = (length - lengths[index]) / (lengths[index + 1] - lengths[index]).max(1e-12);
    (
        index,
        postures[index].lerp(&postures[index + 1], part.clamp(0.0, 1.0)),
    )
}
