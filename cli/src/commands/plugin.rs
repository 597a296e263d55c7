//! `yarp plugin`: lists the built-in carriers, monitors and devices.
//!
//! Stock loads them from libraries on demand; here all are built in, and none can be loaded.

use std::io::{self, Write};
use std::process::ExitCode;

use yarp_hosting::device_types;
use yarp_ports::{built_in_monitors, modifier_names};
use yarp_wire::carrier;

use crate::error::Result;
use crate::stock_format::complain;

const USAGE: &str = "\
Print information about installed plugins

Usage:
 * Test a specific plugin:
     yarp plugin [--verbose] <pluginname>
     yarp plugin [--verbose] /path/to/plugin/<libraryname>.(so|dll|dylib) <pluginpart>
 * Test all the plugins:
     yarp plugin [--verbose] --all
 * Print a list of plugins:
     yarp plugin [--verbose] --list
 * Print plugin search path:
     yarp plugin [--verbose] --search-path
 * Print this help and exit:
     yarp plugin --help
";

/// check properties of a YARP plugin (device/carrier)
///
/// Lists carriers, monitors and devices. All are built in: stock's libraries cannot be loaded.
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Args {
    /// Name or list
    #[arg(
        value_name = "NAME | --list | --all | --search-path | --help",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

/// A feature that stock has as a plugin.
struct Plugin {
    /// `carrier`, `portmonitor` or `device`.
    kind: &'static str,
    name: &'static str,
    about: &'static str,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut words: Vec<&str> = args.words.iter().map(String::as_str).collect();
    if words.len() > 1 && words[0] == "--verbose" {
        writeln!(out, "[WARNING] The verbose argument is deprecated.")?;
        words.remove(0);
    }
    match words[..] {
        [] => {
            writeln!(out, "{USAGE}")?;
            return Ok(ExitCode::FAILURE);
        }
        ["--help", ..] => writeln!(out, "{USAGE}")?,
        ["--search-path", ..] => {
            // There are no libraries to search.
            writeln!(out, "No search path.")?;
            return Ok(ExitCode::FAILURE);
        }
        ["--list", ..] => {
            let mut names: Vec<_> = all().iter().map(|plugin| plugin.name).collect();
            names.sort_unstable();
            names.dedup();
            for name in names {
                writeln!(out, "{name}")?;
            }
        }
        ["--all", ..] => {
            writeln!(out, "Runtime plugins found:")?;
            for plugin in all() {
                writeln!(out, "\n{} {}", plugin.kind, plugin.name)?;
                plugin.print(out)?;
            }
        }
        [name, ..] => {
            let plugins = all();
            // Options that name a library have no effect.
            let mut named = plugins
                .iter()
                .filter(|plugin| words.len() == 1 && plugin.name == name)
                .peekable();
            if named.peek().is_none() {
                complain(out, "cannot find a plugin with the specified name")?;
                complain(out, "    Cannot find or load shared library")?;
                return Ok(ExitCode::FAILURE);
            }
            writeln!(out, "Yes, this is a YARP plugin")?;
            named.try_for_each(|plugin| plugin.print(out))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns everything that is built in.
fn all() -> Vec<Plugin> {
    let plugin = |kind, name, about| Plugin { kind, name, about };
    let mut carriers: Vec<_> = carrier::ALL.iter().map(|carrier| carrier.name).collect();
    // One name stands for `unix_stream` with and without acknowledgements.
    carriers.dedup();
    let carriers = carriers.into_iter().map(|name| plugin("carrier", name, ""));
    let modifiers = modifier_names().map(|name| plugin("carrier", name, ""));
    let monitors = built_in_monitors().map(|name| plugin("portmonitor", name, ""));
    let devices = device_types::DEVICE_TYPES.iter().flat_map(|device| {
        let names = std::iter::once(device.name).chain(device.aliases.iter().copied());
        names.map(move |name| plugin("device", name, device.about))
    });
    let bundler = plugin(
        "device",
        device_types::BUNDLER,
        "a device and what serves it, as one",
    );
    carriers
        .chain(modifiers)
        .chain(monitors)
        .chain(devices)
        .chain([bundler])
        .collect()
}

impl Plugin {
    fn print(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "  * library:        built in")?;
        writeln!(out, "  * type:           {}", self.kind)?;
        match self.about {
            "" => Ok(()),
            about => writeln!(out, "  * about:          {about}"),
        }
    }
}
