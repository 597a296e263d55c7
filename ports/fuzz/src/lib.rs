//! Fuzzing of configuration files, the counters of other ports, and messages that pass monitors:
//! parsed input prints, and parses again.
//!
//! The same functions are replayed over the committed corpus by `tests/fuzz_corpus.rs`.

use std::io;
use std::path::Path;
#[cfg(feature = "tls")]
use std::sync::LazyLock;

use yarp_ports::PortCounters;
use yarp_ports::config::{
    ConfigError, Configuration, Environment, NameServer, Platform, file_name, parse_key,
    parse_namespaces, print_namespaces,
};
use yarp_ports::roles::{Peer, Right, RoleTable};
use yarp_ports::{MonitorSetup, MonitorSide, Passing, built_in_monitor};
use yarp_wire::http::{Head, Service};
use yarp_wire::message::{Form, Payload, Pieces, ReadObject, WireObject};
use yarp_wire::typed::{Image, PixelCode};
use yarp_wire::{Bottle, Limits, WireVersion};

/// An answer to `[prop] [get] counters`, as text.
pub fn counters(data: &[u8]) {
    let Ok(answer) = Bottle::parse(&String::from_utf8_lossy(data)) else {
        return;
    };
    if let Some(counters) = PortCounters::from_bottle(&answer) {
        let told = counters.to_bottle();
        let again = PortCounters::from_bottle(&told).expect("our own words");
        assert_eq!(again.to_bottle().to_string(), told.to_string());
    }
}

/// Parses one file as each kind of configuration file.
pub fn configuration(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let file = Path::new("yarp.conf");
    if let Ok(Some(server)) = NameServer::parse(file, &text) {
        let printed = server.to_string();
        assert!(NameServer::parse(file, &printed).is_ok(), "{printed:?}");
    }
    let names = parse_namespaces(&text);
    assert!(!names.is_empty());
    let _ = print_namespaces(&names);
    for name in &names {
        assert!(!file_name(name).contains('/'), "{name:?}");
    }
    let _ = parse_key(Path::new("auth.conf"), &text);
    if let Ok(roles) = RoleTable::parse(Path::new("roles.conf"), &text) {
        let peer = Peer {
            name: "/fuzz",
            address: [192, 0, 2, 1].into(),
        };
        let rights = roles.rights("/fuzz", peer);
        // No roles, no restrictions.
        assert!(!roles.is_empty() || rights.has(Right::Administer));
    }
}

/// Returns the configuration of a program with one file, and with others that `find` returns by their names.
fn configuration_of(
    name: &str,
    text: &str,
    find: impl Fn(&str) -> Option<String>,
) -> Result<Configuration, ConfigError> {
    let environment = Environment::from_iter([("YARP_CONFIG_HOME", "/nowhere")]);
    Configuration::load(environment.on(Platform::Linux), |file| {
        let asked = file.file_name().and_then(|name| name.to_str());
        let found = match asked {
            Some(asked) if asked == name => Some(text.to_owned()),
            Some(asked) => find(asked),
            None => None,
        };
        found.ok_or_else(|| io::ErrorKind::NotFound.into())
    })
}

/// Parses `browsers.conf`: only its own lines admit a foreign origin or a foreign host.
pub fn browsers_conf(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let Ok(held) = configuration_of("browsers.conf", &text, |_| None) else {
        return;
    };
    let lines = |key: &str| -> Vec<String> {
        let words = text.lines().map(str::split_whitespace);
        let values = words.filter_map(|mut words| (words.next()? == key).then(|| words.next())?);
        values.map(str::to_ascii_lowercase).collect()
    };
    let (origins, hosts) = (lines("origin"), lines("host"));
    let admit = |host: &str, origin: &str| {
        let head = format!("POST /form HTTP/1.1\r\nHost: {host}\r\nOrigin: {origin}\r\n\r\n");
        held.gate()
            .admit(Service::Pages, &Head::parse(head.as_bytes()))
            .ok()
    };
    assert!(admit("localhost", "null").is_none());
    let foreign = ["http://evil.example", "https://evil.example:8080"];
    let words = text.split_whitespace().take(20).chain(foreign);
    for word in words {
        // An own page needs no line.
        let foreign =
            admit("localhost", word).and_then(|admission| Some(admission.origin()?.to_owned()));
        if let Some(origin) = foreign {
            assert!(origins.contains(&origin), "{origin:?} of {word:?}");
        }
        let name = word.rsplit_once("://").map_or(word, |(_, name)| name);
        let rebound = admit("evil.example", &format!("http://{name}"));
        assert!(rebound.is_none() || hosts.contains(&"evil.example".to_owned()));
    }
    for origin in &origins {
        let admission = admit("localhost", origin).expect("an origin that the file lists");
        assert!(admission.origin().is_none_or(|found| found == origin));
    }
}

