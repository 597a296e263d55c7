//! `yarp priority-sched`: scheduling of the threads of a connection.

use std::io::Write;
use std::process::ExitCode;

use yarp_wire::Value;

use super::{code, priority_tables};
use crate::connection_qos::{NAMES, QosCommand, side};
use crate::error::Result;
use crate::network_access;
use crate::stock_format::complain;

/// set/get the thread policy and priority for a given connection
///
/// `describe [POLICY]` lists the policies. `get SOURCE DESTINATION [--src|--des]
/// [--policy|--policy-label|--priority]` shows the present one; `set SOURCE DESTINATION --src|--des
/// POL:POLICY` sets the policy, a number or SCHED_OTHER, SCHED_FIFO or SCHED_RR, and `PRT:NUMBER`
/// the priority. A connection of one of our ports gets a dedicated thread with it; if the system
/// denies it, nothing changes, and the port reports what to try.
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

const FORMATS: [&str; 3] = ["--policy", "--policy-label", "--priority"];
/// Policies with their numbers and ranges of priorities.
const POLICIES: [(&str, i32, std::ops::RangeInclusive<i32>); 3] = [
    ("SCHED_OTHER", 0, 0..=0),
    ("SCHED_FIFO", 1, 1..=99),
    ("SCHED_RR", 2, 1..=99),
];

/// Scheduling policy and priority.
#[derive(Clone, Copy)]
struct Schedule {
    policy: i32,
    priority: i32,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    if let [mode, words @ ..] = &args.words[..]
        && mode == "describe"
    {
        priority_tables::threads(&POLICIES).show(words.first(), out)?;
        return Ok(ExitCode::SUCCESS);
    }
    let Some(command) = QosCommand::parse(&args.words, "priority-sched", out)? else {
        return Ok(ExitCode::FAILURE);
    };
    let network = network_access::network()?;
    let Some(ends) = command.ends(&network, out).await? else {
        return Ok(ExitCode::FAILURE);
    };
    let mut schedules = Vec::new();
    for end in &ends {
        let Some(group) = end.get(&network, "sched", out).await? else {
            return Ok(ExitCode::FAILURE);
        };
        let number = |key| group.find(key).and_then(Value::as_i32).unwrap_or(-1);
        let (policy, priority) = (number("policy"), number("priority"));
        schedules.push(Schedule { policy, priority });
    }
    if command.sets {
        let Some((chosen, value)) = command.chosen(out)? else {
            return Ok(ExitCode::FAILURE);
        };
        let (schedule, warning) = match schedules[chosen].with(value) {
            Ok(wanted) => wanted,
            Err(complaint) => {
                complain(out, &complaint)?;
                return Ok(ExitCode::FAILURE);
            }
        };
        if let Some(warning) = warning {
            writeln!(out, "{warning}")?;
        }
        let values = [("priority", schedule.priority), ("policy", schedule.policy)];
        let set = ends[chosen].set(&network, "sched", &values, out);
        return Ok(code(set.await?));
    }
    let told = |index: usize, format: &str| {
        let what = schedules[index].format(format);
        format!("({} (sched ({what})))", NAMES[index])
    };
    let rest: Vec<&str> = command.rest.iter().map(String::as_str).collect();
    let text = match rest[..] {
        [] => Some(told(0, "") + &told(1, "")),
        [format] if FORMATS.contains(&format) => Some(told(0, format) + &told(1, format)),
        [one] => side(one, "").map(|(index, _)| told(index, "")),
        [first, second, ..] => side(first, second)
            .filter(|(_, format)| FORMATS.contains(format))
            // Stock uses another word for the name of a policy here.
            .map(|(index, format)| match format {
                "--policy-label" => told(index, format).replace("(policy ", "(policy-label "),
                format => told(index, format),
            }),
    };
    command.print_value(text, out)
}

impl Schedule {
    fn format(self, format: &str) -> String {
        let Self { policy, priority } = self;
        match format {
            "--policy" => format!("(policy {policy})"),
            "--policy-label" => {
                let found = POLICIES.iter().find(|(_, number, _)| *number == policy);
                format!("(policy {})", found.map_or("INVALID", |(name, ..)| name))
            }
            "--priority" => format!("(priority {priority})"),
            _ => format!("(policy {policy}) (priority {priority})"),
        }
    }

    /// Returns the schedule changed by a word, with a message for the user, if any.
    fn with(mut self, word: &str) -> std::result::Result<(Self, Option<String>), String> {
        let Some((label @ ("POL" | "PRT"), value)) = word.split_once(':') else {
            let text = "The label used for the data has not been recognised. Try again";
            return Err(format!(
                "{text} (type \"yarp priority-sched --help\" for info)"
            ));
        };
        let number = value.parse::<i32>().ok();
        if label == "POL" {
            let mut policies = POLICIES.iter();
            let named =
                policies.find(|(name, policy, _)| Some(*policy) == number || *name == value);
            let Some((_, policy, priorities)) = named else {
                return Err(match number {
                    Some(_) => {
                        "Invalid policy value. Policy must be a value between 0 and 2".into()
                    }
                    None => format!("You provided an invalid value ({value}). Please try again"),
                });
            };
            self.policy = *policy;
            let mut warning = None;
            if !priorities.contains(&self.priority) {
                self.priority = *priorities.start();
                warning = Some(format!(
                    "The currently set priority is not compatible with selected policy. \
                     Therefore it will be set to {}",
                    self.priority
                ));
            }
            return Ok((self, warning));
        }
        let Some(number) = number else {
            return Err("Priority can only be a numerical value. Please try again".to_owned());
        };
        let mut policies = POLICIES.iter();
        let Some((.., priorities)) = policies.find(|(_, policy, _)| *policy == self.policy) else {
            let text = "The policy for this port is set to an invalid value.";
            return Err(format!(
                "{text} Change the policy before setting the priority value"
            ));
        };
        if !priorities.contains(&number) {
            let (least, most) = (priorities.start(), priorities.end());
            let text = "Invalid priority value. Priority must be a value between";
            return Err(format!("{text} {least} and {most}"));
        }
        self.priority = number;
        Ok((self, None))
    }
}
