//! Objects are sorted into slots by contact and friction alone, also where two change places.

mod support;

use support::{SimulatedCell, Truth, shared};
use yarp_manipulation::{Item, ReorderOptions, SlotCommander, SlotGrid, SlotOrders, reorder};
use yarp_table::{Finish, Random, Scene, Shape, SimulationOptions};

/// Orders that are given one after another.
struct Orders(Vec<SlotOrders>);

impl SlotCommander for Orders {
    fn orders(&mut self, _items: &[Item]) -> SlotOrders {
        self.0[0].clone()
    }

    fn wait(&mut self) -> bool {
        if self.0.len() > 1 {
            self.0.remove(0);
            return true;
        }
        false
    }
}

#[test]
fn two_objects_change_places_and_a_third_follows_a_later_order() {
    let grid = SlotGrid::default();
    let place = |slot: usize| grid.place(slot).expect("a slot");
    let mut scene = Scene::empty();
    let size = [0.05, 0.07, 0.06];
    let glass = Shape::Glass {
        radius: 0.034,
        height: 0.10,
        wall: 0.003,
    };
    for (shape, slot, yaw) in [
        (Shape::Box { size }, 3, 0.4),
        (glass, 4, 0.0),
        (glass, 2, 0.0),
    ] {
        let [x, y] = place(slot);
        scene.put(shape, x, y, yaw, Finish::default());
    }
    let ids: Vec<u32> = scene.objects.iter().map(|object| object.id).collect();
    let mut options = SimulationOptions::default();
    options.joints = Some([0.0, 0.2, 0.0, 2.2, 0.0, 0.7, 0.0]);
    let table = shared(scene, options);
    table.borrow_mut().step(0.3);
    let mut detector = Truth {
        table: table.clone(),
        random: Random::for_purpose(1, 7),
        noise: 0.001,
    };
    let mut picker =
        support::picker(SimulatedCell(table.clone())).expect("the simulated arm is ready");
    let change = SlotOrders::from([(ids[0], 4), (ids[1], 3)]);
    let mut later = change.clone();
    later.insert(ids[2], 0);
    let mut orders = Orders(vec![change, later]);
    let options = ReorderOptions::default();
    let report = reorder(&mut picker, &mut detector, &mut orders, &options);
    assert!(
        report.error.is_none() && report.left.is_empty(),
        "{report:?}"
    );
    assert_eq!(report.set_down, 3, "{report:?}");
    table.borrow_mut().step(1.0);
    let table = table.borrow();
    for (object, slot) in table.simulation.scene().objects.iter().zip([4, 3, 0]) {
        let middle = object.pose.translation;
        assert_eq!(grid.slot_at([middle.x, middle.y]), Some(slot), "{middle}");
    }
    assert_eq!(table.touched, 0, "the robot touched table or baskets");
}
