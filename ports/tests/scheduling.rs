//! All threads of a process are scheduled as an administrator of one of its ports requests, if the
//! system allows it; otherwise the reason is reported. In a process of its own, as the request
//! applies to the whole process.

mod common;

use common::{ask, bottle, open, until};
use yarp_ports::{Port, PortOptions};
use yarp_wire::Value;

/// Returns policy and priority of a thread according to the system. Source: proc(5), fields 40 and
/// 41 of `stat`.
fn of_thread(stat: &str) -> Option<(i32, i32)> {
    // The name before them may hold anything.
    let (_, fields) = stat.rsplit_once(") ")?;
    let mut fields = fields.split(' ').skip(40 - 3);
    let mut number = || fields.next()?.parse::<i32>().ok();
    let priority = number()?;
    Some((number()?, priority))
}

/// Those of all threads of this process.
fn of_all_threads() -> Vec<(i32, i32)> {
    let threads = std::fs::read_dir("/proc/self/task").unwrap();
    let stats = threads
        .filter_map(|thread| std::fs::read_to_string(thread.unwrap().path().join("stat")).ok());
    stats.map(|stat| of_thread(&stat).unwrap()).collect()
}

/// Policy and priority as the port tells them.
async fn told(port: &Port) -> (i32, i32) {
    let answer = bottle(&ask(port, &bottle("[prop] [get] /p")).await);
    let process = answer.find("process").and_then(Value::as_list).unwrap();
    let number = |key| process.find(key).and_then(Value::as_i32).unwrap();
    (number("policy"), number("priority"))
}

async fn set(port: &Port, policy: i32, priority: i32) -> String {
    let wanted = format!("(process ((policy {policy}) (priority {priority})))");
    ask(port, &bottle(&format!("[prop] [set] /p {wanted}"))).await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn threads_are_scheduled_where_the_system_allows_it() {
    let port = open("/p", PortOptions::new()).await;
    let before = told(&port).await;
    // For batches: needs no privilege, and can be undone.
    assert_eq!(set(&port, 3, 0).await, "[ok]");
    assert_eq!(told(&port).await, (3, 0));
    until(|| of_all_threads().iter().all(|thread| *thread == (3, 0))).await;
    assert!(of_all_threads().len() > 2);
    let partly = bottle("[prop] [set] /p (process ((priority 0)))");
    assert_eq!(ask(&port, &partly).await, "[ok]");
    assert_eq!(told(&port).await, (3, 0));

    // For real time: a matter of rights.
    let answer = set(&port, 2, 7).await;
    let allowed = answer == "[ok]";
    let expected = if allowed { (2, 7) } else { (3, 0) };
    assert!(allowed || answer.contains("CAP_SYS_NICE"), "{answer}");
    assert_eq!(told(&port).await, expected);
    until(|| of_all_threads().iter().all(|thread| *thread == expected)).await;

    for (policy, priority) in [(3, 5), (77, 0), (1, 100), (1, 0)] {
        let answer = set(&port, policy, priority).await;
        assert!(answer.contains("no such policy"), "{answer}");
    }
    assert_eq!(told(&port).await, expected);

    assert_eq!(set(&port, before.0, before.1).await, "[ok]");
    assert_eq!(told(&port).await, before);
    until(|| of_all_threads().iter().all(|thread| *thread == before)).await;
}
