//! Everything that a robot program usually needs: `use yarp_client::prelude::*;`.

pub use crate::module::{Context, Flow, Module, run};
pub use crate::{
    CallbackSubscriber, Camera, CartesianTool, Error, Hand, Message, Network, Publisher, Queue,
    Received, Result, Robot, RpcClient, RpcServer, Subscriber, bottle,
};
pub use yarp_devices::{
    Axes, AxisIndex, AxisInfo, CartesianControl, ControlLimits, ControlMode, DeviceError, Encoders,
    FrameGrabberControls, FrameGrabberImage, Grasp, GraspKind, Hand as HandInterface, Mode,
    MotionControl, PositionControl, PositionDirect, Target, TorqueControl, VelocityControl,
};
pub use yarp_wire::{Bottle, Stamp, Value, Vocab32};
