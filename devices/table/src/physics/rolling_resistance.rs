//! Damping of cylinders that roll on a rim.
//!
//! The engine finds contacts once in a step of 2 ms. The rim of a tilted glass goes on by a millimetre in that time, so the
//! force of the table acts behind the place where the rim touches, and pushes the glass on: its energy grows, by about 0.6
//! of itself in a second for a tall glass, until it falls over. A real one comes to rest within a second or two.

use rapier3d::math::Vector;
use rapier3d::prelude::PhysicsWorld;

use super::STEP;

/// Part of the angular velocity across its axis that a cylinder loses in a second while it touches anything: what stops a
/// glass within a second or two, and little beside the forces of a hand. A glass that rolls on its side turns about its axis,
/// and keeps on.
const RESISTANCE: f32 = 4.0;

/// Slows cylinders that roll on a rim.
pub(super) fn resist(world: &mut PhysicsWorld) {
    let mut rolling = Vec::new();
    for pair in world.narrow_phase.contact_pairs() {
        if !pair.has_any_active_contact() {
            continue;
        }
        let sides = [pair.collider1, pair.collider2].map(|side| &world.colliders[side]);
        let cylinders = sides
            .iter()
            .filter(|side| side.shape().as_cylinder().is_some());
        rolling.extend(cylinders.filter_map(|side| {
            let axis = side.rotation() * Vector::new(0.0, 1.0, 0.0);
            Some((side.parent()?, axis))
        }));
    }
    rolling.sort_by_key(|(body, _)| body.into_raw_parts());
    rolling.dedup_by_key(|(body, _)| *body);
    for (body, axis) in rolling {
        let body = &mut world.bodies[body];
        let turn = body.angvel();
        let along = axis * turn.dot(axis);
        let kept = 1.0 - RESISTANCE * STEP.as_secs_f32();
        body.set_angvel(along + (turn - along) * kept, false);
    }
}
