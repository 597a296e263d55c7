//! The values of parameters, those in use and those that outlast a reset.

use super::super::gcl::{Motor, Parameter, Scope, SettingsCommand};

/// One value per motor and parameter; of a parameter of the hand the first one counts.
type Values = [[i32; 4]; Parameter::ROWS];

#[derive(Clone, Debug)]
pub(super) struct Settings {
    used: Values,
    saved: Values,
}

impl Settings {
    pub(super) fn new() -> Self {
        Self {
            used: factory(),
            saved: factory(),
        }
    }

    /// Restores the saved values, as after power-up.
    pub(super) fn restart(&mut self) {
        self.used = self.saved;
    }

    pub(super) fn get(&self, parameter: Parameter, motor: Motor) -> i32 {
        self.used[parameter.row()][place(parameter, motor)]
    }

    /// By the name that the manual prints.
    pub(super) fn motor(&self, name: &str, motor: Motor) -> i32 {
        let parameter = Parameter::find(Scope::Motor, name).expect("its name is in the table");
        self.get(parameter, motor)
    }

    pub(super) fn hand(&self, name: &str) -> i32 {
        let parameter = Parameter::find(Scope::Hand, name).expect("its name is in the table");
        self.get(parameter, Motor::F1)
    }

    pub(super) fn set(&mut self, parameter: Parameter, motor: Motor, value: i32) {
        self.used[parameter.row()][place(parameter, motor)] = value;
    }

    pub(super) fn keep(&mut self, parameter: Parameter, motor: Motor, kept: SettingsCommand) {
        let (row, place) = (parameter.row(), place(parameter, motor));
        match kept {
            SettingsCommand::Load => self.used[row][place] = self.saved[row][place],
            SettingsCommand::Save => self.saved[row][place] = self.used[row][place],
            SettingsCommand::Default => self.used[row][place] = parameter.default(motor),
        }
    }
}

fn place(parameter: Parameter, motor: Motor) -> usize {
    match parameter.scope() {
        Scope::Motor => motor.index(),
        Scope::Hand => 0,
    }
}

fn factory() -> Values {
    let mut values = [[0; 4]; Parameter::ROWS];
    for parameter in Parameter::all() {
        for motor in Motor::ALL {
            values[parameter.row()][place(parameter, motor)] = parameter.default(motor);
        }
    }
    values
}
