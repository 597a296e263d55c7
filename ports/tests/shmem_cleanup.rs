//! Shared objects have no names once both ends have opened them, so that nothing remains however
//! the processes end. A program of its own: it checks all mappings of its process.

mod common;

use common::{bottle, connect, next, open, until, within};
use yarp_ports::{PortOptions, Queue};

/// Returns the shared memory that this process has mapped, by name.
fn mapped() -> Vec<String> {
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    let shared = |line: &&str| line.contains("/SYSV") || line.contains("SHMEM_");
    maps.lines().filter(shared).map(str::to_owned).collect()
}

#[tokio::test]
async fn nothing_has_a_name_while_it_runs_and_nothing_is_mapped_at_the_end() {
    for _ in 0..10 {
        let reader = open("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
        let writer = open("/writer", PortOptions::new()).await;
        connect(&writer, &reader, "shmem").await;
        writer.write(&bottle("hello")).await;
        assert_eq!(next(&reader).await, "hello");
        // The acknowledgement, with which the reader takes the last name away, is on its way.
        writer.write(&bottle("again")).await;
        assert_eq!(next(&reader).await, "again");
        let mapped_now = mapped();
        // Two segments, each mapped by both ends; between ports of ours the locks serve no more.
        assert_eq!(mapped_now.len(), 4, "{mapped_now:#?}");
        until(|| mapped().iter().all(|line| line.ends_with("(deleted)"))).await;
        within(writer.close()).await;
        within(reader.close()).await;
        until(|| mapped().is_empty()).await;
    }
}
