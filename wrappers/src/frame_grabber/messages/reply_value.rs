//! Reply values, in the order of the results in either wire version.

use yarp_devices::image::Image;
use yarp_devices::{CameraConfiguration, Intrinsics};
use yarp_wire::typed::{PixelCode, Property};
use yarp_wire::{Bottle, Value, WireVersion};

use super::camera_request::{Request, flag, integer};
use super::image_message;
use crate::control_board::messages::float;
use crate::thrift::Item;

/// The results of a request.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "a result is what it is made of")]
pub enum Answer {
    Done,
    Flag(bool),
    Integer(i32),
    Integers(Vec<i32>),
    Mode(i32),
    Number(f64),
    Numbers(f64, f64),
    Size(i32, i32),
    Image(Image),
    Configurations(Vec<CameraConfiguration>),
    Intrinsics(Intrinsics),
    Description(i32, String),
}

/// Names of the numbers of [`Intrinsics`]. Source: `IntrinsicParams.cpp`, `FakeFrameGrabber.cpp`.
const NUMBERS: [&str; 10] = [
    "physFocalLength",
    "focalLengthX",
    "focalLengthY",
    "principalPointX",
    "principalPointY",
    "k1",
    "k2",
    "k3",
    "t1",
    "t2",
];
const MODEL: &str = "distortionModel";
const RECTIFICATION: &str = "rectificationMatrix";

fn properties(lens: &Intrinsics) -> Property {
    let mut property = Property::new();
    let [k1, k2, k3] = lens.radial;
    let [t1, t2] = lens.tangential;
    let numbers = [
        lens.physical_focal_length,
        lens.focal_length.0,
        lens.focal_length.1,
        lens.principal_point.0,
        lens.principal_point.1,
        k1,
        k2,
        k3,
        t1,
        t2,
    ];
    for (name, number) in NUMBERS.into_iter().zip(numbers) {
        property.put(name, number);
    }
    property.put(MODEL, lens.distortion_model.as_str());
    let matrix: Bottle = lens.rectification.map(Value::from).into_iter().collect();
    property.put(RECTIFICATION, matrix);
    property
}

/// Focal lengths and principal point must be present; missing others are those of an ideal lens.
fn lens(property: &Property) -> Option<Intrinsics> {
    let number = |place: usize| property.find(NUMBERS[place]).map_or(Some(0.0), float);
    for name in &NUMBERS[1..5] {
        property.find(name)?;
    }
    let mut lens = Intrinsics {
        physical_focal_length: number(0)?,
        focal_length: (number(1)?, number(2)?),
        principal_point: (number(3)?, number(4)?),
        radial: [number(5)?, number(6)?, number(7)?],
        tangential: [number(8)?, number(9)?],
        ..Intrinsics::default()
    };
    if let Some(model) = property.find(MODEL) {
        lens.distortion_model = model.to_plain_string();
    }
    if let Some(matrix) = property.find(RECTIFICATION).and_then(Value::as_list) {
        let numbers: Vec<f64> = matrix.iter().map(float).collect::<Option<_>>()?;
        lens.rectification = numbers.try_into().ok()?;
    }
    Some(lens)
}

fn configuration(of: &CameraConfiguration) -> [Item; 4] {
    let side = |side: usize| Item::I32(i32::try_from(side).unwrap_or(i32::MAX));
    [
        side(of.width),
        side(of.height),
        Item::F64(of.rate),
        Item::Enum(image_message::code_of(of.format).code() as u32),
    ]
}

fn read_configuration(values: &[Value]) -> Option<CameraConfiguration> {
    let [width, height, rate, code] = values else {
        return None;
    };
    let side = |value| usize::try_from(integer(value)?).ok();
    let code = code.as_vocab()?.code();
    Some(CameraConfiguration {
        width: side(width)?,
        height: side(height)?,
        rate: float(rate)?,
        format: image_message::format_of(PixelCode::from_code(code as i32)),
    })
}

impl Answer {
    /// The results; `None` for an image that no message can carry.
    pub(super) fn items(&self, wire_version: WireVersion) -> Option<Vec<Item>> {
        Some(match self {
            Self::Done => Vec::new(),
            Self::Flag(value) => vec![Item::Bool(*value)],
            Self::Integer(value) => vec![Item::I32(*value)],
            Self::Integers(values) => values.iter().copied().map(Item::I32).collect(),
            Self::Mode(mode) => vec![Item::I32(*mode)],
            Self::Number(value) => vec![Item::F64(*value)],
            Self::Numbers(one, other) => vec![Item::F64(*one), Item::F64(*other)],
            Self::Size(width, height) => vec![Item::I32(*width), Item::I32(*height)],
            Self::Image(image) => {
                vec![Item::Bottle(image_message::to_list(
                    &image_message::to_wire(image).ok()?,
                ))]
            }
            Self::Configurations(all) => {
                let each = all.iter().map(configuration);
                match wire_version {
                    WireVersion::V3 => [Item::I32(all.len() as i32)]
                        .into_iter()
                        .chain(each.flatten())
                        .collect(),
                    WireVersion::V4 => {
                        vec![Item::List(each.map(|one| Item::List(one.into())).collect())]
                    }
                }
            }
            Self::Intrinsics(lens) => vec![Item::Bottle(properties(lens).to_bottle())],
            Self::Description(bus, text) => vec![Item::I32(*bus), Item::Text(text.clone())],
        })
    }

    /// Reads the results of `request`.
    pub(super) fn read(
        request: &Request,
        values: &[Value],
        wire_version: WireVersion,
    ) -> Option<Self> {
        use Request as R;
        let first = values.first();
        let numbers = || Some((float(first?)?, float(values.get(1)?)?));
        Some(match request {
            R::Help | R::ProtocolVersion => return None,
            R::Firewire(what, _) => what.answer(values)?,
            R::Width(_) | R::Height(_) | R::RgbWidth | R::RgbHeight => {
                Self::Integer(integer(first?)?)
            }
            R::Image(_) | R::Crop(..) => {
                Self::Image(image_message::from_list(first?.as_list()?).ok()?)
            }
            R::Configurations => Self::Configurations(match wire_version {
                WireVersion::V3 => {
                    let [count, rest @ ..] = values else {
                        return None;
                    };
                    let all: Option<Vec<_>> = rest.chunks(4).map(read_configuration).collect();
                    all.filter(|all| integer(count) == i32::try_from(all.len()).ok())?
                }
                WireVersion::V4 => {
                    let each = first?.as_list()?.iter();
                    let each = each.map(|one| read_configuration(one.as_list()?.as_slice()));
                    each.collect::<Option<_>>()?
                }
            }),
            R::Resolution => Self::Size(integer(first?)?, integer(values.get(1)?)?),
            R::FieldOfView | R::Pair(_) => {
                let (one, other) = numbers()?;
                Self::Numbers(one, other)
            }
            R::Intrinsics => {
                let list = first?.as_list()?.clone();
                Self::Intrinsics(lens(&Property::from_bottle(list))?)
            }
            R::Mirroring | R::Has(..) | R::Active(_) => Self::Flag(flag(first?)?),
            R::Description => Self::Description(integer(first?)?, values.get(1)?.to_plain_string()),
            R::Value(_) => Self::Number(float(first?)?),
            R::Mode(_) => Self::Mode(integer(first?)?),
            _ => Self::Done,
        })
    }
}
