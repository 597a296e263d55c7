//! Parses and starts a command.

use std::env;
use std::ffi::OsString;
use std::fs;
use std::io::{self, PipeReader};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use yarp_wire::{Bottle, Value};

/// A command to start.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Launch {
    /// Name of the command for later requests. Several commands may share one tag.
    pub(super) tag: String,
    /// Program and arguments. Blanks between double quotes do not separate.
    pub(super) command: String,
    /// `A=1;B=2`; a name without a value removes the variable.
    pub(super) environment: String,
    /// Working directory; by default that of the server.
    pub(super) directory: Option<String>,
    /// Port of the logger that gets the output.
    pub(super) logger: Option<String>,
    /// True if the command has a terminal: pipes for input and output.
    pub(super) terminal: bool,
}

impl Launch {
    pub(super) fn of(request: &Bottle) -> Self {
        let text = |name| request.find(name).map(Value::to_plain_string);
        Self {
            tag: text("as").unwrap_or_default(),
            command: text("cmd").unwrap_or_default(),
            environment: text("env").unwrap_or_default(),
            directory: text("workdir"),
            logger: None,
            terminal: false,
        }
    }

    /// Starts the command in a process group of its own, without input unless it has a terminal; returns its output if it is for
    /// a logger or a terminal, and stock's error message on failure.
    pub(super) fn spawn(&self) -> Result<(Child, Option<PipeReader>), String> {
        let directory = self.directory().map_err(|error| {
            let reason = reason(&error);
            format!("Can't execute command, cannot set working directory {reason}")
        })?;
        let words = words(&self.command);
        let Some((program, arguments)) = words.split_first() else {
            return Err("Can't execute command because it is empty".to_owned());
        };
        let mut output = None;
        let mut spawn = |program: OsString| {
            let mut command = Command::new(program);
            command.args(arguments).current_dir(&directory);
            // Stock programs read these two variables.
            command.env("YARP_IS_YARPRUN", "1");
            let is_logged = self.logger.is_some();
            command.env(
                "YARPRUN_IS_FORWARDING_LOG",
                if is_logged { "1" } else { "0" },
            );
            for variable in self.environment.split(';') {
                match variable.split_once('=') {
                    Some(("", _)) => {}
                    Some((name, value)) => drop(command.env(name, value)),
                    None if variable.is_empty() => {}
                    None => drop(command.env_remove(variable)),
                }
            }
            let input = match self.terminal {
                true => Stdio::piped(),
                false => Stdio::null(),
            };
            command.stdin(input).process_group(0);
            if !is_logged && !self.terminal {
                return command.stdout(Stdio::null()).stderr(Stdio::null()).spawn();
            }
            // One pipe for both keeps the order of their lines.
            let (reader, writer) = io::pipe()?;
            output = Some(reader);
            command.stdout(writer.try_clone()?).stderr(writer).spawn()
        };
        // As in stock, a program in the working directory takes precedence.
        let beside = directory.join(program);
        let started = match beside.is_file() {
            true => spawn(beside.into()).or_else(|_| spawn(program.into())),
            false => spawn(program.into()),
        };
        let started =
            started.map_err(|error| format!("Can't execute command because {}", reason(&error)))?;
        Ok((started, output))
    }

    /// Returns the working directory, if it is usable.
    fn directory(&self) -> io::Result<PathBuf> {
        let here = env::current_dir()?;
        let there = match &self.directory {
            Some(directory) => here.join(directory),
            None => here,
        };
        fs::read_dir(&there).map(|_| there)
    }
}

/// Returns the system's error text alone.
pub(super) fn reason(error: &io::Error) -> String {
    let text = error.to_string();
    match text.split_once(" (os error") {
        Some((reason, _)) => reason.to_owned(),
        None => text,
    }
}

/// Splits a command line: quotes keep blanks together, and separate words themselves, as in stock.
pub(super) fn words(line: &str) -> Vec<String> {
    let mut words = Vec::new();
    for (index, part) in line.split('"').enumerate() {
        if index % 2 == 1 {
            words.push(part.to_owned());
        } else {
            words.extend(part.split(' ').map(str::to_owned));
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotes_keep_words_together() {
        let check = |line: &str, expected: &[&str]| assert_eq!(words(line), expected, "{line}");
        check("sleep 100", &["sleep", "100"]);
        check("  sh  -c \"sleep 1; ls\" ", &["sh", "-c", "sleep 1; ls"]);
        check("a\"b c\"d", &["a", "b c", "d"]);
        check("\"unfinished word", &["unfinished word"]);
        check("a \"\" b", &["a", "b"]);
        check("", &[]);
    }

    #[test]
    fn requests_are_parsed_into_commands() {
        let request = Bottle::parse("(cmd \"sleep 9\") (as t) (env \"A=1\")").unwrap();
        let expected = Launch {
            tag: "t".to_owned(),
            command: "sleep 9".to_owned(),
            environment: "A=1".to_owned(),
            directory: None,
            logger: None,
            terminal: false,
        };
        assert_eq!(Launch::of(&request), expected);
        assert_eq!(Launch::of(&Bottle::new()), Launch::default());
    }

    #[test]
    fn commands_that_cannot_start_report_the_reason() {
        let check = |text: &str, expected: &str| {
            let launch = Launch::of(&Bottle::parse(text).unwrap());
            assert_eq!(launch.spawn().unwrap_err(), expected, "{text}");
        };
        let missing = "No such file or directory";
        check(
            "(cmd /no/such/program)",
            &format!("Can't execute command because {missing}"),
        );
        check(
            "(cmd ls) (workdir /no/such/place)",
            &format!("Can't execute command, cannot set working directory {missing}"),
        );
        check("(cmd \"\")", "Can't execute command because it is empty");
    }
}
