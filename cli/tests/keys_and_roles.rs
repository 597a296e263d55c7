//! Keys, roles, and the advertised address of a server in a container: files and options of `yarp
//! server`.

#![cfg(unix)]

use crate::common;

use common::Home;

fn write(home: &Home, file: &str, text: &str) {
    std::fs::write(home.path().join(file), text).unwrap();
}

#[test]
fn only_clients_with_the_key_are_served() {
    let home = Home::new();
    write(&home, "auth.conf", "[AUTH]\nkey \"my_secret_key\"\n");
    let server = home.serve();
    let reader = home.start("read /r").see("active at");
    home.run_with("write /w /r", "hello\n").with(0);
    let reader = reader.see("hello");
    for key in ["", "[AUTH]\nkey other\n"] {
        let stranger = Home::new();
        write(&stranger, "yarp.conf", &home.file("yarp.conf").unwrap());
        if !key.is_empty() {
            write(&stranger, "auth.conf", key);
        }
        let refused = stranger.run("name list").with(1);
        assert!(!refused.says("registration"), "{refused:?}");
        stranger.run("exists /r").with(1);
    }
    reader.signal("INT").finish();
    let ended = server.signal("INT").finish();
    assert!(
        !ended.err.iter().any(|line| line.contains("No auth.conf")),
        "{ended:?}"
    );
}

#[test]
fn an_unreadable_key_stops_every_command_and_is_not_printed() {
    let home = Home::new();
    write(&home, "auth.conf", "[AUTH]\nkey (secret)\n");
    for line in ["name list", "read /r", "server --local"] {
        let ended = home.run(line).with(1);
        let errors: Vec<&String> = ended
            .err
            .iter()
            .filter(|line| line.starts_with("[ERROR]"))
            .collect();
        assert_eq!(errors.len(), 1, "{ended:?}");
        assert!(errors[0].contains("auth.conf:2"), "{ended:?}");
        assert!(!ended.err.concat().contains("secret"), "{ended:?}");
        // The file was written without care for its mode.
        assert!(ended.err[0].contains("chmod 600"), "{ended:?}");
    }
}

#[test]
fn an_open_server_logs_a_warning() {
    let home = Home::new();
    let ended = home.serve().signal("INT").finish();
    let told = ended
        .err
        .iter()
        .filter(|line| line.contains("No auth.conf"));
    assert_eq!(told.count(), 1, "{ended:?}");
}

#[test]
fn roles_can_be_changed_at_run_time() {
    let home = Home::new();
    let roles = "[nobody]\nports /closed /r\nrights none\n";
    write(&home, "roles.conf", roles);
    let _server = home.serve();
    let refused = home.run("read /closed").with(1);
    let told = refused
        .err
        .iter()
        .any(|line| line.contains("no right to administer on /closed"));
    assert!(told, "{refused:?}");
    write(
        &home,
        "roles.conf",
        "[all]\nports /closed\nat local\nrights all\n",
    );
    let _reader = home.start("read /closed").see("active at");
    home.run("exists /closed").with(0);
}

#[test]
fn a_server_advertises_its_address_and_uses_its_port_range() {
    let home = Home::new();
    let _server = home.start("server --local --advertise 203.0.113.7 --ports 31000-31999");
    // It can be reached at its local addresses.
    let range = home.range();
    home.run(&format!("conf 127.0.0.1 {range}")).with(0);
    let list = home.run_until("name list", "name /root ip 203.0.113.7 ");
    assert!(list.says(&format!("port {range} type tcp")), "{list:?}");
    let reader = home.start("read /r").see("active at");
    let place = home.run("name query /r").with(0);
    let number = place.out[0]
        .split(' ')
        .nth(6)
        .and_then(|word| word.parse().ok());
    assert!(
        number.is_some_and(|number: u16| (31000..32000).contains(&number)),
        "{place:?}"
    );
    drop(reader);
    for range in ["1", "5-4", "0-10", "x"] {
        home.run(&format!("server --local --ports {range}")).with(1);
    }
}
