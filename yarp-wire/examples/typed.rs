//! Writes and reads typed messages as 3.5.0 does, or as 4.0 if that is its argument, one a line.
//!
//! A line is `TYPE write CONTENT`, answered by the message in hexadecimal, or `TYPE read HEX`,
//! answered by the content. Content is the text of a bottle; an answer may be `error: WHY`.
//!
//! | type | content |
//! | --- | --- |
//! | `vector_f64`, `_f32`, `_i32`, `_i16`, `_u16`, `_i8`, `_u8` | the numbers |
//! | `matrix` | rows columns numbers |
//! | `image`, `image_CODE` | pixel code, width, height, quantum, mark, {rows without padding} |
//! | `convert` | as `image` and the code wanted; written only |
//! | `sound` | frequency channels samples, and (label sample channel) of places, which 4.0 has |
//! | `stamp` | count time |
//! | `property` | (name values) (name values) |
//! | `pair` | a stamp and a vector: count time numbers |
//! | `grasp` | a struct: name force fingers |
//! | `bottle` | what is in it |
//!
//! ```sh
//! echo 'stamp write 7 1.5' | cargo run -q -p yarp-wire --example typed
//! ```

use std::collections::BTreeMap;
use std::io::{BufRead, Write};

use bytes::{Bytes, BytesMut};
use yarp_testing::{from_hex, to_hex};
use yarp_wire::bottle::Text;
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::typed::{
    Element, Image, Matrix, Pair, PixelCode, Property, Record, Sound, SoundLayout, SoundMarker,
    VectorOf,
};
use yarp_wire::{Bottle, Stamp, Value, WireVersion, wire_struct};

wire_struct! {
    /// A grasp of an object.
    struct Grasp {
        name: String,
        force: f64,
        fingers: i32,
    }
}

type Failure = Box<dyn std::error::Error>;

fn main() -> std::io::Result<()> {
    let wire_version = match std::env::args().nth(1).as_deref() {
        Some("4.0") => WireVersion::V4,
        _ => WireVersion::V3,
    };
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    for line in std::io::stdin().lock().lines() {
        match answer(&line?, wire_version) {
            Ok(answer) => writeln!(out, "{answer}")?,
            Err(error) => writeln!(out, "error: {error}")?,
        }
    }
    out.flush()
}

fn answer(line: &str, wire_version: WireVersion) -> Result<String, Failure> {
    let (kind, rest) = line.split_once(' ').ok_or("expected TYPE")?;
    match rest.split_once(' ').unwrap_or((rest, "")) {
        ("write", content) => Ok(to_hex(&write(
            kind,
            &Bottle::parse(content)?,
            wire_version,
        )?)),
        ("read", hex) => Ok(read(kind, &from_hex(hex).into(), wire_version)?.to_string()),
        _ => Err("expected `write` or `read`".into()),
    }
}

fn write(kind: &str, content: &Bottle, wire_version: WireVersion) -> Result<Bytes, Failure> {
    let mut out = BytesMut::new();
    let numbers = |from| numbers(content, from);
    let object: &dyn WireObject = match kind {
        "vector_f64" => &VectorOf(numbers(0)),
        "vector_f32" => &VectorOf(numbers(0).iter().map(|n| *n as f32).collect::<Vec<_>>()),
        "vector_i32" => &narrow::<i32>(content)?,
        "vector_i16" => &narrow::<i16>(content)?,
        "vector_u16" => &narrow::<u16>(content)?,
        "vector_i8" => &narrow::<i8>(content)?,
        "vector_u8" => &narrow::<u8>(content)?,
        "matrix" => &Matrix::new(size(content, 0)?, size(content, 1)?, numbers(2))?,
        kind if is_image(kind) => &image(content)?,
        "convert" => &image(content)?.converted(code(content, 6)?)?,
        "sound" => {
            let samples = integers(content, 2).iter().map(|s| *s as i16).collect();
            let mut sound = Sound::new(size(content, 1)?, integer(content, 0)?, samples)?;
            sound.markers = markers(content)?;
            let layout = match wire_version {
                WireVersion::V3 => SoundLayout::Pair,
                WireVersion::V4 => SoundLayout::Marked,
            };
            sound.laid_out(layout).write_binary(&mut out, wire_version);
            return Ok(out.freeze());
        }
        "stamp" => &stamp(content)?,
        "property" => &Property::from_bottle(content.clone()),
        "pair" => &Pair {
            head: stamp(content)?,
            body: VectorOf(numbers(2)),
        },
        "grasp" => &Grasp::from_bottle(content).ok_or(Grasp::SHAPE)?,
        "bottle" => content,
        _ => return Err("no such type".into()),
    };
    object.write_binary(&mut out, wire_version);
    Ok(out.freeze())
}

