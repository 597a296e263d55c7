use std::net::Ipv4Addr;
use std::time::Duration;

use proptest::prelude::*;
use yarp_wire::bottle::{Bottle, Value};
use yarp_wire::name_service::END;

use super::*;

/// A registry that receives requests line by line from 127.0.0.1.
struct Asked {
    registry: Registry,
    now: Instant,
}

impl Asked {
    /// Creates the server from which the expected answers were recorded: 192.0.2.2, port 10310.
    fn new() -> Self {
        let registry = Registry::new(Settings::at("192.0.2.2", 10310));
        let now = Instant::now();
        Self { registry, now }
    }

    /// Creates a registry after requests whose answers are not checked.
    fn after(lines: &[&str]) -> Self {
        let mut asked = Self::new();
        for line in lines {
            asked.reply(line);
        }
        asked
    }

    fn reply(&mut self, line: &str) -> Reply {
        let request = Request::parse(line).unwrap();
        let from = Some(Ipv4Addr::LOCALHOST.into());
        self.registry.handle(self.now, from, &request)
    }

    /// Sends a request and compares the answer; lines are joined by `|`, the closing one is written
    /// as `.`.
    #[track_caller]
    fn check(&mut self, line: &str, expected: &str) {
        let body = match self.reply(line).body {
            Body::Lines(lines) => lines.iter().collect::<Vec<_>>().join("|").replace(END, "."),
            Body::Bottle(bottle) => bottle.to_string(),
        };
        assert_eq!(body, expected, "{line}");
    }

    /// Checks the answer to a registration, abbreviated to `NAME HOST PORT CARRIER`.
    #[track_caller]
    fn check_place(&mut self, line: &str, expected: &str) {
        let [name, host, port, carrier] = match expected.split(' ').collect::<Vec<_>>()[..] {
            [name, host, port, carrier] => [name, host, port, carrier],
            _ => panic!("four words, not {expected:?}"),
        };
        let expected = format!("registration name {name} ip {host} port {port} type {carrier}|.");
        self.check(line, &expected);
    }

    #[track_caller]
    fn check_effects(&mut self, line: &str, expected: &[&str]) {
        let effects = self.reply(line).effects;
        let effects: Vec<_> = effects.iter().map(brief).collect();
        assert_eq!(effects, expected, "{line}");
    }
}

fn brief(effect: &Effect) -> String {
    let link = |link: &Link| {
        let (from, to) = (&link.source.name, &link.destination.name);
        format!("{from} {to} {}", link.carrier)
    };
    match effect {
        Effect::Added(name) => format!("add {name}"),
        Effect::Removed(name) => format!("del {name}"),
        Effect::Connect(held) => format!("connect {}", link(held)),
        Effect::Disconnect(held) => format!("disconnect {}", link(held)),
    }
}

#[test]
fn the_server_lists_itself() {
    let mut asked = Asked::new();
    asked.check(
        "list",
        "registration name /root ip 192.0.2.2 port 10310 type tcp|\
         registration name fallback ip 224.2.1.1 port 10000 type mcast|.",
    );
    asked.check(
        "bot list",
        r#"ports (port (name "/root") (ip "192.0.2.2") (port_number 10310) (carrier tcp)) (port (name fallback) (ip "224.2.1.1") (port_number 10000) (carrier mcast))"#,
    );
    asked.check(
        "get /root nameserver",
        "port /root property nameserver = true|.",
    );
}

#[test]
fn unknown_commands_get_the_closing_line() {
    for line in [
        "nonsense",
        "",
        "bot",
        "bot nonsense",
        "bot bot list",
        "LIST",
        "match /a",
        "5",
    ] {
        Asked::new().check(line, ".");
    }
    for line in [
        "bot announce /a",
        "bot subscribe",
        "bot topic",
        "bot type yarp /n",
    ] {
        Asked::new().check(line, ".");
    }
}

