//! Reads configurations and prints them as a bottle, for comparing with another implementation.
//!
//! Each line of standard input is `file PATH`, or `words` and words with U+001F between them; each answer is one line.

use std::io::{BufRead, Write, stdin, stdout};

use yarp_wire::settings::{Settings, Source};

struct Disk;

impl Source for Disk {
    fn read(&self, file: &str) -> Option<String> {
        let bytes = std::fs::read(file).ok()?;
        Some(String::from_utf8_lossy(&bytes).into_owned())
    }

    fn list(&self, directory: &str) -> Option<Vec<String>> {
        let names = std::fs::read_dir(directory).ok()?;
        let name =
            |entry: std::io::Result<std::fs::DirEntry>| entry.ok()?.file_name().into_string().ok();
        Some(names.filter_map(name).collect())
    }

    fn variable(&self, name: &str) -> Option<String> {
        std::env::var(name).ok()
    }

    fn resource(&self, _: &str, _: &str) -> Option<String> {
        None
    }
}

fn main() -> std::io::Result<()> {
    for line in stdin().lock().lines() {
        let line = line?;
        let mut settings = Settings::new();
        match line.split_once(' ') {
            Some(("file", path)) => {
                settings.read_file(path, &Disk);
            }
            Some(("words", words)) => settings.add_command_line(words.split('\x1f')),
            _ => {}
        }
        writeln!(stdout(), "{settings}")?;
        stdout().flush()?;
    }
    Ok(())
}
