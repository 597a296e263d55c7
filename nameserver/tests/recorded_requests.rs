//! Requests and answers recorded between stock programs (3.12.3 and 4.0.0, the same in both).

use std::net::Ipv4Addr;
use std::time::Instant;

use yarp_nameserver::registry::{Registry, Settings};
use yarp_wire::name_service::Request;

/// Requests of `yarp name ...`, of a port over `mcast` and of `yarp topic`, in that order, with the
/// answers as bytes, each line ended by CR LF.
const RECORDED: &[(&str, &str)] = &[
    (
        "bot list",
        r#"ports (port (name "/root") (ip "192.0.2.2") (port_number 10000) (carrier tcp)) (port (name fallback) (ip "224.2.1.1") (port_number 10000) (carrier mcast))"#,
    ),
    ("gc", "garbage collection done.|*** end of message"),
    (
        "register /fake/a",
        "registration name /fake/a ip 192.0.2.2 port 10002 type tcp|*** end of message",
    ),
    (
        "set /fake/a offers http name_ser local tcp fast_tcp mcast udp text text_ack mjpeg portmonitor shmem unix_stream",
        "port /fake/a property offers = fast_tcp http local mcast mjpeg name_ser portmonitor shmem tcp text text_ack udp unix_stream|*** end of message",
    ),
    (
        "set /fake/a ips 127.0.0.1 192.0.2.2 ::1 fd00::2 fe80::fc:ff:fe00:1%4",
        "port /fake/a property ips = 127.0.0.1 192.0.2.2 ::1 fd00::2 fe80::fc:ff:fe00:1%4|*** end of message",
    ),
    (
        "set /fake/a process 29744",
        "port /fake/a property process = 29744|*** end of message",
    ),
    (
        "register /fake/b tcp 127.0.0.1 10077",
        "registration name /fake/b ip 127.0.0.1 port 10077 type tcp|*** end of message",
    ),
    (
        "register ...",
        "registration name /tmp/port/1 ip 192.0.2.2 port 10003 type tcp|*** end of message",
    ),
    (
        "query /fake/a",
        "registration name /fake/a ip 192.0.2.2 port 10002 type tcp|*** end of message",
    ),
    (
        "set /fake/a colour red blue",
        "port /fake/a property colour = blue red|*** end of message",
    ),
    (
        "get /fake/a colour",
        "port /fake/a property colour = blue red|*** end of message",
    ),
    (
        "check /fake/a colour red",
        "port /fake/a property colour value red present true|*** end of message",
    ),
    (
        "check /fake/a colour green",
        "port /fake/a property colour value green present false|*** end of message",
    ),
    ("query /nobody", "*** end of message"),
    (
        "list",
        "registration name /fake/a ip 192.0.2.2 port 10002 type tcp|\
         registration name /fake/b ip 127.0.0.1 port 10077 type tcp|\
         registration name /root ip 192.0.2.2 port 10000 type tcp|\
         registration name /tmp/port/1 ip 192.0.2.2 port 10003 type tcp|\
         registration name fallback ip 224.2.1.1 port 10000 type mcast|*** end of message",
    ),
    (
        "list /fake",
        "registration name /fake/a ip 192.0.2.2 port 10002 type tcp|\
         registration name /fake/b ip 127.0.0.1 port 10077 type tcp|*** end of message",
    ),
    (
        "bot query /fake/a",
        r#"port (name "/fake/a") (ip "192.0.2.2") (port_number 10002) (carrier tcp)"#,
    ),
    (
        "route /fake/a /fake/b",
        "port /fake/a route /fake/b = tcp://fake/b|*** end of message",
    ),
    (
        "help",
        "Here are some ways to use the name server:|+ help|+ list [$prefix]|+ register $portname|\
         + register $portname $carrier $ipAddress $portNumber|  \
         (if you want a field set automatically, write '...')|+ unregister $portname|\
         + query $portname|+ set $portname $property $value|+ get $portname $property|\
         + check $portname $property|+ route $port1 $port2|+ runners|  \
         (to get a list of the yarprun ports)|*** end of message",
    ),
    ("nonsense", "*** end of message"),
    ("topic \"/top/ic\"", "[ok]"),
    ("topic", "\"/top/ic\""),
    ("untopic \"/top/ic\"", "[ok]"),
    ("unregister /nobody", "*** end of message"),
    ("unregister /fake/b", "*** end of message"),
    ("unregister /tmp/port/1", "*** end of message"),
    ("announce /fake/a", "[ok]"),
    (
        "register ... mcast ... ...",
        "registration name /tmp/port/1 ip 224.1.1.3 port 10003 type mcast|*** end of message",
    ),
    ("bot set /fake/a owns /tmp/port/1", "\"/tmp/port/1\""),
    ("unregister /tmp/port/1", "*** end of message"),
    ("unregister /fake/a", "old|*** end of message"),
];

#[test]
fn recorded_requests_get_their_recorded_answers() {
    let mut registry = Registry::new(Settings::at("192.0.2.2", 10000));
    let from = Some(Ipv4Addr::new(192, 0, 2, 2).into());
    for (question, answer) in RECORDED {
        let request = Request::parse(&format!("NAME_SERVER {question}")).unwrap();
        let reply = registry.handle(Instant::now(), from, &request);
        let expected = format!("{}\r\n", answer.replace('|', "\r\n"));
        assert_eq!(reply.body.into_text(), expected, "{question}");
    }
}
