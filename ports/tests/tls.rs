//! Ports connect over `tls` if both hosts have certificates of the same authority, and with nobody else.

#![cfg(feature = "tls")]

use crate::common;

use std::net::SocketAddr;

use common::{DEADLINE, Raw, bottle, next, tcp_header, until, within};
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose,
};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use yarp_ports::{
    AdminClient, Answer, Network, Port, PortError, PortOptions, Queue, Tls, TlsError, TlsRequired,
};
use yarp_wire::Bottle;
use yarp_wire::auth::Key;
use yarp_wire::carrier::Carrier;
use yarp_wire::message::Command;

const LAB: &str = "lab";

/// An authority of a lab.
struct Authority {
    certificate: String,
    issuer: Issuer<'static, KeyPair>,
}

/// Years in which a certificate of a test is valid.
#[derive(Clone, Copy)]
struct Years(i32, i32);

const VALID: Years = Years(2020, 4000);

impl Authority {
    fn new() -> Self {
        let mut params = CertificateParams::default();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        params
            .distinguished_name
            .push(DnType::CommonName, "lab authority");
        params.key_usages.push(KeyUsagePurpose::KeyCertSign);
        let key = KeyPair::generate().unwrap();
        Self {
            certificate: params.self_signed(&key).unwrap().pem(),
            issuer: Issuer::new(params, key),
        }
    }

    /// A certificate of this authority and its key.
    fn certificate(&self, name: &str, valid: Years) -> (String, String) {
        let mut params = CertificateParams::new([name.to_owned()]).unwrap();
        params.not_before = rcgen::date_time_ymd(valid.0, 1, 1);
        params.not_after = rcgen::date_time_ymd(valid.1, 1, 1);
        params.extended_key_usages = vec![
            ExtendedKeyUsagePurpose::ServerAuth,
            ExtendedKeyUsagePurpose::ClientAuth,
        ];
        let key = KeyPair::generate().unwrap();
        let certificate = params.signed_by(&key, &self.issuer).unwrap();
        (certificate.pem(), key.serialize_pem())
    }

    /// Settings of a host with a certificate of this authority.
    fn host(&self) -> Tls {
        self.host_with(LAB, VALID, Some(LAB))
    }

    fn host_with(&self, name: &str, valid: Years, expected: Option<&str>) -> Tls {
        let (certificate, key) = self.certificate(name, valid);
        Tls::from_pem(&self.certificate, &certificate, &key, expected).unwrap()
    }
}

fn network(tls: impl Into<Option<Tls>>) -> Network {
    Network::none().with_timeout(DEADLINE).with_tls(tls.into())
}

async fn open(network: &Network, name: &str, options: PortOptions) -> Port {
    within(Port::open(network, name, options.unregistered()))
        .await
        .unwrap()
}

fn reading() -> PortOptions {
    PortOptions::new().queue(Queue::Wait(8))
}

fn echo() -> PortOptions {
    PortOptions::new().handler(|message| match message.bottle() {
        Ok(bottle) => Answer::reply(bottle),
        Err(_) => Answer::Nothing,
    })
}

/// Asks an echo over `tls`.
async fn asks(port: &Port, network: &Network, text: &str) -> Result<String, PortError> {
    let carrier = Carrier::by_name("tls").unwrap();
    let address = ("127.0.0.1", port.tcp_port());
    let opening = AdminClient::open(port.name(), address, carrier, "/asker", network);
    let mut client = within(opening).await?;
    let reply = within(client.request(&Command::data(true), &bottle(text))).await?;
    Ok(reply.to_bottle().unwrap().to_string())
}

#[tokio::test]
async fn messages_pass_in_both_directions() {
    let lab = Authority::new();
    let [one, other] = [network(lab.host()), network(lab.host())];
    let a = open(&one, "/a", reading()).await;
    let b = open(&other, "/b", reading()).await;
    common::connect(&a, &b, "tls").await;
    common::connect(&b, &a, "tls").await;
    for count in 0..100 {
        within(a.write(&bottle(&format!("to b {count}")))).await;
        within(b.write(&bottle(&format!("to a {count}")))).await;
        assert_eq!(next(&b).await, format!("to b {count}"));
        assert_eq!(next(&a).await, format!("to a {count}"));
    }
    // Larger than all buffers on the way.
    let much: Vec<String> = (0..200_000).map(|count| format!("word{count}")).collect();
    let much = bottle(&much.join(" "));
    within(a.write(&much)).await;
    within(a.write(&bottle("behind"))).await;
    assert_eq!(next(&b).await, much.to_string());
    assert_eq!(next(&b).await, "behind");
    within(a.close()).await;
    until(|| b.inputs().is_empty()).await;
}

