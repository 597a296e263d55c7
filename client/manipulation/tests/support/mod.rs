//! A table in lockstep: arm, hand and physics are stepped by the calls of the workcell.

#![allow(dead_code, unreachable_pub, reason = "each user needs a part of it")]

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::Duration;

use nalgebra::Point3;
use yarp_devices::hand::gcl::Status;
use yarp_devices::kinematics::Joints;
use yarp_devices::{Axes, DeviceError, Mode};
use yarp_manipulation::{
    Class, DetectError, Detector, Item, ItemShape, PickError, Picker, PickerOptions, Stop,
    Surroundings, Workcell, WorkcellError,
};
use yarp_table::{DepthNoise, Other, Random, Renderer, Scene, Shape, TableSimulation, arm_model};

/// The table, and what happened on it.
pub struct Table {
    pub simulation: TableSimulation,
    /// Contacts of the robot with table or baskets, steps.
    pub touched: usize,
    /// The first of them: time, part of the robot, counterpart, place.
    pub first_touch: Option<String>,
    /// The call that fails, counted down; `None` fails nothing.
    pub fails_after: Option<usize>,
    renderer: Renderer,
    looks: u64,
    /// Number of looks into the containers while the hand was carrying out a command.
    pub looks_of_a_busy_hand: u64,
    /// Commands that the hand is to carry out, after the one that it is busy with.
    hand_lines: VecDeque<String>,
}

impl Table {
    fn tell_hand(&mut self, line: &str) {
        self.simulation.hand_mut().receive(line.as_bytes());
        self.simulation.hand_mut().receive(b"\r");
    }

    fn is_hand_busy(&self) -> bool {
        self.simulation.hand().is_busy() || !self.hand_lines.is_empty()
    }

    /// Gives the hand its next command if it has carried out the last one.
    fn give_next_line(&mut self) {
        if !self.hand_lines.is_empty() && !self.simulation.hand().is_busy() {
            let line = self.hand_lines.pop_front().unwrap_or_default();
            self.tell_hand(&line);
        }
    }

    /// Waits until the hand has carried out what it was told, and returns its output.
    fn finish_hand(&mut self) -> Result<String, WorkcellError> {
        let end = self.simulation.time() + Duration::from_secs(15);
        while self.is_hand_busy() && self.simulation.time() < end {
            self.step(0.002);
        }
        let said = self.simulation.hand_mut().take_output();
        let said = String::from_utf8_lossy(&said).into_owned();
        if said.contains("ERR") && !said.contains("ERR 16") {
            let status = said.split("ERR ").nth(1).and_then(|rest| {
                let digits = rest.split_whitespace().next()?;
                digits.parse().ok().map(Status::new)
            });
            let what = status.map_or_else(|| said.clone(), |status| status.to_string());
            return Err(failed("command the hand")(DeviceError::NotSupported {
                what,
            }));
        }
        Ok(said)
    }

    pub fn step(&mut self, seconds: f64) {
        let end = self.simulation.time() + Duration::from_secs_f64(seconds);
        while self.simulation.time() < end {
            self.give_next_line();
            self.simulation.step();
            let contacts = self.simulation.physics().contacts();
            let touches = |other: Other| matches!(other, Other::Table | Other::Basket);
            let touch = contacts.iter().find(|contact| touches(contact.other));
            if let (Some(touch), None) = (touch, &self.first_touch) {
                let time = self.simulation.time().as_secs_f64();
                let (part, other, point) = (touch.part, touch.other, touch.point);
                let fingers = self.simulation.hand().positions();
                self.first_touch = Some(format!(
                    "{time:.1} s, part {part}, {other:?} at {point:.3}, fingers {fingers:.0?}"
                ));
            }
            self.touched += usize::from(touch.is_some());
        }
    }
}

pub type Shared = Rc<RefCell<Table>>;

pub fn shared(scene: Scene, options: yarp_table::SimulationOptions) -> Shared {
    Rc::new(RefCell::new(Table {
        simulation: TableSimulation::new(scene, options),
        touched: 0,
        first_touch: None,
        fails_after: None,
        renderer: Renderer::new(),
        looks: 0,
        looks_of_a_busy_hand: 0,
        hand_lines: VecDeque::new(),
    }))
}

/// Arm and hand of the table.
pub struct SimulatedCell(pub Shared);

/// Returns a picker with the options of the demos.
pub fn picker<W: Workcell>(cell: W) -> Result<Picker<W>, PickError> {
    Picker::new(
        cell,
        arm_model(),
        Surroundings::default(),
        PickerOptions::default(),
        Stop::default(),
    )
}

