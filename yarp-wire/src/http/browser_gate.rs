//! The gate in front of everything that browsers can reach: http, websocket and mjpeg.
//!
//! A browser sends requests to any address on behalf of any page that its user visits. The gate looks at the
//! head of each connection's request once, before anything else is done with it, and lets through:
//!
//! | who asks | is let through if |
//! | --- | --- |
//! | a program: no sign of a browser | its `Host` is missing or names this machine |
//! | a browser | `Host` names this machine, and what the table below says |
//!
//! | request of a browser | from a page of this port, or of an allowed origin | a person goes there | nothing tells | from any other page |
//! | --- | --- | --- | --- | --- |
//! | GET of a page | may view | may view | may view | refused |
//! | GET of pictures (mjpeg) | may view | may view | refused | refused |
//! | POST, websocket | everything | refused | refused | refused |
//!
//! *May view* means that nothing is delivered, commanded or administered ([`Admission::may_only_view`]),
//! whatever the address says: a link, an image or a frame of any page can make a browser ask for any address, and the
//! table's columns cannot always be told apart.
//!
//! * `Host` names this machine if it is an IP address, `localhost`, or a name that the gate was given. A page
//!   whose own name was made to point to this machine (DNS rebinding) has another.
//! * Signs of a browser are a user agent with `Mozilla/`, `Accept-Language`, `Origin`, `Referer`, `Sec-Fetch-*`
//!   and `Sec-CH-*`. A script cannot leave out all of them.
//! * The page that asks is known by `Origin`, else by `Sec-Fetch-Site`, else by `Referer`. Over plain http to
//!   another machine browsers send no `Sec-Fetch-Site`, images and scripts have no `Origin`, and a page can have the
//!   `Referer` left out: then nothing tells. Such an answer can be shown by a foreign page, if it is an image, and its size be
//!   read; therefore pictures are refused then. Of all else a page can read nothing without an `Origin`.
//! * A person goes to an address if the browser says so (`Sec-Fetch-Site: none`, or `Sec-Fetch-Mode: navigate` with
//!   `Sec-Fetch-Dest: document`), and where it says nothing of the kind, if a page is expected (`Accept: text/html`):
//!   what is shown then belongs to no foreign page. So links between ports and the name server work.
//! * An allowed origin is one that the owner of this machine has listed.

use std::net::{Ipv4Addr, Ipv6Addr};

use super::Head;

/// Purpose of a request.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Service {
    /// Pages, and what is sent with forms.
    Pages,
    /// Pictures one after the other.
    Pictures,
    /// Frames of a web socket.
    Frames,
}

/// Decides which requests are answered; see the [module](self).
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Gate {
    hosts: Vec<String>,
    origins: Vec<String>,
}

/// Permissions of an admitted request. The default is that of a program: everything.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Admission {
    views_only: bool,
    /// A browser asks, and nothing tells which page.
    is_of_unknown_page: bool,
    origin: Option<String>,
}

impl Admission {
    /// Returns whether nothing may be delivered, commanded or administered on behalf of this request.
    pub fn may_only_view(&self) -> bool {
        self.views_only
    }

    /// Returns whether a page may show it as a stream: no if nothing tells which page asks.
    pub fn may_stream(&self) -> bool {
        !self.is_of_unknown_page
    }

    /// Returns the allowed origin on whose behalf the request comes, if it is not the port's own.
    pub fn origin(&self) -> Option<&str> {
        self.origin.as_deref()
    }
}

/// Reason for refusing a request.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// The request is for another machine.
    #[error(
        "expected `Host` to be an IP address, `localhost` or a name of this machine, got {host:?}; \
         a name that is right can be added to browsers.conf: `host NAME`"
    )]
    Host {
        /// The host that it is for; empty if it does not say.
        host: String,
    },
    /// A page of another origin asks.
    #[error(
        "expected a request of a page of this port, got one of {origin:?}; \
         an origin that may use this port can be added to browsers.conf: `origin SCHEME://HOST:PORT`"
    )]
    Origin {
        /// The origin.
        origin: String,
    },
    /// A page of another site asks.
    #[error("expected a request of a page of this port, got one that is {site:?}")]
    Site {
        /// Host name that the browser uses for it.
        site: String,
    },
    /// Nothing tells which page asks.
    #[error("expected `Origin` to tell which page asks, the browser does not say")]
    Unknown,
    /// Something is to be sent where browsers may only look.
    #[error(
        "a browser that asks for an address (GET) may look, and send nothing: \
         pages send with POST to /form, programs without the headers of a browser"
    )]
    ViewOnly,
}

/// Relation of the requesting page to the port.
enum Relation {
    /// It is the port's own.
    Own,
    /// Its origin is allowed.
    Allowed(String),
    /// A person goes to the address.
    Navigation,
    Unknown,
}