#[test]
fn numbers_are_chosen_as_in_stock() {
    let mut asked = Asked::new();
    asked.check_place("register /b ... ... ...", "/b 127.0.0.1 10312 tcp");
    asked.check_place("register /b ... ... 0", "/b 127.0.0.1 10312 tcp");
    asked.check_place("register /b ... ... -1", "/b 127.0.0.1 10312 tcp");
    asked.check_place("register /b ... ... 12345", "/b 127.0.0.1 12345 tcp");
    asked.check_place("register /b2 ... ... 12345", "/b2 127.0.0.1 12345 tcp");
    asked.check_place("register /b3 tcp ... abc", "/b3 127.0.0.1 10313 tcp");
    asked.check_place("register /b6 udp 1.2.3.4 5", "/b6 1.2.3.4 5 udp");
    asked.check_place(
        "register /b7 nonsense hostname 6",
        "/b7 hostname 6 nonsense",
    );
    asked.check("unregister /b3", ".");
    asked.check_place("register /b9", "/b9 127.0.0.1 10314 tcp");
    asked.check_place("register /b3", "/b3 127.0.0.1 10313 tcp");
    asked.check_place("register /b", "/b 127.0.0.1 10312 tcp");
}

/// Stock gives 10315 to `/c`, although `/a` asked for it before.
#[test]
fn a_number_in_use_is_not_handed_out() {
    let mut asked = Asked::after(&["register /a tcp 127.0.0.1 10312"]);
    asked.check_place("register /c", "/c 127.0.0.1 10313 tcp");
}

#[test]
fn anonymous_names_are_chosen_as_in_stock() {
    let mut asked = Asked::new();
    asked.check_place("register ...", "/tmp/port/1 127.0.0.1 10312 tcp");
    asked.check_place("register ...", "/tmp/port/2 127.0.0.1 10313 tcp");
    asked.check_place("register =x", "/tmp/port/3=x 127.0.0.1 10314 tcp");
    asked.check_place("register =/x", "/tmp/port/4=/x 127.0.0.1 10315 tcp");
    asked.check("unregister /tmp/port/1", ".");
    asked.check_place("register ...", "/tmp/port/1 127.0.0.1 10312 tcp");
}

#[test]
fn multicast_groups_and_topics_get_their_address() {
    let mut asked = Asked::new();
    asked.check_place("register ... mcast", "/tmp/port/1 224.1.1.3 10312 mcast");
    asked.check_place("register /mc mcast ... ...", "/mc 224.1.1.4 10313 mcast");
    asked.check_place("register /mc mcast", "/mc 224.1.1.4 10313 mcast");
    asked.check_place(
        "register ... mcast 224.9.9.9 55",
        "/tmp/port/2 224.9.9.9 55 mcast",
    );
    asked.check_place("register /mc2 mcast ... 77", "/mc2 224.1.1.5 77 mcast");
    asked.check("unregister /mc", ".");
    asked.check_place("register /mc3 mcast", "/mc3 224.1.1.4 10314 mcast");
    asked.check_place("register /mc3", "/mc3 127.0.0.1 10314 tcp");
    asked.check_place("register /t topic", "/t 192.0.2.2 10310 topic");
    asked.check_place("register /t2 topic ... 55", "/t2 192.0.2.2 55 topic");
}

#[test]
fn refusals_name_the_reason() {
    let mut asked = Asked::new();
    let reason = "refused: port number must be 1 to 65535, or 0 or -1 to have one chosen, got";
    asked.check(
        "register /a tcp ... 99999999",
        &format!("{reason} 99999999|."),
    );
    asked.check("register /a tcp ... -7", &format!("{reason} -7|."));
    asked.check("register", "refused: \"\" cannot be a name: it is empty|.");
    let blank = "it holds a blank, a quote or a control character";
    let refusal = format!("refused: \"/a b\" cannot be a name: {blank}|.");
    asked.check("register \"/a b\"", &refusal);
    for line in [
        "register tcp://a",
        "register \"/a\\n*** end of message\"",
        "register /a \"tcp udp\"",
        "register /a tcp \"1.2.3.4 5\"",
        "set /root \"a\\nb\" v",
        "set /root carrier \"a b\"",
    ] {
        let Body::Lines(lines) = asked.reply(line).body else {
            panic!("a bottle for {line}");
        };
        let lines: Vec<_> = lines.iter().collect();
        assert!(lines[0].starts_with("refused: "), "{line}: {lines:?}");
        assert_eq!(lines.len(), 2, "{line}");
    }
    asked.check_place("query /root", "/root 192.0.2.2 10310 tcp");
    asked.check("query /a", ".");
}

