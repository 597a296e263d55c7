//! The blocks of RealTime mode: small messages of fixed length, one control block for one feedback block.
//!
//! ```text
//! control:   header  [speed] [gain] [torque high, low]  ...     per motor of the LOOP command, 1 2 3 4
//! feedback:  '*'  [speed] [strain] [position high, low] [change] [breakaway high, low] [analog]  ...  [temperature]
//! ```
//!
//! Fields in brackets are present if the parameter enables them: `LCV`, `LCPG`, `LCT`; `LFV`, `LFS`, `LFAP`, `LFDP`,
//! `LFBP`, `LFAIN`; `LFT`. A torque is there only without speed and gain. `LCT`, `LFBP` and `LFAIN` exist from firmware
//! 4.4 on; see [`FirmwareVersion`] for what else differs.
//!
//! Source: the manual of firmware 4.3x, pages 37 to 43, that of 4.4.x, pages 43 to 45, and the order of the newer fields
//! in Barrett's API 4.4.3.

use super::{
    Command, FirmwareVersion, Motor, MotorSet, Parameter, Reply, ReplyReader, Scope, Status, Verb,
};

/// Content of the blocks, for each motor that takes part.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Layout {
    /// Per motor in the order 1, 2, 3, 4; `None` for one that does not take part.
    pub motors: [Option<MotorLayout>; 4],
    /// True if feedback ends with the temperature.
    pub temperature: bool,
    /// Version of the firmware at the other end; the driver replaces it by the one that the hand reports.
    pub firmware: FirmwareVersion,
}

/// Content of the blocks for one motor.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct MotorLayout {
    /// A commanded speed, and the value of one unit of it (`LCV`, `LCVC`): in units of speed, from firmware 4.4 on in
    /// sixteenths of one.
    pub speed: Option<u8>,
    /// A gain (`LCPG`).
    pub gain: bool,
    /// A torque (`LCT`); not sent beside speed or gain.
    pub torque: bool,
    /// The measured speed, and the value of one unit of it (`LFV`, `LFVC`).
    pub measured_speed: Option<u8>,
    /// The strain gauge (`LFS`).
    pub strain: bool,
    /// The position (`LFAP`).
    pub position: bool,
    /// The distance since the last feedback, and the value of one unit of it (`LFDP`, `LFDPC`).
    pub change: Option<u8>,
    /// The position at which the clutch released (`LFBP`).
    pub breakaway: bool,
    /// The analog input (`LFAIN`).
    pub analog: bool,
}

impl MotorLayout {
    fn has_torque(&self) -> bool {
        self.torque && self.speed.is_none() && !self.gain
    }

    fn control_length(&self) -> usize {
        usize::from(self.speed.is_some())
            + usize::from(self.gain)
            + 2 * usize::from(self.has_torque())
    }

    fn feedback_length(&self) -> usize {
        usize::from(self.measured_speed.is_some())
            + usize::from(self.strain)
            + 2 * usize::from(self.position)
            + usize::from(self.change.is_some())
            + 2 * usize::from(self.breakaway)
            + usize::from(self.analog)
    }
}

/// The first letter of a control block.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Header {
    /// `C`: control data; feedback is requested.
    Control,
    /// `c`: control data, no feedback.
    ControlOnly,
    /// `A`: no control data; feedback is requested.
    Ask,
    /// `a`: neither.
    Nothing,
}

impl Header {
    /// The letter.
    pub const fn byte(self) -> u8 {
        match self {
            Header::Control => b'C',
            Header::ControlOnly => b'c',
            Header::Ask => b'A',
            Header::Nothing => b'a',
        }
    }

    /// Decodes the header letter.
    pub const fn from_byte(byte: u8) -> Option<Header> {
        match byte {
            b'C' => Some(Header::Control),
            b'c' => Some(Header::ControlOnly),
            b'A' => Some(Header::Ask),
            b'a' => Some(Header::Nothing),
            _ => None,
        }
    }

    /// Returns whether data for the motors follow.
    pub const fn has_data(self) -> bool {
        matches!(self, Header::Control | Header::ControlOnly)
    }

    /// Returns whether feedback is requested.
    pub const fn asks(self) -> bool {
        matches!(self, Header::Control | Header::Ask)
    }
}

/// Commands for the motors; only the fields of the layout are sent.
pub type Control = [MotorControl; 4];

/// Command for one motor.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct MotorControl {
    /// Speed in units of the layout; closing is positive.
    pub speed: i8,
    /// Gain.
    pub gain: u8,
    /// Torque; its unit is not published.
    pub torque: i16,
}

/// Feedback of the hand; fields that are not in the layout are `None`.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Feedback {
    /// Per motor in the order 1, 2, 3, 4.
    pub motors: [MotorFeedback; 4],
    /// Tenths of a degree Celsius.
    pub temperature: Option<i16>,
}

