//! A connection that is given a policy moves to a dedicated thread without losing messages.
//!
//! The policy for batches needs no privilege. In stock (3.5.0) the thread of a reading connection
//! exists from the beginning; its reported properties are the same.

use crate::common;

use std::sync::{Arc, Mutex};

use common::{ask, at, bottle, connect, next, open, until, within};
use yarp_ports::{Answer, Port, PortOptions, Queue};
use yarp_wire::typed::{Image, PixelCode};
use yarp_wire::{Bottle, Value};

/// Returns the reported properties of the connection to or from another port: policy, priority and
/// thread.
async fn told(port: &Port, peer: &str) -> (i32, i32, i32) {
    let answer = bottle(&ask(port, &bottle(&format!("[prop] [get] {peer}"))).await);
    let schedule = answer.find("sched").and_then(Value::as_list);
    let schedule = schedule.unwrap_or_else(|| panic!("{answer}"));
    let number = |key| schedule.find(key).and_then(Value::as_i32).unwrap();
    (number("policy"), number("priority"), number("tid"))
}

async fn set(port: &Port, peer: &str, wanted: &str) -> String {
    ask(port, &bottle(&format!("[prop] [set] {peer} {wanted}"))).await
}

/// For batches, without priorities.
const BATCH: &str = "(sched ((policy 3) (priority 0)))";
const REAL_TIME: &str = "(sched ((priority 30) (policy 1)))";

/// Waits until a thread of this process has ended.
async fn gone(thread: i32) {
    let path = format!("/proc/self/task/{thread}");
    until(|| !std::fs::exists(&path).unwrap()).await;
}

/// Returns the policy of a thread according to the system. Source: proc(5), field 41 of `stat`.
fn policy_of(thread: i32) -> i32 {
    let stat = std::fs::read_to_string(format!("/proc/self/task/{thread}/stat")).unwrap();
    // The name before may hold anything.
    let (_, fields) = stat.rsplit_once(") ").unwrap();
    fields.split(' ').nth(41 - 3).unwrap().parse().unwrap()
}

/// Returns the number of the thread that asks.
fn this_thread() -> i32 {
    let path = std::fs::read_link("/proc/thread-self").unwrap();
    path.file_name().unwrap().to_str().unwrap().parse().unwrap()
}

async fn pair(carrier: &str) -> (Port, Port) {
    let reader = open("/rd", PortOptions::new().queue(Queue::Wait(64))).await;
    let writer = open("/wr", PortOptions::new()).await;
    connect(&writer, &reader, carrier).await;
    until(|| reader.inputs().contains(&"/wr".to_owned())).await;
    (writer, reader)
}

#[tokio::test]
async fn both_ends_of_a_connection_move_and_go_on() {
    for carrier in [
        "tcp",
        "fast_tcp",
        "text",
        "text_ack",
        "udp",
        "unix_stream",
        "shmem",
    ] {
        let (writer, reader) = pair(carrier).await;
        let mut threads = Vec::new();
        within(writer.write(&Bottle::of(1))).await;
        assert_eq!(next(&reader).await, "1", "{carrier}");
        for (port, peer) in [(&writer, "/rd"), (&reader, "/wr")] {
            assert_eq!(told(port, peer).await.2, -1, "{carrier}");
            assert_eq!(set(port, peer, BATCH).await, "[ok]", "{carrier}");
            let (policy, priority, thread) = told(port, peer).await;
            assert_eq!((policy, priority), (3, 0), "{carrier}");
            assert_eq!(policy_of(thread), 3, "{carrier}");
            threads.push(thread);
            // Again is on the same thread.
            assert_eq!(set(port, peer, "(sched ((policy 0)))").await, "[ok]");
            assert_eq!(told(port, peer).await, (0, 0, thread), "{carrier}");
        }
        for number in 2..50 {
            within(writer.write(&Bottle::of(number))).await;
            assert_eq!(next(&reader).await, number.to_string(), "{carrier}");
        }
        within(writer.disconnect("/rd")).await;
        until(|| reader.inputs().is_empty()).await;
        for thread in threads {
            gone(thread).await;
        }
    }
}

/// Messages in transit during the move stay whole and in order.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nothing_is_lost_while_they_move() {
    for carrier in ["tcp", "fast_tcp", "unix_stream"] {
        let (writer, reader) = pair(carrier).await;
        let writer = Arc::new(writer);
        let writing = tokio::spawn({
            let writer = writer.clone();
            async move {
                for number in 0..3000 {
                    let padding = "x".repeat(number as usize % 700);
                    writer
                        .write(&Bottle::from_iter([number.into(), padding.into()]))
                        .await;
                }
            }
        });
        let moving = async {
            assert_eq!(set(&writer, "/rd", BATCH).await, "[ok]");
            assert_eq!(set(&reader, "/wr", BATCH).await, "[ok]");
        };
        let reading = async {
            for number in 0..3000 {
                let message = within(reader.read()).await.unwrap().bottle().unwrap();
                assert_eq!(message.get(0), Some(&Value::Int32(number)), "{carrier}");
            }
        };
        tokio::join!(reading, moving);
        within(writing).await.unwrap();
    }
}

