//! The port at which programs command the slot of each object.

use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use yarp_client::{Bottle, Network, RpcServer, Value, bottle};
use yarp_manipulation::{ByClass, Item, SlotCommander, SlotGrid, SlotOrders, Stop, StopRequest};

/// Interval at which a stop request is looked for while no orders come.
const STOP_INTERVAL: Duration = Duration::from_millis(100);
const HELP: &str = "list: [is] (ID LABEL SLOT X Y) ... with SLOT -1 outside of all; slots: [is] (SLOT X Y) ...; \
    put ID SLOT: the object shall stand there; quit: end when the orders are carried out";

/// Orders that come over a port, and those by class where none came.
pub(super) struct PortOrders {
    shared: Arc<Shared>,
    /// Orders for objects that nobody commanded anything for, until they are applied.
    otherwise: Option<ByClass>,
    waits: bool,
    stop: Stop,
    _server: RpcServer,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    grid: SlotGrid,
}

#[derive(Default)]
struct State {
    orders: SlotOrders,
    /// Label and place of each object, as last detected.
    seen: BTreeMap<u32, (String, [f64; 2])>,
    /// An order came that nobody has looked at yet.
    is_new: bool,
    quits: bool,
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn reply(&self, request: &Bottle) -> Bottle {
        match request.get(0).and_then(Value::as_str) {
            Some("list") => self.list(),
            Some("slots") => {
                let mut reply = bottle!["is"];
                for slot in 0..self.grid.len() {
                    let [x, y] = self.grid.place(slot).expect("it is one of them");
                    reply.push(Value::List(bottle![slot as i32, x, y]));
                }
                reply
            }
            Some("put") => match self.put(request) {
                Ok(()) => bottle!["ok"],
                Err(reason) => bottle!["fail", reason.as_str()],
            },
            Some("quit") => {
                self.state().quits = true;
                self.changed.notify_all();
                bottle!["ok"]
            }
            Some("help") => bottle!["is", HELP],
            _ => bottle!["fail", "expected list, slots, put ID SLOT, quit or help"],
        }
    }

    /// Waits for orders; returns whether there are any that nobody has looked at yet. Those that came before the end was
    /// commanded are carried out.
    fn wait(&self, stop: &Stop) -> bool {
        let mut state = self.state();
        while !state.is_new && !state.quits && stop.request() == StopRequest::None {
            let waited = self.changed.wait_timeout(state, STOP_INTERVAL);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        state.is_new
    }

    fn list(&self) -> Bottle {
        let mut reply = bottle!["is"];
        for (id, (label, place)) in &self.state().seen {
            let slot = self.grid.slot_at(*place).map_or(-1, |slot| slot as i32);
            let [x, y] = *place;
            reply.push(Value::List(bottle![*id as i32, label.as_str(), slot, x, y]));
        }
        reply
    }

    fn put(&self, request: &Bottle) -> Result<(), String> {
        let number = |index: usize| request.get(index).and_then(Value::as_i32);
        let (Some(id), Some(slot)) = (number(1), number(2)) else {
            return Err("expected put ID SLOT with two numbers".to_owned());
        };
        let last = self.grid.len().saturating_sub(1);
        let slot = usize::try_from(slot).ok().filter(|slot| *slot <= last);
        let slot = slot.ok_or_else(|| format!("there are slots 0 to {last}"))?;
        let mut state = self.state();
        let id = u32::try_from(id)
            .ok()
            .filter(|id| state.seen.contains_key(id));
        let id = id.ok_or("no such object on the table; see list")?;
        let mut taken = state.orders.iter().map(|(other, at)| (*other, *at));
        if let Some((other, _)) = taken.find(|(other, at)| *at == slot && *other != id) {
            if state.seen.contains_key(&other) {
                return Err(format!(
                    "slot {slot} is for object {other}; put that elsewhere first"
                ));
            }
            // It is gone.
            state.orders.remove(&other);
        }
        state.orders.insert(id, slot);
        state.is_new = true;
        self.changed.notify_all();
        Ok(())
    }
}

impl PortOrders {
    /// Opens the port.
    ///
    /// With `waits` nothing moves until it is commanded, and the end is commanded, too; otherwise objects stand in the order of their
    /// classes, and the end is when all are in their slots.
    pub(super) fn open(
        network: &Network,
        name: &str,
        grid: SlotGrid,
        waits: bool,
        stop: Stop,
    ) -> yarp_client::Result<Self> {
        let shared = Arc::new(Shared {
            state: Mutex::default(),
            changed: Condvar::new(),
            grid,
        });
        let answering = shared.clone();
        let server = RpcServer::open_on(network, name, move |request: Bottle| {
            answering.reply(&request)
        })?;
        Ok(Self {
            shared,
            otherwise: (!waits).then(|| ByClass::new(&grid)),
            waits,
            stop,
            _server: server,
        })
    }

