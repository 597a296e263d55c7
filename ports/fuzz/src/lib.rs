//! Fuzzing of configuration files, the counters of other ports, and messages that pass monitors:
//! parsed input prints, and parses again.
//!
//! The same functions are replayed over the committed corpus by `tests/fuzz_corpus.rs`.

use std::path::Path;

use yarp_ports::PortCounters;
use yarp_ports::config::{NameServer, file_name, parse_key, parse_namespaces, print_namespaces};
use yarp_ports::roles::{Peer, Right, RoleTable};
use yarp_ports::{MonitorSetup, MonitorSide, Passing, built_in_monitor};
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
