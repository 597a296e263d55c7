//! Connections of the network, as the name server's page knows them.

use std::time::Duration;

use serde_json::{Value as Json, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use yarp_ports::Network;

/// Timeout of a request.
const TIMEOUT: Duration = Duration::from_secs(2);
/// Maximum number of bytes of an answer.
const MAX_ANSWER: u64 = 1 << 20;
/// Maximum number of connections that are shown.
const MAX_CONNECTIONS: usize = 200;

/// Returns the connections, or the reason why they are unknown.
pub(crate) async fn connections(network: &Network) -> Json {
    let Some((host, port)) = network.server() else {
        return json!({ "error": "there is no name server" });
    };
    match tokio::time::timeout(TIMEOUT, request(host, port)).await {
        Ok(Ok(text)) => read(&text),
        Ok(Err(error)) => {
            json!({ "error": format!("the name server at {host}:{port} does not answer: {error}") })
        }
        Err(_) => {
            json!({ "error": format!("the name server at {host}:{port} does not answer in time") })
        }
    }
}

async fn request(host: &str, port: u16) -> std::io::Result<String> {
    let mut stream = TcpStream::connect((host, port)).await?;
    let head = format!(
        "GET /api/connections?wait=0 HTTP/1.1\r\nHost: {host}:{port}\r\nConnection: close\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).await?;
    let mut answer = Vec::new();
    stream.take(MAX_ANSWER).read_to_end(&mut answer).await?;
    Ok(String::from_utf8_lossy(&answer).into_owned())
}

/// Reads an answer; what another name server than ours answers is no error of the network.
fn read(answer: &str) -> Json {
    let unknown =
        || json!({ "error": "this name server does not tell connections, or they are too many" });
    let Some((_, body)) = answer.split_once("\r\n\r\n") else {
        return unknown();
    };
    let Ok(Json::Object(mut told)) = serde_json::from_str(body) else {
        return unknown();
    };
    let Some(Json::Array(mut connections)) = told.remove("connections") else {
        return unknown();
    };
    let count = connections.len();
    connections.truncate(MAX_CONNECTIONS);
    json!({ "connections": connections, "count": count })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_read_and_bounded() {
        let head = "HTTP/1.1 200 OK\r\nContent-Length: 1\r\n\r\n";
        let told = read(&format!("{head}{{\"connections\":[{{\"from\":\"/a\"}}]}}"));
        assert_eq!(told["connections"][0]["from"], "/a");
        let many = vec!["1"; MAX_CONNECTIONS + 3].join(",");
        let told = read(&format!("{head}{{\"connections\":[{many}]}}"));
        assert_eq!(
            told["connections"].as_array().unwrap().len(),
            MAX_CONNECTIONS
        );
        assert_eq!(told["count"], MAX_CONNECTIONS + 3);
        for bad in [
            "",
            "HTTP/1.1 404 Not Found\r\n\r\nnothing",
            "\r\n\r\n[]",
            "\r\n\r\n{\"connections\":1}",
        ] {
            assert!(read(bad)["error"].is_string(), "{bad:?}");
        }
    }
}
