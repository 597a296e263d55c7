//! Files of the page, compiled into the program.

use yarp_wire::http::Response;

/// Address, media type and content of each file.
const FILES: [(&str, &str, &str); 10] = [
    ("", "text/html", include_str!("files/index.html")),
    (
        "web/name-server.css",
        "text/css",
        include_str!("files/name-server.css"),
    ),
    ("web/main.css", "text/css", include_str!("files/main.css")),
    (
        "web/icon.svg",
        "image/svg+xml",
        include_str!("files/icon.svg"),
    ),
    ("web/main.js", SCRIPT, include_str!("files/main.js")),
    ("web/data.js", SCRIPT, include_str!("files/data.js")),
    ("web/table.js", SCRIPT, include_str!("files/table.js")),
    ("web/details.js", SCRIPT, include_str!("files/details.js")),
    ("web/layout.js", SCRIPT, include_str!("files/layout.js")),
    ("web/graph.js", SCRIPT, include_str!("files/graph.js")),
];
const SCRIPT: &str = "text/javascript";

/// Returns the file at an address.
pub(super) fn at(path: &str) -> Option<Response> {
    let (_, mime, content) = FILES.iter().find(|(known, ..)| *known == path)?;
    Some(Response::new(mime, *content))
}
