//! The interpreter: input of the line, actions and output of the hand.

use super::super::gcl::{
    ABORT, BANNER, Command, Control, Feedback, FirmwareVersion, Header, Layout, Motor,
    MotorFeedback, MotorSet, PROMPT, Parameter, Scope, Status, Verb,
};
use super::hand_motion::{Motion, Purpose, strain};
use super::parameter_values::Settings;
use super::simulated_motor::{Drive, Load, Object, SimulatedMotor};

/// Start-up time of the hand after power-up, s.
const BOOT_TIME: f64 = 0.5;
/// Maximum step of the simulation, s.
const MAX_STEP: f64 = 0.001;
/// Maximum length of a line; characters beyond it are not echoed.
const MAX_LINE_BYTES: usize = 255;
/// Counts/s of a unit of speed in RealTime.
const REALTIME_UNIT: f64 = 100.0;
/// Fingers closed farther than this are in the way of the spread, counts.
const SPREAD_CLEARANCE: f64 = 14000.0;
/// Temperature of the room, °C; cooling rate towards it, 1/s; heating by a pushing and by a moving motor, °C/s.
const ROOM_TEMPERATURE: f64 = 35.0;
const COOLING_RATE: f64 = 1.0 / 300.0;
const PUSHING_HEAT_RATE: f64 = 2.0;
const MOVING_HEAT_RATE: f64 = 0.02;
/// Heating by a motor that holds its position, or pushes with controlled torque after its motion, °C/s.
const HOLDING_HEAT_RATE: f64 = 0.01;
/// Difference below its limit to which a hot hand must cool before it moves again, °C.
const COOLING_MARGIN: f64 = 5.0;

/// The hand's processor, motors and all: bytes and time in, bytes out.
///
/// ```
/// use yarp_devices::hand::simulated::Firmware;
///
/// let mut hand = Firmware::new();
/// hand.advance(1.0);
/// hand.take_output();
/// hand.receive(b"GC\r");
/// assert_eq!(hand.take_output(), b"GC\n\rERR 4\n\r=> ");
/// ```
#[derive(Clone, Debug)]
pub struct Firmware {
    state: State,
    settings: Settings,
    motors: [SimulatedMotor; 4],
    initialised: MotorSet,
    /// °C.
    temperature: f64,
    peak: f64,
    /// True if it overheated and has not cooled down since.
    hot: bool,
    /// s since power-up.
    up: f64,
    /// True if time is stopped for the motors.
    frozen: bool,
    version: FirmwareVersion,
    output: Vec<u8>,
}

#[derive(Clone, Debug)]
enum State {
    /// Until then, s.
    Booting(f64),
    /// Waits for a command; what was typed so far.
    Listening(Vec<u8>),
    Moving(Motion),
    RealTime(Loop),
}

/// RealTime mode.
#[derive(Clone, Debug)]
struct Loop {
    layout: Layout,
    block: Vec<u8>,
    /// Last position of each motor reported to the other end.
    reported: [i32; 4],
}

impl Default for Firmware {
    fn default() -> Self {
        Self::new()
    }
}

impl Firmware {
    /// A hand that has just got power, with its fingers somewhere and the newest firmware.
    pub fn new() -> Self {
        Self::with_version(FirmwareVersion::default())
    }

    /// Creates a hand with firmware of this version.
    pub fn with_version(version: FirmwareVersion) -> Self {
        Self {
            state: State::Booting(BOOT_TIME),
            settings: Settings::new(),
            motors: Motor::ALL.map(SimulatedMotor::new),
            initialised: MotorSet::NONE,
            temperature: ROOM_TEMPERATURE,
            peak: ROOM_TEMPERATURE,
            hot: false,
            up: 0.0,
            frozen: false,
            version,
            output: Vec::new(),
        }
    }

    /// Takes its power and gives it back: it forgets what was not saved, and fingers stay where they are.
    pub fn restart(&mut self) {
        self.state = State::Booting(BOOT_TIME);
        self.settings.restart();
        self.initialised = MotorSet::NONE;
        self.up = 0.0;
        self.motors.iter_mut().for_each(SimulatedMotor::stop);
    }

