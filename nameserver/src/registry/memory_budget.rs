//! Memory that a registry holds for others: counted in total, and for each address that asked for it.
//!
//! Everything that a request makes the registry keep holds a [`Charge`]; dropping it gives the bytes
//! back. The counted bytes are those of the texts and of what is allocated around them.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv4Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::registry_limits::{Capacity, Refusal};

/// Bytes of a registered port besides its texts and properties.
const PORT_COST: usize = 512;
/// Bytes of one key of one port besides the texts, which ports share.
pub(super) const SLOT_COST: usize = 48;
/// Bytes of a stored text or list besides the text.
const STORED_COST: usize = 128;
/// Bytes of one value of a property besides the text.
const VALUE_COST: usize = 48;

/// Bytes of a registered port without properties.
pub(super) fn port_cost(name: &str, host: &str) -> usize {
    // The name is also the key of the port, and stands in the list of numbers.
    PORT_COST + 3 * name.len() + host.len()
}

/// Bytes of stored texts.
pub(super) fn text_cost<'a>(texts: impl IntoIterator<Item = &'a str>) -> usize {
    STORED_COST + texts.into_iter().map(str::len).sum::<usize>()
}

/// Bytes of the values of a property.
pub(super) fn values_cost(values: &[String]) -> usize {
    let one = |value: &String| value.len() + VALUE_COST;
    STORED_COST + values.iter().map(one).sum::<usize>()
}

/// Limits that a charge is checked against.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Enforce {
    /// All of them: somebody asks.
    All,
    /// Those of the whole registry: it was kept by an earlier run.
    Total,
    /// None: other servers have agreed on it.
    Nothing,
}

/// The counts of one registry.
#[derive(Debug)]
struct Counts {
    capacity: Capacity,
    total: Held,
    by_address: HashMap<IpAddr, Held>,
}

#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
struct Held {
    bytes: usize,
    names: usize,
}

/// Address that is charged for stored data.
#[derive(Clone, Debug)]
pub(super) struct Account {
    counts: Arc<Mutex<Counts>>,
    address: IpAddr,
    enforce: Enforce,
}

/// The address of who is nobody: the server itself, and ports whose host is a name.
const NOBODY: IpAddr = IpAddr::V4(Ipv4Addr::UNSPECIFIED);

impl Account {
    /// The account of the server itself, with nothing charged yet.
    pub(super) fn new(capacity: Capacity) -> Self {
        let counts = Counts {
            capacity,
            total: Held::default(),
            by_address: HashMap::new(),
        };
        Self {
            counts: Arc::new(Mutex::new(counts)),
            address: NOBODY,
            enforce: Enforce::Total,
        }
    }

    /// The account of `address` in the same registry; that of the server itself if there is none.
    pub(super) fn of(&self, address: Option<IpAddr>, enforce: Enforce) -> Self {
        let (address, enforce) = match (address, enforce) {
            (None, Enforce::All) => (NOBODY, Enforce::Total),
            (address, enforce) => (address.unwrap_or(NOBODY).to_canonical(), enforce),
        };
        Self {
            counts: self.counts.clone(),
            address,
            enforce,
        }
    }

    /// The account of `address` under the same limits.
    pub(super) fn at(&self, address: Option<IpAddr>) -> Self {
        self.of(address, self.enforce)
    }

    /// The account that pays for `charge`, under the same limits.
    pub(super) fn same_as(&self, charge: &Charge) -> Self {
        self.at(Some(charge.address))
    }

    /// Returns whether `charge` is paid by the same address.
    pub(super) fn pays(&self, charge: &Charge) -> bool {
        charge.address == self.address
    }

    /// Charges `bytes`, unless a limit would be exceeded.
    pub(super) fn charge(&self, bytes: usize) -> Result<Charge, Refusal> {
        self.take(Held { bytes, names: 0 })
    }

    /// Charges a name of `bytes`, unless a limit would be exceeded.
    pub(super) fn charge_name(&self, bytes: usize) -> Result<Charge, Refusal> {
        self.take(Held { bytes, names: 1 })
    }

    /// Returns the bytes charged to all addresses.
    pub(super) fn total_bytes(&self) -> usize {
        lock(&self.counts).total.bytes
    }

    fn take(&self, more: Held) -> Result<Charge, Refusal> {
        lock(&self.counts).add(self.address, self.enforce, more)?;
        Ok(Charge {
            counts: self.counts.clone(),
            address: self.address,
            held: more,
        })
    }
}

/// Charge for one stored item; returned on drop.
#[derive(Debug)]
pub(super) struct Charge {
    counts: Arc<Mutex<Counts>>,
    address: IpAddr,
    held: Held,
}

