//! Admin requests: commands that a port itself answers.

use crate::bottle::{Bottle, Value};
use crate::vocab::Vocab32;

/// A request to a port, sent with the command `a`.
///
/// Words may come as vocabs or as strings.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum AdminRequest {
    /// `[help]`
    Help,
    /// `[ver]`
    Version,
    /// `[add] DEST [CARRIER]`: connect to DEST.
    Add(String),
    /// `[del] NAME`: drop the connection to or from NAME.
    Remove(String),
    /// `[list] [in|out] [NAME]`
    List(Direction, Option<String>),
    /// `[set] [in|out] NAME (PARAMETER VALUE)...`
    Set(Direction, Option<String>, Bottle),
    /// `[get] [in|out] NAME`
    Get(Direction, Option<String>),
    /// `[prop] [get] [KEY]`
    GetProperty(Option<String>),
    /// `[prop] [set] KEY VALUE...`
    SetProperty(String, Bottle),
    /// `[prop]` with another action.
    UnknownProperty,
    /// `[atch] [in|out] "(KEY VALUE)..."`: a direction, if it is complete, and the monitor to
    /// attach. As in stock, only a string describes the monitor.
    Attach(Option<Direction>, String),
    /// `[dtch] [in|out]`
    Detach(Option<Direction>),
    /// `[pid]`, or `getPid`: the process id. 3.x only, for ROS.
    Process,
    /// `[rpup]`, or `publisherUpdate`: the publishers of a ROS topic. 3.x only, like the next two.
    PublisherUpdate,
    /// `[rtop]`, or `requestTopic`: the address from which a ROS topic can be read.
    RequestTopic,
    /// `[bus]`, or `getBusInfo`: the connections in the form of ROS.
    BusInfo,
    /// `[pray]`
    Pray,
    /// Anything else: for the owner's own reader, if it has one.
    Other(Bottle),
}

impl AdminRequest {
    /// Returns whether 3.x closes the connection after its answer, as ROS expects; 4.0 no longer
    /// knows such requests.
    pub fn is_of_ros(&self) -> bool {
        matches!(
            self,
            Self::Process | Self::PublisherUpdate | Self::RequestTopic | Self::BusInfo
        )
    }
}

/// The direction of a port's connections.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Direction {
    /// Connections that the port reads from.
    In,
    /// Connections that the port writes to.
    Out,
}

impl AdminRequest {
    /// Reads a request.
    pub fn parse(request: &Bottle) -> Self {
        let word = |index: usize| request.get(index).and_then(Value::as_vocab);
        // A list is not a name: browsers add the fields of a request as lists.
        let text = |index: usize| {
            let item = request.get(index).filter(|item| item.as_list().is_none());
            item.map(Value::to_plain_string)
        };
        let is = |index, name: &str| word(index) == Some(Vocab32::new(name));
        let direction = |index| {
            if is(index, "in") {
                Some(Direction::In)
            } else if is(index, "out") {
                Some(Direction::Out)
            } else {
                None
            }
        };
        // Only words of at most four characters are commands; `address` is not `[addr]`.
        let Some(head) = text(0) else {
            return Self::Other(request.clone());
        };
        match head.as_str() {
            "help" => Self::Help,
            "ver" => Self::Version,
            "add" => {
                let destination = text(1).unwrap_or_default();
                Self::Add(match text(2) {
                    Some(carrier) => format!("{carrier}:/{destination}"),
                    None => destination,
                })
            }
            "del" => Self::Remove(text(1).unwrap_or_default()),
            "list" => Self::List(direction(1).unwrap_or(Direction::Out), text(2)),
            "set" => {
                let parameters = request.iter().skip(3).cloned().collect();
                Self::Set(direction(1).unwrap_or(Direction::Out), text(2), parameters)
            }
            "get" => Self::Get(direction(1).unwrap_or(Direction::Out), text(2)),
            "prop" if is(1, "get") => Self::GetProperty(text(2)),
            "prop" if is(1, "set") => {
                let values = request.iter().skip(3).cloned().collect();
                Self::SetProperty(text(2).unwrap_or_default(), values)
            }
            "prop" => Self::UnknownProperty,
            "atch" => {
                let what = request.get(2).and_then(Value::as_str).unwrap_or_default();
                Self::Attach(direction(1), what.to_owned())
            }
            "dtch" => Self::Detach(direction(1)),
            "pid" | "getPid" => Self::Process,
            "rpup" | "publisherUpdate" => Self::PublisherUpdate,
            "rtop" | "requestTopic" => Self::RequestTopic,
            "bus" | "getBusInfo" => Self::BusInfo,
            "pray" => Self::Pray,
            _ => Self::Other(request.clone()),
        }
    }
}

