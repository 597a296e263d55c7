//! `yarp robotinterface --strict` reports what stock reads without a word and is most likely a mistake.

#![cfg(unix)]

use crate::common;

use common::Home;

/// Returns a description with `device` inside the element of a device, in line 3.
fn around(device: &str) -> String {
    format!(
        "<robot name=\"r\" build=\"1\" portprefix=\"r\">\n<device name=\"arm\" type=\"simulatedWam\"/>\n<device name=\"d\" type=\"simulatedWam\">{device}</device>\n</robot>\n"
    )
}

fn home(text: &str) -> (Home, String) {
    let home = Home::new();
    let file = home.path().join("r.xml");
    std::fs::write(&file, text).unwrap();
    (home, file.display().to_string())
}

#[test]
fn each_lint_has_file_and_line() {
    for (text, expected) in [
        (
            around("<group name=\"g\" x:a=\"\"><param name=\"p\">1</param></group>"),
            "r.xml:3: prefix x of x:a is not declared, expected xmlns:x=\"...\"",
        ),
        (
            around("").replace("build=\"1\"", "build=1"),
            "r.xml:1: the value of attribute build is not quoted",
        ),
        (
            around("").replace("build=\"1\" ", "build=\"1\""),
            "r.xml:1: no blank after the value of attribute build",
        ),
        (
            around("").replace("build=\"1\"", "build=\"b\""),
            "r.xml:1: expected a whole number from 0 as build, got b",
        ),
        (
            around("").replace(" portprefix=\"r\"", ""),
            "r.xml:1: no attribute portprefix in <robot>: its name is used",
        ),
        (
            around("").replace("build", "biuld"),
            "r.xml:1: attribute biuld of <robot> is not read, expected name, build, portprefix",
        ),
        (around("\n<!-- a -- b -->"), "r.xml:4: -- inside a comment"),
        (
            around("\n<?xml version=\"1.0\"?>"),
            "r.xml:4: an XML declaration has to be at the beginning of the file",
        ),
        (
            around("\n<1>"),
            "r.xml:4: expected a name after <, got \"<1>\": the tag is passed over",
        ),
        (
            around("") + "</robot>",
            "r.xml:5: expected a name after <, got \"</robot>\": the tag is passed over",
        ),
        (
            around("") + "<robot/>",
            "r.xml:5: an element after the root element is passed over",
        ),
        (
            around("") + "more",
            "r.xml:5: text after the root element: nothing after it is read",
        ),
        (
            around("<param name=\"p\">a & b</param>"),
            "r.xml:3: expected &amp; or another entity, got &, which is dropped",
        ),
        (
            around("<param name=\"p\">a b (c</param>"),
            "r.xml:3: brackets or quotes of parameter p do not close: it is lost",
        ),
        (
            around("<param name=\"p\">a<b/></param>"),
            "r.xml:3: elements in <param name=\"p\"> are not read",
        ),
        (
            around("two <param name=\"p\">a</param>"),
            "r.xml:3: the text in <device> is not read",
        ),
        (
            around("<action phase=\"start\" level=\"1\" type=\"detach\"/>"),
            "r.xml:3: there is no phase start: the action never runs",
        ),
        (
            around("").replace("\"d\"", "\"arm\""),
            "r.xml:3: device arm is defined already, at",
        ),
        (
            around("<param name=\"p\">1</param>\n<param name=\"p\">2</param>"),
            "r.xml:4: parameter p of device d is given already, at",
        ),
        (
            around(
                "<group name=\"g\"><param name=\"p\">1</param>\n<param name=\"p\">2</param></group>",
            ),
            "r.xml:4: parameter p of group g of device d is given already, at",
        ),
        (
            around(
                "<action phase=\"startup\" level=\"1\" type=\"attach\"><param name=\"device\">d</param></action>",
            ),
            "r.xml:3: device d attaches to itself",
        ),
        (
            around(
                "<action phase=\"startup\" level=\"1\" type=\"attach\"><param name=\"device\">leg</param></action>",
            ),
            "r.xml:3: attach action of device d: there is no device leg",
        ),
    ] {
        let (home, file) = home(&text);
        let line = format!("robotinterface --dryrun --strict --config {file}");
        let ended = home.run(&line).with(1);
        ended.complains(expected);
        // What a start would report too is counted twice.
        let count = if expected.contains("parameter p of device d is given") {
            2
        } else {
            1
        };
        ended.complains(&format!(
            "{count} problems found: expected none with --strict"
        ));
        // Without the option the description is read as stock reads it.
        if !expected.contains("given already") {
            home.run(&format!("robotinterface --dryrun --config {file}"))
                .with(0);
        }
    }
}

#[test]
fn a_clean_description_passes_and_lints_are_json() {
    let clean = around("<param name=\"p\">1</param>")
        .replace(
            "<robot",
            "<robot xmlns:xi=\"http://www.w3.org/2001/XInclude\"",
        )
        .replace("</robot>", "<xi:include href=\"part.xml\"/></robot>");
    let (home, file) = home(&clean);
    let part = home.path().join("part.xml");
    std::fs::write(&part, "<?xml version=\"1.0\"?>\n<devices/>\n").unwrap();
    let line = format!("robotinterface --dryrun --strict --json --config {file}");
    let lints = |code: i32| -> serde_json::Value {
        let text = home.run(&line).with(code).out;
        let begin = text.iter().position(|line| line == "{").unwrap();
        let whole: serde_json::Value = serde_json::from_str(&text[begin..].join("\n")).unwrap();
        whole["lints"].clone()
    };
    assert_eq!(lints(0), serde_json::json!([]));
    std::fs::write(&part, "<devices x=1/>\n").unwrap();
    let at = format!("{}:1", part.display());
    let expected = serde_json::json!([
        {"origin": at, "what": "the value of attribute x is not quoted"},
        {"origin": at, "what": "attribute x of <devices> is not read, expected file, robot, build"},
    ]);
    assert_eq!(lints(1), expected);
    // Nor does such a robot start.
    let ended = home.run(&line.replace(" --dryrun", "")).with(1);
    ended.complains("2 problems found: expected none with --strict");
}

/// A long file of mistakes costs little memory.
#[test]
fn lints_are_bounded() {
    let (home, file) = home(&around(&format!(
        "<param name=\"p\">a {}</param>",
        "& ".repeat(10_000)
    )));
    let line = format!("robotinterface --dryrun --strict --config {file}");
    home.run(&line)
        .with(1)
        .complains("200 problems found: expected none with --strict");
    let devices = "<device name=\"arm\" type=\"simulatedWam\"/>".repeat(2_000);
    std::fs::write(
        &file,
        around("").replace("</robot>", &format!("{devices}</robot>")),
    )
    .unwrap();
    home.run(&line)
        .with(1)
        .complains("1000 problems found: expected none with --strict");
}
