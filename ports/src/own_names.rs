//! The names of this machine, as far as they are known without asking anybody.

use std::net::IpAddr;
use std::path::Path;
use std::sync::LazyLock;

use yarp_wire::http::Gate;

use crate::addresses;

/// File with the names of addresses.
const HOSTS: &str = "/etc/hosts";
/// File with the domain of names without a dot.
const RESOLVER: &str = "/etc/resolv.conf";

/// A gate that knows this machine by these names; they are looked up once per process.
pub(crate) static GATE: LazyLock<Gate> = LazyLock::new(|| {
    let read = |file| std::fs::read_to_string(file).unwrap_or_default();
    let names = names(
        &host_name(),
        &read(HOSTS),
        &read(RESOLVER),
        addresses::is_own,
    );
    names.iter().fold(Gate::new(), |gate, name| gate.host(name))
});

/// Returns the host name of the system; empty if no file states it.
pub fn host_name() -> String {
    let files = ["/proc/sys/kernel/hostname", "/etc/hostname"];
    let mut texts = files
        .iter()
        .filter_map(|file| std::fs::read_to_string(file).ok());
    texts.next().unwrap_or_default().trim().to_owned()
}

/// Returns the name under which this program was started, without its folder.
pub fn program_name() -> String {
    let program = std::env::args_os().next().unwrap_or_default();
    let name = Path::new(&program).file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// The host name as it is, without its domain, in the domain of the resolver and as `NAME.local`; and all names that
/// the file of hosts gives to loopback and to `own` addresses.
fn names(host: &str, hosts: &str, resolver: &str, own: impl Fn(IpAddr) -> bool) -> Vec<String> {
    let mut names = Vec::new();
    if !host.is_empty() {
        let (short, _) = host.split_once('.').unwrap_or((host, ""));
        names.extend([host.to_owned(), short.to_owned(), format!("{short}.local")]);
        let domains = resolver.lines().filter_map(|line| {
            let mut words = line.split_whitespace();
            matches!(words.next(), Some("search" | "domain")).then_some(words)
        });
        // The search list may hold a domain in which others have a machine of the same name.
        let first = domains.filter_map(|mut words| words.next());
        names.extend(first.map(|domain| format!("{short}.{}", domain.trim_matches('.'))));
    }
    for line in hosts.lines() {
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line.split_whitespace();
        let address = words.next().and_then(|word| word.parse::<IpAddr>().ok());
        if address.is_some_and(|address| address.is_loopback() || own(address)) {
            names.extend(words.map(str::to_owned));
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_this_machine_alone() {
        let hosts = "127.0.0.1 localhost # here\n127.0.1.1 robot.lab robot\n\
            10.0.0.2 cell7\n10.0.0.3 other\nnonsense evil\n#127.0.0.1 off\n";
        let own = |address: IpAddr| address.to_string() == "10.0.0.2";
        let names = names(
            "robot",
            hosts,
            "# x\nsearch lab.example other.example\n",
            own,
        );
        let expected = [
            "robot",
            "robot",
            "robot.local",
            "robot.lab.example",
            "localhost",
            "robot.lab",
            "robot",
            "cell7",
        ];
        assert_eq!(names, expected);
        assert!(super::names("", "", "search a", |_| true).is_empty());
    }
}