impl Gate {
    /// Returns a gate that knows this machine by IP addresses and `localhost`, and allows no foreign origin.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a name of this machine.
    pub fn host(mut self, name: &str) -> Self {
        self.hosts.push(name.to_ascii_lowercase());
        self
    }

    /// Adds an origin whose pages may do what pages of the port itself may, as `http://HOST:PORT` (the port is left
    /// out if it is that of the scheme). Returns `None` if it is none.
    pub fn origin(mut self, origin: &str) -> Option<Self> {
        let origin = origin.to_ascii_lowercase();
        let (scheme, authority) = split(&origin)?;
        let is_plain =
            |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | ':' | '[' | ']' | '_');
        let fits = !authority.is_empty() && authority.chars().all(is_plain);
        // No browser names an origin with anything behind it: such a line would have no effect.
        if !fits || origin.len() != scheme.len() + "://".len() + authority.len() {
            return None;
        }
        self.origins.push(origin);
        Some(self)
    }

    /// Returns what a request with this head may do.
    pub fn admit(&self, service: Service, head: &Head) -> Result<Admission, Refusal> {
        let is_of_browser = head.is_of_browser();
        let host = head.host.as_deref().unwrap_or_default();
        let is_missing = host.is_empty() && !is_of_browser;
        if !is_missing && !self.is_own_host(host) {
            let host = short(host);
            return Err(Refusal::Host { host });
        }
        if !is_of_browser {
            return Ok(Admission::default());
        }
        let relation = self.relation(head)?;
        let changes = head.posts || service == Service::Frames;
        // Players ask for a language, too, and no page can make a browser ask for nothing but that.
        let is_of_unknown_page =
            matches!(relation, Relation::Unknown) && (head.mozilla || head.fetch_metadata);
        match relation {
            Relation::Navigation | Relation::Unknown if changes => Err(Refusal::Unknown),
            _ if service == Service::Pictures && is_of_unknown_page => Err(Refusal::Unknown),
            relation => Ok(Admission {
                views_only: !changes,
                is_of_unknown_page,
                origin: match relation {
                    Relation::Allowed(origin) => Some(origin),
                    _ => None,
                },
            }),
        }
    }

    fn relation(&self, head: &Head) -> Result<Relation, Refusal> {
        if let Some(origin) = &head.origin {
            let known = self.known(origin, head);
            // The same host under another scheme is another origin, and browsers say so.
            if let (Some(Relation::Own), Some(site)) = (&known, head.site.as_deref())
                && !matches!(site, "same-origin" | "none")
            {
                return Err(Refusal::Site { site: short(site) });
            }
            let origin = short(origin);
            return known.ok_or(Refusal::Origin { origin });
        }
        let referer = head.referer.as_deref();
        let referer = referer.map(|referer| self.known(referer, head));
        match (head.site.as_deref(), referer) {
            (Some("same-origin"), _) => Ok(Relation::Own),
            (Some("none"), _) => Ok(Relation::Navigation),
            (Some(_), Some(Some(allowed @ Relation::Allowed(_)))) => Ok(allowed),
            (Some(_), _) if head.navigates => Ok(Relation::Navigation),
            (Some(site), _) => Err(Refusal::Site { site: short(site) }),
            (None, Some(Some(known))) => Ok(known),
            (None, _) if head.accepts_html => Ok(Relation::Navigation),
            (None, Some(None)) => Err(Refusal::Site {
                site: "cross-site".to_owned(),
            }),
            (None, None) => Ok(Relation::Unknown),
        }
    }

    /// Returns how a page or an origin is related to the host of a request; none if it is not.
    fn known(&self, address: &str, head: &Head) -> Option<Relation> {
        let (scheme, authority) = split(address)?;
        let host = head.host.as_deref().unwrap_or_default();
        if authority.eq_ignore_ascii_case(host) {
            return Some(Relation::Own);
        }
        let origin = format!("{scheme}://{authority}").to_ascii_lowercase();
        let allowed = self.origins.contains(&origin);
        allowed.then_some(Relation::Allowed(origin))
    }

    /// Returns whether a `Host` names this machine; its port may be another than ours, behind a tunnel.
    fn is_own_host(&self, host: &str) -> bool {
        let Some(name) = name_of(host) else {
            return false;
        };
        let name = name.to_ascii_lowercase();
        name == "localhost"
            || name.parse::<Ipv4Addr>().is_ok()
            || self.hosts.contains(&name)
            || name
                .strip_prefix('[')
                .and_then(|name| name.strip_suffix(']'))
                .is_some_and(|address| address.parse::<Ipv6Addr>().is_ok())
    }
}

/// Returns the part of a client's text that is repeated in an answer.
fn short(text: &str) -> String {
    const SHOWN: usize = 200;
    text.chars().take(SHOWN).collect()
}