    /// Returns the orders in force.
    pub(super) fn in_force(&self) -> SlotOrders {
        self.shared.state().orders.clone()
    }
}

impl SlotCommander for PortOrders {
    fn orders(&mut self, items: &[Item]) -> SlotOrders {
        let mut state = self.shared.state();
        state.is_new = false;
        for item in items {
            let place = item.pose.translation.vector;
            let seen = (item.label.clone(), [place.x, place.y]);
            state.seen.insert(item.id, seen);
        }
        let present = |id: &u32| items.iter().any(|item| item.id == *id);
        state.seen.retain(|id, _| present(id));
        if let Some(mut otherwise) = self.otherwise.take() {
            for (id, slot) in otherwise.orders(items) {
                let is_free = !state.orders.values().any(|taken| *taken == slot);
                if is_free && !state.orders.contains_key(&id) {
                    state.orders.insert(id, slot);
                }
            }
        }
        state.orders.clone()
    }

    fn wait(&mut self) -> bool {
        self.waits && self.shared.wait(&self.stop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shared() -> Shared {
        let mut state = State::default();
        let seen = [(4, "glass", [0.43, 0.24]), (7, "box", [0.5, 0.1])];
        for (id, label, place) in seen {
            state.seen.insert(id, (label.to_owned(), place));
        }
        Shared {
            state: Mutex::new(state),
            changed: Condvar::new(),
            grid: SlotGrid::default(),
        }
    }

    fn reply(shared: &Shared, request: &str) -> String {
        let request: Bottle = request.parse().unwrap();
        shared.reply(&request).to_string()
    }

    #[test]
    fn orders_that_came_before_the_end_are_carried_out() {
        let shared = shared();
        let stop = Stop::default();
        assert_eq!(reply(&shared, "put 7 2"), "ok");
        assert_eq!(reply(&shared, "quit"), "ok");
        assert!(shared.wait(&stop));
        shared.state().is_new = false;
        assert!(!shared.wait(&stop));
    }

    #[test]
    fn objects_are_listed_with_their_slots() {
        let list = bottle![
            "is",
            Value::List(bottle![4, "glass", 0, 0.43, 0.24]),
            Value::List(bottle![7, "box", -1, 0.5, 0.1])
        ];
        assert_eq!(shared().list(), list);
        let slots = reply(&shared(), "slots");
        assert!(
            slots.starts_with("is (0 0.43") && slots.contains("(5 0.67"),
            "{slots}"
        );
        assert_eq!(slots.matches('(').count(), 6);
    }

    #[test]
    fn orders_are_taken_or_refused_with_the_reason() {
        let shared = shared();
        for (request, expected) in [
            ("put 7 5", "ok"),
            (
                "put 4 5",
                "fail \"slot 5 is for object 7; put that elsewhere first\"",
            ),
            ("put 7 2", "ok"),
            ("put 4 5", "ok"),
            ("put 4 6", "fail \"there are slots 0 to 5\""),
            ("put 4 -1", "fail \"there are slots 0 to 5\""),
            ("put 5 1", "fail \"no such object on the table; see list\""),
            ("put -4 1", "fail \"no such object on the table; see list\""),
            ("put 4", "fail \"expected put ID SLOT with two numbers\""),
            (
                "put glass 1",
                "fail \"expected put ID SLOT with two numbers\"",
            ),
            (
                "stop",
                "fail \"expected list, slots, put ID SLOT, quit or help\"",
            ),
        ] {
            assert_eq!(reply(&shared, request), expected, "{request}");
        }
        assert_eq!(shared.state().orders, SlotOrders::from([(4, 5), (7, 2)]));
        // An object that is gone leaves its slot to others.
        shared.state().seen.remove(&4);
        assert_eq!(reply(&shared, "put 7 5"), "ok");
        assert_eq!(shared.state().orders, SlotOrders::from([(7, 5)]));
        assert!(shared.state().is_new && !shared.state().quits);
        assert_eq!(reply(&shared, "quit"), "ok");
        assert!(shared.state().quits);
    }
}
