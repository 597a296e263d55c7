//! The port at which programs command the slot of each object.

use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use yarp_client::{Bottle, Network, RpcServer, Value, bottle};
use yarp_manipulation::{ByClass, Item, SlotCommander, SlotGrid, SlotOrders, Stop, StopRequest};

/// Interval at which a stop request is looked for while no orders come.
const STOP_INTERVAL: Duration = Duration::from_millis(100);
/// Maximum number of objects of a reply, and of orders.
const MAX_OBJECTS: usize = 1000;
const HELP: &str = "list: [is] (ID LABEL SLOT X Y) ... with SLOT -1 outside of all; slots: [is] (SLOT X Y) ...; \
    put ID SLOT: the object shall stand there; quit: end when the orders are carried out";

/// Orders that come over a port, and those by class where none came.
pub(super) struct PortOrders {
    shared: Arc<Shared>,
    /// What applies to objects that nobody commanded anything for.
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
    /// An order came, or the end, that nobody has looked at yet.
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
                let mut state = self.state();
                (state.quits, state.is_new) = (true, true);
                self.changed.notify_all();
                bottle!["ok"]
            }
            Some("help") => bottle!["is", HELP],
            _ => bottle!["fail", "expected list, slots, put ID SLOT, quit or help"],
        }
    }

    fn list(&self) -> Bottle {
        let mut reply = bottle!["is"];
        for (id, (label, place)) in self.state().seen.iter().take(MAX_OBJECTS) {
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
        if let Some((other, _)) = state
            .orders
            .iter()
            .find(|(other, at)| **at == slot && **other != id)
        {
            return Err(format!(
                "slot {slot} is for object {other}; put that elsewhere first"
            ));
        }
        if state.orders.len() >= MAX_OBJECTS {
            return Err("too many orders".to_owned());
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
        if let Some(otherwise) = self.otherwise.take() {
            let mut otherwise = otherwise;
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
        if !self.waits {
            return false;
        }
        let mut state = self.shared.state();
        while !state.is_new && !state.quits && self.stop.request() == StopRequest::None {
            let waited = self.shared.changed.wait_timeout(state, STOP_INTERVAL);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        state.is_new && !state.quits
    }
}
