//! Every word of the protocol, spelt as on the wire.
//!
//! Source: `GenericVocabs.h`, `ControlBoardVocabs.h` and the interface headers of YARP 3.5 to 3.12; those marked
//! *recorded* also stand in recorded traffic of 3.12.3.

use yarp_wire::Vocab32;

macro_rules! words {
    ($($(#[$doc:meta])* $name:ident = $word:literal;)*) => {
        $($(#[$doc])* pub const $name: Vocab32 = Vocab32::new($word);)*
    };
}

words! {
    /// An order. *Recorded.*
    SET = "set";
    /// A question. *Recorded.*
    GET = "get";
    /// Begins the answer to a question. *Recorded.*
    IS = "is";
    /// Answers a request of fewer than two words. *Recorded.*
    NOT_UNDERSTOOD = "nak";
    /// Before the count and time of an answer. *Recorded.*
    TIME_STAMP = "tsta";
    /// Asks for usage, together with [`MORE`].
    HELP = "help";
    /// Asks for more than little.
    MORE = "more";
    /// The version of the protocol. *Recorded.*
    PROTOCOL_VERSION = "prot";

    /// Number of axes. *Recorded.*
    AXES = "axes";
    /// Name of an axis. *Recorded.*
    NAME = "name";
    /// Kind of an axis. *Recorded.*
    TYPE = "type";
    /// The kind of an axis that turns. *Recorded.*
    REVOLUTE = "atrv";
    /// The kind of an axis that slides.
    PRISMATIC = "atpr";
    /// The kind of an axis that nobody knows.
    UNKNOWN_TYPE = "unkn";

    /// Position, degrees or metres. *Recorded.*
    POSITION = "pos";
    /// Positions of several.
    POSITION_GROUP = "posg";
    /// Positions of all. *Recorded.*
    POSITIONS = "poss";
    /// Distance from here. *Recorded.*
    RELATIVE = "rel";
    /// Distances of several.
    RELATIVE_GROUP = "relg";
    /// Distances of all.
    RELATIVES = "rels";
    /// Speed of point-to-point moves. *Recorded.*
    SPEED = "vel";
    /// Speeds of several.
    SPEED_GROUP = "velg";
    /// Speeds of all. *Recorded.*
    SPEEDS = "vels";
    /// Acceleration of moves.
    ACCELERATION = "acc";
    /// Accelerations of several.
    ACCELERATION_GROUP = "accg";
    /// Accelerations of all.
    ACCELERATIONS = "accs";
    /// Whether a move is done.
    DONE = "don";
    /// Whether several are done.
    DONE_GROUP = "dong";
    /// Whether all are done. *Recorded.*
    DONES = "dons";
    /// Stop. *Recorded.*
    STOP = "sto";
    /// Stop several.
    STOP_GROUP = "stog";
    /// Stop all. *Recorded.*
    STOPS = "stos";
    /// Velocity to move at. *Recorded.*
    VELOCITY = "vmo";
    /// Velocities of several.
    VELOCITY_GROUP = "vmog";
    /// Velocities of all.
    VELOCITIES = "vmos";

    /// Measured position. *Recorded.*
    ENCODER = "enc";
    /// Measured positions. *Recorded.*
    ENCODERS = "encs";
    /// Measured speed.
    ENCODER_SPEED = "esp";
    /// Measured speeds.
    ENCODER_SPEEDS = "esps";
    /// Measured acceleration.
    ENCODER_ACCELERATION = "eac";
    /// Measured accelerations.
    ENCODER_ACCELERATIONS = "eacs";
    /// Call the present position 0.
    RESET_ENCODER = "ere";
    /// Call all present positions 0.
    RESET_ENCODERS = "eres";

    /// Position limits. *Recorded.*
    POSITION_LIMITS = "llim";
    /// Velocity limits. *Recorded.*
    VELOCITY_LIMITS = "vlim";

    /// Before the words on control modes. *Recorded.*
    CONTROL_MODE_INTERFACE = "icmd";
    /// Control mode. *Recorded.*
    CONTROL_MODE = "cmod";
    /// Control modes of several.
    CONTROL_MODE_GROUP = "cmog";
    /// Control modes of all. *Recorded.*
    CONTROL_MODES = "cmds";

    /// Before the words on position and velocity control loops. *Recorded.*
    PID_INTERFACE = "pid";
    /// Before the words on torque. *Recorded.*
    TORQUE_INTERFACE = "torq";
    /// Before the words on faults of joints.
    FAULT_INTERFACE = "ijfl";
    /// Before the words on impedance. *Recorded.*
    IMPEDANCE_INTERFACE = "iimp";
    /// Before the words on interaction modes. *Recorded.*
    INTERACTION_MODE_INTERFACE = "intm";
    /// Before the words on calibration from afar.
    REMOTE_CALIBRATOR_INTERFACE = "reca";
    /// Before the words on variables of the device.
    REMOTE_VARIABLES_INTERFACE = "ivar";
    /// Before the words on motor currents.
    CURRENT_INTERFACE = "icur";
    /// Before the words on motor duty cycles.
    PWM_INTERFACE = "ipwm";
}

/// The words whose place as item 1 sends a request to an interface of its own that we do not serve.
pub const INTERFACES_NOT_SERVED: [Vocab32; 9] = [
    PID_INTERFACE,
    TORQUE_INTERFACE,
    FAULT_INTERFACE,
    IMPEDANCE_INTERFACE,
    INTERACTION_MODE_INTERFACE,
    REMOTE_CALIBRATOR_INTERFACE,
    REMOTE_VARIABLES_INTERFACE,
    CURRENT_INTERFACE,
    PWM_INTERFACE,
];
