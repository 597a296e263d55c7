//! Every word of the protocol, spelt as on the wire.
//!
//! Source: `GenericVocabs.h`, `ControlBoardVocabs.h` and the interface headers of YARP 3.5 to 3.12; those marked
//! *recorded* are also in recorded traffic of 3.12.3.

use yarp_wire::Vocab32;

macro_rules! words {
    ($($(#[$doc:meta])* $name:ident = $word:literal;)*) => {
        $($(#[$doc])* pub const $name: Vocab32 = Vocab32::new($word);)*
    };
}

words! {
    /// A command. *Recorded.*
    SET = "set";
    /// A query. *Recorded.*
    GET = "get";
    /// Begins the reply to a query. *Recorded.*
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
    /// The type of an axis that is not known.
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
    /// Query whether a move is done.
    DONE = "don";
    /// Query whether several are done.
    DONE_GROUP = "dong";
    /// Query whether all are done. *Recorded.*
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

    /// Position of a motor.
    MOTOR_ENCODER = "mnc";
    /// Positions of all motors.
    MOTOR_ENCODERS = "mncs";
    /// Speed of a motor.
    MOTOR_SPEED = "msp";
    /// Speeds of all motors.
    MOTOR_SPEEDS = "msps";
    /// Acceleration of a motor.
    MOTOR_ACCELERATION = "mac";
    /// Accelerations of all motors.
    MOTOR_ACCELERATIONS = "macs";
    /// Counts of a motor's encoder per turn.
    MOTOR_COUNTS = "mcpr";
    /// Number of motor encoders.
    MOTOR_ENCODER_COUNT = "mnum";
    /// Call the present position of a motor 0.
    RESET_MOTOR_ENCODER = "mre";
    /// Call the present positions of all motors 0.
    RESET_MOTOR_ENCODERS = "mres";
    /// Number of motors. *Recorded.*
    MOTORS = "mtnm";
    /// Temperature of a motor. *Recorded.*
    TEMPERATURE = "tmp";
    /// Temperatures of all motors.
    TEMPERATURES = "tmps";
    /// Maximum temperature of a motor.
    TEMPERATURE_LIMIT = "tmpl";
    /// Turns of a motor per turn of its joint.
    GEARBOX_RATIO = "gbxr";

    /// Switch an amplifier on.
    ENABLE_AMPLIFIER = "aen";
    /// Switch an amplifier off.
    DISABLE_AMPLIFIER = "adi";
    /// State of an amplifier. *Recorded.*
    AMPLIFIER_STATUS = "asts";
    /// States of all amplifiers.
    AMPLIFIER_STATUSES = "asta";
    /// Current of an amplifier.
    AMPLIFIER_CURRENT = "acu";
    /// Currents of all amplifiers.
    AMPLIFIER_CURRENTS = "acus";
    /// Current at which an amplifier switches off. *Recorded.*
    MAX_CURRENT = "maxc";
    /// Current that an amplifier may give for ever.
    NOMINAL_CURRENT = "acno";
    /// Current that an amplifier may give for a short time.
    PEAK_CURRENT = "acpk";
    /// Duty cycle of an amplifier; of a motor, after [`PWM_INTERFACE`].
    DUTY_CYCLE = "pwm";
    /// Duty cycles of all motors.
    DUTY_CYCLES = "pwms";
    /// Largest duty cycle of an amplifier.
    DUTY_CYCLE_LIMIT = "pwml";
    /// Voltage that feeds an amplifier.
    SUPPLY_VOLTAGE = "avsu";

    /// Position to be at now.
    DIRECT_POSITION = "dpo";
    /// The same for several.
    DIRECT_POSITION_GROUP = "dpog";
    /// The same for all.
    DIRECT_POSITIONS = "dpos";
    /// Torque to push with, streamed.
    STREAMED_TORQUE = "dtq";
    /// The same for several.
    STREAMED_TORQUE_GROUP = "dtqg";
    /// The same for all.
    STREAMED_TORQUES = "dtqs";
    /// Velocity to be at now, streamed (4.0).
    STREAMED_DIRECT_VELOCITY = "vdso";
    /// The same for several.
    STREAMED_DIRECT_VELOCITY_GROUP = "vdsg";
    /// The same for all.
    STREAMED_DIRECT_VELOCITIES = "vdsa";
    /// Offset of a control loop, streamed (4.0).
    STREAMED_PID_OFFSET = "poff";
    /// Feed-forward of a control loop, streamed (4.0).
    STREAMED_PID_FEEDFORWARD = "pffd";

    /// Torque measured. *Recorded.*
    TORQUE = "trq";
    /// Torques measured.
    TORQUES = "trqs";
    /// Reference: torque, current, duty cycle or the reference of a loop.
    REFERENCE = "ref";
    /// The same for several.
    REFERENCE_GROUP = "refg";
    /// The same for all.
    REFERENCES = "refs";
    /// Smallest and largest. *Recorded.*
    RANGE = "rng";
    /// Smallest and largest of all.
    RANGES = "rngs";
    /// Motor parameters of the torque loop.
    MOTOR_PARAMETERS = "mtps";
    /// All joints to torque mode.
    ALL_TORQUE = "trqd";

    /// Gains of a loop. *Recorded.*
    PID = "pid";
    /// Gains of the loops of all joints.
    PIDS = "pids";
    /// Largest error of a loop.
    ERROR_LIMIT = "lim";
    /// Largest errors of all.
    ERROR_LIMITS = "lims";
    /// Error of a loop. *Recorded.*
    ERROR = "err";
    /// Errors of all.
    ERRORS = "errs";
    /// Output of a loop.
    OUTPUT = "out";
    /// Outputs of all.
    OUTPUTS = "outs";
    /// Offset of a loop.
    OFFSET = "off";
    /// Forget the integral of a loop.
    RESET = "res";
    /// Open a loop.
    DISABLE = "dis";
    /// Close a loop; queries whether it is closed.
    ENABLE = "ena";

    /// Stiffness and damping. *Recorded.*
    IMPEDANCE = "ipr";
    /// Torque added to that of the spring.
    IMPEDANCE_OFFSET = "iof";
    /// Interaction mode. *Recorded.*
    INTERACTION = "mode";
    /// Interaction modes of several.
    INTERACTION_GROUP = "modg";
    /// Interaction modes of all.
    INTERACTIONS = "mods";

    /// Query whether there is a calibrator.
    IS_CALIBRATOR = "isca";
    /// Calibrate one; alone, calibrate the robot.
    CALIBRATE = "cal";
    /// Calibrate all.
    CALIBRATE_ALL = "cals";
    /// Send one home.
    HOME = "hom";
    /// Send all home.
    HOME_ALL = "homs";
    /// Park one.
    PARK_JOINT = "par";
    /// Park all.
    PARK_ALL = "pars";
    /// End a calibration.
    QUIT_CALIBRATION = "quca";
    /// End parking.
    QUIT_PARK = "qupa";
    /// Calibrate a joint with parameters.
    CALIBRATE_JOINT = "calj";
    /// Keep how a joint is calibrated.
    CALIBRATION_PARAMETERS = "cljp";
    /// Query whether a joint is calibrated.
    CALIBRATION_DONE = "cald";
    /// Park the robot.
    PARK_ROBOT = "park";
    /// End the calibration of the robot.
    ABORT_CALIBRATION = "abca";
    /// End the parking of the robot.
    ABORT_PARK = "abpa";

    /// A variable.
    VARIABLE = "mvar";
    /// The names of the variables.
    VARIABLES = "lvar";
    /// The last fault of a joint.
    FAULT = "jhfl";

    /// Before streamed velocities, in 4.0.
    VELOCITY_INTERFACE = "ivel";
    /// Before streamed positions, in 4.0.
    POSITION_DIRECT_INTERFACE = "ipod";
    /// Before streamed direct velocities, in 4.0.
    VELOCITY_DIRECT_INTERFACE = "ived";
    /// Before streamed torques, in 4.0.
    STREAMED_TORQUE_INTERFACE = "itrq";
    /// Before streamed targets, in 4.0.
    POSITION_INTERFACE = "ipos";
    /// Before streamed values of control loops, in 4.0.
    STREAMED_PID_INTERFACE = "ipid";

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