/// `[list] [out] NAME`: asks for the connection to NAME.
pub fn list(direction: Direction, name: Option<&str>) -> Bottle {
    let direction = match direction {
        Direction::In => "in",
        Direction::Out => "out",
    };
    let mut request = Bottle::from_iter([word("list"), word(direction)]);
    request.extend(name.map(Value::from));
    request
}

/// `[add] "CARRIER://DEST"`.
pub fn add(destination: &str) -> Bottle {
    Bottle::from_iter([word("add"), destination.into()])
}

/// `[del] "NAME"`.
pub fn remove(name: &str) -> Bottle {
    Bottle::from_iter([word("del"), name.into()])
}

/// `[prop] [get] "KEY"`: asks for a property; the port's own name selects the process.
pub fn property(key: &str) -> Bottle {
    Bottle::from_iter([word("prop"), word("get"), key.into()])
}

/// `[ver]`.
pub fn version() -> Bottle {
    Bottle::of(Vocab32::new("ver"))
}

/// Returns whether this is how a port answers [`version`].
pub fn is_version(answer: &Bottle) -> bool {
    let first = answer.get(0).map(Value::to_plain_string);
    matches!(first.as_deref(), Some("ver" | "dict"))
}

fn word(word: &str) -> Value {
    Vocab32::new(word).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(text: &str, expected: AdminRequest) {
        let request = Bottle::parse(text).unwrap();
        assert_eq!(AdminRequest::parse(&request), expected, "{text}");
    }

    #[test]
    fn requests_read_as_in_stock() {
        let some = |name: &str| Some(name.to_owned());
        check("[help]", AdminRequest::Help);
        check("ver", AdminRequest::Version);
        check(
            "[list] [out] \"/r\"",
            AdminRequest::List(Direction::Out, some("/r")),
        );
        check("list in", AdminRequest::List(Direction::In, None));
        check("[list]", AdminRequest::List(Direction::Out, None));
        check("[add] \"tcp://r\"", AdminRequest::Add("tcp://r".into()));
        check("[add] /r udp", AdminRequest::Add("udp://r".into()));
        check("[del] /r", AdminRequest::Remove("/r".into()));
        check("[prop] [get]", AdminRequest::GetProperty(None));
        check(
            "[prop] [set] colour red",
            AdminRequest::SetProperty("colour".into(), Bottle::of("red")),
        );
        check("[prop] [x]", AdminRequest::UnknownProperty);
        check(
            "[set] [in] /w (tc 7)",
            AdminRequest::Set(Direction::In, some("/w"), Bottle::parse("(tc 7)").unwrap()),
        );
        check(
            "[atch] [out] \"(type dll) (file x)\"",
            AdminRequest::Attach(Some(Direction::Out), "(type dll) (file x)".into()),
        );
        check(
            "[atch] [in] (type dll)",
            AdminRequest::Attach(Some(Direction::In), String::new()),
        );
        check("[pid]", AdminRequest::Process);
        check("getPid", AdminRequest::Process);
        check("publisherUpdate /me /t ()", AdminRequest::PublisherUpdate);
        check("[rpup]", AdminRequest::PublisherUpdate);
        check("requestTopic", AdminRequest::RequestTopic);
        check("[rtop]", AdminRequest::RequestTopic);
        check("getBusInfo", AdminRequest::BusInfo);
        check("[bus]", AdminRequest::BusInfo);
        check("pray", AdminRequest::Pray);
        check(
            "[address] 1",
            AdminRequest::Other(Bottle::parse("[address] 1").unwrap()),
        );
    }

    #[test]
    fn requests_print_as_in_stock() {
        assert_eq!(
            list(Direction::Out, Some("/r")).to_string(),
            "[list] [out] \"/r\""
        );
        assert_eq!(add("tcp://r").to_string(), "[add] \"tcp://r\"");
        assert_eq!(remove("/r").to_string(), "[del] \"/r\"");
    }
}