fn read(kind: &str, bytes: &Bytes, wire_version: WireVersion) -> Result<Bottle, Failure> {
    fn of<T: ReadObject>(bytes: &Bytes, wire_version: WireVersion) -> Result<T, Failure> {
        Ok(T::read_binary(bytes, wire_version)?)
    }
    Ok(match kind {
        "vector_f64" => vector::<f64, f64>(bytes, wire_version)?,
        "vector_f32" => vector::<f32, f64>(bytes, wire_version)?,
        "vector_i32" => vector::<i32, i32>(bytes, wire_version)?,
        "vector_i16" => vector::<i16, i32>(bytes, wire_version)?,
        "vector_u16" => vector::<u16, i32>(bytes, wire_version)?,
        "vector_i8" => vector::<i8, i32>(bytes, wire_version)?,
        "vector_u8" => vector::<u8, i32>(bytes, wire_version)?,
        "matrix" => {
            let matrix: Matrix = of(bytes, wire_version)?;
            let mut content = values([matrix.rows() as i32, matrix.columns() as i32]);
            content.extend(values(matrix.into_values()));
            content
        }
        kind if is_image(kind) => {
            let image: Image = of(bytes, wire_version)?;
            let numbers = [image.width(), image.height(), image.quantum()];
            let mut content = Bottle::of(image.code().code());
            content.extend(values(numbers.map(|number| number as i32)));
            content
                .with(i32::from(image.is_marked()))
                .with(image.packed())
        }
        "sound" => {
            let sound: Sound = of(bytes, wire_version)?;
            let mut content = values([sound.frequency(), sound.channels() as i32]);
            content.extend(values(sound.samples().iter().map(|s| i32::from(*s))));
            let markers = sound.markers.into_values().map(|marker| {
                Bottle::from_iter([
                    marker.label.into(),
                    marker.sample.into(),
                    marker.channel.into(),
                ])
            });
            content.extend(values(markers));
            content
        }
        "stamp" => of::<Stamp>(bytes, wire_version)?.to_bottle(),
        "property" => of::<Property>(bytes, wire_version)?.to_bottle(),
        "pair" => {
            let pair: Pair<Stamp, VectorOf<f64>> = of(bytes, wire_version)?;
            let mut content = pair.head.to_bottle();
            content.extend(values(pair.body.0));
            content
        }
        "grasp" => of::<Grasp>(bytes, wire_version)?.to_bottle(),
        "bottle" => of::<Bottle>(bytes, wire_version)?,
        _ => return Err("no such type".into()),
    })
}

/// Returns a vector of `T` as a bottle of `W`.
fn vector<T: Element, W: From<T> + Into<Value>>(
    bytes: &Bytes,
    wire_version: WireVersion,
) -> Result<Bottle, Failure> {
    let vector = VectorOf::<T>::read_binary(bytes, wire_version)?;
    Ok(values(vector.0.into_iter().map(W::from)))
}

fn values<T: Into<Value>>(items: impl IntoIterator<Item = T>) -> Bottle {
    items.into_iter().map(Into::into).collect()
}

/// Matches a particular pixel type too: here the code distinguishes it, in stock a type.
fn is_image(kind: &str) -> bool {
    kind.starts_with("image")
}

/// Lists follow the samples of a sound.
fn markers(content: &Bottle) -> Result<BTreeMap<Text, SoundMarker>, Failure> {
    let lists = content.iter().filter_map(Value::as_list);
    let marker = |list: &Bottle| {
        let label = Text::from(list.get(0)?.as_str()?);
        let marker = SoundMarker {
            label: label.clone(),
            sample: list.get(1)?.as_i64()?,
            channel: list.get(2)?.as_i32()?,
        };
        Some((label, marker))
    };
    let markers: Option<_> = lists.map(marker).collect();
    markers.ok_or_else(|| "expected (label sample channel)".into())
}

/// Numbers that have to fit.
fn narrow<T: Element + TryFrom<i32>>(content: &Bottle) -> Result<VectorOf<T>, Failure> {
    let numbers = integers(content, 0).into_iter().map(T::try_from);
    let numbers: Result<Vec<T>, _> = numbers.collect();
    Ok(VectorOf(numbers.map_err(|_| "a number does not fit")?))
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