    /// Bytes from the other end of the line.
    pub fn receive(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            match &mut self.state {
                State::Booting(_) => {}
                State::Listening(line) => match byte {
                    ABORT => {
                        line.clear();
                        self.motors.iter_mut().for_each(SimulatedMotor::stop);
                        self.answer("");
                    }
                    b'\r' => {
                        let line = std::mem::take(line);
                        self.execute(&line);
                    }
                    b'\n' => {}
                    _ if line.len() < MAX_LINE_BYTES => {
                        line.push(byte);
                        self.output.push(byte);
                    }
                    _ => {}
                },
                State::Moving(_) if byte == ABORT => self.end(Status::ABORTED),
                State::Moving(_) => {}
                State::RealTime(_) => self.block(byte),
            }
        }
    }

    /// Lets time pass, s.
    pub fn advance(&mut self, seconds: f64) {
        let mut left = seconds;
        while left > 0.0 {
            let step = left.min(MAX_STEP);
            left -= step;
            self.step(step);
        }
    }

    /// Takes the output since the last call.
    pub fn take_output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.output)
    }

    /// Returns whether time changes anything: a motion, RealTime, or starting up.
    pub fn is_busy(&self) -> bool {
        !matches!(self.state, State::Listening(_))
    }

    /// The speed of the line, bits per second.
    pub fn baud(&self) -> u32 {
        self.settings.hand("BAUD").cast_unsigned() * 100
    }

    /// Returns the true positions of the motors, counts.
    pub fn positions(&self) -> [f64; 4] {
        self.motors.each_ref().map(SimulatedMotor::position)
    }

    /// Returns the total distance of each motor, counts.
    pub fn travelled(&self) -> [f64; 4] {
        self.motors.each_ref().map(SimulatedMotor::travelled)
    }

    /// Puts something in the way of a motor, or takes it away.
    pub fn set_object(&mut self, motor: Motor, object: Option<Object>) {
        self.motors[motor.index()].object = object;
    }

    /// Sets what contact does to the finger of a motor, until told otherwise; the spread feels nothing.
    pub fn set_load(&mut self, motor: Motor, load: Load) {
        self.motors[motor.index()].load = load;
    }

    /// Returns where the clutch of each finger is disengaged, counts; `None` while it is engaged.
    pub fn clutches(&self) -> [Option<f64>; 3] {
        [Motor::F1, Motor::F2, Motor::F3].map(|motor| self.motors[motor.index()].clutch())
    }

    /// Pushes the spread from outside by these counts; it yields without current alone, fingers never.
    pub fn push_spread(&mut self, counts: f64) {
        self.motors[Motor::Spread.index()].push_back(counts);
    }

    fn banner(&self) -> String {
        format!("{BANNER} {}0 (simulated BH8-262)", self.version)
    }

    /// Makes it this hot, °C.
    pub fn set_temperature(&mut self, celsius: f64) {
        self.temperature = celsius;
    }

    /// Stops or resumes time for the motors: motions in progress neither move nor end, and can be stopped.
    pub fn freeze(&mut self, frozen: bool) {
        self.frozen = frozen;
    }

    fn step(&mut self, seconds: f64) {
        self.up += seconds;
        let positions = self.positions();
        let fingers_block = positions[..3]
            .iter()
            .any(|position| *position > SPREAD_CLEARANCE);
        self.motors[Motor::Spread.index()].blocked = fingers_block;
        for motor in self.motors.iter_mut().filter(|_| !self.frozen) {
            motor.step(seconds);
        }
        self.heat(seconds);
        match &mut self.state {
            State::Booting(left) => {
                *left -= seconds;
                if *left <= 0.0 {
                    self.answer(&self.banner());
                }
            }
            State::Listening(_) if self.hot => {
                self.motors.iter_mut().for_each(SimulatedMotor::stop);
            }
            State::Listening(_) => {}
            State::Moving(_) if self.hot => self.end(Status::OVER_TEMPERATURE),
            State::Moving(_) if self.frozen => {}
            State::Moving(motion) => {
                if motion.watch(&mut self.motors, &self.settings) {
                    self.end(Status::FINE);
                }
            }
            State::RealTime(_) if self.hot => self.leave_realtime(Status::OVER_TEMPERATURE),
            State::RealTime(_) => {}
        }
    }

    fn heat(&mut self, seconds: f64) {
        let heating: f64 = self
            .motors
            .iter()
            .map(|motor| match motor {
                motor if motor.has_current() && !motor.is_driven() => HOLDING_HEAT_RATE,
                motor if motor.pushing() > 0.0 => PUSHING_HEAT_RATE,
                motor if motor.speed() != 0.0 => MOVING_HEAT_RATE,
                _ => 0.0,
            })
            .sum();
        self.temperature +=
            (heating - (self.temperature - ROOM_TEMPERATURE) * COOLING_RATE) * seconds;
        self.peak = self.peak.max(self.temperature);
        let limit = f64::from(self.settings.hand("OTEMP")) / 10.0;
        self.hot =
            self.temperature > limit || (self.hot && self.temperature > limit - COOLING_MARGIN);
    }

    /// The motion has ended, by itself or, with a status, by something else: then no motor keeps its current.
    fn end(&mut self, status: Status) {
        let state = std::mem::replace(&mut self.state, State::Listening(Vec::new()));
        if !status.is_fine() {
            self.motors.iter_mut().for_each(SimulatedMotor::stop);
        }
        let status = match state {
            State::Moving(motion) => {
                let status = motion.status.and(status);
                if motion.purpose == Purpose::Initialise && status.is_fine() {
                    self.initialised = motion.motors.iter().fold(self.initialised, MotorSet::with);
                }
                status
            }
            _ => status,
        };
        self.complain(status);
    }

    fn execute(&mut self, line: &[u8]) {
        let text = String::from_utf8_lossy(line);
        match Command::parse(&text) {
            Ok(command) => match self.check(&command.verb) {
                Status::FINE => self.carry_out(command),
                status => self.complain(status),
            },
            Err(status) => self.complain(status),
        }
    }

    /// Checks parameters against the version.
    fn check(&self, verb: &Verb) -> Status {
        let known = |parameter: &Parameter| parameter.exists_in(self.version);
        match verb {
            Verb::Set(_, pairs) if !pairs.iter().all(|(parameter, _)| known(parameter)) => {
                Status::UNKNOWN_PARAMETER
            }
            Verb::Set(_, pairs)
                if !pairs
                    .iter()
                    .all(|(parameter, value)| parameter.allows_in(self.version, *value)) =>
            {
                Status::INVALID_VALUE
            }
            Verb::Get(_, parameters) | Verb::Keep(_, _, parameters)
                if !parameters.iter().all(known) =>
            {
                Status::UNKNOWN_PARAMETER
            }
            _ => Status::FINE,
        }
    }

    fn carry_out(&mut self, command: Command) {
        let motors = command.motors.unwrap_or_else(|| self.enabled());
        if command.moves() {
            return self.set_off(motors, &command.verb);
        }
        let text = match &command.verb {
            Verb::Terminate => {
                for motor in motors.iter() {
                    self.motors[motor.index()].stop();
                }
                String::new()
            }
            Verb::Set(scope, pairs) => {
                for (parameter, value) in pairs {
                    for motor in about(*scope, motors).iter() {
                        self.settings.set(*parameter, motor, *value);
                    }
                }
                String::new()
            }
            Verb::Get(scope, parameters) => {
                let numbers = parameters.iter().flat_map(|parameter| {
                    about(*scope, motors)
                        .iter()
                        .map(|motor| self.value(*parameter, motor).to_string())
                });
                numbers.collect::<Vec<_>>().join(" ")
            }
            Verb::Keep(scope, kept, parameters) => {
                let all: Vec<Parameter> = match parameters.is_empty() {
                    true => Parameter::all().filter(|each| each.scope() == *scope).collect(),
                    false => parameters.clone(),
                };
                for parameter in all {
                    for motor in about(*scope, motors).iter() {
                        self.settings.keep(parameter, motor, *kept);
                    }
                }
                String::new()
            }
            Verb::List(scope, listing) => {
                let listed = Parameter::list(*scope, listing.advanced)
                    .filter(|parameter| parameter.exists_in(self.version));
                let lines = listed.map(|parameter| {
                    let mut line = parameter.to_string();
                    for motor in about(*scope, motors).iter().filter(|_| listing.values) {
                        line += &format!(" {}", self.value(parameter, motor));
                    }
                    line
                });
                lines.collect::<Vec<_>>().join("\n\r")
            }
            Verb::Help { advanced: false } => "C O TC TO IC IO M HOME HI T LOOP\n\rFSET FGET FLIST \
                FLISTV FLOAD FSAVE FDEF\n\rPSET PGET PLIST PLISTV PLOAD PSAVE PDEF\n\r? ERR RESET VERS"
                .to_owned(),
            Verb::Help { advanced: true } => "A? FLISTA FLISTAV PLISTA PLISTAV".to_owned(),
            Verb::Errors => (0..15)
                .map(|bit| Status::new(1 << bit).to_string())
                .collect::<Vec<_>>()
                .join("\n\r"),
            Verb::Version => self.banner(),
            Verb::Reset => return self.restart(),
            _ => String::new(),
        };
        self.answer(&text);
    }

    /// Starts a motion or RealTime, if nothing prevents it.
    fn set_off(&mut self, motors: MotorSet, verb: &Verb) {
        let ready = motors.iter().all(|motor| self.initialised.contains(motor));
        if !ready && *verb != Verb::Initialise {
            return self.complain(Status::NOT_INITIALISED);
        }
        if self.hot {
            return self.complain(Status::OVER_TEMPERATURE);
        }
        let Some(purpose) = Purpose::of(verb) else {
            return self.enter_realtime(motors);
        };
        let motion = Motion::start(motors, purpose, &mut self.motors, &self.settings);
        self.state = State::Moving(motion);
    }

    fn enabled(&self) -> MotorSet {
        MotorSet::ALL
            .iter()
            .filter(|motor| self.settings.motor("EN", *motor) != 0)
            .fold(MotorSet::NONE, MotorSet::with)
    }

    /// Returns the value of a parameter.
    fn value(&self, parameter: Parameter, motor: Motor) -> i32 {
        let moved = &self.motors[motor.index()];
        match (parameter.scope(), parameter.name()) {
            (Scope::Motor, "P") => self.counted(motor),
            (Scope::Motor, "S") => match self.initialised.contains(motor) {
                true => 0,
                false => i32::from(Status::NOT_INITIALISED.bits()),
            },
            (Scope::Motor, "SG") => strain(motor, moved),
            (Scope::Motor, "BD") => i32::from(moved.breakaway().is_some()),
            (Scope::Motor, "BP") => moved.breakaway().unwrap_or(0.0) as i32,
            (Scope::Motor, "OD") => (moved.travelled() / 1000.0) as i32,
            (Scope::Hand, "TEMP") => (self.temperature * 10.0) as i32,
            (Scope::Hand, "PTEMP") => (self.peak * 10.0) as i32,
            (Scope::Hand, "UPSECS") => self.up as i32,
            _ => self.settings.get(parameter, motor),
        }
    }

    /// The counter of a motor, which begins at the open stop once that was found.
    fn counted(&self, motor: Motor) -> i32 {
        match self.initialised.contains(motor) {
            true => self.motors[motor.index()].position().round() as i32,
            false => 0,
        }
    }

    fn enter_realtime(&mut self, motors: MotorSet) {
        for motor in motors.iter() {
            let gain = self.settings.motor("FPG", motor);
            self.motors[motor.index()].set_gain(f64::from(gain));
        }
        let value = |name: &str, motor| self.settings.motor(name, motor);
        let temperature = self.settings.hand("LFT") != 0;
        self.state = State::RealTime(Loop {
            layout: Layout::from_parameters(self.version, motors, value, temperature),
            block: Vec::new(),
            reported: Motor::ALL.map(|motor| self.counted(motor)),
        });
        self.output.extend(b"\n\r*");
    }

    /// A byte of a control block.
    fn block(&mut self, byte: u8) {
        let State::RealTime(realtime) = &mut self.state else {
            return;
        };
        if realtime.block.is_empty() {
            if byte == ABORT {
                return self.leave_realtime(Status::FINE);
            }
            if Header::from_byte(byte).is_none() {
                return self.leave_realtime(Status::BAD_HEADER);
            }
        }
        realtime.block.push(byte);
        let Some(header) = Header::from_byte(realtime.block[0]) else {
            return;
        };
        let wanted = match header.has_data() {
            true => realtime.layout.control_length(),
            false => 0,
        };
        if realtime.block.len() <= wanted {
            return;
        }
        let control = realtime.layout.read_control(&realtime.block[1..]);
        realtime.block.clear();
        let layout = realtime.layout.clone();
        if let Some(control) = control.filter(|_| header.has_data()) {
            self.follow(&layout, &control);
        }
        let feedback = self.measure(&layout);
        self.output.extend(layout.write_feedback(header, &feedback));
    }

    /// Executes a control block. Torques (`LCT`) are read and move nothing: their unit is not published.
    fn follow(&mut self, layout: &Layout, control: &Control) {
        for (motor, of_motor) in Motor::ALL.into_iter().zip(&layout.motors) {
            let fields = control[motor.index()];
            let moved = &mut self.motors[motor.index()];
            if of_motor.is_some_and(|of_motor| of_motor.gain) {
                moved.set_gain(f64::from(fields.gain));
            }
            let Some(units) = layout.commanded_speed(motor, fields.speed) else {
                continue;
            };
            let drive = match units == 0.0 {
                true => Drive::Off,
                false => Drive::At(units * REALTIME_UNIT),
            };
            if moved.drive != drive {
                moved.drive(drive);
            }
        }
    }

    fn measure(&mut self, layout: &Layout) -> Feedback {
        let mut feedback = Feedback::default();
        for (motor, layout) in Motor::ALL.into_iter().zip(&layout.motors) {
            let Some(layout) = layout else { continue };
            let position = self.counted(motor);
            let moved = &self.motors[motor.index()];
            let speed = moved.speed() / REALTIME_UNIT;
            let speed = speed / f64::from(layout.measured_speed.unwrap_or(1).max(1));
            let breakaway = moved.breakaway().unwrap_or(0.0);
            let mut change = None;
            if let (Some(scale), State::RealTime(realtime)) = (layout.change, &mut self.state) {
                let scale = i32::from(scale.max(1));
                let known = &mut realtime.reported[motor.index()];
                let steps = ((position - *known) / scale).clamp(-128, 127);
                // The remainder is reported next time.
                *known += steps * scale;
                change = Some(steps as i8);
            }
            feedback.motors[motor.index()] = MotorFeedback {
                speed: Some(speed.clamp(-128.0, 127.0) as i8),
                strain: Some(strain(motor, &self.motors[motor.index()]) as u8),
                position: Some(position as i16),
                change,
                breakaway: Some(breakaway as u16),
                analog: Some(0),
            };
        }
        feedback.temperature = Some((self.temperature * 10.0) as i16);
        feedback
    }

    fn leave_realtime(&mut self, status: Status) {
        self.motors.iter_mut().for_each(SimulatedMotor::stop);
        self.state = State::Listening(Vec::new());
        if !status.is_fine() {
            self.output.extend(b"\r\n");
            self.output.extend(format!("ERR {}", status.bits()).bytes());
        }
        self.output.extend(b"\n\r");
        self.output.extend(PROMPT);
    }

    fn complain(&mut self, status: Status) {
        match status.is_fine() {
            true => self.answer(""),
            false => self.answer(&format!("ERR {}", status.bits())),
        }
    }

    /// Says something and waits for the next command.
    fn answer(&mut self, text: &str) {
        self.state = State::Listening(Vec::new());
        if !text.is_empty() {
            self.output.extend(b"\n\r");
            self.output.extend(text.bytes());
        }
        self.output.extend(b"\n\r");
        self.output.extend(PROMPT);
    }
}

