//! Reads texts of bottles, one a line, and prints each as `TEXT<TAB>BINARY` (3.x, hexadecimal).
//!
//! With `--hex` the texts are hexadecimal on both sides, so that any byte can stand in them.
//!
//! ```sh
//! echo 'hello 0.5 (a [ok])' | cargo run -q -p yarp-wire --example bottle
//! ```

use std::io::{BufRead, Write};

use yarp_testing::{from_hex, to_hex};
use yarp_wire::{Bottle, WireVersion};

fn main() -> std::io::Result<()> {
    let hexadecimal = std::env::args().any(|argument| argument == "--hex");
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    for line in std::io::stdin().lock().split(b'\n') {
        let line = line?;
        let text = if hexadecimal {
            from_hex(&String::from_utf8_lossy(&line))
        } else {
            line
        };
        match Bottle::parse_bytes(&text) {
            Ok(bottle) => {
                let printed = bottle.to_text();
                if hexadecimal {
                    out.write_all(to_hex(&printed).as_bytes())?;
                } else {
                    out.write_all(&printed)?;
                }
                writeln!(out, "\t{}", to_hex(&bottle.encode(WireVersion::V3)))?;
            }
            Err(error) => writeln!(out, "error: {error}\t")?,
        }
    }
    out.flush()
}