/// Scheme and authority of an address of the web.
fn split(address: &str) -> Option<(&str, &str)> {
    let (scheme, rest) = address.split_once("://")?;
    let is_web = scheme.eq_ignore_ascii_case("http") || scheme.eq_ignore_ascii_case("https");
    let authority = rest.split(['/', '?', '#']).next()?;
    is_web.then_some((scheme, authority))
}

/// The name in `NAME` or `NAME:PORT`.
fn name_of(host: &str) -> Option<&str> {
    let end = match host.starts_with('[') {
        true => host.find(']')? + 1,
        false => host.find(':').unwrap_or(host.len()),
    };
    let (name, port) = host.split_at(end);
    let port = port.strip_prefix(':').unwrap_or(port);
    port.bytes()
        .all(|byte| byte.is_ascii_digit())
        .then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHROMIUM: &str = "User-Agent: Mozilla/5.0 Chrome/156\r\nAccept-Language: en\r\n";

    fn gate() -> Gate {
        let gate = Gate::new().host("Robot").host("robot.local");
        gate.origin("http://lab.example:8080").unwrap()
    }

    fn admit(service: Service, method: &str, headers: &str) -> Result<Admission, Refusal> {
        let head = format!("{method} / HTTP/1.1\r\n{headers}\r\n");
        gate().admit(service, &Head::parse(head.as_bytes()))
    }

    /// Returns what a request comes to, in short.
    fn short(result: &Result<Admission, Refusal>) -> &'static str {
        match result {
            Ok(Admission {
                views_only: true, ..
            }) => "view",
            Ok(_) => "all",
            Err(Refusal::Host { .. }) => "host",
            Err(Refusal::Origin { .. }) => "origin",
            Err(Refusal::Site { .. }) => "site",
            Err(Refusal::Unknown) => "unknown",
            Err(_) => "other",
        }
    }

    /// GET, POST, pictures and frames for these headers.
    #[track_caller]
    fn check(headers: &str, expected: [&str; 4]) {
        let asked = [
            (Service::Pages, "GET"),
            (Service::Pages, "POST"),
            (Service::Pictures, "GET"),
            (Service::Frames, "GET"),
        ];
        let got = asked.map(|(service, method)| short(&admit(service, method, headers)));
        assert_eq!(got, expected, "{headers}");
    }

    #[test]
    fn programs_are_let_through() {
        for headers in [
            "",
            "Host: 127.0.0.1:10002\r\nUser-Agent: curl/8.5.0\r\nAccept: */*\r\n",
            "Host: localhost\r\nUser-Agent: Python-urllib/3.13\r\n",
            "Host: ROBOT.local:1\r\n",
            "Host: [::1]:10002\r\n",
            "Host: [fe80::1]\r\n",
        ] {
            check(headers, ["all"; 4]);
        }
        // As VLC asks.
        let player = "Host: 10.0.0.2:1\r\nAccept: */*\r\nAccept-Language: en\r\nUser-Agent: VLC/3.0.21 LibVLC/3.0.21\r\n";
        check(player, ["view", "unknown", "view", "unknown"]);
    }

    #[test]
    fn a_foreign_host_is_refused() {
        for host in [
            "evil.example",
            "evil.example:10002",
            "robot.evil.example",
            "127.0.0.1.evil.example",
            "127.0.0.1:x",
            "[::1",
            "[evil]",
            "127.1",
            "2130706433",
            "a, 127.0.0.1",
        ] {
            check(&format!("Host: {host}\r\n"), ["host"; 4]);
            check(
                &format!(
                    "Host: {host}\r\nOrigin: http://{host}\r\nSec-Fetch-Site: same-origin\r\n"
                ),
                ["host"; 4],
            );
        }
        check(CHROMIUM, ["host"; 4]);
        check("Host:\r\nUser-Agent: Mozilla/5.0\r\n", ["host"; 4]);
    }

    #[test]
    fn pages_of_the_port_itself_may_send() {
        for headers in [
            "Origin: http://10.0.0.2:1\r\n",
            "Origin: http://10.0.0.2:1\r\nSec-Fetch-Site: same-origin\r\n",
            "Referer: http://10.0.0.2:1/form\r\n",
        ] {
            let headers = format!("Host: 10.0.0.2:1\r\n{CHROMIUM}{headers}");
            check(&headers, ["view", "all", "view", "all"]);
        }
    }

    #[test]
    fn foreign_pages_are_refused() {
        for (headers, why) in [
            ("Origin: http://evil.example\r\n", "origin"),
            ("Origin: http://10.0.0.2:2\r\n", "origin"),
            ("Origin: http://10.0.0.2\r\n", "origin"),
            ("Origin: null\r\n", "origin"),
            ("Origin: http://10.0.0.2:1.evil.example\r\n", "origin"),
            ("Origin: http://lab.example\r\n", "origin"),
            ("Origin: https://lab.example:8080\r\n", "origin"),
            ("Origin: chrome-extension://10.0.0.2:1\r\n", "origin"),
            (
                "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: no-cors\r\nSec-Fetch-Dest: image\r\n",
                "site",
            ),
            (
                "Sec-Fetch-Site: same-site\r\nSec-Fetch-Mode: navigate\r\nSec-Fetch-Dest: iframe\r\n",
                "site",
            ),
            (
                "Sec-Fetch-Site: cross-site\r\nReferer: http://10.0.0.2:1/\r\n",
                "site",
            ),
            (
                "Referer: http://evil.example/\r\nAccept: image/webp,*/*\r\n",
                "site",
            ),
        ] {
            let headers = format!("Host: 10.0.0.2:1\r\n{CHROMIUM}{headers}");
            check(&headers, [why; 4]);
        }
    }

    /// A page may leave out the referrer, and has no origin if it only shows what it asks for.
    #[test]
    fn where_nothing_tells_only_pages_are_shown() {
        let headers = format!("Host: 10.0.0.2:1\r\n{CHROMIUM}Accept: image/webp,*/*\r\n");
        check(&headers, ["view", "unknown", "unknown", "unknown"]);
    }

    #[test]
    fn a_person_may_look() {
        for headers in [
            "Sec-Fetch-Site: none\r\nSec-Fetch-Mode: navigate\r\nSec-Fetch-Dest: document\r\n",
            "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: navigate\r\nSec-Fetch-Dest: document\r\nReferer: http://x/\r\n",
            "Accept: text/html,application/xhtml+xml\r\n",
            "Accept: text/html\r\nReferer: http://10.0.0.2:10000/\r\n",
        ] {
            let headers = format!("Host: 10.0.0.2:1\r\n{CHROMIUM}{headers}");
            check(&headers, ["view", "unknown", "view", "unknown"]);
        }
    }

    #[test]
    fn allowed_origins_are_as_the_own() {
        let headers = format!("Host: robot:1\r\n{CHROMIUM}Origin: http://Lab.example:8080\r\n");
        check(&headers, ["view", "all", "view", "all"]);
        let admission = admit(Service::Pages, "POST", &headers).unwrap();
        assert_eq!(admission.origin(), Some("http://lab.example:8080"));
        let shown = "Host: robot:1\r\nReferer: http://lab.example:8080/x?y\r\n";
        for site in [
            "",
            "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Dest: image\r\n",
        ] {
            let admission = admit(Service::Pictures, "GET", &format!("{shown}{site}")).unwrap();
            assert_eq!(admission.origin(), Some("http://lab.example:8080"));
            assert!(admission.may_only_view());
        }
    }

    #[test]
    fn what_a_client_says_is_said_again_in_one_short_line() {
        for name in ["Host", "Host: localhost\r\nOrigin"] {
            let headers = format!("{name}: \x1b[31m{}\r\n", "x".repeat(10_000));
            let words = admit(Service::Pages, "GET", &headers)
                .unwrap_err()
                .to_string();
            assert!(words.len() < 600 && !words.contains('\x1b'), "{words}");
        }
    }

    #[test]
    fn what_is_no_origin_cannot_be_allowed() {
        for text in [
            "",
            "*",
            "null",
            "lab",
            "http://",
            "http://a/",
            "ftp://a",
            "http://a b",
            "http://*.a",
        ] {
            assert_eq!(Gate::new().origin(text), None, "{text}");
        }
        assert!(Gate::new().origin("https://[::1]:8080").is_some());
    }

    /// The same host over another scheme is another origin.
    #[test]
    fn the_own_origin_is_refused_if_the_browser_says_otherwise() {
        let own = "Host: 10.0.0.2:1\r\nOrigin: http://10.0.0.2:1\r\n";
        check(own, ["view", "all", "view", "all"]);
        check(
            &format!("{own}Sec-Fetch-Site: same-origin\r\n"),
            ["view", "all", "view", "all"],
        );
        for site in ["cross-site", "same-site"] {
            check(&format!("{own}Sec-Fetch-Site: {site}\r\n"), ["site"; 4]);
        }
    }

    /// An image of a foreign page without a referrer could keep a source busy.
    #[test]
    fn a_browser_whose_page_is_unknown_gets_no_stream() {
        let may_stream = |headers: &str| {
            let admission = admit(Service::Pages, "GET", headers).unwrap();
            admission.may_stream()
        };
        let host = "Host: 10.0.0.2:1\r\n";
        assert!(!may_stream(&format!("{host}{CHROMIUM}Accept: image/*\r\n")));
        assert!(may_stream(&format!(
            "{host}{CHROMIUM}Accept: text/html\r\n"
        )));
        assert!(may_stream(host));
    }
}
