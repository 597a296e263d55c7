//! The types of requests, generated from the descriptions in `devices/src/iface/`, and the tables by which they are
//! found.

use std::collections::{HashMap, HashSet};
use std::sync::LazyLock;

use yarp_devices::{
    Axes, AxisIndex, CalibrationParameters, EncoderReading, Fault, Impedance, ImpedanceLimits,
    Interaction, JointType, Limits, Mode, MotorTorqueParameters, Pid, PidInfo, PidKind,
    VariableValue,
};
use yarp_wire::{Bottle, Vocab32};

use super::axis_selection::{Form, Forms, Selection};
use super::board_arguments::{Argument, Arguments, CallLayout, SentMotorParameters};
use super::request_spelling::Spelling;
use super::results::{Choices, Outcome};
use crate::thrift::Item;

/// The kind of control loop of a request, if its row has one.
macro_rules! kind {
    () => {
        None
    };
    ($kind:ident) => {
        Some($kind)
    };
}

/// Stands for the kind of control loop in a row.
macro_rules! instead {
    ($kind:ident, $other:tt) => {
        $other
    };
}

/// Methods common to the types of requests.
macro_rules! row_type {
    ($name:ident { $($row:ident $({ $kind:ident: $type:ident })?: $prefix:literal $words:tt $functions:tt;)* }) => {
        impl $name {
            /// Every row; those about control loops for positions, in the place of all kinds.
            pub(super) fn all() -> impl Iterator<Item = Self> {
                [$(Self::$row $(($type::Position))?),*].into_iter()
            }

            /// Returns the spelling of the request. Stock 3.x takes a setting without words on `command:i` only.
            pub(crate) fn spelling(self) -> Spelling {
                match self {
                    $(Self::$row $((instead!($kind, _)))? => {
                        const { Spelling::of_row($prefix, row_type!(@forms $words), row_type!(@forms $functions)) }
                    })*
                }
            }
        }
    };
    (@forms [$one:literal $group:literal $all:literal]) => {
        [$one, $group, $all]
    };
}

/// Methods of the types of requests that may be about control loops.
macro_rules! loop_type {
    ($name:ident { $($row:ident $({ $kind:ident: $type:ident })?;)* }) => {
        impl $name {
            /// The kind of control loop it is about.
            pub(super) fn kind(self) -> Option<PidKind> {
                match self {
                    $(Self::$row $(($kind))? => kind!($($kind)?),)*
                }
            }

            /// The same about another kind of control loop.
            pub(super) fn of_kind(self, other: PidKind) -> Self {
                match self {
                    $(Self::$row $((instead!($kind, _)))? => Self::$row $((instead!($kind, other)))?,)*
                }
            }
        }
    };
}

