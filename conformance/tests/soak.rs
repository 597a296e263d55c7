//! Programs that connect and disconnect leak nothing; `make soak` runs longer.

use yarp_conformance::counting_allocator::Counting;
use yarp_conformance::soak_cycles;

#[global_allocator]
static COUNTING: Counting = Counting;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn ten_thousand_cycles_leak_nothing() {
    let words = ["--exact", "ten_thousand_cycles_leak_nothing", "--nocapture"];
    if let Some(output) = soak_cycles::alone(words).unwrap() {
        assert!(output.status.success(), "{output:?}");
        return;
    }
    let outcome = soak_cycles::run(10_000).await.unwrap();
    assert!(outcome.is_clean(), "{outcome:?}");
}
