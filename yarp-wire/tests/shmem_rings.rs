//! A ring in shared memory returns only valid ranges, whatever the other end claims, and transmits
//! bytes unchanged.

use proptest::prelude::*;
use yarp_wire::shmem::Ring;

proptest! {
    #[test]
    fn no_claim_reaches_beyond_the_room(
        numbers in any::<[i32; 4]>(),
        near in any::<[i8; 4]>(),
        room in 0..300_usize,
        most in any::<usize>(),
    ) {
        for numbers in [numbers, near.map(i32::from)] {
            let Ok(ring) = Ring::checked(numbers, room) else {
                continue;
            };
            let (mut reading, mut writing) = (ring, ring);
            for range in reading.take(most).into_iter().chain(writing.put(most)) {
                prop_assert!(range.start <= range.end && range.end <= room);
            }
        }
    }

    #[test]
    fn bytes_go_through_a_ring_whole(
        size in 1..100_usize,
        steps in prop::collection::vec((any::<bool>(), 0..60_usize), 0..100),
    ) {
        let mut memory = vec![0_u8; size];
        let mut ring = Ring::empty(size);
        let (mut next, mut expected) = (0_u8, 0_u8);
        for (write, most) in steps {
            let ranges = if write { ring.put(most) } else { ring.take(most) };
            for at in ranges.into_iter().flatten() {
                if write {
                    memory[at] = next;
                    next = next.wrapping_add(1);
                } else {
                    prop_assert_eq!(memory[at], expected);
                    expected = expected.wrapping_add(1);
                }
            }
            prop_assert_eq!(Ring::checked(ring.numbers(), size), Ok(ring));
            prop_assert_eq!(ring.available(), usize::from(next.wrapping_sub(expected)));
        }
    }
}