#[tokio::test]
async fn requests_are_replied_to() {
    let lab = Authority::new();
    let port = open(&network(lab.host()), "/echo", echo()).await;
    let client = network(lab.host());
    let asker = open(&client, "/asker", PortOptions::new().rpc_client()).await;
    common::connect(&asker, &port, "tls").await;
    for count in 0..100 {
        let question = bottle(&format!("question {count}"));
        let reply: Bottle = within(asker.call(&question)).await.unwrap();
        assert_eq!(reply, question);
    }
    assert_eq!(asks(&port, &client, "a b").await.unwrap(), "a b");
}

/// Nothing that is said can be read on the way, the names of ports included.
#[tokio::test]
async fn nothing_of_it_can_be_read() {
    let lab = Authority::new();
    let reader = open(&network(lab.host()), "/reader-of-secrets", reading()).await;
    let (number, seen) = tapped(reader.tcp_port()).await;
    let writer = open(
        &network(lab.host()),
        "/writer-of-secrets",
        PortOptions::new(),
    )
    .await;
    within(writer.connect(&format!("tls://127.0.0.1:{number}/reader-of-secrets")))
        .await
        .unwrap();
    within(writer.write(&bottle("move to 45.5"))).await;
    assert_eq!(next(&reader).await, "move to 45.5");
    within(writer.close()).await;
    let seen = within(seen).await.unwrap();
    assert!(!seen.is_empty());
    for secret in ["secrets", "move", "YARP_TLS"] {
        let found = seen
            .windows(secret.len())
            .any(|bytes| bytes == secret.as_bytes());
        assert!(!found, "{secret} can be read");
    }
}

/// A place that passes all on to a port, and what it has seen at the end of the first connection.
async fn tapped(to: u16) -> (u16, tokio::task::JoinHandle<Vec<u8>>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = listener.local_addr().unwrap().port();
    let passing = tokio::spawn(async move {
        let (mut client, _) = listener.accept().await.unwrap();
        let mut server = TcpStream::connect(("127.0.0.1", to)).await.unwrap();
        let (mut seen, mut back) = (Vec::new(), Vec::new());
        let (mut from_client, mut from_server) = (vec![0; 4096], vec![0; 4096]);
        loop {
            tokio::select! {
                read = client.read(&mut from_client) => match read {
                    Ok(0) | Err(_) => break,
                    Ok(count) => {
                        seen.extend_from_slice(&from_client[..count]);
                        let _ = server.write_all(&from_client[..count]).await;
                    }
                },
                read = server.read(&mut from_server) => match read {
                    Ok(0) | Err(_) => break,
                    Ok(count) => {
                        back.extend_from_slice(&from_server[..count]);
                        let _ = client.write_all(&from_server[..count]).await;
                    }
                },
            }
        }
        seen.append(&mut back);
        seen
    });
    (number, passing)
}

/// The carriers of stock go on beside it.
#[tokio::test]
async fn plain_carriers_are_taken_too_unless_encryption_is_required() {
    let lab = Authority::new();
    let reader = open(&network(lab.host()), "/reader", reading()).await;
    for carrier in ["tcp", "fast_tcp", "text", "udp", "unix_stream"] {
        let writer = open(&network(None), "/writer", PortOptions::new()).await;
        common::connect(&writer, &reader, carrier).await;
        within(writer.write(&bottle("hello"))).await;
        assert_eq!(next(&reader).await, "hello", "{carrier}");
        within(writer.close()).await;
    }
}

#[tokio::test]
async fn with_a_key_both_are_asked_for() {
    let lab = Authority::new();
    let with = |key: &str| network(lab.host()).with_key(Key::new(key.as_bytes()));
    let port = open(&with("key"), "/echo", echo()).await;
    assert_eq!(asks(&port, &with("key"), "a b").await.unwrap(), "a b");
    let error = asks(&port, &with("other"), "a b").await.unwrap_err();
    assert!(
        matches!(error, PortError::Authentication { .. }),
        "{error:?}"
    );
}

/// The port takes no part in it, and goes on with others.
async fn is_refused(port: &Port, client: &Network) -> PortError {
    let error = asks(port, client, "a b").await.unwrap_err();
    assert!(port.inputs().is_empty());
    error
}

