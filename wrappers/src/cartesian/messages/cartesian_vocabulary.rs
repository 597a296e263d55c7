//! Every word, spelt as on the wire.

use yarp_wire::Vocab32;

macro_rules! words {
    ($($name:ident = $word:literal;)*) => {
        $(pub(super) const $name: Vocab32 = Vocab32::new($word);)*
    };
}

words! {
    ACK = "ack";
    NACK = "nack";

    GET = "get";
    SET = "set";
    ASK = "ask";
    STORE = "stor";
    RESTORE = "rest";
    DELETE = "del";
    GO = "go";
    TASK_VELOCITY = "tvel";
    STOP = "stop";
    EVENT = "even";

    MODE = "mode";
    REFERENCE = "refe";
    PRIORITY = "prio";
    TIME = "time";
    TOLERANCE = "tol";
    DOF = "dof";
    REST = "resp";
    WEIGHTS = "resw";
    DESIRED = "des";
    LIMITS = "lim";
    X_DESIRED = "xd";
    X = "x";
    Q = "q";
    X_VELOCITY = "xdot";
    Q_VELOCITY = "qdot";
    TIP = "tip";
    DONE = "done";
    IS_ON = "ison";
    POSE = "pose";
    INFO = "info";
    TWEAK = "twea";
    REGISTER = "regi";
    UNREGISTER = "unre";
    LIST = "list";

    FULL = "full";
    PLACE = "xyz";
    TRACK = "cont";
    SINGLE = "shot";
    TRUE = "true";
    FALSE = "fals";
    ONGOING = "ogoi";
}

pub(super) const STRAIGHTNESS: &str = "straightness";
pub(super) const SOLVER_TOLERANCE: &str = "tol";
pub(super) const CONSTRAINT_TOLERANCE: &str = "constr_tol";
pub(super) const ITERATIONS: &str = "max_iter";
pub(super) const POSITION: &str = "position";
pub(super) const ORIENTATION: &str = "orientation";

/// Yes or no.
pub(super) fn flag(value: bool) -> Vocab32 {
    if value { TRUE } else { FALSE }
}
