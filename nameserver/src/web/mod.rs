//! Pages of the name server for browsers, and JSON for programs.
//!
//! | address | what is there |
//! | --- | --- |
//! | `/` | the page: ports, connections, and a graph of the network |
//! | `/web/...` | its script and style; `/web/main.css` is the style that pages of stock's ports ask for |
//! | `/data=list` | for browsers: sends them on to `/`; for programs the list of stock |
//! | `/api` | these addresses as JSON |
//! | `/api/names` | every name with its place, state, carriers, type and process |
//! | `/api/connections` | every connection with what passed over it, where the ports count |
//!
//! Nothing at these addresses changes anything. All other addresses are answered as any port
//! answers them: `/form` is the plain page, `/data=list` the list of stock.
//!
//! The states are those of the registry. Connections are known from the ports themselves, which are asked only while somebody
//! looks: an answer tells what was heard last and starts another round of questions, not sooner
//! than [`Settings::interval`] after the last one. The first answer waits a little for the first
//! round, two seconds unless the field `wait` says otherwise (`/api/names?wait=0`).

mod connection_survey;
mod json_view;
mod name_status;
mod port_query;
mod static_files;

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde::Serialize;
use yarp_ports::{Page, run_large};
use yarp_wire::http::{Request, Response};

use crate::name_server::lock;
use crate::registry::Registry;
pub(crate) use connection_survey::{Settings, Survey};

/// Default time that an answer waits for the first round.
const DEFAULT_FIRST_ROUND_WAIT: Duration = Duration::from_secs(2);
/// Maximum time that a client may let an answer wait, in seconds.
const MAX_WAIT_SECONDS: f64 = 10.0;

/// The pages, with the data they show.
#[derive(Clone)]
pub(crate) struct Web {
    pub(crate) registry: Arc<Mutex<Registry>>,
    pub(crate) survey: Arc<Survey>,
}

impl Web {
    /// Returns the page at an address, if this module has one.
    pub(crate) fn page(&self, request: &Request) -> Option<Page> {
        let (path, _) = request
            .target
            .split_once('?')
            .unwrap_or((&request.target, ""));
        // `/?...` belongs to stock, `/?` to neither.
        if path.is_empty() && !request.fields.is_empty() {
            return None;
        }
        // Where pages of ports link to; people are shown more than stock's list.
        if path == "data=list" && request.admission.may_only_view() {
            return Some(Box::pin(async { Response::see_other("/") }));
        }
        if let Some(file) = static_files::at(path) {
            return Some(Box::pin(std::future::ready(file)));
        }
        let web = self.clone();
        let wait = wait_of(request);
        let revision = field(request, "revision").map(str::to_owned);
        match path {
            "api" => Some(Box::pin(async { json_view::addresses() })),
            "api/names" => Some(Box::pin(async move {
                web.survey.request_round(wait).await;
                run_large(web.size_bytes(), || web.names(revision.as_deref())).await
            })),
            "api/connections" => Some(Box::pin(async move {
                web.survey.request_round(wait).await;
                let connections = || json(&json_view::connections(&web.survey));
                run_large(web.size_bytes(), connections).await
            })),
            other if other.starts_with("api/") => {
                let words = format!("There is nothing at /{other}; /api lists what there is.\n");
                Some(Box::pin(async { Response::not_found(words) }))
            }
            _ => None,
        }
    }

    /// Returns the memory that the registry takes, which decides how long a list of it takes.
    fn size_bytes(&self) -> usize {
        lock(&self.registry).size_bytes()
    }

    /// Returns all names, or only a note that nothing changed if the client knows this revision.
    fn names(&self, revision: Option<&str>) -> Response {
        let (names, server) = {
            let registry = lock(&self.registry);
            let names = name_status::names(&registry, &self.survey);
            (names, json_view::Server::of(registry.settings()))
        };
        let names = to_json(&names);
        let mut hasher = DefaultHasher::new();
        names.hash(&mut hasher);
        let current = format!("{:016x}", hasher.finish());
        let server = to_json(&server);
        let head = format!("{{\"revision\":\"{current}\",\"server\":{server}");
        Response::json(match revision == Some(&current) {
            true => format!("{head},\"unchanged\":true}}"),
            false => format!("{head},\"names\":{names}}}"),
        })
    }
}

fn field<'a>(request: &'a Request, name: &str) -> Option<&'a str> {
    let found = request.fields.iter().find(|(key, _)| key == name);
    found.map(|(_, value)| value.as_str())
}

fn wait_of(request: &Request) -> Duration {
    let asked = field(request, "wait").and_then(|text| text.parse::<f64>().ok());
    match asked {
        Some(seconds) if seconds >= 0.0 => Duration::from_secs_f64(seconds.min(MAX_WAIT_SECONDS)),
        _ => DEFAULT_FIRST_ROUND_WAIT,
    }
}

fn json(value: &impl Serialize) -> Response {
    Response::json(to_json(value))
}

fn to_json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("keys are texts, and writing to memory succeeds")
}
