//! What a request asks of the port.

use super::Request;
use crate::bottle::{Bottle, Value};

/// What a request asks of the port.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// The page with the connections.
    Describe,
    /// A message for the owner; the reply comes back on the page.
    Send(String),
    /// A message for the owner or, as administration, for the port; the reply comes back as JSON.
    Json {
        /// The message.
        request: Bottle,
        /// Whether the port itself is asked.
        admin: bool,
    },
    /// All messages that the port writes from now on.
    Read,
    /// A page of the owner's own.
    Web(Bottle),
}

impl Action {
    /// What `request` asks.
    pub fn of(request: &Request) -> Self {
        let field = |name: &str| {
            let found = request.fields.iter().find(|(key, _)| key == name);
            found.map(|(_, value)| value.as_str())
        };
        let target = request.target.as_str();
        if let Some(text) = field("req") {
            let mut message = Bottle::parse(text).unwrap_or_default();
            message.extend(pairs(request, Some("json")));
            let admin = field("admin").is_some();
            return Self::Json {
                request: message,
                admin,
            };
        }
        if let Some(text) = field("data") {
            return Self::Send(with_fields(text, request));
        }
        if target == "r" {
            return Self::Read;
        }
        let classic = target.len() <= 1
            || target.starts_with('?')
            || ["form", "favi"]
                .iter()
                .any(|start| target.starts_with(start));
        if classic {
            return Self::Describe;
        }
        let path = target.split('?').next().unwrap_or_default();
        let mut message: Bottle = path.split('/').map(Value::from).collect();
        message.extend(pairs(request, None));
        Self::Web(message)
    }
}

/// The fields as `(key value)` lists sorted by key, with what stock adds of its own.
fn pairs(request: &Request, format: Option<&str>) -> Vec<Value> {
    let mut fields: Vec<(&str, &str)> = request
        .fields
        .iter()
        .map(|(key, value)| (key.as_str(), value.as_str()))
        .collect();
    fields.push(("REQUEST_URI", &request.target));
    fields.extend(format.map(|format| ("format", format)));
    fields.sort_unstable();
    let pair = |(key, value): (&str, &str)| Bottle::from_iter([key.into(), value.into()]).into();
    fields.into_iter().map(pair).collect()
}

/// `$name` stands for the field of that name.
fn with_fields(text: &str, request: &Request) -> String {
    let mut out = text.to_owned();
    for (key, value) in request.fields.iter().filter(|(key, _)| key != "data") {
        out = out.replace(&format!("${key}"), value);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn action(target: &str) -> Action {
        let mut reader = super::super::RequestReader::default();
        let text = format!("GET /{target} HTTP/1.1\r\n\r\n");
        let mut input = bytes::BytesMut::from(text.as_bytes());
        let request = reader.read(&mut input, crate::Limits::DEFAULT).unwrap();
        Action::of(&request.unwrap())
    }

    #[test]
    fn requests_mean_what_they_mean_to_stock() {
        let bottle = |text: &str| Bottle::parse(text).unwrap();
        assert_eq!(action(""), Action::Describe);
        assert_eq!(action("favicon.ico"), Action::Describe);
        assert_eq!(action("r"), Action::Read);
        assert_eq!(action("data=list"), Action::Send("list".into()));
        let request =
            bottle("hello (REQUEST_URI \"?req=hello&x=1\") (format json) (req hello) (x \"1\")");
        let admin = false;
        assert_eq!(action("?req=hello&x=1"), Action::Json { request, admin });
        let web = bottle("web \"main.css\" (REQUEST_URI \"web/main.css\")");
        assert_eq!(action("web/main.css"), Action::Web(web));
    }
}