/// Feedback of one motor.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct MotorFeedback {
    /// The speed measured, in units of the layout.
    pub speed: Option<i8>,
    /// The strain gauge.
    pub strain: Option<u8>,
    /// Counts.
    pub position: Option<i16>,
    /// The way since the last feedback, in units of the layout.
    pub change: Option<i8>,
    /// Counts at which the clutch released.
    pub breakaway: Option<u16>,
    /// The analog input.
    pub analog: Option<u8>,
}

/// Reasons why bytes are not feedback.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BlockError {
    /// The hand left RealTime with a complaint.
    #[error("the hand left RealTime: {0}")]
    Ended(Status),
    /// Something else than feedback or a complaint.
    #[error("expected `*` of a feedback block, got \"{0}\"")]
    Unexpected(String),
}

impl Layout {
    /// The same for each of these motors.
    pub fn same(motors: MotorSet, layout: MotorLayout) -> Self {
        let each = |motor| motors.contains(motor).then_some(layout);
        Self {
            motors: Motor::ALL.map(each),
            ..Self::default()
        }
    }

    /// The motors that take part.
    pub fn taking_part(&self) -> MotorSet {
        let each = Motor::ALL.into_iter().zip(&self.motors);
        each.filter(|(_, layout)| layout.is_some())
            .fold(MotorSet::NONE, |motors, (motor, _)| motors.with(motor))
    }

    /// Returns the layout for these values of parameters, as a hand of this version interprets them.
    pub fn from_parameters(
        firmware: FirmwareVersion,
        motors: MotorSet,
        value: impl Fn(&str, Motor) -> i32,
        temperature: bool,
    ) -> Self {
        let each = |motor: Motor| {
            let on = |name| value(name, motor) != 0;
            let newer = |name| firmware.has_newer_fields() && on(name);
            let scaled = |name, scale| on(name).then(|| value(scale, motor) as u8);
            motors.contains(motor).then(|| MotorLayout {
                speed: scaled("LCV", "LCVC"),
                gain: on("LCPG"),
                torque: newer("LCT"),
                measured_speed: scaled("LFV", "LFVC"),
                strain: on("LFS"),
                position: on("LFAP"),
                change: scaled("LFDP", "LFDPC"),
                breakaway: newer("LFBP"),
                analog: newer("LFAIN"),
            })
        };
        Self {
            motors: Motor::ALL.map(each),
            temperature,
            firmware,
        }
    }

    /// Returns the speed that a command of a motor stands for, in units of speed; `None` without a commanded speed.
    pub fn commanded_speed(&self, motor: Motor, command: i8) -> Option<f64> {
        let scale = self.motors[motor.index()]?.speed?;
        let fraction = f64::from(self.firmware.speed_fraction());
        Some(f64::from(command) * f64::from(scale) / fraction)
    }

    /// Returns the commands that select this layout and enter RealTime; the last one is `LOOP`.
    ///
    /// The fields that firmware has from 4.4 on are switched off there when the layout has none: one that is on in the
    /// EEPROM would shift all that follows it.
    pub fn commands(&self) -> Vec<Command> {
        let mut commands = Vec::new();
        for (motors, layout) in self.groups() {
            let values = [
                ("LCV", i32::from(layout.speed.is_some())),
                ("LCVC", i32::from(layout.speed.unwrap_or(1))),
                ("LCPG", i32::from(layout.gain)),
                ("LFV", i32::from(layout.measured_speed.is_some())),
                ("LFVC", i32::from(layout.measured_speed.unwrap_or(1))),
                ("LFS", i32::from(layout.strain)),
                ("LFAP", i32::from(layout.position)),
                ("LFDP", i32::from(layout.change.is_some())),
                ("LFDPC", i32::from(layout.change.unwrap_or(1))),
            ];
            let verb = Verb::Set(Scope::Motor, values.map(pair(Scope::Motor)).to_vec());
            commands.push(Command::new(motors, verb));
            if self.firmware.has_newer_fields() {
                let values = [
                    ("LCT", i32::from(layout.torque)),
                    ("LFBP", i32::from(layout.breakaway)),
                    ("LFAIN", i32::from(layout.analog)),
                ];
                let verb = Verb::Set(Scope::Motor, values.map(pair(Scope::Motor)).to_vec());
                commands.push(Command::new(motors, verb));
            }
        }
        let temperature = pair(Scope::Hand)(("LFT", i32::from(self.temperature)));
        commands.push(Verb::Set(Scope::Hand, vec![temperature]).into());
        commands.push(Command::new(self.taking_part(), Verb::Loop));
        commands
    }

