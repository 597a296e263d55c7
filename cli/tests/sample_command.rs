//! `yarp sample` forwards the latest message at a constant rate.

use crate::common;

use common::Home;

#[test]
fn the_latest_message_is_repeated() {
    let home = Home::new();
    let _server = home.serve();
    let reader = home.start("read /r").see("Port /r active at");
    let sampler = home
        .start("sample --output /s --rate 50")
        .see("Port /s active at");
    home.run("connect /s /r").with(0);
    // Before the first message there are empty ones.
    let reader = reader.see_often("", 2);
    home.run_with("write /w /s", "hello (a b)\n").with(0);
    drop(reader.see_often("hello (a b)", 3));
    sampler.signal("INT").finish().with(0);
}

#[test]
fn messages_in_between_are_dropped() {
    const COUNT: usize = 1000;
    let home = Home::new();
    let _server = home.serve();
    let mut writer = home.start("write /w").see("Port /w active at");
    let line = "sample --input /w --output /s --period 0.2 --carrier tcp --show";
    let sampler = home
        .start(line)
        .see("Receiving input from /w to /s using tcp");
    writer = writer.see("Sending output from /w to /s");
    let numbers: String = (0..COUNT)
        .map(|number| format!("number {number}\n"))
        .collect();
    writer.type_text(&numbers);
    let last = format!("number {}", COUNT - 1);
    let ended = sampler.see(&last).signal("TERM").finish().with(0);
    let mut shown: Vec<_> = ended
        .out
        .iter()
        .filter(|line| line.starts_with("number "))
        .collect();
    shown.dedup();
    // At five per second, all of them would exceed the timeout.
    assert!(shown.len() < COUNT, "{} of {COUNT}", shown.len());
}

#[test]
fn a_port_that_cannot_open_is_reported() {
    let ended = Home::new().run("sample --output s --rate 5").with(1);
    assert_eq!(ended.out, ["[ERROR] Failed to open output port"]);
}