#[tokio::test]
async fn certificates_of_others_are_refused_by_both() {
    let (lab, others) = (Authority::new(), Authority::new());
    let ours = network(lab.host());
    let port = open(&ours, "/echo", echo()).await;
    // The client does not know the authority of the port.
    let error = is_refused(&port, &network(others.host())).await;
    let PortError::Encryption { source, .. } = &error else {
        panic!("{error:?}");
    };
    assert!(matches!(source, TlsError::Refused(_)), "{source:?}");
    // The client knows it, and shows a certificate of another.
    let (certificate, key) = others.certificate(LAB, VALID);
    let stranger = Tls::from_pem(&lab.certificate, &certificate, &key, Some(LAB)).unwrap();
    is_refused(&port, &network(stranger)).await;
    assert_eq!(asks(&port, &ours, "a b").await.unwrap(), "a b");
}

#[tokio::test]
async fn certificates_that_have_expired_are_refused_by_both() {
    let lab = Authority::new();
    let ours = network(lab.host());
    for years in [Years(2000, 2001), Years(3999, 4000)] {
        let stale = network(lab.host_with(LAB, years, Some(LAB)));
        let port = open(&ours, "/echo", echo()).await;
        is_refused(&port, &stale).await;
        let port = open(&stale, "/stale", echo()).await;
        let error = is_refused(&port, &ours).await;
        assert!(matches!(error, PortError::Encryption { .. }), "{error:?}");
    }
}

#[tokio::test]
async fn a_certificate_has_to_bear_the_name() {
    let lab = Authority::new();
    let port = open(
        &network(lab.host_with("127.0.0.1", VALID, None)),
        "/echo",
        echo(),
    )
    .await;
    let by_host = network(lab.host_with("127.0.0.1", VALID, None));
    assert_eq!(asks(&port, &by_host, "a b").await.unwrap(), "a b");
    let error = is_refused(&port, &network(lab.host())).await;
    assert!(matches!(error, PortError::Encryption { .. }), "{error:?}");
    let elsewhere = lab.host_with("192.0.2.1", VALID, None);
    let port = open(&network(elsewhere), "/echo", echo()).await;
    let error = is_refused(&port, &by_host).await;
    assert!(matches!(error, PortError::Encryption { .. }), "{error:?}");
}

#[tokio::test]
async fn who_has_no_certificate_is_told() {
    let lab = Authority::new();
    let port = open(&network(lab.host()), "/echo", echo()).await;
    let error = is_refused(&port, &network(None)).await;
    let PortError::Encryption { source, .. } = &error else {
        panic!("{error:?}");
    };
    assert!(matches!(source, TlsError::NotConfigured), "{source:?}");
    // One that has none does not answer either.
    let plain = open(&network(None), "/plain", echo()).await;
    let error = is_refused(&plain, &network(lab.host())).await;
    assert!(matches!(error, PortError::Encryption { .. }), "{error:?}");
    // The handshake alone makes nobody a member: this client shows no certificate.
    let mut raw = Raw::to(&port).await;
    raw.send(hello()).await;
    raw.ended().await;
    assert!(port.inputs().is_empty());
}

/// Writes to the port as a client of another implementation that trusts the lab; returns what it reads, or why it could not.
fn written_by_other_client(
    number: u16,
    lab: &str,
    certificate: Option<(String, String)>,
) -> std::io::Result<String> {
    use rustls::pki_types::pem::PemObject;
    use rustls::pki_types::{CertificateDer, PrivateKeyDer};
    use std::io::{Read, Write};
    let mut roots = rustls::RootCertStore::empty();
    let root = CertificateDer::from_pem_slice(lab.as_bytes()).unwrap();
    roots.add(root).unwrap();
    let provider = std::sync::Arc::new(rustls::crypto::ring::default_provider());
    let builder = rustls::ClientConfig::builder_with_provider(provider)
        .with_protocol_versions(&[&rustls::version::TLS13])
        .unwrap()
        .with_root_certificates(roots);
    let config = match certificate {
        None => builder.with_no_client_auth(),
        Some((chain, key)) => {
            let chain = vec![CertificateDer::from_pem_slice(chain.as_bytes()).unwrap()];
            let key = PrivateKeyDer::from_pem_slice(key.as_bytes()).unwrap();
            builder.with_client_auth_cert(chain, key).unwrap()
        }
    };
    let mut session =
        rustls::ClientConnection::new(config.into(), LAB.try_into().unwrap()).unwrap();
    let mut tcp = std::net::TcpStream::connect(("127.0.0.1", number))?;
    tcp.set_read_timeout(Some(DEADLINE))?;
    let mut stream = rustls::Stream::new(&mut session, &mut tcp);
    stream.write_all(b"CONNECT asker\r\n")?;
    let mut welcome = [0; 15];
    stream.read_exact(&mut welcome)?;
    Ok(String::from_utf8_lossy(&welcome).into_owned())
}