fn failed(action: &'static str) -> impl FnOnce(DeviceError) -> WorkcellError {
    move |source| WorkcellError {
        device: "the simulated table".to_owned(),
        action,
        source: Box::new(source),
    }
}

impl SimulatedCell {
    fn fail(&self) -> Result<(), WorkcellError> {
        let mut table = self.0.borrow_mut();
        match &mut table.fails_after {
            Some(0) => Err(failed("do anything")(DeviceError::NoDataYet {
                what: "state",
            })),
            Some(left) => {
                *left -= 1;
                Ok(())
            }
            None => Ok(()),
        }
    }
}

impl Workcell for SimulatedCell {
    fn prepare(&mut self) -> Result<(), WorkcellError> {
        self.fail()?;
        let mut table = self.0.borrow_mut();
        let arm = table.simulation.arm_mut();
        let set = arm.set_control_modes(Axes::All, &[Mode::PositionDirect; 7]);
        set.map_err(failed("set the mode"))
    }

    fn resume(&mut self) -> Result<(), WorkcellError> {
        let mut modes = [Mode::UNKNOWN; 7];
        {
            let table = self.0.borrow();
            let read = table
                .simulation
                .arm()
                .read_control_modes(Axes::All, &mut modes);
            read.map_err(failed("read the modes"))?;
        }
        if modes
            .iter()
            .any(|mode| !matches!(mode, Mode::Position | Mode::PositionDirect))
        {
            return Err(failed("follow")(DeviceError::Held {
                joint: 0.into(),
                by: "its idle mode",
                remedy: "test",
            }));
        }
        self.prepare()
    }

    fn joints(&mut self) -> Result<Joints<7>, WorkcellError> {
        let table = self.0.borrow();
        let arm = table.simulation.arm();
        let mut joints = Joints::<7>::zeros();
        for joint in 0..7 {
            let state = arm.state(joint.into()).map_err(failed("read"))?;
            joints[joint] = state.position.to_radians();
        }
        Ok(joints)
    }

    fn command(&mut self, joints: &Joints<7>) -> Result<(), WorkcellError> {
        self.fail()?;
        let mut table = self.0.borrow_mut();
        let degrees = joints.map(f64::to_degrees);
        let arm = table.simulation.arm_mut();
        let sent = arm.set_direct_positions(Axes::All, degrees.as_slice());
        sent.map_err(failed("command"))
    }

    fn wait(&mut self, seconds: f64) -> Result<f64, WorkcellError> {
        self.0.borrow_mut().step(seconds);
        Ok(seconds)
    }

    fn command_hand(&mut self, line: &str) -> Result<String, WorkcellError> {
        self.fail()?;
        let mut table = self.0.borrow_mut();
        table.finish_hand()?;
        table.tell_hand(line);
        table.finish_hand()
    }

    fn start_hand(&mut self, lines: &[String]) -> Result<(), WorkcellError> {
        self.fail()?;
        let mut table = self.0.borrow_mut();
        table.finish_hand()?;
        table.hand_lines.extend(lines.iter().cloned());
        table.give_next_line();
        Ok(())
    }

    fn finish_hand(&mut self) -> Result<(), WorkcellError> {
        self.0.borrow_mut().finish_hand().map(drop)
    }

    fn fingers(&mut self) -> Result<[f64; 4], WorkcellError> {
        let table = self.0.borrow();
        // As the client of a hand: one call at a time.
        if table.is_hand_busy() {
            let what = "positions of a busy hand".to_owned();
            return Err(failed("read the fingers")(DeviceError::NotSupported {
                what,
            }));
        }
        Ok(table.simulation.hand().positions())
    }

    fn look_into_containers(&mut self) -> Result<Vec<Point3<f64>>, WorkcellError> {
        let mut table = self.0.borrow_mut();
        table.looks += 1;
        table.looks_of_a_busy_hand += u64::from(table.is_hand_busy());
        let scene = table.simulation.scene();
        let mut points = Vec::new();
        for camera in scene.basket_cameras() {
            let noise = DepthNoise {
                seed: table.looks,
                ..DepthNoise::default()
            };
            let depth = table.renderer.depth(scene, &camera, &noise);
            for (index, metres) in depth.metres.iter().enumerate() {
                if *metres > 0.0 {
                    let pixel = [index % depth.width, index / depth.width].map(|at| at as f64);
                    let ray = camera.lens.direction(pixel) * f64::from(*metres);
                    points.push(camera.pose * Point3::from(ray));
                }
            }
        }
        Ok(points)
    }

    fn hold(&mut self) -> Result<(), WorkcellError> {
        let joints = self.joints()?;
        let mut table = self.0.borrow_mut();
        let degrees = joints.map(f64::to_degrees);
        let arm = table.simulation.arm_mut();
        let sent = arm.set_direct_positions(Axes::All, degrees.as_slice());
        sent.map_err(failed("hold"))
    }
}

