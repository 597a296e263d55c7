//! `yarp priority-qos`: packet priority of a connection.

use std::io::Write;
use std::process::ExitCode;

use yarp_wire::Value;
use yarp_wire::qos::{CodePoint, Level};

use super::{code, priority_tables};
use crate::connection_qos::{NAMES, QosCommand, side};
use crate::error::Result;
use crate::network_access;
use crate::stock_format::complain;

/// set/get the packet priority for a given connection
///
/// `describe [VALUE]` lists the values. `get SOURCE DESTINATION [--src|--des]
/// [--dscp|--level|--tos]` shows the type of service of the packets that either end sends; `set
/// SOURCE DESTINATION --src|--des VALUE` sets it: a number, the name of a class such as AF42, LOW,
/// NORM, HIGH or CRIT, or one of these behind `TOS:`, `DSCP:` or `LEVEL:`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Command and connection
    #[arg(
        value_name = "describe|get|set SOURCE DESTINATION ...",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

const FORMATS: [&str; 3] = ["--dscp", "--level", "--tos"];

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    if let [mode, words @ ..] = &args.words[..]
        && mode == "describe"
    {
        priority_tables::packets().show(words.first(), out)?;
        return Ok(ExitCode::SUCCESS);
    }
    let Some(command) = QosCommand::parse(&args.words, "priority-qos", out)? else {
        return Ok(ExitCode::FAILURE);
    };
    let network = network_access::network()?;
    let Some(ends) = command.ends(&network, out).await? else {
        return Ok(ExitCode::FAILURE);
    };
    if command.sets {
        let Some((chosen, value)) = command.chosen(out)? else {
            return Ok(ExitCode::FAILURE);
        };
        let Some(service) = service(value) else {
            let text = format!("You provided an invalid value ({value}). Please try again");
            complain(out, &text)?;
            return Ok(ExitCode::FAILURE);
        };
        let values = [("tos", service)];
        let set = ends[chosen].set(&network, "qos", &values, out);
        return Ok(code(set.await?));
    }
    let mut services = Vec::new();
    for end in &ends {
        let Some(group) = end.get(&network, "qos", out).await? else {
            return Ok(ExitCode::FAILURE);
        };
        let service = group.find("tos").and_then(Value::as_i32);
        services.push(service.unwrap_or(-1));
    }
    let told = |index: usize, format: &str| {
        let (label, value) = format_service(services[index], format);
        format!("({} (qos (({label} {value}))))", NAMES[index])
    };
    let rest: Vec<&str> = command.rest.iter().map(String::as_str).collect();
    let text = match rest[..] {
        [] => Some(format!("{} {}", told(0, "--tos"), told(1, "--tos"))),
        [format] if FORMATS.contains(&format) => {
            // Stock calls a level a class here.
            let text = format!("{} {}", told(0, format), told(1, format));
            Some(text.replace("((level ", "((dscp "))
        }
        [one] => side(one, "").map(|(index, _)| told(index, "--tos")),
        [first, second, ..] => side(first, second)
            .filter(|(_, format)| FORMATS.contains(format))
            .map(|(index, format)| told(index, format)),
    };
    command.print_value(text, out)
}

/// Formats a type of service; as a number if it has no name.
fn format_service(service: i32, format: &str) -> (&'static str, String) {
    let point = u8::try_from(service).ok().map(|service| service >> 2);
    let point = point.and_then(CodePoint::new);
    let name = match format {
        "--dscp" => point.and_then(CodePoint::name).map(|name| ("dscp", name)),
        "--level" => {
            // Stock spells it out here, and accepts either spelling.
            let levels = [
                (Level::Low, "LOW"),
                (Level::Normal, "NORMAL"),
                (Level::High, "HIGH"),
                (Level::Critical, "CRIT"),
            ];
            let mut levels = levels.into_iter();
            let found = levels.find(|(level, _)| Some(level.code_point()) == point);
            found.map(|(_, name)| ("level", name))
        }
        _ => None,
    };
    match name {
        Some((label, name)) => (label, name.to_owned()),
        None => ("tos", service.to_string()),
    }
}

/// Parses a type of service.
fn service(word: &str) -> Option<i32> {
    let (label, value) = word.split_once(':').unwrap_or(("", word));
    let class = || match value.parse::<u8>() {
        Ok(number) => CodePoint::new(number),
        Err(_) => value.parse().ok(),
    };
    let level = || {
        let name = if value == "NORMAL" { "NORM" } else { value };
        Some(name.parse::<Level>().ok()?.code_point())
    };
    let point = match label {
        "DSCP" => class()?,
        "LEVEL" => match value.parse::<u8>() {
            Ok(number) => CodePoint::new(number)?,
            Err(_) => level()?,
        },
        "" | "TOS" => match value.parse::<u8>() {
            Ok(service) => return Some(service.into()),
            Err(_) if label.is_empty() => class().or_else(level)?,
            Err(_) => return None,
        },
        _ => return None,
    };
    Some(point.type_of_service().into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn priorities_have_aliases() {
        for (word, expected) in [
            ("144", Some(144)),
            ("TOS:144", Some(144)),
            ("AF42", Some(144)),
            ("DSCP:AF42", Some(144)),
            ("DSCP:36", Some(144)),
            ("HIGH", Some(144)),
            ("LEVEL:HIGH", Some(144)),
            ("NORMAL", Some(0)),
            ("LEVEL:NORM", Some(0)),
            ("300", None),
            ("DSCP:64", None),
            ("TOS:AF42", None),
            ("x", None),
            ("X:1", None),
        ] {
            assert_eq!(service(word), expected, "{word}");
        }
        assert_eq!(format_service(144, "--dscp"), ("dscp", "AF42".to_owned()));
        assert_eq!(format_service(144, "--level"), ("level", "HIGH".to_owned()));
        assert_eq!(format_service(4, "--level"), ("tos", "4".to_owned()));
        assert_eq!(format_service(-1, "--dscp"), ("tos", "-1".to_owned()));
    }
}
