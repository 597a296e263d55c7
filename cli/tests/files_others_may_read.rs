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
    let _server = home.serve();
    // A group may share the key and the roles of a lab; the key of a host belongs to it alone.
    for (file, group_is_warned_of) in [
        ("auth.conf", false),
        ("roles.conf", false),
        ("tls/host.key", true),
    ] {
        for (mode, expected) in [
            (0o600, false),
            (0o640, group_is_warned_of),
            (0o644, true),
            (0o660, true),
        ] {
            set_mode(file, mode);
            let ended = home.run("name list").with(0);
            let warnings = ended.err.iter().filter(|line| line.contains("chmod 600"));
            let warnings: Vec<_> = warnings.collect();
            assert_eq!(!warnings.is_empty(), expected, "{file} {mode:o}: {ended:?}");
            let told = warnings.iter().all(|line| line.contains(file));
            assert!(told, "{file} {mode:o}: {ended:?}");
        }
        set_mode(file, 0o600);
    }
}
