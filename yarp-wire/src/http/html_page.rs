//! The answers: pages for people, headers for programs.

use bytes::{BufMut, BytesMut};

use super::{Admission, Body, ResponseHead};
use crate::bottle::{Bottle, Value};

/// The content of a port's page.
#[derive(Clone, Copy, Debug)]
pub struct Page<'a> {
    /// The port.
    pub port: &'a str,
    /// Host and number of the name server, if there is one.
    pub name_server: Option<&'a str>,
    /// The last message sent to the owner.
    pub data: &'a str,
    /// Lines to show: connections, or a reply.
    pub text: &'a str,
}

/// The style of the name server's page, which is one link away.
const STYLE: &str = "\
:root{color-scheme:light dark;--line:light-dark(#dde3ea,#2a3642);--accent:light-dark(#0b62a4,#69b3ee);\
--surface:light-dark(#fff,#161e27);--tint:light-dark(#e5f0f9,#17324a)}\
body{font:15px/1.5 system-ui,sans-serif;max-width:64rem;margin:0 auto;padding:1.2rem;\
background:light-dark(#f3f5f8,#0e141a);color:light-dark(#17222d,#dfe7ee)}\
h1{font-size:1.25rem;margin:.3rem 0 1rem;overflow-wrap:anywhere}\
h1 code{background:var(--tint);color:var(--accent);padding:.1rem .45rem;border-radius:6px}\
a{color:var(--accent);text-decoration:none}a:hover{text-decoration:underline}\
nav{display:flex;flex-wrap:wrap;gap:.5rem}nav a{background:var(--surface);border:1px solid var(--line);\
border-radius:99px;padding:.15rem .8rem}nav a:hover{border-color:var(--accent);text-decoration:none}\
pre{font:.9rem/1.6 ui-monospace,monospace;background:var(--surface);border:1px solid var(--line);\
border-radius:12px;padding:1rem;margin:1rem 0;overflow:auto}\
form{display:flex;gap:.5rem;margin:1rem 0 0}nav form{margin:0}input{font:inherit;color:inherit;background:var(--surface);\
border:1px solid var(--line);border-radius:10px;padding:.4rem .8rem}input[name=data]{flex:1;min-width:0}\
input[type=submit]{cursor:pointer;font-weight:600;background:light-dark(#0b62a4,#2a6ea6);color:#fff;\
border-color:transparent}:focus-visible{outline:2px solid var(--accent);outline-offset:1px}";

/// Further headers for browsers: no script runs here, whatever the name of a port.
const META: &str = "<meta charset=\"utf-8\">\
    <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">";
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src 'self'; \
    base-uri 'none'; form-action 'self'";
/// Pages that an owner answers with have styles of their own, too.
const OWN_POLICY: &str = "default-src 'none'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; \
    base-uri 'none'; form-action 'self'";
/// Forms of a page tell where they come from, to the port alone.
const REFERRER: &str = "same-origin";
/// Longest message that stands in the form again.
const SHOWN: usize = 64 * 1024;

/// The head of a page that is whole, or goes on.
fn head(mime: &str, policy: &str, body: Body, admission: &Admission) -> String {
    let head = ResponseHead {
        status: "200 OK",
        mime,
        policy,
        referrer: REFERRER,
        admission,
        body,
    };
    head.to_string()
}

impl Page<'_> {
    /// Appends the whole response; the connection ends with it.
    pub fn put(&self, admission: &Admission, out: &mut BytesMut) {
        let body = self.html();
        let head = head(
            "text/html; charset=utf-8",
            POLICY,
            Body::Whole(body.len()),
            admission,
        );
        out.reserve(head.len() + body.len());
        out.put_slice(head.as_bytes());
        out.put_slice(body.as_bytes());
    }

    fn html(&self) -> String {
        let mut out = String::with_capacity(STYLE.len() + self.text.len() + 1024);
        out.push_str("<!DOCTYPE html>\n<html lang=\"en\"><head>");
        out.push_str(META);
        out.push_str("<title>");
        escape(&mut out, self.port);
        out.push_str("</title><style>");
        out.push_str(STYLE);
        out.push_str("</style></head><body><h1>yarp port <code>");
        escape(&mut out, self.port);
        out.push_str("</code></h1>\n<nav>");
        if let Some(server) = self.name_server {
            out.push_str("<a href=\"http://");
            escape(&mut out, server);
            out.push_str("/data=list\">All ports</a>");
        }
        // Nothing is sent by following a link.
        out.push_str(
            "<a href=\"/\">connections</a>\
             <form method=\"post\" action=\"/form\"><input type=\"hidden\" name=\"data\" value=\"help\">\
             <input type=\"submit\" value=\"help\"></form>\
             <a href=\"/r\">read</a></nav>\n\
             <form method=\"post\" action=\"/form\"><input name=\"data\" value=\"",
        );
        if self.data.len() <= SHOWN {
            escape(&mut out, self.data);
        }
        out.push_str(
            "\" aria-label=\"message\" autofocus>\
             <input type=\"submit\" value=\"send data\"></form>\n<pre>\n",
        );
        for line in self.text.lines() {
            put_linked(&mut out, line);
            out.push('\n');
        }
        out.push_str("</pre></body></html>\n");
        out
    }
}

