//! Names of name servers, and the files that belong to them.

use yarp_wire::{Bottle, Value};

/// The name server's name unless told otherwise.
pub const DEFAULT_NAMESPACE: &str = "/root";

/// Reads the content of `yarp_namespace.conf` or `YARP_NAMESPACE`: one or more names, quoted or
/// not, by blanks or by lines. Nothing is [`DEFAULT_NAMESPACE`].
pub fn parse_namespaces(text: &str) -> Vec<String> {
    // Nested too deep to be read is no list of names either.
    let bottle = Bottle::parse(text).unwrap_or_default();
    let names = bottle.iter().map(Value::to_plain_string);
    let names: Vec<_> = names.filter(|name| !name.is_empty()).collect();
    if names.is_empty() {
        return vec![DEFAULT_NAMESPACE.to_owned()];
    }
    names
}

/// Returns the content of `yarp_namespace.conf`: `"/foo" "/bar"`, as stock writes it.
pub fn print_namespaces(names: &[String]) -> String {
    let names: Bottle = names
        .iter()
        .map(|name| Value::from(name.as_str()))
        .collect();
    names.to_string()
}

/// Returns the name of the file with the address of the name server called `namespace`.
///
/// `yarp.conf` for `/root`; else the name with every byte but ASCII letters and digits replaced:
/// `_foo.conf` for `/foo`.
pub fn file_name(namespace: &str) -> String {
    if namespace == DEFAULT_NAMESPACE {
        return "yarp.conf".to_owned();
    }
    format!("{}.conf", plain(namespace))
}

/// Returns the name with `_` for every byte that is no ASCII letter or digit.
pub(super) fn plain(name: &str) -> String {
    let plain = |byte: u8| match byte {
        byte if byte.is_ascii_alphanumeric() => char::from(byte),
        _ => '_',
    };
    name.bytes().map(plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_named_after_namespaces() {
        for (namespace, file) in [
            ("/root", "yarp.conf"),
            ("/foo", "_foo.conf"),
            ("/a-b/c.d", "_a_b_c_d.conf"),
            ("noslash", "noslash.conf"),
            ("/é", "___.conf"),
            ("../../etc/x", "______etc_x.conf"),
        ] {
            assert_eq!(file_name(namespace), file);
        }
    }

    #[test]
    fn names_are_read_in_all_spellings() {
        for text in ["\"/foo\" \"/bar\"", "/foo /bar", "/foo\n/bar\n"] {
            assert_eq!(parse_namespaces(text), ["/foo", "/bar"]);
        }
        for text in ["", "\n", "\"\"", &"(".repeat(1000)] {
            assert_eq!(parse_namespaces(text), ["/root"]);
        }
        let names = ["/foo", "/bar"].map(str::to_owned);
        assert_eq!(print_namespaces(&names), "\"/foo\" \"/bar\"");
    }
}