    /// Returns the motors that take part, those with the same content together.
    fn groups(&self) -> Vec<(MotorSet, MotorLayout)> {
        let mut groups: Vec<(MotorSet, MotorLayout)> = Vec::new();
        for (motor, layout) in Motor::ALL.into_iter().zip(self.motors) {
            let Some(layout) = layout else { continue };
            match groups.iter_mut().find(|(_, other)| *other == layout) {
                Some((motors, _)) => *motors = motors.with(motor),
                None => groups.push((MotorSet::NONE.with(motor), layout)),
            }
        }
        groups
    }

    /// Returns the number of bytes after the header of a control block with data.
    pub fn control_length(&self) -> usize {
        let motors = self.motors.iter().flatten();
        motors.map(MotorLayout::control_length).sum()
    }

    /// Returns the number of bytes after the `*` of a feedback block.
    pub fn feedback_length(&self) -> usize {
        let motors = self.motors.iter().flatten();
        let temperature = match self.temperature {
            true => self.firmware.temperature_length(),
            false => 0,
        };
        motors.map(MotorLayout::feedback_length).sum::<usize>() + temperature
    }

    /// A control block with its header.
    pub fn write_control(&self, header: Header, control: &Control) -> Vec<u8> {
        let mut block = vec![header.byte()];
        if header.has_data() {
            for (layout, fields) in self.motors.iter().zip(control) {
                let Some(layout) = layout else { continue };
                block.extend(layout.speed.map(|_| fields.speed.cast_unsigned()));
                block.extend(layout.gain.then_some(fields.gain));
                if layout.has_torque() {
                    block.extend(fields.torque.to_be_bytes());
                }
            }
        }
        block
    }

    /// The data of a control block, of exactly [`control_length`](Self::control_length) bytes.
    pub fn read_control(&self, data: &[u8]) -> Option<Control> {
        if data.len() != self.control_length() {
            return None;
        }
        let mut bytes = data.iter().copied();
        let mut control = Control::default();
        for (layout, fields) in self.motors.iter().zip(&mut control) {
            let Some(layout) = layout else { continue };
            if layout.speed.is_some() {
                fields.speed = bytes.next()?.cast_signed();
            }
            if layout.gain {
                fields.gain = bytes.next()?;
            }
            if layout.has_torque() {
                fields.torque = i16::from_be_bytes([bytes.next()?, bytes.next()?]);
            }
        }
        Some(control)
    }

    /// Encodes a feedback block; fields of the layout that `feedback` lacks are zero.
    pub fn write_feedback(&self, header: Header, feedback: &Feedback) -> Vec<u8> {
        let mut block = vec![b'*'];
        if !header.asks() {
            return block;
        }
        for (layout, fields) in self.motors.iter().zip(&feedback.motors) {
            let Some(layout) = layout else { continue };
            let speed = fields.speed.unwrap_or(0).cast_unsigned();
            block.extend(layout.measured_speed.map(|_| speed));
            block.extend(layout.strain.then_some(fields.strain.unwrap_or(0)));
            if layout.position {
                block.extend(fields.position.unwrap_or(0).to_be_bytes());
            }
            let change = fields.change.unwrap_or(0).cast_unsigned();
            block.extend(layout.change.map(|_| change));
            if layout.breakaway {
                block.extend(fields.breakaway.unwrap_or(0).to_be_bytes());
            }
            block.extend(layout.analog.then_some(fields.analog.unwrap_or(0)));
        }
        if self.temperature {
            let tenths = feedback.temperature.unwrap_or(0);
            match self.firmware.temperature_length() {
                1 => block.push((tenths / 10).clamp(-128, 127).to_be_bytes()[1]),
                _ => block.extend(tenths.to_be_bytes()),
            }
        }
        block
    }

    /// The feedback at the start of `bytes`, which answers a block with this header; `None` until all of it is there.
    ///
    /// Errors: [`BlockError`]; a complaint only once the prompt behind it has come.
    pub fn read_feedback(
        &self,
        header: Header,
        bytes: &[u8],
    ) -> Result<Option<Feedback>, BlockError> {
        match bytes.first() {
            None => return Ok(None),
            Some(b'*') => {}
            Some(b'\r' | b'\n') => return complaint(bytes),
            Some(_) => return Err(unexpected(bytes)),
        }
        if !header.asks() {
            return Ok(Some(Feedback::default()));
        }
        let data = &bytes[1..];
        if data.len() < self.feedback_length() {
            return Ok(None);
        }
        let mut bytes = data.iter().copied();
        let mut next = || bytes.next().expect("the length was checked");
        let mut feedback = Feedback::default();
        for (layout, fields) in self.motors.iter().zip(&mut feedback.motors) {
            let Some(layout) = layout else { continue };
            fields.speed = layout.measured_speed.map(|_| next().cast_signed());
            fields.strain = layout.strain.then(&mut next);
            fields.position = layout
                .position
                .then(|| i16::from_be_bytes([next(), next()]));
            fields.change = layout.change.map(|_| next().cast_signed());
            fields.breakaway = layout
                .breakaway
                .then(|| u16::from_be_bytes([next(), next()]));
            fields.analog = layout.analog.then(&mut next);
        }
        feedback.temperature = self
            .temperature
            .then(|| match self.firmware.temperature_length() {
                1 => i16::from(next().cast_signed()) * 10,
                _ => i16::from_be_bytes([next(), next()]),
            });
        Ok(Some(feedback))
    }
}

