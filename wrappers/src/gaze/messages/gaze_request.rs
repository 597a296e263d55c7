//! Requests, as stock's client spells them, and targets without a reply.
//!
//! ```text
//! look 3D (x y z)                      look ang (abs azimuth elevation vergence)
//! look mono (left u v z)               look mono (left u v ver vergence)
//! look stereo (ul vl ur vr)
//! get Tneck                            set Tneck 1.0
//! get pitch                            bind pitch min max       clear pitch
//! get 3D mono (left u v z)             get 3D proj (left u v a b c d)
//! stor          rest id                del (id id)
//! register ongoing 0.5                 unregister ongoing 0.5   list ongoing
//! ```

use yarp_devices::{
    Eye, GazeAngles, GazeFrame, GazeOptions, GazeReference, GazeTarget, Limits, NeckJoint,
};
use yarp_wire::{Bottle, Value};

use super::gaze_options::to_list;

/// Returns a request for a value.
pub(crate) fn get(what: &str) -> Bottle {
    Bottle::of("get").with(what)
}

/// Returns a request that sets a number.
pub(crate) fn set_number(what: &str, number: f64) -> Bottle {
    Bottle::of("set").with(what).with(number)
}

/// Returns a request that switches something on or off.
pub(crate) fn set_flag(what: &str, on: bool) -> Bottle {
    Bottle::of("set").with(what).with(i32::from(on))
}

/// Returns a request that sets named values.
pub(crate) fn set_options(what: &str, options: &GazeOptions) -> Bottle {
    Bottle::of("set").with(what).with(to_list(options))
}

/// Returns a request to turn to a target.
pub(crate) fn look(target: &GazeTarget) -> Bottle {
    let word = match target {
        GazeTarget::Point(_) => "3D",
        GazeTarget::Angles { .. } => "ang",
        GazeTarget::Pixel { .. } | GazeTarget::PixelWithVergence { .. } => "mono",
        GazeTarget::StereoPixels { .. } => "stereo",
    };
    Bottle::of("look").with(word).with(target_list(target))
}

/// Returns a target, as it travels in a request and on the ports for targets.
pub(crate) fn target_list(target: &GazeTarget) -> Bottle {
    match target {
        GazeTarget::Point(point) => numbers(Bottle::new(), point),
        GazeTarget::Angles { reference, angles } => angles_list(*reference, *angles),
        GazeTarget::Pixel { eye, pixel, depth } => {
            numbers(Bottle::of(eye_word(*eye)), pixel).with(*depth)
        }
        GazeTarget::PixelWithVergence {
            eye,
            pixel,
            vergence,
        } => numbers(Bottle::of(eye_word(*eye)), pixel)
            .with("ver")
            .with(*vergence),
        GazeTarget::StereoPixels { left, right } => pixels(left, right),
    }
}

/// Returns a request for the pose of a frame.
pub(crate) fn get_pose(frame: GazeFrame) -> Bottle {
    get("pose").with(match frame {
        GazeFrame::LeftEye => "left",
        GazeFrame::RightEye => "right",
        GazeFrame::Head => "head",
    })
}

/// Returns a request for the pixel of a point.
pub(crate) fn get_pixel(eye: Eye, point: &[f64; 3]) -> Bottle {
    get("2D").with(numbers(Bottle::of(eye_word(eye)), point))
}

/// Returns a request for the point behind a pixel at a depth.
pub(crate) fn get_point_at_depth(eye: Eye, pixel: &[f64; 2], depth: f64) -> Bottle {
    let list = numbers(Bottle::of(eye_word(eye)), pixel).with(depth);
    get("3D").with("mono").with(list)
}

/// Returns a request for the point behind a pixel on a plane.
pub(crate) fn get_point_on_plane(eye: Eye, pixel: &[f64; 2], plane: &[f64; 4]) -> Bottle {
    let list = numbers(numbers(Bottle::of(eye_word(eye)), pixel), plane);
    get("3D").with("proj").with(list)
}

/// Returns a request for the point in a direction.
pub(crate) fn get_point_from_angles(reference: GazeReference, angles: GazeAngles) -> Bottle {
    get("3D").with("ang").with(angles_list(reference, angles))
}

/// Returns a request for the point that both eyes see.
pub(crate) fn get_triangulated(left: &[f64; 2], right: &[f64; 2]) -> Bottle {
    get("3D").with("stereo").with(pixels(left, right))
}

/// Returns a request for the direction of a point.
pub(crate) fn get_angles(point: &[f64; 3]) -> Bottle {
    get("ang").with(numbers(Bottle::new(), point))
}

/// Returns the word of a joint of the neck.
pub(crate) fn neck_word(joint: NeckJoint) -> &'static str {
    match joint {
        NeckJoint::Pitch => "pitch",
        NeckJoint::Roll => "roll",
        NeckJoint::Yaw => "yaw",
    }
}

/// Returns a request that keeps a joint of the neck in a range.
pub(crate) fn bind_neck(joint: NeckJoint, range: Limits) -> Bottle {
    let joint = Bottle::of("bind").with(neck_word(joint));
    joint.with(range.min).with(range.max)
}

/// Returns a request that keeps the eyes at a vergence.
pub(crate) fn bind_eyes(vergence: f64) -> Bottle {
    Bottle::of("bind").with("eyes").with(vergence)
}

/// Returns a request that frees `pitch`, `roll`, `yaw` or `eyes`.
pub(crate) fn clear(what: &str) -> Bottle {
    Bottle::of("clear").with(what)
}

/// Returns a request to take stored settings again.
pub(crate) fn restore(id: i32) -> Bottle {
    Bottle::of("rest").with(id)
}

/// Returns a request to forget stored settings.
pub(crate) fn delete(ids: impl IntoIterator<Item = i32>) -> Bottle {
    let ids: Bottle = ids.into_iter().map(Value::Int32).collect();
    Bottle::of("del").with(ids)
}

/// Returns a request to announce a checkpoint.
pub(crate) fn register(checkpoint: f64) -> Bottle {
    Bottle::of("register").with("ongoing").with(checkpoint)
}

/// Returns a request to announce a checkpoint no longer.
pub(crate) fn unregister(checkpoint: f64) -> Bottle {
    Bottle::of("unregister").with("ongoing").with(checkpoint)
}

/// Returns the first number of a message, also in its lists, that is not finite.
pub(crate) fn not_finite(message: &Bottle) -> Option<f64> {
    message.iter().find_map(|value| match value {
        Value::Float64(number) => (!number.is_finite()).then_some(*number),
        value => not_finite(value.as_list()?),
    })
}

fn eye_word(eye: Eye) -> &'static str {
    match eye {
        Eye::Left => "left",
        Eye::Right => "right",
    }
}

fn angles_list(reference: GazeReference, angles: GazeAngles) -> Bottle {
    let word = match reference {
        GazeReference::Absolute => "abs",
        GazeReference::Relative => "rel",
    };
    numbers(Bottle::of(word), &angles.to_array())
}

fn pixels(left: &[f64; 2], right: &[f64; 2]) -> Bottle {
    numbers(numbers(Bottle::new(), left), right)
}

/// Adds numbers, always of 64 bits: the controller does not take whole numbers everywhere.
fn numbers(list: Bottle, numbers: &[f64]) -> Bottle {
    numbers.iter().fold(list, |list, number| list.with(*number))
}
