//! The answers: pages for people, headers for programs.

use std::fmt::Write;

use crate::bottle::{Bottle, Value};

/// The content of a port's page.
#[derive(Clone, Copy, Debug)]
pub struct Page<'a> {
    /// The port.
    pub port: &'a str,
    /// Host and number by which the browser reached it.
    pub host: &'a str,
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
form{display:flex;gap:.5rem;margin:1rem 0 0}input{font:inherit;color:inherit;background:var(--surface);\
border:1px solid var(--line);border-radius:10px;padding:.4rem .8rem}input[name=data]{flex:1;min-width:0}\
input[type=submit]{cursor:pointer;font-weight:600;background:light-dark(#0b62a4,#2a6ea6);color:#fff;\
border-color:transparent}:focus-visible{outline:2px solid var(--accent);outline-offset:1px}";

/// Further headers for browsers: no script runs here, whatever the name of a port.
const META: &str = "<meta charset=\"utf-8\">\
    <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">";
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src 'self'; \
    base-uri 'none'; form-action 'self'";

impl Page<'_> {
    /// Returns the whole response; the connection ends with it.
    pub fn response(&self) -> String {
        let body = self.html();
        format!(
            "HTTP/1.1 200 OK\r\nContent-Type: text/html; charset=utf-8\r\n\
             Content-Length: {}\r\nConnection: close\r\n\
             Content-Security-Policy: {POLICY}\r\n\r\n{body}",
            body.len()
        )
    }

    fn html(&self) -> String {
        let port = escape(self.port);
        let host = escape(self.host);
        let data = escape(self.data);
        let mut out = format!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head>{META}<title>{port}</title>\
             <style>{STYLE}</style></head><body><h1>yarp port <code>{port}</code></h1>\n<nav>"
        );
        if let Some(server) = self.name_server {
            let server = escape(server);
            // Writing to a string cannot fail.
            let _ = write!(out, "<a href=\"http://{server}/data=list\">All ports</a>");
        }
        let _ = write!(
            out,
            "<a href=\"http://{host}/\">connections</a>\
             <a href=\"http://{host}/data=help\">help</a>\
             <a href=\"http://{host}/r\">read</a></nav>\n\
             <form method=\"post\" action=\"http://{host}/form\">\
             <input name=\"data\" value=\"{data}\" aria-label=\"message\" autofocus>\
             <input type=\"submit\" value=\"send data\"></form>\n<pre>\n"
        );
        for line in self.text.lines() {
            out.push_str(&linked(line));
            out.push('\n');
        }
        out.push_str("</pre></body></html>\n");
        out
    }
}

/// Returns the line with a link to the port that it registers, if it is such a line.
fn linked(line: &str) -> String {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words[..] {
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
        ] => {
            let (name, host, number) = (escape(name), escape(host), escape(number));
            format!("<a href=\"http://{host}:{number}/\">{name}</a>  ({host}:{number})")
        }
        _ => escape(line),
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// Returns the response that carries JSON to a program; an owner may call it by another type.
pub fn json_response(json: &str, mime: Option<&str>) -> String {
    own_response(&format!("{json}\n"), mime.unwrap_or("application/json"))
}

/// Returns the response that carries an owner's own page.
pub fn own_response(body: &str, mime: &str) -> String {
    let mime = one_line(mime);
    format!("HTTP/1.1 200 OK\nContent-Type: {mime}\nAccess-Control-Allow-Origin: *\n\n{body}")
}

/// Returns a type with a line end would be headers of its own.
fn one_line(mime: &str) -> String {
    mime.chars().filter(|c| !c.is_control()).collect()
}

/// Returns the head of an owner's own streaming page: each message follows as a [`chunk`].
pub fn own_stream_head(body: &str, mime: &str) -> String {
    format!(
        "HTTP/1.1 200 OK\r\nContent-Type: {}\r\nTransfer-Encoding: chunked\r\n\r\n{}",
        one_line(mime),
        raw_chunk(&format!("{}{body}", " ".repeat(MIN_FIRST_CHUNK)))
    )
}

/// Browsers show nothing before they have a fair amount.
const MIN_FIRST_CHUNK: usize = 2048;

/// Returns the head of a streaming page: each message follows as a [`chunk`].
pub fn stream_head(port: &str) -> String {
    let head = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head>{META}<title>{0}</title>\
         <style>{STYLE}</style></head><body><h1>reading <code>{0}</code></h1>\n",
        escape(port)
    );
    let head = format!("{head}{}\n", " ".repeat(MIN_FIRST_CHUNK));
    let mut out = String::from(
        "HTTP/1.1 200 OK\r\nContent-Type: text/html; charset=utf-8\r\n\
         Transfer-Encoding: chunked\r\n",
    );
    // Content that messages carry under `web` is shown; it does not run.
    let _ = write!(out, "Content-Security-Policy: {POLICY}\r\n\r\n");
    out.push_str(&raw_chunk(&head));
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
    raw_chunk(&format!("<pre>{}</pre>\n", escape(text.trim_end())))
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
            host: "h:1",
            name_server: Some("n:10000"),
            data: "\"x\"",
            text: "a & b\nregistration name /c ip 1.2.3.4 port 5 type tcp\n",
        };
        let html = page.response();
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
