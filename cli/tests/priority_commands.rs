//! `yarp priority-qos` and `yarp priority-sched` on connections between processes.

use crate::common;

use common::{Home, Running};

/// Starts a writer `/w` that is connected to a reader `/r`.
fn connected(home: &Home) -> [Running; 3] {
    let server = home.serve();
    let reader = home.start("read /r").see("active at");
    let writer = home.start("write /w").see("active at");
    home.run("connect /w /r").with(0);
    [server, reader, writer]
}

/// Returns the answer of the port `/w` to an administration request.
#[track_caller]
fn ask_writer(home: &Home, request: &str) -> Vec<String> {
    home.run_with("admin rpc /w", &format!("{request}\n"))
        .with(0)
        .out
}

#[test]
fn packets_have_the_priority_that_was_set() {
    let home = Home::new();
    let _running = connected(&home);
    let get = |words: &str| {
        home.run(&format!("priority-qos get /w /r{words}"))
            .with(0)
            .out
    };
    assert_eq!(get(""), ["(src (qos ((tos 0)))) (des (qos ((tos 0))))"]);
    for (value, service, level) in [
        ("LEVEL:HIGH", 144, "HIGH"),
        ("DSCP:AF11", 40, "LOW"),
        ("TOS:176", 176, "CRIT"),
    ] {
        home.run(&format!("priority-qos set /w /r --src {value}"))
            .with(0);
        let told = format!("(src (qos ((tos {service})))) (des (qos ((tos 0))))");
        assert_eq!(get(""), [told]);
        let told = format!("(src (qos ((level {level}))))");
        assert_eq!(get(" --src --level"), [told]);
        // The value of the connection's socket option.
        let answer = ask_writer(&home, "[prop] [get] /r");
        let service = format!("(qos ((tos {service})))");
        assert!(answer.concat().contains(&service), "{answer:?}");
    }
    home.run("priority-qos set /w /r --des 8").with(0);
    assert_eq!(get(""), ["(src (qos ((tos 176)))) (des (qos ((tos 8))))"]);

    for (words, complaint) in [
        ("set /w /r --src DSCP:99", "invalid value"),
        ("set /w /nobody --src 8", "/nobody not found"),
        ("get /w /r --colour", "Do not know what"),
    ] {
        let ended = home.run(&format!("priority-qos {words}")).with(1);
        assert!(ended.says(complaint), "{ended:?}");
    }
    assert_eq!(get(""), ["(src (qos ((tos 176)))) (des (qos ((tos 8))))"]);
}

#[test]
fn the_thread_of_a_connection_is_scheduled_where_the_system_allows_it() {
    let home = Home::new();
    let _running = connected(&home);
    let get = || home.run("priority-sched get /w /r").with(0).out;
    let before = get();
    let usual = "(src (sched ((policy -1) (priority -1))))(des (sched ((policy 0) (priority 0))))";
    assert_eq!(before, [usual]);
    let ended = home.run("priority-sched set /w /r --des POL:SCHED_FIFO");
    match ended.code {
        Some(0) => {
            assert!(get()[0].ends_with("(des (sched ((policy 1) (priority 1))))"));
            home.run("priority-sched set /w /r --des PRT:30").with(0);
            assert!(get()[0].ends_with("(des (sched ((policy 1) (priority 30))))"));
        }
        _ => {
            assert!(ended.says("CAP_SYS_NICE"), "{ended:?}");
            assert_eq!(get(), before);
        }
    }

    // All threads of the process: every user may set the batch policy.
    let wanted = "[prop] [set] /w (process ((policy 3) (priority 0)))";
    let answer = ask_writer(&home, wanted).concat();
    assert!(answer.contains("[ok]"), "{answer}");
    let answer = ask_writer(&home, "[prop] [get] /w").concat();
    assert!(answer.contains("(policy 3)"), "{answer}");
    let answer = ask_writer(
        &home,
        "[prop] [set] /w (process ((policy 77) (priority 0)))",
    );
    assert!(answer.concat().contains("no such policy"), "{answer:?}");
}
