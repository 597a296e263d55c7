//! A person at a terminal is answered word for word as by stock.
//!
//! Source: recorded traffic of 3.12.3 and 4.0.0 (`text_mode`), and 3.5.0 answering by hand.

use crate::common;

use common::{Raw, bottle, next, open, until};
use tokio::sync::watch;
use yarp_ports::{Answer, Port, PortOptions, Queue};

const HELP: &str = "\
This is a YARP port.  Here are the commands it responds to:\r\n\
*       Gives a description of this port\r\n\
d       Signals the beginning of input for the port's owner\r\n\
do      The same as \"d\" except replies should be suppressed (\"data-only\")\r\n\
q       Disconnects\r\n\
i       Interrupt parent process (unix only)\r\n\
r       Reverse connection type to be a reader\r\n\
/port   Requests to send output to /port\r\n\
!/port  Requests to stop sending output to /port\r\n\
~/port  Requests to stop receiving input from /port\r\n\
a       Signals the beginning of an administrative message\r\n\
?       Gives this help\r\n";
const NOT_UNDERSTOOD: &str = "\
Port command not understood.\r\n\
Type d to send data to the port's owner.\r\n\
Type ? for help.\r\n";

#[tokio::test]
async fn the_recorded_dialogue() {
    let port = open("/rd", PortOptions::new().queue(Queue::Wait(10))).await;
    let mut raw = Raw::text(&port, "foo").await;
    raw.send("?\r\n").await;
    raw.expect(HELP).await;
    raw.send("*\r\n").await;
    raw.expect(format!(
        "This is /rd at {}\r\n\
        There are no outgoing connections\r\n\
        There is an input connection from foo to /rd using text\r\n",
        port.address()
    ))
    .await;
    raw.send("d\r\nhello yarp 1 2 (3)\r\nnonsense\r\n").await;
    assert_eq!(next(&port).await, "hello yarp 1 2 (3)");
    raw.expect(NOT_UNDERSTOOD).await;
    raw.send("a\r\n[list] [in]\r\n").await;
    raw.expect("foo\r\n").await;
    raw.send("q\r\n").await;
    assert!(raw.ended().await.is_empty());
}

#[tokio::test]
async fn the_recorded_dialogue_with_acknowledgements() {
    let port = open("/rd", PortOptions::new().queue(Queue::Wait(10))).await;
    let mut raw = Raw::to(&port).await;
    raw.send("CONNACK foo\r\n").await;
    raw.expect("Welcome foo\r\n").await;
    raw.send("d\r\n12\r\n").await;
    assert_eq!(next(&port).await, "12");
    raw.expect("<ACK>\r\n").await;
    raw.send("q\r\n").await;
    raw.expect("<ACK>\r\n").await;
    assert!(raw.ended().await.is_empty());
}

#[tokio::test]
async fn a_description_says_who_is_connected() {
    let port = open("/adm", PortOptions::new()).await;
    let mut raw = Raw::to(&port).await;
    raw.send("CONNACK <ping>\r\n").await;
    raw.expect("Welcome <ping>\r\n").await;
    raw.send("*\r\n").await;
    raw.expect(format!(
        "This is /adm at {}\r\n\
        There are no outgoing connections\r\n\
        There is an input connection from <ping> to /adm using text_ack\r\n<ACK>\r\n",
        port.address()
    ))
    .await;
}

