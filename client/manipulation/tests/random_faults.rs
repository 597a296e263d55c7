//! A sample of what `--example tidy_with_faults` tries on many tables.

#[allow(
    dead_code,
    unreachable_pub,
    reason = "it is a program, of which this test needs a part"
)]
#[path = "../examples/tidy_with_faults.rs"]
mod tidy_with_faults;

#[test]
fn a_run_with_a_fault_ends_tidy_or_with_the_reason_and_drops_nothing() {
    // The seeds choose each kind of fault twice, and some of them while an object is in the hand.
    for seed in 9000..9014 {
        let good = tidy_with_faults::run(seed, 2).expect("the simulation is ready");
        assert!(good, "the run of seed {seed} is in the output");
    }
}
