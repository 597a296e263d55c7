//! `yarp resource` finds files of contexts, robots and packages. `conformance/live/resources.py`
//! compares it with stock.

#![cfg(unix)]

use crate::common;

use std::path::Path;
use std::process::Command;

use common::Home;

const FILES: [&str; 8] = [
    "here/a.ini",
    "here/near.ini",
    "a.ini",
    "robots/wam/r.ini",
    "contexts/app/c.ini",
    "contexts/app/near.ini",
    "data/d.ini",
    "package/p.ini",
];

fn write(home: &Path, file: &str, text: &str) {
    let file = home.join(file);
    std::fs::create_dir_all(file.parent().unwrap()).unwrap();
    std::fs::write(file, text).unwrap();
}

#[test]
fn in_the_order_of_stock() {
    let home = Home::new();
    for file in FILES {
        write(home.path(), file, &format!("at {file}\n"));
    }
    let package = format!("[search one]\npath {}/package\n", home.path().display());
    write(home.path(), "shared/config/path.d/one.ini", &package);
    let ask = |line: &str, robot: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_yarp"));
        command
            .args(line.split(' '))
            .env("YARP_ROBOT_NAME", robot)
            .env("YARP_DATA_DIRS", home.path().join("shared"))
            .current_dir(home.path().join("here"));
        home.spawn(command, line).finish()
    };
    let check = |line: &str, robot: &str, expected: &str| {
        let ended = ask(line, robot).with(0);
        let expected = match expected {
            "" => "\"\"".to_owned(),
            // The directory may have another name.
            file => format!("/{file}\""),
        };
        assert!(ended.out[0].ends_with(&expected), "{line}: {ended:?}");
    };
    check("resource --find a.ini", "", "here/a.ini");
    check("resource --find r.ini", "wam", "robots/wam/r.ini");
    check("resource --find r.ini", "other", "");
    check(
        "resource --context app --find c.ini",
        "",
        "contexts/app/c.ini",
    );
    check("resource --find c.ini", "", "");
    check("resource --find d.ini", "", "data/d.ini");
    check("resource --find p.ini", "", "package/p.ini");
    // In the folder of the main file, contexts are ignored.
    check(
        "resource --context app --from near.ini",
        "",
        "here/near.ini",
    );
    let shown = ask("resource --from near.ini --show --at me", "").with(0);
    assert!(shown.says("(at me) (from near.ini)"), "{shown:?}");
    let missing = ask("resource --from none.ini", "").with(1);
    assert!(
        missing.err[0].contains("cannot find none.ini in any of"),
        "{missing:?}"
    );
    assert!(home.run("resource").with(0).says("Example usage:"));
}