macro_rules! request_types {
    ($($method:ident: $interface:ident, $wire:tt, $about:tt {
        numbers { $(
            $(#[$n_doc:meta])*
            $number:ident $({ $n_kind:ident: $n_type:ident })?:
                $n_prefix:literal $n_words:tt $n_functions:tt => $n_call:tt;
        )* }
        settings { $(
            $(#[$s_doc:meta])*
            $setting:ident $({ $s_kind:ident: $s_type:ident })?:
                $s_prefix:literal $s_words:tt $s_functions:tt => $s_call:tt;
        )* }
        actions { $(
            $(#[$a_doc:meta])*
            $action:ident $({ $a_kind:ident: $a_type:ident })?:
                $a_prefix:literal $a_words:tt $a_functions:tt => $a_call:tt;
        )* }
        queries { $(
            $(#[$q_doc:meta])*
            $query:ident $({ $q_kind:ident: $q_type:ident })? -> $result:ty:
                $q_prefix:literal $q_words:tt $q_functions:tt => $q_call:tt;
        )* }
        commands { $(
            $(#[$c_doc:meta])*
            $command:ident($($field:ident: $field_type:ty),*):
                $c_prefix:literal $c_words:tt $c_functions:tt => $c_call:tt;
        )* }
    })*) => {
        /// A number that can be read.
        #[derive(Clone, Copy, Debug, Eq, PartialEq)]
        pub enum Quantity { $($( $(#[$n_doc])* $number $(($n_type))?, )*)* }

        /// A number that can be set.
        #[derive(Clone, Copy, Debug, Eq, PartialEq)]
        pub enum Setting { $($( $(#[$s_doc])* $setting $(($s_type))?, )*)* }

        /// A command without values.
        #[derive(Clone, Copy, Debug, Eq, PartialEq)]
        pub enum Action { $($( $(#[$a_doc])* $action $(($a_type))?, )*)* }

        /// Queries other than for one number per joint.
        #[derive(Clone, Copy, Debug, Eq, PartialEq)]
        pub enum Query { $($( $(#[$q_doc])* $query $(($q_type))?, )*)* }

        /// Commands with values other than one number per joint.
        #[derive(Clone, Copy, Debug, Eq, PartialEq)]
        pub(super) enum CommandKind { $($( $command, )*)* }

        /// A command. Values are degrees or metres, per second, per second squared.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Set {
            /// A number for each joint.
            Values(Setting, Selection, Vec<f64>),
            /// Something without values. Commands to the whole board use [`Selection::All`].
            Act(Action, Selection),
            $($( $(#[$c_doc])* $command($($field_type),*), )*)*
        }

        row_type! { Quantity {
            $($( $number $({ $n_kind: $n_type })?: $n_prefix $n_words $n_functions; )*)*
        } }
        row_type! { Setting {
            $($( $setting $({ $s_kind: $s_type })?: $s_prefix $s_words $s_functions; )*)*
        } }
        row_type! { Action {
            $($( $action $({ $a_kind: $a_type })?: $a_prefix $a_words $a_functions; )*)*
        } }
        row_type! { Query {
            $($( $query $({ $q_kind: $q_type })?: $q_prefix $q_words $q_functions; )*)*
        } }
        loop_type! { Quantity { $($( $number $({ $n_kind: $n_type })?; )*)* } }
        loop_type! { Setting { $($( $setting $({ $s_kind: $s_type })?; )*)* } }
        loop_type! { Action { $($( $action $({ $a_kind: $a_type })?; )*)* } }
        loop_type! { Query { $($( $query $({ $q_kind: $q_type })?; )*)* } }
        row_type! { CommandKind {
            $($( $command: $c_prefix $c_words $c_functions; )*)*
        } }

        impl Query {
            /// The results that accompany an error in 4.0, where all are present even then; `one`: for one axis.
            pub(super) fn nothing(self, one: bool) -> Vec<Item> {
                match self {
                    $($( Self::$query $((instead!($q_kind, _)))? => <$result as Outcome>::nothing(one), )*)*
                }
            }
        }

        impl Set {
            /// Returns the axes that it addresses; all of them for requests of the whole board.
            pub fn axes(&self) -> Axes<'_> {
                let addressed = match self {
                    Self::Values(_, selection, _) | Self::Act(_, selection) => {
                        return selection.axes();
                    }
                    $($( Self::$command($($field),*) => [$(Argument::axes($field)),*].into_iter().flatten().next(), )*)*
                };
                addressed.unwrap_or(Axes::All)
            }

            /// Returns the row of a command that has one of its own.
            pub(super) fn command(&self) -> Option<CommandKind> {
                match self {
                    Self::Values(..) | Self::Act(..) => None,
                    $($( Self::$command(..) => Some(CommandKind::$command), )*)*
                }
            }

            /// Reads the arguments of a command; `None` if one is missing or of another kind.
            pub(super) fn read(command: CommandKind, from: &mut Arguments<'_>) -> Option<Self> {
                Some(match command {
                    $($( CommandKind::$command => {
                        Self::$command($(<$field_type as Argument>::read(from)?),*)
                    } )*)*
                })
            }

            /// Appends the arguments of a command for 3.x; `None` if 3.x cannot express them.
            pub(super) fn write_v3(&self, form: Form, message: &mut Bottle) -> Option<()> {
                match self {
                    Self::Values(..) | Self::Act(..) => {}
                    $($( Self::$command($($field),*) => { $(Argument::write_v3($field, form, message)?;)* } )*)*
                }
                Some(())
            }

            /// Appends the arguments of a command for 4.0.
            pub(super) fn write_v4(&self, layout: CallLayout, items: &mut Vec<Item>) {
                match self {
                    Self::Values(..) | Self::Act(..) => {}
                    $($( Self::$command($($field),*) => { $(Argument::write_v4($field, layout, items);)* } )*)*
                }
            }
        }
    };
}

yarp_devices::describe_board!(request_types);

/// A row of the descriptions.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Row {
    Number(Quantity),
    Setting(Setting),
    Action(Action),
    Query(Query),
    Command(CommandKind),
}

/// The position of a request's word in a message of 3.x.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub(super) enum Place {
    /// Behind `[get]`, or behind `[get]` and this prefix.
    Get(Option<Vocab32>),
    /// Behind `[set]`, or behind `[set]` and this prefix.
    Set(Option<Vocab32>),
    /// The first item.
    First,
}

impl Row {
    pub(super) fn all() -> impl Iterator<Item = Self> {
        let numbers = Quantity::all().map(Self::Number);
        let settings = Setting::all().map(Self::Setting);
        let actions = Action::all().map(Self::Action);
        let queries = Query::all().map(Self::Query);
        let commands = CommandKind::all().map(Self::Command);
        let reads = numbers.chain(queries);
        reads.chain(settings).chain(actions).chain(commands)
    }

    pub(super) fn spelling(self) -> Spelling {
        match self {
            Self::Number(row) => row.spelling(),
            Self::Setting(row) => row.spelling(),
            Self::Action(row) => row.spelling(),
            Self::Query(row) => row.spelling(),
            Self::Command(row) => row.spelling(),
        }
    }

    fn place(self, spelling: &Spelling) -> Place {
        match self {
            _ if spelling.first => Place::First,
            Self::Number(_) | Self::Query(_) => Place::Get(spelling.interface),
            _ => Place::Set(spelling.interface),
        }
    }

    /// Finds the row of a function of 4.0, without `RPC` at its end, and the form it announces.
    pub(super) fn of_function(name: &str) -> Option<(Self, Form)> {
        FUNCTIONS.get(name).copied()
    }

    /// Finds the row of a word of 3.x, and the form it announces.
    pub(super) fn of_word(place: Place, word: Vocab32) -> Option<(Self, Form)> {
        WORDS.get(&(place, word)).copied()
    }
}

static FUNCTIONS: LazyLock<HashMap<&'static str, (Row, Form)>> = LazyLock::new(|| {
    let rows = Row::all().flat_map(|row| {
        let functions = named(row.spelling().functions);
        functions.map(move |(name, form)| (name, (row, form)))
    });
    rows.collect()
});

static WORDS: LazyLock<HashMap<(Place, Vocab32), (Row, Form)>> = LazyLock::new(|| {
    let rows = Row::all().flat_map(|row| {
        let spelling = row.spelling();
        let place = row.place(&spelling);
        named(spelling.words).map(move |(word, form)| ((place, word), (row, form)))
    });
    rows.collect()
});

static PREFIXES: LazyLock<HashSet<Vocab32>> = LazyLock::new(|| {
    let spellings = Row::all().map(Row::spelling);
    spellings
        .filter_map(|spelling| spelling.interface)
        .collect()
});

/// Returns whether a word, as item 1, makes the rest words of an interface.
pub(super) fn is_prefix(word: Vocab32) -> bool {
    PREFIXES.contains(&word)
}

fn named<T>(forms: Forms<T>) -> impl Iterator<Item = (T, Form)> {
    let one = forms.one.map(|spelt| (spelt, Form::One));
    let group = forms.group.map(|spelt| (spelt, Form::Group));
    let all = forms.all.map(|spelt| (spelt, Form::All));
    [one, group, all].into_iter().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spelling_belongs_to_one_row() {
        let spellings = || Row::all().map(Row::spelling);
        let functions = spellings()
            .flat_map(|spelling| named(spelling.functions))
            .count();
        let words = spellings()
            .flat_map(|spelling| named(spelling.words))
            .count();
        assert_eq!((FUNCTIONS.len(), WORDS.len()), (functions, words));
    }

    #[test]
    fn rows_are_found_by_their_spelling() {
        let stop = Row::Action(Action::Stop);
        assert_eq!(Row::of_function("stopGroup"), Some((stop, Form::Group)));
        assert_eq!(Row::of_function(""), None);
        let word = Vocab32::new("cal");
        let place = Place::Set(Some(Vocab32::new("reca")));
        let one = Some((Row::Action(Action::Calibrate), Form::One));
        assert_eq!(Row::of_word(place, word), one);
        let robot = Some((Row::Action(Action::CalibrateRobot), Form::All));
        assert_eq!(Row::of_word(Place::First, word), robot);
        assert_eq!(Row::of_word(Place::Set(None), word), None);
        assert!(is_prefix(Vocab32::new("icmd")) && !is_prefix(Vocab32::new("*")));
    }
}