/// Parses `tls.conf`, with a certificate and its key where it asks for them: settings never show the key, and whoever
/// adds the line has encryption required.
#[cfg(feature = "tls")]
pub fn tls_conf(data: &[u8]) {
    static HOST: LazyLock<(String, String)> = LazyLock::new(|| {
        let made = rcgen::generate_simple_self_signed(["lab".to_owned()]).expect("a certificate");
        (made.cert.pem(), made.signing_key.serialize_pem())
    });
    let (certificate, key) = &*HOST;
    let find = |name: &str| {
        let extension = name.rsplit_once('.')?.1;
        match extension {
            "pem" => Some(certificate.clone()),
            "key" => Some(key.clone()),
            // The file itself as a certificate.
            "raw" => Some(String::from_utf8_lossy(data).into_owned()),
            _ => None,
        }
    };
    let text = String::from_utf8_lossy(data);
    let Ok(held) = configuration_of("tls.conf", &text, find) else {
        return;
    };
    let tls = held.tls().expect("settings of the file");
    let secret = key.lines().nth(1).expect("a line of the key");
    assert!(!format!("{tls:?} {held:?}").contains(secret));
    let more = format!("{text}\n[TLS]\nrequired others\n");
    let held = configuration_of("tls.conf", &more, find).expect("one more section");
    let required = held.tls().map(|tls| tls.required());
    assert!(!matches!(
        required,
        None | Some(yarp_ports::TlsRequired::None)
    ));
}

/// Passes bytes to each of the monitors that decompress or convert: no message exceeds its maximum
/// size, and the output of monitors can be read.
pub fn monitors(data: &[u8]) {
    for form in [Form::Binary(WireVersion::V3), Form::Text] {
        let payload = Payload::new(data.to_vec().into(), form);
        for name in [
            "bottle_compression_zlib",
            "image_compression_jpeg",
            "image_to_mono",
        ] {
            if let Some(made) = passed(name, "", payload.clone()) {
                assert!(made.bytes().len() <= Limits::DEFAULT.inflated.max(data.len()));
            }
        }
        let images = [
            "depthimage_compression_zlib",
            "depthimage_to_mono",
            "depthimage_to_rgb",
        ];
        for name in images {
            image(passed(name, "", payload.clone()));
        }
        bayer(payload);
    }
    let [width, pixels @ ..] = data else {
        return;
    };
    let width = usize::from(*width % 40) + 1;
    let height = pixels.len() / width;
    let pixels = pixels[..width * height].to_vec();
    let raw = Image::from_padded(PixelCode::MONO, width, height, 1, pixels);
    let mut pieces = Pieces::new();
    let image = raw.expect("an image");
    image.write_pieces(&mut pieces, WireVersion::V3);
    bayer(Payload::of_pieces(&pieces, WireVersion::V3));
}

fn bayer(payload: Payload) {
    for order in ["grbg", "gbrg", "rggb", "bggr"] {
        for method in [
            "bilinear",
            "nearest",
            "simple",
            "hqlinear",
            "edgesense",
            "downsample",
        ] {
            let options = format!("(order {order}) (method {method})");
            image(passed("bayer", &options, payload.clone()));
        }
    }
}

fn image(bytes: Option<Payload>) {
    if let Some(payload) = bytes {
        Image::read(&payload).expect("what a monitor makes is an image");
    }
}

/// Returns the output of a reader's monitor for a message.
fn passed(name: &str, options: &str, payload: Payload) -> Option<Payload> {
    let options = Bottle::parse(options).expect("a bottle");
    let setup = MonitorSetup::new(MonitorSide::Receive, "/w", "/r", options);
    let monitor = built_in_monitor(name, &setup).expect("a monitor");
    Some(monitor.update(Passing::new(payload))?.payload)
}
