//! Files with keys and roles that other users may read: a warning names the file and the remedy.

#![cfg(all(unix, feature = "tls"))]

use crate::common;

use std::fs;
use std::os::unix::fs::PermissionsExt;

use common::Home;

/// Nothing was said of an `auth.conf` that every user could read.
#[test]
fn keys_and_roles_that_every_user_may_read_are_warned_of() {
    let home = Home::new();
    home.run("keys init").with(0);
    let texts = [
        ("auth.conf", "[AUTH]\nkey \"a key of the lab\"\n"),
        (
            "roles.conf",
            "[nobody]\nports /closed\nat local\nrights none\n",
        ),
    ];
    let set_mode = |file: &str, mode| {
        let path = home.path().join(file);
        fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    };
    for (file, text) in texts {
        fs::write(home.path().join(file), text).unwrap();
        set_mode(file, 0o600);
    }
    let modes = [(0o600, false), (0o640, false), (0o644, true), (0o660, true)];
    let check = |file: &str, mode, expected, log: &[String]| {
        let mut warnings = log.iter().filter(|line| line.contains("chmod 600"));
        let told = warnings.clone().all(|line| line.contains(file));
        let is_warned_of = warnings.next().is_some();
        assert!(told && is_warned_of == expected, "{file} {mode:o}: {log:?}");
    };
    // The server looks at roles, and again whenever the file changes.
    for (mode, expected) in modes {
        set_mode("roles.conf", mode);
        let server = home.serve();
        home.run("name list").with(0);
        let ended = server.signal("INT").finish();
        check("roles.conf", mode, expected, &ended.err);
    }
    set_mode("roles.conf", 0o600);
    // A group may share the key of a lab; the key of a host belongs to it alone.
    let _server = home.serve();
    for file in ["auth.conf", "tls/host.key"] {
        for (mode, expected) in modes {
            let expected = expected || mode == 0o640 && file == "tls/host.key";
            set_mode(file, mode);
            let ended = home.run("name list").with(0);
            check(file, mode, expected, &ended.err);
        }
        set_mode(file, 0o600);
    }
}