/// Regression: `/tcp://reader` was looked up as a name. Checked against 3.5.0.
#[tokio::test]
async fn connections_are_made_and_ended_by_hand() {
    let reader = open("/rd", PortOptions::new().queue(Queue::Latest)).await;
    let writer = open("/wr", PortOptions::new()).await;
    let mut raw = Raw::text(&writer, "me").await;
    let at = format!("tcp://127.0.0.1:{}/rd", reader.tcp_port());
    raw.send(format!("/{at}\r\n")).await;
    raw.expect(format!("Added connection from /wr to /{at}\r\n"))
        .await;
    raw.send("*\r\n").await;
    raw.expect(format!(
        "This is /wr at {}\r\n\
        There is an output connection from /wr to /rd using tcp\r\n\
        There is an input connection from me to /wr using text\r\n",
        writer.address()
    ))
    .await;
    raw.send("!/tcp://rd\r\n!/rd\r\n!/rd\r\n~/nobody\r\n").await;
    raw.expect(
        "Could not find an outgoing connection to /tcp://rd\r\n\
        Removed connection from /wr to /rd\r\n\
        Could not find an outgoing connection to /rd\r\n\
        Could not find an incoming connection from /nobody\r\n",
    )
    .await;
    until(|| reader.inputs().is_empty()).await;
}

#[tokio::test]
async fn a_text_goes_on_until_its_brackets_close() {
    let port = open("/rd", PortOptions::new().queue(Queue::Wait(10))).await;
    let mut raw = Raw::text(&port, "foo").await;
    raw.send("do\r\n(1\r\n2)\r\nd\r\n\"a\r\nb\" {1\r\n2}\r\nd\r\n1 \\\r\n2\r\nd\r\n\r\n")
        .await;
    assert_eq!(next(&port).await, "(1 2)");
    assert_eq!(next(&port).await, "\"a\\nb\" {1 2}");
    assert_eq!(next(&port).await, "1 2");
    assert_eq!(next(&port).await, "");
}

#[tokio::test]
async fn lines_may_end_without_a_carriage_return() {
    let options = PortOptions::new()
        .handler(|request| Answer::reply(bottle("you said").with(request.bottle().unwrap())));
    let port = open("/rpc", options).await;
    let mut raw = Raw::to(&port).await;
    raw.send("CONNECT me\nd\nhello\nD\nhush\nd\n1 2\nq\n").await;
    raw.expect("Welcome me\r\nyou said (hello)\r\nyou said (1 2)\r\n")
        .await;
    assert!(raw.ended().await.is_empty());
}

/// A name was read as a value: `007` was welcomed as `7`. Checked against 3.5.0.
#[tokio::test]
async fn names_are_repeated_as_they_stand() {
    let port = open("/rd", PortOptions::new()).await;
    for name in ["007", "1e5", "[add]", "\"ab\"", "a,b"] {
        Raw::text(&port, name).await;
    }
    let mut raw = Raw::to(&port).await;
    raw.send("CONNECT /a (log in)\r\n*\r\n").await;
    raw.expect("Welcome /a\r\n").await;
}

/// Returns a port that answers `slow` only on a signal, and every other request at once, in a
/// future.
async fn slow_port() -> (Port, watch::Sender<bool>) {
    let (release, released) = watch::channel(false);
    let options = PortOptions::new().handler(move |request| {
        let slow = request.bottle().unwrap().to_string() == "slow";
        let mut released = released.clone();
        Answer::Later(Box::pin(async move {
            if slow {
                released.wait_for(|go| *go).await.unwrap();
            }
            Answer::reply(bottle("ok"))
        }))
    });
    (open("/rpc", options).await, release)
}

/// The greeting waited until the first message was answered.
#[tokio::test]
async fn answers_do_not_wait_for_later_messages() {
    let (port, release) = slow_port().await;
    let mut raw = Raw::to(&port).await;
    raw.send("CONNECT me\r\nd\r\nquick\r\nd\r\nslow\r\n").await;
    raw.expect("Welcome me\r\nok\r\n").await;
    release.send_replace(true);
    raw.expect("ok\r\n").await;
}

/// A header reply waits for the reply to a message that was received with it, but not for long.
#[tokio::test]
async fn a_header_reply_does_not_wait_for_a_slow_reply() {
    let (port, release) = slow_port().await;
    let mut raw = Raw::to(&port).await;
    raw.send("CONNECT me\r\nd\r\nslow\r\n").await;
    raw.expect("Welcome me\r\n").await;
    release.send_replace(true);
    raw.expect("ok\r\n").await;
}
