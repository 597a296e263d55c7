//! `yarp plugin` lists what is built in.

use crate::common;

use common::Home;

#[test]
fn carriers_monitors_and_devices_are_listed() {
    let home = Home::new();
    let listed = home.run("plugin --list").with(0).out;
    assert!(listed.is_sorted(), "{listed:?}");
    let all = home.run("plugin --all").with(0);
    for (kind, name) in [
        ("carrier", "tcp"),
        ("carrier", "shmem"),
        ("carrier", "portmonitor"),
        ("carrier", "bayer"),
        ("device", "fakeMotionControl"),
        ("device", "deviceBundler"),
        ("device", "controlBoard_nwc_yarp"),
    ] {
        assert!(listed.iter().any(|line| line == name), "{name}: {listed:?}");
        assert!(
            all.out.contains(&format!("{kind} {name}")),
            "{name}: {all:?}"
        );
        let told = home.run(&format!("plugin {name}")).with(0);
        assert_eq!(told.out[0], "Yes, this is a YARP plugin");
    }
    assert!(all.out.iter().any(|line| line.starts_with("portmonitor ")));
}

#[test]
fn unknown_plugins_are_reported() {
    let home = Home::new();
    for line in ["plugin nonsense", "plugin /some/libyarp_shmem.so shmem"] {
        let ended = home.run(line).with(1);
        let told = [
            "[ERROR] cannot find a plugin with the specified name",
            "[ERROR]     Cannot find or load shared library",
        ];
        assert_eq!(ended.out, told, "{line}");
    }
    assert_eq!(
        home.run("plugin --search-path").with(1).out,
        ["No search path."]
    );
}
