//! `yarp keys`, and networks whose connections are encrypted.

#![cfg(all(unix, feature = "tls"))]

use crate::common;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use common::Home;

fn mode(path: &Path) -> u32 {
    fs::metadata(path).unwrap().permissions().mode() & 0o777
}

/// Copies what is in a configuration folder to another.
fn copy(from: &Path, to: &Path) {
    for name in [
        "tls.conf",
        "tls/authority.pem",
        "tls/host.pem",
        "tls/host.key",
    ] {
        fs::create_dir_all(to.join("tls")).unwrap();
        fs::copy(from.join(name), to.join(name)).unwrap();
    }
}

#[test]
fn keys_are_made_and_kept_from_others() {
    let home = Home::new();
    let made = home.run("keys init").with(0);
    assert!(made.says("tls.conf"), "{made:?}");
    let file = |name: &str| home.path().join(name);
    assert_eq!(mode(&file("tls")), 0o700);
    for key in ["tls/authority.key", "tls/host.key"] {
        assert_eq!(mode(&file(key)), 0o600, "{key}");
    }
    let before = home.file("tls/host.pem").unwrap();
    // Neither replaces what is there.
    assert!(home.run("keys init").with(1).says("is there already"));
    assert_eq!(home.file("tls/host.pem").unwrap(), before);
    let out = home.path().join("other");
    let line = format!("keys host arm-pc --out {}", out.display());
    home.run(&line).with(0);
    assert_eq!(mode(&out.join("tls/host.key")), 0o600);
    assert!(!out.join("tls/authority.key").exists());
    assert!(home.run(&line).with(1).says("is there already"));
    home.run("keys renew").with(0);
    assert_ne!(home.file("tls/host.pem").unwrap(), before);
    let empty = Home::new();
    assert!(empty.run("keys renew").with(1).says("yarp keys init"));
}

#[test]
fn ports_of_two_hosts_connect_over_tls() {
    let (home, other) = (Home::new(), Home::new());
    home.run("keys init").with(0);
    let out = home.path().join("other");
    home.run(&format!("keys host arm-pc --out {}", out.display()))
        .with(0);
    let _server = home.serve();
    copy(&out, other.path());
    fs::copy(
        home.path().join("yarp.conf"),
        other.path().join("yarp.conf"),
    )
    .unwrap();
    let mut reader = home.start("read /r").see("Port /r active");
    let mut writer = other.start("write /w").see("Port /w active");
    home.run("connect /w /r tls").with(0);
    writer.reaches(&mut reader, "hello");
    assert!(
        reader
            .printed()
            .iter()
            .any(|line| line.contains("using tls"))
    );
    // A stranger's authority.
    let stranger = Home::new();
    stranger.run("keys init").with(0);
    fs::copy(
        home.path().join("yarp.conf"),
        stranger.path().join("yarp.conf"),
    )
    .unwrap();
    let _writer = stranger
        .start("write /stranger")
        .see("Port /stranger active");
    home.run("connect /stranger /r tls").with(1);
}

#[test]
fn a_name_server_can_require_encryption() {
    let (home, plain) = (Home::new(), Home::new());
    home.run("keys init --required").with(0);
    let settings = home.file("tls.conf").unwrap();
    assert!(settings.contains("required others"), "{settings}");
    // The tests have one machine.
    let settings = settings.replace("required others", "required all");
    fs::write(home.path().join("tls.conf"), settings).unwrap();
    let _server = home.serve();
    fs::copy(
        home.path().join("yarp.conf"),
        plain.path().join("yarp.conf"),
    )
    .unwrap();
    home.run("where").with(0);
    let mut reader = home.start("read /r").see("Port /r active");
    let mut writer = home.start("write /w /r").see("Port /w active");
    writer.reaches(&mut reader, "hello");
    assert_eq!(home.names().len(), 2);
    plain.run("where").with(1);
    let refused = plain.run("name register /x tcp 127.0.0.1 12345");
    assert_ne!(refused.code, Some(0), "{refused:?}");
    assert_eq!(home.names().len(), 2);
    // A member of another lab is none of this.
    plain.run("keys init --required").with(0);
    plain.run("where").with(1);
}

#[test]
fn damaged_settings_are_told_and_nothing_goes_on_in_plain() {
    let home = Home::new();
    let _server = home.serve();
    home.run("keys init").with(0);
    let settings = home.file("tls.conf").unwrap();
    let check = |settings: &str, expected: &str| {
        fs::write(home.path().join("tls.conf"), settings).unwrap();
        home.run("name list").with(1).complains(expected);
    };
    check(
        &settings.replace("tls/host.pem", "tls/none.pem"),
        "tls.conf:3",
    );
    check(
        &settings.replace("certificate", "certificat"),
        "certificate FILE",
    );
    check(
        &format!("{settings}required some\n"),
        "`required others` or `required all`",
    );
    fs::write(home.path().join("tls/host.key"), "no key").unwrap();
    check(&settings, "no private key in it");
}

#[test]
fn a_key_that_others_may_read_is_warned_of() {
    let home = Home::new();
    let _server = home.serve();
    home.run("keys init").with(0);
    let key = home.path().join("tls/host.key");
    let warns = |expected: bool| {
        let ended = home.run("name list").with(0);
        let warned = ended.err.iter().any(|line| line.contains("chmod 600"));
        assert_eq!(warned, expected, "{ended:?}");
    };
    warns(false);
    fs::set_permissions(&key, fs::Permissions::from_mode(0o644)).unwrap();
    warns(true);
}