/// A handler runs on the thread of its connection; its real-time priority does not spread.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn handlers_run_on_the_thread_of_their_connection() {
    let seen = Arc::new(Mutex::new((0, 0)));
    let handler = {
        let seen = seen.clone();
        move |_: &mut yarp_ports::Received| {
            let started = std::thread::spawn(|| policy_of(this_thread()));
            *seen.lock().unwrap() = (this_thread(), started.join().unwrap());
            Answer::reply(Bottle::of("done"))
        }
    };
    let server = open("/rd", PortOptions::new().handler(handler)).await;
    let client = open("/wr", PortOptions::new().rpc_client()).await;
    connect(&client, &server, "tcp").await;
    let call = async || {
        let reply: Bottle = client.call(&Bottle::of("now")).await.unwrap();
        assert_eq!(reply.to_string(), "done");
    };
    call().await;
    assert_eq!(set(&server, "/wr", BATCH).await, "[ok]");
    let (_, _, thread) = told(&server, "/wr").await;
    // It moves between messages.
    within(async {
        while seen.lock().unwrap().0 != thread {
            call().await;
        }
    })
    .await;
    if set(&server, "/wr", REAL_TIME).await == "[ok]" {
        assert_eq!(told(&server, "/wr").await, (1, 30, thread));
        call().await;
        assert_eq!(*seen.lock().unwrap(), (thread, 0));
    }
}

#[tokio::test]
async fn real_time_scheduling_needs_privileges() {
    let (writer, reader) = pair("tcp").await;
    let answer = set(&writer, "/rd", REAL_TIME).await;
    match answer.as_str() {
        "[ok]" => {
            let (policy, priority, thread) = told(&writer, "/rd").await;
            assert_eq!((policy, priority, policy_of(thread)), (1, 30, 1));
        }
        refused => {
            assert!(refused.contains("CAP_SYS_NICE") && refused.contains("ulimit -r"));
            assert_eq!(told(&writer, "/rd").await, (-1, -1, -1));
        }
    }
    within(writer.write(&Bottle::of(1))).await;
    assert_eq!(next(&reader).await, "1");
}

#[tokio::test]
async fn a_moved_connection_closes_normally() {
    let peer_ends = |port: &Port| port.outputs().is_empty() && port.inputs().is_empty();
    for ending in ["writer closes", "reader closes", "displaced", "asked"] {
        let (writer, reader) = pair("tcp").await;
        let mut threads = Vec::new();
        for (port, peer) in [(&writer, "/rd"), (&reader, "/wr")] {
            assert_eq!(set(port, peer, BATCH).await, "[ok]");
            threads.push(told(port, peer).await.2);
        }
        match ending {
            "writer closes" => {
                within(writer.close()).await;
                until(|| peer_ends(&reader)).await;
            }
            "reader closes" => {
                within(reader.close()).await;
                until(|| peer_ends(&writer)).await;
            }
            "displaced" => {
                let other = open("/wr", PortOptions::new()).await;
                within(other.connect(&at(&reader, "tcp"))).await.unwrap();
                until(|| peer_ends(&writer)).await;
                until(|| reader.inputs() == ["/wr"]).await;
            }
            _ => {
                let removed = ask(&reader, &bottle("[del] /wr")).await;
                assert!(removed.contains("Removing connection"), "{removed}");
                until(|| peer_ends(&reader) && peer_ends(&writer)).await;
            }
        }
        for thread in threads {
            gone(thread).await;
        }
    }
}

/// A reader of JPEG images decodes them on a dedicated thread from the beginning; policies apply to
/// it.
#[tokio::test]
async fn a_reader_of_images_has_a_dedicated_thread() {
    let camera = open("/camera", PortOptions::new()).await;
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(4))).await;
    within(reader.connect(&at(&camera, "mjpeg"))).await.unwrap();
    until(|| camera.outputs() == ["null"]).await;
    let (policy, _, thread) = told(&reader, "/camera").await;
    assert_eq!(policy, 0);
    assert_eq!(set(&reader, "/camera", BATCH).await, "[ok]");
    assert_eq!(told(&reader, "/camera").await, (3, 0, thread));
    assert_eq!(policy_of(thread), 3);
    assert_eq!(set(&reader, "/camera", "(qos ((tos 40)))").await, "[ok]");
    let told = ask(&reader, &bottle("[prop] [get] /camera")).await;
    assert!(told.contains("(tos 40)"), "{told}");
    let image = Image::new(PixelCode::RGB, 16, 16).unwrap();
    assert_eq!(within(camera.write(&image)).await, 1);
    within(reader.read()).await.unwrap();
    within(camera.close()).await;
    until(|| reader.inputs().is_empty()).await;
    gone(thread).await;
}

#[tokio::test]
async fn connections_without_a_task_refuse_a_schedule() {
    let (writer, reader) = pair("local").await;
    for (port, peer) in [(&writer, "/rd"), (&reader, "/wr")] {
        let answer = set(port, peer, BATCH).await;
        assert!(answer.contains("within a process"), "{answer}");
    }
}