/// The client trusts the port, and completes its part of the handshake.
#[tokio::test]
async fn a_client_without_a_certificate_of_the_lab_is_refused() {
    let (lab, others) = (Authority::new(), Authority::new());
    let port = open(&network(lab.host()), "/echo", echo()).await;
    let written = async |certificate| {
        let (number, lab) = (port.tcp_port(), lab.certificate.clone());
        let writing = move || written_by_other_client(number, &lab, certificate);
        tokio::task::spawn_blocking(writing).await.unwrap()
    };
    let member = written(Some(lab.certificate(LAB, VALID))).await;
    assert_eq!(member.unwrap(), "Welcome asker\r\n");
    for certificate in [None, Some(others.certificate(LAB, VALID))] {
        let error = written(certificate).await.unwrap_err();
        assert!(
            error.to_string().contains("received fatal alert"),
            "{error}"
        );
    }
}

/// A `ClientHello` as OpenSSL would send one, cut down to what TLS 1.3 asks for; its key share is no point of the curve.
fn hello() -> Vec<u8> {
    let mut extensions = Vec::new();
    let mut add = |kind: u16, content: &[u8]| {
        extensions.extend_from_slice(&kind.to_be_bytes());
        extensions.extend_from_slice(&(content.len() as u16).to_be_bytes());
        extensions.extend_from_slice(content);
    };
    add(43, &[2, 3, 4]);
    add(10, &[0, 2, 0, 29]);
    add(13, &[0, 2, 4, 3]);
    add(51, &[&[0, 36, 0, 29, 0, 32][..], &[9; 32]].concat());
    let mut body = vec![3, 3];
    body.extend_from_slice(&[7; 32]);
    body.extend_from_slice(&[0, 0, 2, 0x13, 1, 1, 0]);
    body.extend_from_slice(&(extensions.len() as u16).to_be_bytes());
    body.extend_from_slice(&extensions);
    let mut message = vec![1, 0];
    message.extend_from_slice(&(body.len() as u16).to_be_bytes());
    message.extend_from_slice(&body);
    let mut record = vec![22, 3, 1];
    record.extend_from_slice(&(message.len() as u16).to_be_bytes());
    record.extend_from_slice(&message);
    record
}

#[tokio::test]
async fn plain_connections_are_refused_where_encryption_is_required() {
    let lab = Authority::new();
    let strict = network(lab.host().with_required(TlsRequired::All));
    let port = open(&strict, "/reader", reading()).await;
    for header in [
        &tcp_header("/writer")[..],
        b"CONNECT /writer\r\n",
        b"GET / HTTP/1.1\r\n\r\n",
    ] {
        let mut raw = Raw::to(&port).await;
        raw.send(header).await;
        assert_eq!(raw.ended().await, b"");
    }
    for carrier in [
        "tcp",
        "fast_tcp",
        "text",
        "udp",
        "unix_stream",
        "shmem",
        "mjpeg",
    ] {
        let writer = open(&network(lab.host()), "/writer", PortOptions::new()).await;
        let connecting = within(writer.connect(&common::at(&port, carrier))).await;
        // Who sends lines does not wait for an answer.
        assert!(connecting.is_err() || carrier == "text", "{carrier}");
        until(|| writer.outputs().is_empty()).await;
    }
    assert!(port.inputs().is_empty());
    // Whoever requires it encrypts what is asked for as plain, and makes nothing that cannot be.
    for carrier in ["tls", "tcp", "text", "text_ack"] {
        let writer = open(&strict, "/writer", PortOptions::new()).await;
        common::connect(&writer, &port, carrier).await;
        within(writer.write(&bottle("hello"))).await;
        assert_eq!(next(&port).await, "hello", "{carrier}");
        within(writer.close()).await;
    }
    for carrier in ["udp", "unix_stream", "shmem"] {
        let writer = open(&strict, "/writer", PortOptions::new()).await;
        let error = within(writer.connect(&common::at(&port, carrier)))
            .await
            .unwrap_err();
        let text = yarp_ports::error_chain(&error);
        assert!(text.contains("is not encrypted"), "{carrier}: {text}");
    }
}

/// The name of the carrier says what it does: in a plain connection it is refused.
#[tokio::test]
async fn the_carrier_is_refused_in_a_plain_connection() {
    let lab = Authority::new();
    for network in [network(lab.host()), network(None)] {
        let port = open(&network, "/reader", reading()).await;
        let mut raw = Raw::to(&port).await;
        let header = tcp_header("/writer");
        raw.send([b"YARP_TLS", &header[8..]].concat()).await;
        assert_eq!(raw.ended().await, b"");
        assert!(port.inputs().is_empty());
    }
}