/// The motors that a value is about: a parameter of the hand has one value.
fn about(scope: Scope, motors: MotorSet) -> MotorSet {
    match scope {
        Scope::Motor => motors,
        Scope::Hand => MotorSet::from(Motor::F1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hand at rest that has found its stops, with its motors where `lines` bring them, as warm as the room.
    fn at_room_temperature(lines: &[&str]) -> Firmware {
        let mut hand = Firmware::new();
        hand.advance(1.0);
        for line in [&["HI"], lines].concat() {
            hand.receive(format!("{line}\r").as_bytes());
            while hand.is_busy() {
                hand.advance(0.01);
            }
        }
        hand.set_temperature(ROOM_TEMPERATURE);
        hand
    }

    /// Returns how much warmer it gets in a time, °C.
    fn heating(hand: &mut Firmware, seconds: f64) -> f64 {
        hand.set_temperature(35.0);
        hand.advance(seconds);
        hand.temperature - 35.0
    }

    fn is_about(found: f64, expected: f64) -> bool {
        (found - expected).abs() < 0.1 * expected
    }

    /// Barrett's wiki: a hand that works has 40 to 60 °C. With all motors moving it settles at 59 °C, `35 + 4 * 0.02 * 300`.
    #[test]
    fn four_motors_that_move_warm_the_hand_to_the_top_of_its_usual_range() {
        let mut hand = at_room_temperature(&["1234FSET MCV 16"]);
        hand.receive(b"C\r");
        hand.advance(0.1);
        let rate = heating(&mut hand, 0.2) / 0.2;
        assert!(hand.is_busy());
        let settled = 35.0 + rate * 300.0;
        assert!((settled - 59.0).abs() < 1.0, "{settled} °C");
    }

    /// Half of what it is in motion: 47 °C.
    #[test]
    fn four_motors_that_hold_warm_the_hand_by_half_as_much_as_four_that_move() {
        let mut hand = at_room_temperature(&["1234FSET HOLD 1", "GM 5000", "SM 1000"]);
        let rate = heating(&mut hand, 1.0);
        assert!(is_about(rate, 0.04), "{rate} °C/s");
        let settled = 35.0 + rate * 300.0;
        assert!((settled - 47.0).abs() < 1.0, "{settled} °C");
        // Without current there is no heat.
        let mut hand = at_room_temperature(&["1234FSET HOLD 0", "GM 5000", "SM 1000"]);
        assert_eq!(heating(&mut hand, 1.0), 0.0);
    }

    /// Barrett's wiki: a long push (`TSTOP`) overheats motors, and 65 °C are the most. One that pushes on gets there from 35 °C in a
    /// quarter of a minute, by `T' = 2 - (T - 35) / 300`.
    #[test]
    fn a_motor_that_pushes_on_overheats_the_hand_in_a_quarter_of_a_minute() {
        let object = Object {
            inner: 30.0,
            outer: 5.0,
            torque: 0.1,
        };
        let mut hand = at_room_temperature(&["1FSET TSTOP 60000", "PSET OTEMP 650"]);
        hand.set_object(Motor::F1, Some(object));
        hand.receive(b"1C\r");
        while hand.motors[0].pushing() == 0.0 {
            hand.advance(MAX_STEP);
        }
        hand.set_temperature(35.0);
        hand.take_output();
        let mut seconds = 0.0;
        while hand.is_busy() {
            hand.advance(0.01);
            seconds += 0.01;
        }
        let expected = -300.0 * (1.0_f64 - 30.0 / 600.0).ln();
        assert!(is_about(seconds, expected), "{seconds} s");
        let output = hand.take_output();
        assert!(output.windows(8).any(|part| part == b"ERR 8192"));
    }

    /// The data sheet of the hand: 1.0 s for a finger and 0.5 s for the spread, from one end to the other, with the speeds at
    /// which it is delivered; and some hundredths of a second more, for the acceleration.
    #[test]
    fn fingers_close_and_spread_in_the_times_of_the_data_sheet() {
        for (line, expected) in [("1M 17500", 1.0), ("SM 3150", 0.5)] {
            let mut hand = at_room_temperature(&["O"]);
            hand.receive(format!("{line}\r").as_bytes());
            let mut seconds = 0.0;
            while hand.is_busy() {
                hand.advance(MAX_STEP);
                seconds += MAX_STEP;
            }
            assert!(is_about(seconds, expected), "{line}: {seconds} s");
        }
    }
}
