//! Executes queries on the device.

use yarp_devices::{AxisIndex, EncoderReading, Limits};
use yarp_wire::{Bottle, WireVersion};

use super::super::messages::{
    Get, Quantity, Query, Range, Selection, gains, joint_type_to_value, kind_word, pid_info,
    variable_to_values,
};
use super::request_handler::{Refusal, RequestHandler};
use crate::thrift::Item;

type Results = Result<Vec<Item>, Refusal>;

impl RequestHandler {
    /// Results of a query.
    pub(super) fn ask(&self, get: &Get) -> Results {
        match get {
            Get::Values(quantity, selection) => {
                let values = self.quantity(*quantity, selection)?;
                Ok(vec![as_selected(selection, values)])
            }
            Get::About(question, Selection::One(axis)) => self.about_one(*question, *axis),
            Get::About(question, selection) => self.about(*question, selection),
            Get::Variable(name) => {
                let value = self.variables()?.variable(name)?;
                let value: Bottle = variable_to_values(&value).collect();
                Ok(vec![Item::Bottle(value)])
            }
        }
    }

    /// Queries of one axis alone; the others are for a selection.
    fn about_one(&self, question: Query, axis: AxisIndex) -> Results {
        Ok(match question {
            Query::Name => vec![Item::Text(self.info()?.axis_name(axis)?)],
            Query::Type => vec![joint_type_to_value(self.info()?.joint_type(axis)?)],
            Query::Range(Range::Position) => pair(self.limits()?.position_limits(axis)?),
            Query::Range(Range::Velocity) => pair(self.limits()?.velocity_limits(axis)?),
            Query::AvailableModes => {
                let modes = self.modes()?.available_control_modes(axis)?;
                vec![Item::Enums(modes.into_iter().map(u32::from).collect())]
            }
            Query::Impedance => {
                let impedance = self.impedance()?.impedance(axis)?;
                vec![Item::F64(impedance.stiffness), Item::F64(impedance.damping)]
            }
            Query::ImpedanceLimits => {
                let limits = self.impedance()?.impedance_limits(axis)?;
                let mut items = pair(limits.stiffness);
                items.extend(pair(limits.damping));
                items
            }
            Query::MotorParameters => {
                let parameters = self.torque()?.motor_torque_parameters(axis)?;
                parameters.to_array().map(Item::F64).to_vec()
            }
            Query::AvailablePids => {
                let kinds = self.pids()?.available_pids(axis)?.into_iter();
                let words = kinds.map(|kind| kind_word(kind, WireVersion::V4).code());
                vec![Item::Enums(words.collect())]
            }
            Query::CalibrationDone => {
                vec![Item::Bool(self.calibration()?.calibration_done(axis)?)]
            }
            Query::Fault => {
                let fault = self.faults()?.last_fault(axis)?;
                vec![Item::I32(fault.code), Item::Text(fault.message)]
            }
            Query::Braked => vec![Item::Bool(self.brakes()?.is_braked(axis)?)],
            Query::AutoBrake => vec![Item::Bool(self.brakes()?.auto_brake(axis)?)],
            of_many => return self.about(of_many, &Selection::One(axis)),
        })
    }

    fn about(&self, question: Query, selection: &Selection) -> Results {
        let axes = selection.axes();
        // The length of an answer is bounded only once the axes are known to exist.
        axes.check(self.axes())?;
        let total = Item::I32(self.axes() as i32);
        Ok(match question {
            Query::Axes => vec![total],
            Query::Motors => {
                self.motor()?;
                vec![total]
            }
            Query::MotorEncoders => {
                self.motor_encoders()?;
                vec![total]
            }
            Query::MotionDone => vec![Item::Bool(self.position()?.motion_done(axes)?)],
            Query::ControlModes => {
                let modes = self.modes()?.control_modes(axes)?;
                vec![words(selection, modes)]
            }
            Query::Interactions => {
                let interactions = self.interaction()?.interactions(axes)?;
                vec![words(selection, interactions)]
            }
            Query::TimedPositions => timed(selection, &self.encoders()?.encoder_readings(axes)?),
            Query::TimedMotorPositions => {
                timed(selection, &self.motor_encoders()?.motor_readings(axes)?)
            }
            Query::AmplifierStatus => {
                let status = self.amplifiers()?.amplifier_status(axes)?;
                vec![match (selection, &status[..]) {
                    (Selection::One(_), [one]) => Item::I32(*one),
                    _ => Item::I32s(status),
                }]
            }
            Query::Range(Range::Torque) => ranges(selection, &self.torque()?.torque_ranges(axes)?),
            Query::Range(Range::Current) => {
                ranges(selection, &self.current()?.current_ranges(axes)?)
            }
            Query::Pids(kind) => {
                let each = self.pids()?.pids(kind, axes)?;
                lists(selection, each.iter().map(gains).collect())
            }
            Query::PidEnabled(kind) => {
                let enabled = self.pids()?.pids_enabled(kind, axes)?;
                vec![Item::Bool(enabled.into_iter().all(|one| one))]
            }
            Query::PidInfo(kind) => {
                let each = self.pids()?.pid_info(kind, axes)?;
                lists(selection, each.into_iter().map(pid_info).collect())
            }
            Query::CalibratorPresent => {
                vec![Item::Bool(self.calibrator()?.calibrator_present()?)]
            }
            Query::Variables => {
                let names = self.variables()?.variables()?;
                let names: Bottle = names.into_iter().map(Into::into).collect();
                vec![Item::List(vec![Item::Bottle(names)])]
            }
            // PolledMotion of one axis only, which both protocols see to.
            _ => {
                return Err(Refusal::NoInterface(
                    "way to answer this for several joints",
                ));
            }
        })
    }

