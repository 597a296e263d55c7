//! Tables of `yarp priority-qos describe` and `yarp priority-sched describe`, as stock prints them.

use std::io::{self, Write};

use yarp_wire::qos::{CodePoint, Level};

/// Header of a table, and rows with the words that select them.
pub(super) struct Table {
    head: &'static str,
    rows: Vec<(Vec<String>, String)>,
    /// Text after all rows.
    end: &'static str,
}

impl Table {
    /// Prints the whole table, or the row that `word` selects, if any.
    pub(super) fn show(&self, word: Option<&String>, out: &mut dyn Write) -> io::Result<()> {
        let named = |names: &[String]| word.is_none_or(|word| names.contains(word));
        let mut rows = self.rows.iter().filter(|(names, _)| named(names));
        let Some((_, first)) = rows.next() else {
            return Ok(());
        };
        writeln!(out, "\n{}\n{first}", self.head)?;
        for (_, row) in rows {
            writeln!(out, "{row}")?;
        }
        match word {
            None => out.write_all(self.end.as_bytes()),
            Some(_) => writeln!(out),
        }
    }
}

const CLASSES: [&str; 22] = [
    "CS0", "CS1", "CS2", "CS3", "CS4", "CS5", "CS6", "CS7", "AF11", "AF12", "AF13", "AF21", "AF22",
    "AF23", "AF31", "AF32", "AF33", "AF41", "AF42", "AF43", "VA", "EF",
];
const LEVELS: [Level; 4] = [Level::Low, Level::Normal, Level::High, Level::Critical];
/// Former names of the upper three bits of the type of service. Source: RFC 791.
const PRECEDENCES: [&str; 8] = [
    "-",
    "Priority",
    "Immediate",
    "Flash",
    "FlashOverride",
    "Critical",
    "Internetworkcontrol",
    "Networkcontrol",
];

/// Returns the table of packet priorities.
pub(super) fn packets() -> Table {
    let row = |class: &&str| {
        let point: CodePoint = class.parse().expect("all of them are known");
        let (number, service) = (point.number(), point.type_of_service());
        let level = LEVELS.iter().find(|level| level.code_point() == point);
        let level = level.map(Level::to_string);
        let shown = level.as_deref().unwrap_or("-");
        let precedence = service >> 5;
        let flag = |bit: u8| service >> bit & 1;
        let row = format!(
            "| {class:<5} | {number:06b} | 0×{number:02X}  | {number:<5} | {service:<5} | 0×{service:02X}  \
             | {service:08b} | {precedence:03b}   | {precedence:<5} | {:<5} | {:<9} | {:<11} | {:<19} | {shown:<5} |",
            flag(4),
            flag(3),
            flag(2),
            PRECEDENCES[usize::from(precedence)],
        );
        let names = [(*class).to_owned(), service.to_string()];
        (names.into_iter().chain(level).collect(), row)
    };
    Table {
        head: "\
| DSCP  | DSCP   | DSCP  | DSCP  | TOS   | ToS   | ToS      | ToS   | ToS   | ToS   | ToS       | ToS         | ToS                 | YARP  |
| class | (bin)  | (hex) | (dec) | (dec) | (hex) | (bin)    | Prec. | Prec. | Delay | Throghput | Reliability | Str.                | Level |
|       |        |       |       |       |       |          | (bin) | (dec) | Flag  | Flag      | Flag        | Format              |       |
|-------|--------|-------|-------|-------|-------|----------|-------|-------|-------|-----------|-------------|---------------------|-------|",
        rows: CLASSES.iter().map(row).collect(),
        end: "",
    }
}

/// Returns the table of thread policies: label, number and range of priorities.
pub(super) fn threads(policies: &[(&str, i32, std::ops::RangeInclusive<i32>)]) -> Table {
    let row = |(label, number, priorities): &(&str, i32, std::ops::RangeInclusive<i32>)| {
        let (least, most) = (priorities.start(), priorities.end());
        let row = format!("| {label:<12} | {number:<12} | {least:<18} | {most:<18} |");
        (vec![(*label).to_owned(), number.to_string()], row)
    };
    Table {
        head: "\
| Policy label | Policy (dec) | Priority min (dec) | Priority max (dec) |
|--------------|--------------|--------------------|--------------------|",
        rows: policies.iter().map(row).collect(),
        end: "\n",
    }
}
