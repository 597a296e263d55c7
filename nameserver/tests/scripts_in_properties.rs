//! Properties that hold a script, as a browser gets them from the server.

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use yarp_nameserver::{Server, ServerOptions};

/// The script of a property ran at the origin of the server: its answer was a page without a policy.
#[tokio::test]
async fn a_script_in_a_property_does_not_run() {
    let mut options = ServerOptions::default().at("127.0.0.1", 0);
    options.probe_interval = None;
    let server = Server::start(options).await.unwrap();
    let network = server.network();
    network.ask("register /x tcp 127.0.0.1 9").await.unwrap();
    let set = "set /x k \"x<script>document.title=1</script>\"";
    let answer = network.ask(set).await.unwrap();
    let line = answer.lines().next().unwrap_or_default();
    assert!(line.contains("<script>"), "{line}");
    for target in [
        "/?req=bot+get+/x+k&format=html",
        "/?req=get+/x+k&format=html",
        "/?data=get+/x+k",
        "/data=get+/x+k",
    ] {
        let address = ("127.0.0.1", server.port());
        let mut stream = TcpStream::connect(address).await.unwrap();
        let request = format!("GET {target} HTTP/1.1\r\nHost: localhost\r\n\r\n");
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).await.unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        let head = head.to_ascii_lowercase();
        assert!(body.contains("document.title"), "{answer}");
        let is_page = head.contains("content-type: text/html");
        assert!(!is_page || !body.contains("<script>document"), "{answer}");
        assert!(head.contains("x-content-type-options: nosniff"), "{head}");
        let policy = head
            .lines()
            .find(|line| line.starts_with("content-security-policy:"));
        let policy = policy.unwrap_or_else(|| panic!("{head}"));
        assert!(policy.contains("default-src 'none'"), "{policy}");
    }
    server.close().await;
}
