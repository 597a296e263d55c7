//! Masks what legitimately differs between two runs of the same scenario.
//!
//! | field | shown as | where |
//! | --- | --- | --- |
//! | IPv4 address | `IP` | anywhere in text |
//! | port number | `N` | after `port`, `port_number`, and in `HOST:N/` |
//! | process and thread ids | `N` | after `process =`, `pid`, `tid` |
//! | addresses of the machine | `ADDRESSES` | after `property ips =` |
//! | carriers offered and accepted | kept | what a client asked for is stored as it stands |
//! | TCP port in a header reply | `N` | first eight bytes of a binary acceptor |
//! | count and time of an answer | `COUNT`, `TIME` | after `[tsta]`, see [`bottle`] |

use yarp_wire::{Bottle, Value, Vocab32};

/// Masks text; other data is unchanged.
pub fn text(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let mut out = String::new();
    for line in text.split_inclusive('\n') {
        out.push_str(&mask_line(line));
    }
    out
}

fn mask_line(line: &str) -> String {
    if let Some((head, _)) = line.split_once(" property ips = ") {
        return format!("{head} property ips = ADDRESSES\r\n");
    }
    let mut out = String::new();
    let mut word = String::new();
    let mut before = String::new();
    for c in line.chars().chain(std::iter::once('\0')) {
        if c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | ':') {
            word.push(c);
            continue;
        }
        out.push_str(&mask_word(&word, &before));
        if !word.is_empty() {
            before = std::mem::take(&mut word);
        } else if c == '=' && before == "process" {
            before = "process =".to_owned();
        }
        if c != '\0' {
            out.push(c);
        }
    }
    out
}

fn mask_word(word: &str, before: &str) -> String {
    let number = |word: &str| !word.is_empty() && word.chars().all(|c| c.is_ascii_digit());
    if let Some((host, port)) = word.split_once(':')
        && is_address(host)
        && number(port)
    {
        return "IP:N".to_owned();
    }
    if is_address(word) {
        return "IP".to_owned();
    }
    if number(word) && matches!(before, "port" | "port_number" | "process =" | "pid" | "tid") {
        return "N".to_owned();
    }
    word.to_owned()
}

fn is_address(word: &str) -> bool {
    word.parse::<std::net::Ipv4Addr>().is_ok()
}

/// Masks the count and time that control boards append after `[tsta]`.
pub fn bottle(bottle: &Bottle) -> Bottle {
    let mut items = bottle.as_slice().to_vec();
    let stamp = Value::Vocab32(Vocab32::new("tsta"));
    if let Some(at) = items.iter().position(|item| *item == stamp) {
        if let Some(count @ Value::Int32(_)) = items.get_mut(at + 1) {
            *count = "COUNT".into();
        }
        if let Some(time @ Value::Float64(_)) = items.get_mut(at + 2) {
            *time = "TIME".into();
        }
    }
    items.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_varies_is_masked() {
        let check = |raw: &str, masked: &str| assert_eq!(text(raw.as_bytes()), masked);
        check(
            "registration name /a ip 192.0.2.2 port 10002 type tcp\r\n",
            "registration name /a ip IP port N type tcp\r\n",
        );
        check(
            "This is /a at tcp://10.0.0.1:10002/\r\n",
            "This is /a at tcp://IP:N/\r\n",
        );
        check(
            "port /a property process = 77\r\n",
            "port /a property process = N\r\n",
        );
        check(
            "port /a property colour = 77\r\n",
            "port /a property colour = 77\r\n",
        );
        check(
            "(port_number 10002) (ip \"1.2.3.4\")",
            "(port_number N) (ip \"IP\")",
        );
        check("a 1 2.5 (3)", "a 1 2.5 (3)");
    }
}
