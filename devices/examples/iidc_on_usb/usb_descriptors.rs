//! USB descriptors of the simulated camera: a Chameleon of Point Grey, with one bulk endpoint for images.

const VENDOR: u16 = 0x1e10;
const PRODUCT: u16 = 0x2004;

/// Returns the answer to a standard request to read; `None` for those that it does not know.
pub(crate) fn answer(setup: [u8; 8]) -> Option<Vec<u8>> {
    let [kind, request, low, high, ..] = setup;
    match (kind, request) {
        // Status of device and interface; configuration; alternate setting.
        (0x80..=0x82, 0x00) => Some(vec![1, 0]),
        (0x80, 0x08) => Some(vec![1]),
        (0x81, 0x0a) => Some(vec![0]),
        (0x80, 0x06) => match (high, low) {
            (1, _) => Some(device()),
            (2, 0) => Some(configuration()),
            (3, 0) => Some(vec![4, 3, 0x09, 0x04]),
            (3, 1) => Some(text("Point Grey Research")),
            (3, 2) => Some(text("Chameleon")),
            (6, _) => Some(vec![10, 6, 0, 2, 0xff, 0, 0, 64, 1, 0]),
            _ => None,
        },
        _ => None,
    }
}

fn device() -> Vec<u8> {
    let mut bytes = vec![18, 1, 0x00, 0x02, 0xff, 0, 0, 64];
    bytes.extend(VENDOR.to_le_bytes());
    bytes.extend(PRODUCT.to_le_bytes());
    bytes.extend([0, 1, 1, 2, 0, 1]);
    bytes
}

fn configuration() -> Vec<u8> {
    let interface = [9, 4, 0, 0, 1, 0xff, 0xff, 0xff, 0];
    let endpoint = [7, 5, 0x81, 2, 0x00, 0x02, 0];
    let mut bytes = vec![9, 2, 25, 0, 1, 1, 0, 0x80, 250];
    bytes.extend(interface);
    bytes.extend(endpoint);
    bytes
}

fn text(words: &str) -> Vec<u8> {
    let mut bytes = vec![2 + 2 * words.len() as u8, 3];
    bytes.extend(words.bytes().flat_map(|letter| [letter, 0]));
    bytes
}
