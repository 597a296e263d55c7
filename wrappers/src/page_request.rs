//! Requests of pages and of programs such as curl, over HTTP.

use yarp_ports::Received;
use yarp_wire::{Bottle, Value};

/// First of the fields that a request over HTTP has behind its words.
const FIRST_FIELD: &str = "REQUEST_URI";

/// Returns the request in a message, without the fields that a request over HTTP has behind it.
///
/// `/?req=set+pos+0+20` arrives as `set pos 0 20 (REQUEST_URI ..) (format json) (req ..)`, as in stock. A device would
/// refuse the fields as extra values.
pub(crate) fn request_of(received: &Received) -> Bottle {
    without_fields(received.bottle().unwrap_or_default())
}

fn without_fields(request: Bottle) -> Bottle {
    let is_first = |item: &Value| {
        let field = item.as_list().and_then(|field| field.get(0));
        field.and_then(Value::as_str) == Some(FIRST_FIELD)
    };
    match request.iter().position(is_first) {
        Some(end) => request.into_items().into_iter().take(end).collect(),
        None => request,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_a_request_over_http_are_no_part_of_it() {
        let check = |text: &str, expected: &str| {
            let request = without_fields(Bottle::parse(text).unwrap());
            assert_eq!(request, Bottle::parse(expected).unwrap(), "{text}");
        };
        let fields = "(REQUEST_URI \"?req=set+pos+0+20\") (format json) (req \"set pos 0 20\")";
        check(&format!("set pos 0 20 {fields}"), "set pos 0 20");
        check("set pos 0 20", "set pos 0 20");
        check("set poss (1.0 2.0)", "set poss (1.0 2.0)");
        check(&format!("a (b c) {fields}"), "a (b c)");
    }
}