/// Appends the line, with a link to the port that it registers if it is such a line.
fn put_linked(out: &mut String, line: &str) {
    let mut words = [""; 9];
    let mut count = 0;
    for word in line.split_whitespace() {
        // More than that is no such line.
        if count == words.len() {
            count += 1;
            break;
        }
        words[count] = word;
        count += 1;
    }
    match words {
        [
            "registration",
            "name",
            name,
            "ip",
            host,
            "port",
            number,
            "type",
            "tcp",
        ] if count == words.len() => {
            out.push_str("<a href=\"http://");
            escape(out, host);
            out.push(':');
            escape(out, number);
            out.push_str("/\">");
            escape(out, name);
            out.push_str("</a>  (");
            escape(out, host);
            out.push(':');
            escape(out, number);
            out.push(')');
        }
        _ => escape(out, line),
    }
}

/// Appends text so that it stays text.
fn escape(out: &mut String, text: &str) {
    let mut rest = text;
    while let Some(at) = rest.find(['&', '<', '>', '"']) {
        out.push_str(&rest[..at]);
        out.push_str(match rest.as_bytes()[at] {
            b'&' => "&amp;",
            b'<' => "&lt;",
            b'>' => "&gt;",
            _ => "&quot;",
        });
        rest = &rest[at + 1..];
    }
    out.push_str(rest);
}

/// Returns the response that carries JSON to a program; an owner may call it by another type.
pub fn json_response(json: &str, mime: Option<&str>, admission: &Admission) -> String {
    let body = format!("{json}\n");
    own_response(&body, mime.unwrap_or("application/json"), admission)
}

/// The response that carries text.
pub fn text_response(text: &str, admission: &Admission) -> String {
    own_response(text, "text/plain; charset=utf-8", admission)
}

/// Returns the response that carries an owner's own page.
pub fn own_response(body: &str, mime: &str, admission: &Admission) -> String {
    let head = head(mime, OWN_POLICY, Body::Whole(body.len()), admission);
    format!("{head}{body}")
}

/// Returns the head of an owner's own streaming page: each message follows as a [`chunk`].
pub fn own_stream_head(body: &str, mime: &str, admission: &Admission) -> String {
    let head = head(mime, OWN_POLICY, Body::Chunks, admission);
    format!(
        "{head}{}",
        raw_chunk(&format!("{}{body}", " ".repeat(MIN_FIRST_CHUNK)))
    )
}

/// Browsers show nothing before they have a fair amount.
const MIN_FIRST_CHUNK: usize = 2048;

/// Returns the head of a streaming page: each message follows as a [`chunk`].
pub fn stream_head(port: &str, admission: &Admission) -> String {
    let mut name = String::new();
    escape(&mut name, port);
    let body = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head>{META}<title>{name}</title>\
         <style>{STYLE}</style></head><body><h1>reading <code>{name}</code></h1>\n{}\n",
        " ".repeat(MIN_FIRST_CHUNK)
    );
    // Content that messages carry under `web` is shown; it does not run.
    let mut out = head("text/html; charset=utf-8", POLICY, Body::Chunks, admission);
    out.push_str(&raw_chunk(&body));
    out
}

/// Returns a message for a streaming page: the value of the key `web` unchanged, anything else as
/// text.
pub fn chunk(text: &str) -> String {
    let page = Bottle::parse(text).ok();
    let page = page.as_ref().and_then(|message| message.find("web"));
    // An empty chunk would be the end.
    if let Some(page) = page
        .map(Value::to_plain_string)
        .filter(|page| !page.is_empty())
    {
        return raw_chunk(&page);
    }
    let mut shown = String::from("<pre>");
    escape(&mut shown, text.trim_end());
    shown.push_str("</pre>\n");
    raw_chunk(&shown)
}

fn raw_chunk(text: &str) -> String {
    format!("{:x}\r\n{text}\r\n", text.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_escape_what_they_show() {
        let page = Page {
            port: "/<a>",
            name_server: Some("n:10000"),
            data: "\"x\"",
            text: "a & b\nregistration name /c ip 1.2.3.4 port 5 type tcp\n",
        };
        let mut out = BytesMut::new();
        page.put(&Admission::default(), &mut out);
        let html = String::from_utf8_lossy(&out);
        for part in [
            "yarp port <code>/&lt;a&gt;</code>",
            "value=\"&quot;x&quot;\"",
            "a &amp; b\n",
            "<a href=\"http://1.2.3.4:5/\">/c</a>",
            "http://n:10000/data=list",
        ] {
            assert!(html.contains(part), "{part} in {html}");
        }
        assert_eq!(
            chunk("<1>\r\n"),
            "17\r\n<pre>&lt;1&gt;</pre>\n\r\n".replace("17", "15")
        );
    }
}
