//! Writes and reads the typed messages of 3.x, one a line.
//!
//! A line is `TYPE write CONTENT`, answered by the message in hexadecimal, or `TYPE read HEX`,
//! answered by the content. Content is the text of a bottle; an answer may be `error: WHY`.
//!
//! | type | content |
//! | --- | --- |
//! | `vector_f64`, `vector_i32` | the numbers |
//! | `matrix` | rows columns numbers |
//! | `image` | pixel code, width, height, quantum, mark, {rows without padding} |
//! | `convert` | as `image` and the code wanted; written only |
//! | `sound` | frequency channels samples, as read by versions up to 3.8 |
//! | `stamp` | count time |
//! | `property` | (name values) (name values) |
//! | `pair` | a stamp and a vector: count time numbers |
//! | `grasp` | a struct: name force fingers |
//!
//! ```sh
//! echo 'stamp write 7 1.5' | cargo run -q -p yarp-wire --example typed
//! ```

use std::fmt::Write as _;
use std::io::{BufRead, Write};

use bytes::{Bytes, BytesMut};
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::typed::{
    Image, Matrix, Pair, PixelCode, Property, Record, Sound, SoundLayout, VectorOf,
};
use yarp_wire::{Bottle, Dialect, Stamp, Value, wire_struct};

wire_struct! {
    /// How to take hold of something.
    struct Grasp {
        name: String,
        force: f64,
        fingers: i32,
    }
}

type Failure = Box<dyn std::error::Error>;

fn main() -> std::io::Result<()> {
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    for line in std::io::stdin().lock().lines() {
        match answer(&line?) {
            Ok(answer) => writeln!(out, "{answer}")?,
            Err(error) => writeln!(out, "error: {error}")?,
        }
    }
    out.flush()
}

fn answer(line: &str) -> Result<String, Failure> {
    let (kind, rest) = line.split_once(' ').ok_or("expected TYPE")?;
    match rest.split_once(' ').unwrap_or((rest, "")) {
        ("write", content) => Ok(to_hex(&write(kind, &Bottle::parse(content)?)?)),
        ("read", hex) => Ok(read(kind, &from_hex(hex)?)?.to_string()),
        _ => Err("expected `write` or `read`".into()),
    }
}

fn write(kind: &str, content: &Bottle) -> Result<Bytes, Failure> {
    let mut out = BytesMut::new();
    let numbers = |from| numbers(content, from);
    let object: &dyn WireObject = match kind {
        "vector_f64" => &VectorOf(numbers(0)),
        "vector_i32" => &VectorOf(integers(content, 0)),
        "matrix" => &Matrix::new(size(content, 0)?, size(content, 1)?, numbers(2))?,
        "image" => &image(content)?,
        "convert" => &image(content)?.converted(code(content, 6)?)?,
        "sound" => {
            let samples = integers(content, 2).iter().map(|s| *s as i16).collect();
            let sound = Sound::new(size(content, 1)?, integer(content, 0)?, samples)?;
            sound
                .laid_out(SoundLayout::Pair)
                .write_binary(&mut out, Dialect::V3);
            return Ok(out.freeze());
        }
        "stamp" => &stamp(content)?,
        "property" => &Property::from_bottle(content.clone()),
        "pair" => &Pair {
            head: stamp(content)?,
            body: VectorOf(numbers(2)),
        },
        "grasp" => &Grasp::from_bottle(content).ok_or(Grasp::SHAPE)?,
        _ => return Err("no such type".into()),
    };
    object.write_binary(&mut out, Dialect::V3);
    Ok(out.freeze())
}

fn read(kind: &str, bytes: &Bytes) -> Result<Bottle, Failure> {
    fn of<T: ReadObject>(bytes: &Bytes) -> Result<T, Failure> {
        Ok(T::read_binary(bytes, Dialect::V3)?)
    }
    Ok(match kind {
        "vector_f64" => values(of::<VectorOf<f64>>(bytes)?.0),
        "vector_i32" => values(of::<VectorOf<i32>>(bytes)?.0),
        "matrix" => {
            let matrix: Matrix = of(bytes)?;
            let mut content = values([matrix.rows() as i32, matrix.columns() as i32]);
            content.extend(values(matrix.into_values()));
            content
        }
        "image" => {
            let image: Image = of(bytes)?;
            let numbers = [image.width(), image.height(), image.quantum()];
            let mut content = Bottle::of(image.code().code());
            content.extend(values(numbers.map(|number| number as i32)));
            content
                .with(i32::from(image.is_marked()))
                .with(image.packed())
        }
        "sound" => {
            let sound: Sound = of(bytes)?;
            let mut content = values([sound.frequency(), sound.channels() as i32]);
            content.extend(values(sound.samples().iter().map(|s| i32::from(*s))));
            content
        }
        "stamp" => of::<Stamp>(bytes)?.to_bottle(),
        "property" => of::<Property>(bytes)?.to_bottle(),
        "pair" => {
            let pair: Pair<Stamp, VectorOf<f64>> = of(bytes)?;
            let mut content = pair.head.to_bottle();
            content.extend(values(pair.body.0));
            content
        }
        "grasp" => of::<Grasp>(bytes)?.to_bottle(),
        _ => return Err("no such type".into()),
    })
}

fn values<T: Into<Value>>(items: impl IntoIterator<Item = T>) -> Bottle {
    items.into_iter().map(Into::into).collect()
}

fn numbers(content: &Bottle, from: usize) -> Vec<f64> {
    let items = content.iter().skip(from);
    items.filter_map(Value::as_f64).collect()
}

fn integers(content: &Bottle, from: usize) -> Vec<i32> {
    let items = content.iter().skip(from);
    items.filter_map(Value::as_i32).collect()
}

fn integer(content: &Bottle, at: usize) -> Result<i32, Failure> {
    let item = content.get(at).and_then(Value::as_i32);
    item.ok_or_else(|| format!("expected a number as item {at}").into())
}

fn size(content: &Bottle, at: usize) -> Result<usize, Failure> {
    Ok(usize::try_from(integer(content, at)?)?)
}

fn code(content: &Bottle, at: usize) -> Result<PixelCode, Failure> {
    Ok(PixelCode::from_code(integer(content, at)?))
}

fn stamp(content: &Bottle) -> Result<Stamp, Failure> {
    let time = content.get(1).and_then(Value::as_f64);
    Ok(Stamp::new(
        integer(content, 0)?,
        time.ok_or("expected a time")?,
    ))
}

fn image(content: &Bottle) -> Result<Image, Failure> {
    let (width, height) = (size(content, 1)?, size(content, 2)?);
    let pixels = content.iter().find_map(Value::as_blob);
    let pixels = pixels.ok_or("expected pixels")?.clone();
    let image = Image::from_padded(code(content, 0)?, width, height, 1, pixels)?;
    let image = image.with_quantum(size(content, 3)?)?;
    Ok(image.with_mark(integer(content, 4)? != 0))
}

fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut hex, byte| {
        // Writing to a string cannot fail.
        let _ = write!(hex, "{byte:02x}");
        hex
    })
}

fn from_hex(hex: &str) -> Result<Bytes, Failure> {
    let digits = hex.as_bytes().chunks(2);
    let bytes: Result<Vec<u8>, Failure> = digits
        .map(|pair| Ok(u8::from_str_radix(std::str::from_utf8(pair)?, 16)?))
        .collect();
    Ok(bytes?.into())
}
