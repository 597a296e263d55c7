//! Random numbers that are the same for the same seed on every machine.

pub use yarp_devices::pseudo_random::Random;

/// Returns well-mixed bits of an integer: noise that can be asked for at any place in any order.
pub(crate) fn hash(value: u64) -> u64 {
    Random::new(value).bits()
}
