//! `yarp topic`: manages topics, names that several ports share.

use std::io::Write;
use std::process::ExitCode;

use yarp_wire::{Bottle, Value};

use crate::error::Result;
use crate::network_access;
use crate::stock_format::complain;

/// set a topic name
///
/// Adds, lists and removes topics: every port connected to a topic is connected with every port
/// connected from it.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// List the topics
    #[arg(long)]
    list: bool,
    /// Remove a topic
    #[arg(long, value_name = "TOPIC", num_args = 0..=1, default_missing_value = "", allow_hyphen_values = true)]
    remove: Option<String>,
    /// Name of the topic, and the type of its messages
    #[arg(
        value_name = "TOPIC [TYPE]",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let words: Vec<&str> = args.words.iter().map(String::as_str).collect();
    let (request, kind) = if args.list {
        (vec!["topic"], TopicRequest::List)
    } else if let Some(name) = args.remove.as_deref().filter(|name| !name.is_empty()) {
        (vec!["untopic", name], TopicRequest::Remove(name))
    } else if args.remove.is_none() && !words.is_empty() {
        (
            [&["topic"], &words[..words.len().min(2)]].concat(),
            TopicRequest::Create(words[0]),
        )
    } else {
        complain(
            out,
            "Please supply the topic name\n(Or: '--list' to list all topics)\n(Or: '--remove <topic>' to remove a topic)",
        )?;
        return Ok(ExitCode::FAILURE);
    };
    let network = network_access::network()?;
    let request: Bottle = request.into_iter().map(Value::from).collect();
    let answer = match network_access::ask_server(&network, &request).await {
        Ok(answer) => Some(answer),
        Err(error) => {
            network_access::log_server_unreachable(&network, &error);
            None
        }
    };
    print_result(kind, answer.as_ref(), out)
}

enum TopicRequest<'a> {
    List,
    Remove(&'a str),
    Create(&'a str),
}

fn print_result(
    request: TopicRequest<'_>,
    answer: Option<&Bottle>,
    out: &mut dyn Write,
) -> Result<ExitCode> {
    let agreed = answer
        .and_then(|answer| answer.get(0))
        .map(Value::to_plain_string);
    let agreed = agreed.as_deref() == Some("ok");
    let reason = answer.map(ToString::to_string).unwrap_or_default();
    let failure = match request {
        TopicRequest::List => match answer {
            None => "Failed to read topic list".to_owned(),
            Some(topics) if topics.is_empty() => {
                writeln!(out, "No topics")?;
                return Ok(ExitCode::SUCCESS);
            }
            Some(topics) => {
                writeln!(out, "Topics: {topics}")?;
                return Ok(ExitCode::SUCCESS);
            }
        },
        TopicRequest::Remove(name) if agreed => {
            writeln!(out, "Topic {name} deleted")?;
            return Ok(ExitCode::SUCCESS);
        }
        TopicRequest::Create(name) if agreed => {
            writeln!(out, "Topic {name} created")?;
            return Ok(ExitCode::SUCCESS);
        }
        TopicRequest::Remove(name) => format!("Failed to delete topic {name}:"),
        TopicRequest::Create(name) => format!("Failed to create topic {name}:"),
    };
    complain(out, &failure)?;
    if failure.ends_with(':') {
        writeln!(out, "  {reason}")?;
    }
    Ok(ExitCode::FAILURE)
}