#[test]
fn exhausted_numbers_do_not_stop_the_server() {
    let mut asked = Asked {
        registry: Registry::new(Settings::at("192.0.2.2", 65533)),
        now: Instant::now(),
    };
    asked.check_place("register /a", "/a 127.0.0.1 65535 tcp");
    let reason = "refused: all port numbers from 65535 to 65535 are taken; \
                  unregister dead ports (yarp clean)|.";
    asked.check("register /b", reason);
    asked.check("register ...", reason);
    asked.check("unregister /a", ".");
    asked.check_place("register ...", "/tmp/port/1 127.0.0.1 65535 tcp");
}

#[test]
fn queries_accept_carriers_and_networks() {
    let mut asked = Asked::after(&[
        "register /a tcp 127.0.0.1 10339",
        "register /ab tcp 127.0.0.1 10338",
        "register noslash tcp 127.0.0.1 10340",
        "set /a ips 127.0.0.1 192.168.1.5 10.0.0.7",
    ]);
    asked.check_place("query /a", "/a 127.0.0.1 10339 tcp");
    asked.check_place("query udp://a extra", "/a 127.0.0.1 10339 tcp");
    asked.check_place("query tcp:/noslash", "noslash 127.0.0.1 10340 tcp");
    asked.check("query tcp:/a", ".");
    asked.check("query tcp:///a", ".");
    asked.check("query", ".");
    asked.check_place("query /net=192.168/a", "/a 192.168.1.5 10339 tcp");
    asked.check_place("query tcp://net=10/a", "/a 10.0.0.7 10339 tcp");
    asked.check_place("query /net=99/a", "/a 127.0.0.1 10339 tcp");
    asked.check_place("query /net=/a", "/a 127.0.0.1 10339 tcp");
    asked.check_place("query /net=192/ab", "/ab 127.0.0.1 10338 tcp");
    asked.check("query /net=192.168", ".");
    asked.check("query net=192.168/a", ".");
    asked.check("get /net=10/a ips", ".");
    asked.check("list /net=10/a", ".");
    asked.check(
        "bot query /net=10/a",
        r#"port (name "/a") (ip "10.0.0.7") (port_number 10339) (carrier tcp)"#,
    );
    asked.check("bot query /no", r#"port (error -2 "port not known")"#);
}

#[test]
fn lists_take_a_prefix() {
    let mut asked = Asked::after(&[
        "register /a/c tcp h 2",
        "register /a/b tcp h 1",
        "register /ab tcp h 3",
        "register /a tcp h 4",
        "register /Z tcp h 5",
    ]);
    let mut check = |line: &str, expected: &[&str]| {
        let Body::Lines(lines) = asked.reply(line).body else {
            panic!("a bottle");
        };
        let names = lines.iter().filter_map(|line| line.split(' ').nth(2));
        let names: Vec<_> = names.filter(|name| *name != "of").collect();
        assert_eq!(names, expected, "{line}");
    };
    let all = ["/Z", "/a", "/a/b", "/a/c", "/ab", "/root", "fallback"];
    check("list", &all);
    check("list \"\"", &all);
    check("list 5", &all);
    check("list /", &all[..6]);
    check("list /a", &["/a", "/a/b", "/a/c"]);
    check("list /a/", &["/a/b", "/a/c"]);
    check("list /a /ab", &["/a", "/a/b", "/a/c"]);
    check("list a", &[]);
    check("list tcp://a", &[]);
}

#[test]
fn properties_belong_to_registered_ports() {
    let mut asked = Asked::new();
    asked.check("set /a k v", ".");
    asked.check("get /a k", ".");
    asked.check("check /a k v", ".");
    asked.check("bot set /a k v", "");
    asked.check("bot get /a k", "");
    asked.check("bot check /a k v", ".");
    asked.reply("register /a tcp h 1 yarp/image");
    asked.check("get /a type", "port /a property type = yarp/image|.");
    asked.check("set /a", "port /a property  =|.");
    asked.check("set /a k", "port /a property k =|.");
    asked.check("set /a k z y x z y a", "port /a property k = a x y y z z|.");
    asked.check("bot get /a k", "a x y y z z");
    asked.check("check /a k x", "port /a property k value x present true|.");
    asked.check(
        "bot check /a k q",
        "port /a property k value q present false|.",
    );
    asked.check("check /a", "port /a property  value  present false|.");
    asked.check("set /a k", "port /a property k =|.");
    asked.check("set /a \"k l\" v", "port /a property k l = v|.");
    asked.check("set /a (k l) \"\"", "port /a property k l = |.");
    asked.check("set tcp://a k v", ".");
    asked.reply("register /a tcp h 1");
    asked.check("get /a type", "port /a property type =|.");
}

#[test]
fn values_of_any_kind_become_text() {
    let mut asked = Asked::after(&["register /a tcp h 1"]);
    asked.check(
        r#"set /a k [v1] (1 (2 3)) {1 2 3} -3 0x10 1e3 1.0 "1.0" "a \"quoted\" b" (x "y z")"#,
        r"port /a property k = -3 1 (2 3) 1 2 3 1.0 1.0 1000.0 16 a \quoted\ b v1 x \y z\|.",
    );
    asked.check(
        "bot get /a k",
        r#"-3 "1 (2 3)" "1 2 3" 1.0 1.0 1000.0 16 "a \"quoted\" b" v1 "x \"y z\"""#,
    );
}

#[test]
fn the_carrier_is_a_property() {
    let mut asked = Asked::after(&["register /a tcp h 1"]);
    asked.check("get /a carrier", "port /a property carrier = tcp|.");
    asked.check("set /a carrier b a", "port /a property carrier = a b|.");
    asked.check_place("query /a", "/a h 1 a");
    asked.check("set /a port 5", "port /a property port = 5|.");
    asked.check_place("query /a", "/a h 1 a");
}

#[test]
fn programs_ask_with_json_in_mind() {
    let mut asked = Asked::after(&["register /s tcp h 1"]);
    let place = r#"port (name "/s") (ip h) (port_number 1) (carrier tcp)"#;
    asked.check("query /s (format json)", place);
    asked.check("bot query /s (format json)", place);
    asked.check("(format json) query /s", ".");
    asked.check("nonsense (format json)", ".");
    asked.check("list format json", "ports");
    asked.check("set /s k v (format json)", "v");
}

#[test]
fn bot_commands_without_a_bottle_answer_other_lines() {
    let mut asked = Asked::new();
    let lines = "port|name /a|ip 127.0.0.1|port_number 10312|carrier tcp|.";
    asked.check("bot register /a", lines);
    asked.check("bot unregister /a", "port|error -2 port not known|.");
    asked.check("query /a", ".");
    asked.check("bot gc", "garbage collection done.|.");
    asked.check("bot route /a /b", "port /a route /b = tcp://b|.");
    asked.check("route", "port  route  = tcp:/|.");
}

#[test]
fn runners_are_marked_by_a_property() {
    let mut asked = Asked::after(&["register /r tcp h 1", "register /q tcp h 2"]);
    asked.check("runners", ".");
    asked.check("bot runners", "ports");
    asked.reply("set /r yarprun true false");
    asked.reply("set /q yarprun 1");
    asked.check_place("runners", "/r h 1 tcp");
}

#[test]
fn owned_names_are_removed_with_their_owner() {
    let owning = [
        "register /ow",
        "register /owned",
        "set /ow owns /owned /never /ow",
        "set /owned owns /ow",
    ];
    let mut asked = Asked::after(&owning);
    asked.check("unregister /ow", "old|old|old|old|.");
    asked.check("list /ow", ".");
    asked.check("list /owned", ".");
    let mut asked = Asked::after(&owning[..3]);
    asked.check_effects("unregister /ow", &["del /owned", "del /ow"]);
}

/// Stock answers an unregistration like a query; only the bare name unregisters.
#[test]
fn only_the_bare_name_unregisters() {
    let mut asked = Asked::after(&["register /a tcp h 1"]);
    asked.check_place("unregister tcp://a", "/a h 1 tcp");
    asked.check_place("query /a", "/a h 1 tcp");
    asked.check("unregister /a", ".");
    asked.check("unregister /a", ".");
    asked.check("unregister", ".");
}

#[test]
fn added_and_removed_names_are_published() {
    let mut asked = Asked::new();
    asked.check_effects("register /e", &["add /e"]);
    asked.check_effects("register /e", &["del /e", "add /e"]);
    asked.check_effects("register /m mcast", &[]);
    asked.check_effects("unregister /m", &[]);
    asked.check_effects("unregister /e", &["del /e"]);
    asked.check_effects("unregister /e", &[]);
    asked.check_effects("register ...", &["add /tmp/port/1"]);
    asked.check_effects("query /e", &[]);
}

/// Registers the two ports of the persistent connections in the tests below.
fn two_ports() -> Asked {
    Asked::after(&["register /s1 tcp h 1", "register /s2 tcp h 2"])
}

#[test]
fn persistent_connections_are_listed_in_order() {
    let mut asked = two_ports();
    asked.check("subscribe", "subscriptions");
    for line in [
        "subscribe topic://tp /s8",
        "subscribe /s1 /s2",
        "subscribe /s1 udp://s2",
        "subscribe a b",
        "subscribe /s4 /s7 bogus",
        "subscribe /s9 topic://tp",
    ] {
        asked.check(line, "[ok]");
    }
    let all = [
        r#"(subscription (src "/s1") (dest "udp://s2"))"#,
        r#"(subscription (src "/s4") (dest "/s7") (mode bogus))"#,
        r#"(subscription (src "/s9") (dest "topic://tp") (topic 0 1))"#,
        r#"(subscription (src "topic://tp") (dest "/s8") (topic 1 0))"#,
        "(subscription (src a) (dest b))",
    ];
    asked.check("subscribe", &format!("subscriptions {}", all.join(" ")));
    asked.check(
        "subscribe /tp",
        &format!("subscriptions {}", all[2..4].join(" ")),
    );
    asked.check("subscribe /s2", &format!("subscriptions {}", all[0]));
    asked.check("subscribe /x", "subscriptions");
    asked.check("unsubscribe tcp://s1 /s2", "[ok]");
    asked.check("unsubscribe /s1 /s2", "[ok]");
    asked.check("unsubscribe", "[ok]");
    asked.check("subscribe /s1", "subscriptions");
    asked.check("topic", "\"/tp\"");
    asked.check("untopic /tp", "[ok]");
    asked.check(
        "subscribe /s9",
        r#"subscriptions (subscription (src "/s9") (dest "topic://tp"))"#,
    );
}

#[test]
fn topics_and_types_are_kept() {
    let mut asked = Asked::new();
    asked.check("topic", "");
    asked.check("topic /b", "[ok]");
    asked.check("topic /a \"some struct\"", "[ok]");
    asked.check("topic /b (a b)", "[ok]");
    asked.check("topic", "\"/b\" \"/a\"");
    asked.check("untopic /b", "[ok]");
    asked.check("untopic /nope", "[ok]");
    asked.check("topic", "\"/a\"");
    asked.check("query /a", ".");
    asked.check("type", "[fail]");
    asked.check("type yarp /n", "[fail]");
    asked.check("type yarp /n val", "[ok]");
    asked.check("type yarp /n", r#"type yarp "/n" val"#);
    asked.check("type yarp /n (a b)", "[ok]");
    asked.check("type yarp /n", "[fail]");
    asked.check("type other /n val", "[fail]");
    asked.check("web", "web Hmm.");
}

#[test]
fn subscribing_connects_registered_ports() {
    let mut asked = two_ports();
    asked.check_effects("subscribe /s1 /s2", &["connect /s1 /s2 tcp"]);
    asked.check_effects("subscribe udp://s1 /s2", &["connect /s1 /s2 udp"]);
    asked.check_effects("subscribe udp://s1 mcast://s2", &["connect /s1 /s2 mcast"]);
    asked.check_effects("subscribe /s1 /nobody", &[]);
    asked.check_effects("unsubscribe /s1 /s2", &[]);
}

#[test]
fn announcing_makes_pending_connections() {
    let mut asked = two_ports();
    asked.reply("subscribe /s1 /s2");
    asked.check_effects("announce /s1", &[]);
    asked.check_effects("announce /s2", &["connect /s1 /s2 tcp"]);
    asked.check_effects("announce /s1", &["connect /s1 /s2 tcp"]);
    asked.check_effects("unregister /s2", &["disconnect /s1 /s2 tcp", "del /s2"]);
    asked.check_effects("register /s2 tcp h 2", &["add /s2"]);
    asked.check_effects("announce /s1", &[]);
    asked.check_effects("announce /s2", &["connect /s1 /s2 tcp"]);
    asked.check("announce /zz", "[ok]");
    asked.check("announce", "[ok]");
}

#[test]
fn dead_ports_are_not_connected_until_they_announce() {
    let mut asked = two_ports();
    asked.reply("subscribe /s1 /s2");
    asked.reply("announce /s1");
    asked.reply("announce /s2");
    asked.now += Duration::from_secs(29);
    asked.reply("announce /s2 0");
    asked.check_effects("announce /s1", &["connect /s1 /s2 tcp"]);
    asked.now += Duration::from_secs(2);
    asked.check_effects("announce /s2 0", &[]);
    asked.check_effects("announce /s1", &[]);
    asked.check_effects("announce /s2", &["connect /s1 /s2 tcp"]);
}

#[test]
fn a_mode_ends_the_subscription_with_its_end() {
    let mut asked = two_ports();
    asked.reply("subscribe /s1 /s2 from");
    let listed = r#"subscriptions (subscription (src "/s1") (dest "/s2") (mode from))"#;
    asked.reply("unregister /s2");
    asked.check("subscribe", listed);
    asked.reply("unregister /s1");
    asked.check("subscribe", "subscriptions");
    let mut asked = two_ports();
    asked.reply("subscribe /s1 /s2 to");
    asked.reply("unregister /s1");
    asked.check("subscribe", &listed.replace("from", "to"));
    asked.reply("register /s2 tcp h 2");
    asked.check("subscribe", "subscriptions");
    asked.check("subscribe /u1 /s2 from", "[ok]");
    asked.check("subscribe /s2 /u1 to", "[ok]");
    asked.check("subscribe", "subscriptions");
}

#[test]
fn topics_connect_their_ports() {
    let mut asked = Asked::after(&[
        "register /s1 tcp h 1",
        "register /s2 tcp h 2",
        "register /s3 tcp h 3",
        "announce /s1",
        "announce /s2",
        "announce /s3",
    ]);
    asked.check_effects("subscribe /s1 topic://tp", &[]);
    asked.check_effects("subscribe topic://tp udp://s3", &["connect /s1 /s3 udp"]);
    let both = ["connect /s1 /s3 udp", "connect /s2 /s3 udp"];
    asked.check_effects("subscribe /s2 /tp", &both);
    asked.check_effects("announce /s2", &both[1..]);
    asked.check_effects("announce /s3", &both);
    asked.reply("untopic /tp");
    asked.check_effects("announce /s3", &[]);
    asked.check_effects("topic /tp", &both);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// Whatever is registered, set or subscribed, every line of `list` stays a registration, and every
    /// name in it can be looked up and removed.
    #[test]
    fn arbitrary_arguments_do_not_damage_the_list(requests in prop::collection::vec(arbitrary(), 1..20)) {
        let mut asked = Asked::new();
        for (command, arguments) in requests {
            let mut request = Bottle::of(command);
            request.extend(arguments.iter().map(|argument| Value::from(argument.as_str())));
            let body = asked.reply(&request.to_string()).body;
            check_shape(&body)?;
        }
        let Body::Lines(listed) = asked.reply("list").body else { unreachable!() };
        let listed: Vec<_> = listed.iter().collect();
        prop_assert_eq!(listed.len(), asked.registry.registrations().count() + 1);
        for line in &listed[..listed.len() - 1] {
            let Ok(held) = line.parse::<Registration>() else {
                return Err(TestCaseError::fail(format!("not a registration: {line:?}")));
            };
            let query = Bottle::of("query").with(held.name.as_str());
            let Body::Lines(found) = asked.reply(&query.to_string()).body else { unreachable!() };
            prop_assert_eq!(found.iter().next(), Some(*line));
        }
    }

    /// A first word that is no command changes nothing and is answered by the closing line alone.
    #[test]
    fn text_that_is_no_command_changes_nothing(line in "[^ a-z/]{0,20}( [^\"]{0,20})?") {
        let mut asked = Asked::after(&["register /a tcp h 1", "set /a note kept"]);
        let before: Vec<_> = asked.registry.registrations().cloned().collect();
        let Ok(request) = Request::parse(&line) else { return Ok(()) };
        let reply = asked.registry.handle(asked.now, None, &request);
        prop_assert_eq!(reply.body, Body::lines([""; 0]));
        prop_assert!(reply.effects.is_empty());
        let after: Vec<_> = asked.registry.registrations().cloned().collect();
        prop_assert_eq!(before, after);
        asked.check("get /a note", "port /a property note = kept|.");
    }

    #[test]
    fn any_sequence_of_requests_is_answered(requests in prop::collection::vec(words(), 0..40)) {
        let mut asked = Asked::new();
        for line in requests {
            let body = asked.reply(&line).body;
            check_shape(&body)?;
        }
    }

    #[test]
    fn no_number_is_handed_out_twice(steps in prop::collection::vec(step(), 0..120)) {
        let mut asked = Asked {
            registry: Registry::new(Settings::at("192.0.2.2", 65500)),
            now: Instant::now(),
        };
        for (line, chosen) in steps {
            let Body::Lines(lines) = asked.reply(&line).body else { unreachable!() };
            let Ok(fresh) = lines.iter().next().unwrap_or_default().parse::<Registration>() else { continue };
            if !chosen { continue }
            let same = asked.registry.registrations().filter(|held| held.port == fresh.port);
            prop_assert_eq!(same.count(), 1, "{} got {}", line, fresh);
        }
    }
}

/// Checks that every answer of lines ends with the closing one, and that no line starts with a word
/// of the client.
fn check_shape(body: &Body) -> Result<(), TestCaseError> {
    if let Body::Lines(lines) = body {
        prop_assert_eq!(lines.iter().next_back(), Some(END));
        prop_assert!(
            lines.iter().all(|line| !line.contains(['\r', '\n'])),
            "{lines:?}"
        );
    }
    Ok(())
}

/// Generates a command that changes something, and arguments of any text.
fn arbitrary() -> impl Strategy<Value = (&'static str, Vec<String>)> {
    let command = prop::sample::select(vec![
        "register",
        "set",
        "subscribe",
        "topic",
        "announce",
        "unregister",
    ]);
    let argument = prop_oneof![
        "/[a-c]",
        "/[ -~]{0,12}",
        ".{0,20}",
        "[0-9\r\n\"(){}\\[\\] -]{0,6}",
    ];
    (command, prop::collection::vec(argument, 0..5))
}

fn words() -> impl Strategy<Value = String> {
    let word = prop::sample::select(vec![
        "register",
        "unregister",
        "query",
        "list",
        "set",
        "get",
        "check",
        "announce",
        "subscribe",
        "unsubscribe",
        "topic",
        "untopic",
        "type",
        "lease",
        "state",
        "bot",
        "/a",
        "/b",
        "tcp://a",
        "topic://t",
        "...",
        "=x",
        "mcast",
        "owns",
        "carrier",
        "from",
        "to",
        "0",
        "-1",
        "10312",
        "\"a\\nb\"",
        "\"\"",
        "(",
        "[",
        "yarp",
        "/net=1/a",
        "ips",
        "(format json)",
    ]);
    prop::collection::vec(word, 0..7).prop_map(|words| words.join(" "))
}

/// Generates registrations, with and without a number, and removals, of few names.
fn step() -> impl Strategy<Value = (String, bool)> {
    let name = prop::sample::select(vec![
        "/a",
        "/b",
        "/c",
        "/d",
        "/e",
        "...",
        "=x",
        "/tmp/port/1",
    ]);
    (name, 0..4, 65500..65520, any::<bool>()).prop_map(|(name, kind, number, mcast)| {
        let carrier = if mcast { "mcast" } else { "tcp" };
        match kind {
            0 => (format!("unregister {name}"), false),
            1 => (format!("register {name} {carrier} ... {number}"), false),
            _ => (format!("register {name} {carrier}"), true),
        }
    })
}