    fn quantity(&self, quantity: Quantity, selection: &Selection) -> Result<Vec<f64>, Refusal> {
        let axes = selection.axes();
        // The length of an answer is bounded only once the axes are known to exist.
        axes.check(self.axes())?;
        Ok(match quantity {
            Quantity::TargetPosition => self.position()?.target_positions(axes)?,
            Quantity::ReferenceSpeed => self.position()?.reference_speeds(axes)?,
            Quantity::ReferenceAcceleration => self.motion()?.reference_accelerations(axes)?,
            Quantity::ReferenceVelocity => self.velocity()?.reference_velocities(axes)?,
            Quantity::DirectPosition => self.position_direct()?.direct_positions(axes)?,
            Quantity::DirectVelocity => self.velocity_direct()?.direct_velocities(axes)?,
            Quantity::Position | Quantity::Speed | Quantity::Acceleration => {
                let readings = self.encoders()?.encoder_readings(axes)?;
                part(&readings, quantity)
            }
            Quantity::MotorPosition | Quantity::MotorSpeed | Quantity::MotorAcceleration => {
                let readings = self.motor_encoders()?.motor_readings(axes)?;
                part(&readings, quantity)
            }
            Quantity::Temperature => self.motor()?.temperatures(axes)?,
            Quantity::Current => self.current()?.currents(axes)?,
            Quantity::Torque => self.torque()?.torques(axes)?,
            Quantity::ReferenceTorque => self.torque()?.reference_torques(axes)?,
            Quantity::ReferenceCurrent => self.current()?.reference_currents(axes)?,
            Quantity::ReferenceDutyCycle => self.pwm()?.reference_duty_cycles(axes)?,
            Quantity::DutyCycle => self.pwm()?.duty_cycles(axes)?,
            Quantity::Pid(kind, value) => self.pids()?.pid_values(kind, value, axes)?,
            Quantity::MotorCounts
            | Quantity::TemperatureLimit
            | Quantity::GearboxRatio
            | Quantity::Amplifier(_)
            | Quantity::AmplifierDutyCycle
            | Quantity::SupplyVoltage
            | Quantity::ImpedanceOffset => axes
                .iter(self.axes())
                .map(|axis| self.of_one(quantity, axis))
                .collect::<Result<_, _>>()?,
        })
    }

    /// Reads quantities that devices return for one axis at a time.
    fn of_one(&self, quantity: Quantity, axis: AxisIndex) -> Result<f64, Refusal> {
        Ok(match quantity {
            Quantity::MotorCounts => self.motor_encoders()?.counts_per_revolution(axis)?,
            Quantity::TemperatureLimit => self.motor()?.temperature_limit(axis)?,
            Quantity::GearboxRatio => self.motor()?.gearbox_ratio(axis)?,
            Quantity::Amplifier(limit) => self.amplifiers()?.amplifier_limit(limit, axis)?,
            Quantity::AmplifierDutyCycle => self.amplifiers()?.amplifier_duty_cycle(axis)?,
            Quantity::SupplyVoltage => self.amplifiers()?.supply_voltage(axis)?,
            _ => self.impedance()?.impedance_offset(axis)?,
        })
    }
}

fn part(readings: &[EncoderReading], quantity: Quantity) -> Vec<f64> {
    let value = readings.iter().map(|reading| match quantity {
        Quantity::Speed | Quantity::MotorSpeed => reading.speed,
        Quantity::Acceleration | Quantity::MotorAcceleration => reading.acceleration,
        _ => reading.position,
    });
    value.collect()
}

/// One number by itself, several as a list.
fn as_selected(selection: &Selection, values: Vec<f64>) -> Item {
    match (selection, &values[..]) {
        (Selection::One(_), [one]) => Item::F64(*one),
        _ => Item::F64s(values),
    }
}

/// One struct by itself, several as a list.
fn lists(selection: &Selection, all: Vec<Item>) -> Vec<Item> {
    match selection {
        Selection::One(_) => all,
        _ => vec![Item::List(all)],
    }
}

/// One word by itself, several as a list.
fn words<T: Into<u32>>(selection: &Selection, words: Vec<T>) -> Item {
    let mut words: Vec<u32> = words.into_iter().map(Into::into).collect();
    match (selection, &words[..]) {
        (Selection::One(_), [one]) => Item::Enum(*one),
        _ => Item::Enums(std::mem::take(&mut words)),
    }
}

fn pair(limits: Limits) -> Vec<Item> {
    vec![Item::F64(limits.min), Item::F64(limits.max)]
}

/// Smallest and largest values apart.
fn ranges(selection: &Selection, all: &[Limits]) -> Vec<Item> {
    let smallest = all.iter().map(|limits| limits.min).collect();
    let largest = all.iter().map(|limits| limits.max).collect();
    vec![
        as_selected(selection, smallest),
        as_selected(selection, largest),
    ]
}

/// Positions and times apart.
fn timed(selection: &Selection, readings: &[EncoderReading]) -> Vec<Item> {
    let positions = readings.iter().map(|reading| reading.position).collect();
    let times = readings.iter().map(|reading| reading.time).collect();
    vec![
        as_selected(selection, positions),
        as_selected(selection, times),
    ]
}