#[tokio::test]
async fn garbage_ends_a_handshake() {
    let lab = Authority::new();
    let ours = network(lab.host());
    let port = open(&ours, "/echo", echo()).await;
    let mut flipped = hello();
    flipped[9] ^= 0xff;
    for garbage in [
        &[22; 64][..],
        &[22, 3, 1, 0xff, 0xff],
        &[22, 3, 1, 0, 0, 0, 0, 0],
        &[22, 3, 1, 0, 4, 1, 0xff, 0xff, 0xff],
        &flipped,
        &[&hello()[..], &[0; 4096]].concat(),
    ] {
        let mut raw = Raw::to(&port).await;
        raw.try_send(garbage).await;
        raw.try_send([0xa5; 32 * 1024]).await;
        raw.ended().await;
    }
    assert_eq!(asks(&port, &ours, "a b").await.unwrap(), "a b");
    // And of those who listen.
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = listener.local_addr().unwrap().port();
    tokio::spawn(async move {
        let (mut stream, _) = listener.accept().await.unwrap();
        stream.write_all(&[0xa5; 4096]).await.unwrap();
        std::future::pending::<()>().await;
    });
    let writer = open(&ours, "/writer", PortOptions::new()).await;
    let error = within(writer.connect(&format!("tls://127.0.0.1:{number}/garbage"))).await;
    assert!(
        matches!(error, Err(PortError::Encryption { .. })),
        "{error:?}"
    );
}

#[tokio::test]
async fn a_peer_that_goes_during_the_handshake_leaves_nothing() {
    let lab = Authority::new();
    let ours = network(lab.host());
    let port = open(&ours, "/echo", echo()).await;
    let hello = hello();
    for length in 0..hello.len() {
        let mut raw = Raw::to(&port).await;
        raw.send(&hello[..length]).await;
        drop(raw);
    }
    assert_eq!(asks(&port, &ours, "a b").await.unwrap(), "a b");
    until(|| port.inputs().is_empty()).await;
}

/// A peer that sends byte by byte would hold a connection without end.
#[tokio::test]
async fn a_handshake_is_over_in_time_however_slow() {
    let lab = Authority::new();
    let port = open(&network(lab.host()), "/echo", echo()).await;
    let address = SocketAddr::from(([127, 0, 0, 1], port.tcp_port()));
    let mut stream = TcpStream::connect(address).await.unwrap();
    let dripping = async {
        for byte in hello() {
            if stream.write_all(&[byte]).await.is_err() {
                return;
            }
            // The whole of it would take longer than a test may.
            tokio::time::sleep(DEADLINE / 40).await;
            if matches!(stream.try_read(&mut [0; 256]), Ok(0)) {
                return;
            }
        }
        panic!("the handshake went on");
    };
    within(dripping).await;
}

/// A stream that was cut off is not taken for one that ended.
#[tokio::test]
async fn what_changes_on_the_way_ends_the_connection() {
    let lab = Authority::new();
    let reader = open(&network(lab.host()), "/reader", reading()).await;
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = listener.local_addr().unwrap().port();
    let to = reader.tcp_port();
    let (change, changes) = tokio::sync::watch::channel(false);
    tokio::spawn(async move {
        let (client, _) = listener.accept().await.unwrap();
        let server = TcpStream::connect(("127.0.0.1", to)).await.unwrap();
        let (mut from_client, mut to_client) = client.into_split();
        let (mut from_server, mut to_server) = server.into_split();
        tokio::spawn(async move { tokio::io::copy(&mut from_server, &mut to_client).await });
        let mut bytes = vec![0; 4096];
        while let Ok(count @ 1..) = from_client.read(&mut bytes).await {
            if *changes.borrow() {
                bytes[count - 1] ^= 1;
            }
            let _ = to_server.write_all(&bytes[..count]).await;
        }
    });
    let writer = open(&network(lab.host()), "/writer", PortOptions::new()).await;
    within(writer.connect(&format!("tls://127.0.0.1:{number}/reader")))
        .await
        .unwrap();
    within(writer.write(&bottle("first"))).await;
    assert_eq!(next(&reader).await, "first");
    change.send_replace(true);
    within(writer.write(&bottle("changed"))).await;
    until(|| reader.inputs().is_empty() && writer.outputs().is_empty()).await;
}