fn pair(scope: Scope) -> impl Fn((&str, i32)) -> (Parameter, i32) {
    move |(name, value)| {
        let parameter = Parameter::find(scope, name).expect("its name is in the table");
        (parameter, value)
    }
}

/// `ERR n` and the prompt, instead of feedback.
fn complaint(bytes: &[u8]) -> Result<Option<Feedback>, BlockError> {
    match ReplyReader::new("").push(bytes) {
        None => Ok(None),
        Some(Ok(reply)) => Err(ended(&reply, bytes)),
        Some(Err(_)) => Err(unexpected(bytes)),
    }
}

fn ended(reply: &Reply, bytes: &[u8]) -> BlockError {
    match reply.status() {
        status if !status.is_fine() => BlockError::Ended(status),
        _ => unexpected(bytes),
    }
}

fn unexpected(bytes: &[u8]) -> BlockError {
    let shown = &bytes[..bytes.len().min(20)];
    BlockError::Unexpected(shown.escape_ascii().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the manual: F1 and F2 by speed with strain and change, the spread with change alone.
    #[test]
    fn the_example_of_the_manual_has_its_lengths() {
        let finger = MotorLayout {
            speed: Some(1),
            strain: true,
            change: Some(1),
            ..MotorLayout::default()
        };
        let spread = MotorLayout {
            change: Some(1),
            ..MotorLayout::default()
        };
        let layout = Layout {
            motors: [Some(finger), Some(finger), None, Some(spread)],
            temperature: true,
            firmware: FirmwareVersion::V4_3,
        };
        let mut control = Control::default();
        control[0].speed = 100;
        control[1].speed = -2;
        let block = layout.write_control(Header::Control, &control);
        assert_eq!(block, [b'C', 100, 0xfe]);
        assert_eq!(layout.read_control(&block[1..]), Some(control));
        assert_eq!(1 + layout.feedback_length(), 8);
        let feedback = layout.read_feedback(Header::Control, b"*\x80\x05\x81\xfb\x07\x01\x5e");
        let feedback = feedback.unwrap().unwrap();
        assert_eq!(feedback.motors[0].strain, Some(128));
        assert_eq!(feedback.motors[1].change, Some(-5));
        assert_eq!(feedback.motors[3].change, Some(7));
        assert_eq!(feedback.temperature, Some(350));
        let commands = layout.commands();
        assert_eq!(commands.last().unwrap().to_string(), "124LOOP");
        let set: Vec<String> = commands.iter().map(Command::to_string).collect();
        assert!(set[0].starts_with("12FSET ") && set[1].starts_with("SFSET "));
    }

    /// Recorded in a program of the time: 43 64 5A 64 5A 64 5A.
    #[test]
    fn speed_and_gain_alternate() {
        let motor = MotorLayout {
            speed: Some(1),
            gain: true,
            strain: true,
            position: true,
            ..MotorLayout::default()
        };
        let layout = Layout::same(MotorSet::FINGERS, motor);
        let fields = MotorControl {
            speed: 100,
            gain: 90,
            ..MotorControl::default()
        };
        let block = layout.write_control(Header::Control, &[fields; 4]);
        assert_eq!(block, [0x43, 0x64, 0x5a, 0x64, 0x5a, 0x64, 0x5a]);
        assert_eq!(layout.feedback_length(), 9);
    }

    #[test]
    fn a_complaint_ends_realtime() {
        let layout = Layout::same(MotorSet::FINGERS, MotorLayout::default());
        let read = |bytes: &[u8]| layout.read_feedback(Header::Ask, bytes);
        assert_eq!(read(b"\r\nERR 2048\n\r="), Ok(None));
        assert_eq!(
            read(b"\r\nERR 2048\n\r=> "),
            Err(BlockError::Ended(Status::BAD_HEADER))
        );
        assert!(matches!(read(b"\r\n=> "), Err(BlockError::Unexpected(_))));
        assert!(matches!(read(b"x"), Err(BlockError::Unexpected(_))));
    }
}