/// Something that comes between a task and a [`SimulatedCell`]: what it does not override goes through.
pub trait Interceptor {
    fn cell(&mut self) -> &mut SimulatedCell;

    fn command(&mut self, joints: &Joints<7>) -> Result<(), WorkcellError> {
        self.cell().command(joints)
    }

    fn command_hand(&mut self, line: &str) -> Result<String, WorkcellError> {
        self.cell().command_hand(line)
    }

    fn start_hand(&mut self, lines: &[String]) -> Result<(), WorkcellError> {
        self.cell().start_hand(lines)
    }

    fn finish_hand(&mut self) -> Result<(), WorkcellError> {
        self.cell().finish_hand()
    }

    fn wait(&mut self, seconds: f64) -> Result<f64, WorkcellError> {
        self.cell().wait(seconds)
    }

    fn hold(&mut self) -> Result<(), WorkcellError> {
        self.cell().hold()
    }
}

/// A workcell with an interceptor.
pub struct Intercepted<I>(pub I);

impl<I: Interceptor> Workcell for Intercepted<I> {
    fn prepare(&mut self) -> Result<(), WorkcellError> {
        self.0.cell().prepare()
    }

    fn resume(&mut self) -> Result<(), WorkcellError> {
        self.0.cell().resume()
    }

    fn joints(&mut self) -> Result<Joints<7>, WorkcellError> {
        self.0.cell().joints()
    }

    fn command(&mut self, joints: &Joints<7>) -> Result<(), WorkcellError> {
        self.0.command(joints)
    }

    fn wait(&mut self, seconds: f64) -> Result<f64, WorkcellError> {
        self.0.wait(seconds)
    }

    fn command_hand(&mut self, line: &str) -> Result<String, WorkcellError> {
        self.0.command_hand(line)
    }

    fn start_hand(&mut self, lines: &[String]) -> Result<(), WorkcellError> {
        self.0.start_hand(lines)
    }

    fn finish_hand(&mut self) -> Result<(), WorkcellError> {
        self.0.finish_hand()
    }

    fn fingers(&mut self) -> Result<[f64; 4], WorkcellError> {
        self.0.cell().fingers()
    }

    fn look_into_containers(&mut self) -> Result<Vec<Point3<f64>>, WorkcellError> {
        self.0.cell().look_into_containers()
    }

    fn hold(&mut self) -> Result<(), WorkcellError> {
        self.0.hold()
    }
}

/// Returns whether an object is in the basket of its class.
pub fn is_placed(scene: &Scene, object: &yarp_table::Object) -> bool {
    let basket = match object.class() {
        yarp_table::Class::Glass => 1,
        yarp_table::Class::Plate => 2,
        _ => 0,
    };
    scene.baskets[basket].contains(&object.pose.translation.vector)
}

/// The truth about the table, with noise of a camera.
pub struct Truth {
    pub table: Shared,
    pub random: Random,
    pub noise: f64,
}

pub fn item(object: &yarp_table::Object) -> Option<Item> {
    let (class, shape) = match object.shape {
        Shape::Box { size } => (Class::Polygon, ItemShape::Cuboid { size }),
        Shape::Brick { kind } => (Class::Polygon, ItemShape::Cuboid { size: kind.size() }),
        Shape::Prism { side, height } => (Class::Polygon, ItemShape::Prism { side, height }),
        Shape::Glass { radius, height, .. } => {
            (Class::Glass, ItemShape::Cylinder { radius, height })
        }
        Shape::Plate { radius, height } => (Class::Plate, ItemShape::Cylinder { radius, height }),
        _ => return None,
    };
    Some(Item {
        id: object.id,
        label: object.class().word().to_owned(),
        class,
        shape,
        pose: object.pose,
    })
}

impl Detector for Truth {
    fn name(&self) -> &'static str {
        "truth"
    }

    fn detect(&mut self) -> Result<Vec<Item>, DetectError> {
        let table = self.table.borrow();
        let scene = table.simulation.scene();
        let mut items: Vec<Item> = scene
            .objects
            .iter()
            .filter(|object| {
                let place = object.pose.translation.vector;
                place.z > scene.table.surface - 0.01
                    && (scene.table.x[0]..scene.table.x[1]).contains(&place.x)
                    && (scene.table.y[0]..scene.table.y[1]).contains(&place.y)
            })
            .filter_map(item)
            .collect();
        for item in &mut items {
            let mut shift = || self.random.between(-1.7, 1.7) * self.noise;
            let place = &mut item.pose.translation.vector;
            place.x += shift();
            place.y += shift();
        }
        Ok(items)
    }
}