impl Charge {
    /// Charges `bytes` more, as `account` allows.
    pub(super) fn grow(&mut self, account: &Account, bytes: usize) -> Result<(), Refusal> {
        let more = Held { bytes, names: 0 };
        lock(&self.counts).add(self.address, account.enforce, more)?;
        self.held.bytes += bytes;
        Ok(())
    }

    /// Gives `bytes` of it back.
    pub(super) fn shrink(&mut self, bytes: usize) {
        let bytes = bytes.min(self.held.bytes);
        lock(&self.counts).remove(self.address, Held { bytes, names: 0 });
        self.held.bytes -= bytes;
    }
}

impl Drop for Charge {
    fn drop(&mut self) {
        lock(&self.counts).remove(self.address, self.held);
    }
}

fn lock(counts: &Mutex<Counts>) -> MutexGuard<'_, Counts> {
    counts.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Counts {
    fn add(&mut self, address: IpAddr, enforce: Enforce, more: Held) -> Result<(), Refusal> {
        let total = self.total.plus(more);
        let address_held = self.by_address.get(&address).copied().unwrap_or_default();
        let own = address_held.plus(more);
        let Capacity {
            names,
            names_per_address,
            memory,
            memory_per_address,
        } = self.capacity;
        let exceeded = |what, held: usize, limit: usize| match held > limit {
            true => Err(Refusal::Full { what, limit }),
            false => Ok(()),
        };
        // What adds nothing of a kind does not exceed the limit of that kind.
        if enforce != Enforce::Nothing {
            if more.names > 0 {
                exceeded("ports", total.names, names)?;
            }
            exceeded("bytes of names and properties", total.bytes, memory)?;
        }
        if enforce == Enforce::All && address != NOBODY {
            if more.names > 0 {
                exceeded("ports from one address", own.names, names_per_address)?;
            }
            let what = "bytes of names and properties from one address";
            exceeded(what, own.bytes, memory_per_address)?;
        }
        self.total = total;
        self.by_address.insert(address, own);
        Ok(())
    }

    fn remove(&mut self, address: IpAddr, less: Held) {
        self.total = self.total.minus(less);
        if let Some(held) = self.by_address.get_mut(&address) {
            *held = held.minus(less);
            if *held == Held::default() {
                self.by_address.remove(&address);
            }
        }
    }
}

impl Held {
    fn plus(self, more: Self) -> Self {
        Self {
            bytes: self.bytes + more.bytes,
            names: self.names + more.names,
        }
    }

    fn minus(self, less: Self) -> Self {
        Self {
            bytes: self.bytes.saturating_sub(less.bytes),
            names: self.names.saturating_sub(less.names),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn account() -> Account {
        Account::new(Capacity {
            names: 3,
            names_per_address: 2,
            memory: 100,
            memory_per_address: 60,
        })
    }

    fn at(account: &Account, last: u8) -> Account {
        account.of(Some([10, 0, 0, last].into()), Enforce::All)
    }

    #[test]
    fn each_address_has_its_share_and_all_have_the_total() {
        let server = account();
        let (a, b) = (at(&server, 1), at(&server, 2));
        let first = a.charge(60).unwrap();
        assert!(a.charge(1).is_err());
        let _second = b.charge(40).unwrap();
        assert!(b.charge(1).is_err());
        drop(first);
        assert!(b.charge(21).is_err());
        let mut third = b.charge(10).unwrap();
        assert!(third.grow(&b, 11).is_err());
        third.grow(&b, 10).unwrap();
        third.shrink(20);
        assert!(b.charge(20).is_ok());
    }

    #[test]
    fn names_are_counted_apart() {
        let server = account();
        let (a, b) = (at(&server, 1), at(&server, 2));
        let names = [a.charge_name(1), a.charge_name(1)].map(Result::unwrap);
        assert!(a.charge_name(1).is_err());
        a.charge(1).unwrap();
        let _third = b.charge_name(1).unwrap();
        assert!(b.charge_name(1).is_err());
        drop(names);
        assert!(b.charge_name(1).is_ok());
    }

    #[test]
    fn what_others_have_agreed_on_is_counted_and_never_refused() {
        let server = account();
        let restored = server.of(Some([10, 0, 0, 1].into()), Enforce::Total);
        let _kept = restored.charge(90).unwrap();
        assert!(restored.charge(11).is_err());
        let agreed = server.of(None, Enforce::Nothing);
        let _more = agreed.charge(1000).unwrap();
        assert!(at(&server, 2).charge(1).is_err());
        // Nothing is left behind.
        drop((_kept, _more));
        assert!(lock(&server.counts).by_address.is_empty());
    }
}
