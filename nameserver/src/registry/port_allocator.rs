//! Allocates what a port leaves open when it registers: number, name, multicast group.

use std::collections::{BTreeSet, HashMap, VecDeque};
use std::net::Ipv4Addr;
use std::ops::RangeInclusive;

use super::registry_limits::{MAX_REMEMBERED_NAME, Refusal};

/// Port numbers that the server hands out, one pool for all hosts.
///
/// Order of allocation, as in stock: the number that the name had before, if it is free; else the
/// next number that was never handed out; else the number that has been free longest. Unlike stock,
/// a number that a live port chose itself is never handed out to another port, and when stock's
/// numbers are used up, those up to [`LAST_SPARE_NUMBER`] follow.
#[derive(Debug)]
pub(super) struct PortNumbers {
    first: u32,
    /// First number of the range that was never handed out.
    next: u32,
    last: u32,
    /// First number beyond `last` that was never handed out.
    spare: u32,
    /// Last number beyond `last`.
    most: u32,
    previous: HashMap<String, u16>,
    names: HashMap<u16, String>,
    freed: VecDeque<u16>,
    /// Number of live ports with each number.
    used: HashMap<u16, usize>,
}

/// Last number below those that Linux gives to clients.
const LAST_SPARE_NUMBER: u32 = 32_767;

impl PortNumbers {
    /// Creates stock's range above the server's own number: from the second to the 9999th.
    pub(super) fn above(server: u16) -> Self {
        let server = u32::from(server);
        let last = (server + 9999).min(u16::MAX.into());
        Self::between(server + 2, last, LAST_SPARE_NUMBER)
    }

    /// Creates a pool with another range.
    pub(super) fn within(range: RangeInclusive<u16>) -> Self {
        let last = (*range.end()).into();
        Self::between((*range.start()).into(), last, last)
    }

    fn between(first: u32, last: u32, most: u32) -> Self {
        Self {
            first,
            next: first,
            last,
            spare: last + 1,
            most,
            previous: HashMap::new(),
            names: HashMap::new(),
            freed: VecDeque::new(),
            used: HashMap::new(),
        }
    }

    /// Returns a number for `name`, or `None` if all are in use. It counts as used only after
    /// [`take`](Self::take).
    pub(super) fn choose(&mut self, name: &str) -> Option<u16> {
        let number = self.candidate(name)?;
        if name.len() > MAX_REMEMBERED_NAME {
            return Some(number);
        }
        if let Some(last_name) = self.names.insert(number, name.to_owned()) {
            self.previous.remove(&last_name);
        }
        if let Some(old) = self.previous.insert(name.to_owned(), number)
            && old != number
        {
            self.names.remove(&old);
        }
        Some(number)
    }

    fn candidate(&mut self, name: &str) -> Option<u16> {
        if let Some(&number) = self.previous.get(name)
            && !self.used.contains_key(&number)
        {
            self.freed.retain(|freed| *freed != number);
            return Some(number);
        }
        while self.next <= self.last {
            let number = u16::try_from(self.next).ok()?;
            self.next += 1;
            if !self.used.contains_key(&number) {
                return Some(number);
            }
        }
        while let Some(number) = self.freed.pop_front() {
            if !self.used.contains_key(&number) {
                return Some(number);
            }
        }
        while self.spare <= self.most {
            let number = u16::try_from(self.spare).ok()?;
            self.spare += 1;
            if !self.used.contains_key(&number) {
                return Some(number);
            }
        }
        None
    }

    /// Returns true if the number was handed out before.
    fn is_ours(&self, number: u16) -> bool {
        let number = u32::from(number);
        (self.first..self.next).contains(&number) || (self.last + 1..self.spare).contains(&number)
    }

    /// Records that a port of an earlier registry has `number`; call [`free_unused`](Self::free_unused) after
    /// the last one.
    pub(super) fn restore(&mut self, name: &str, number: u16) {
        self.take(number);
        let after = u32::from(number) + 1;
        if (self.first..=self.last).contains(&number.into()) {
            self.next = self.next.max(after);
        } else if (self.last + 1..=self.most).contains(&number.into()) && self.next > self.last {
            self.spare = self.spare.max(after);
        } else {
            return;
        }
        if name.len() > MAX_REMEMBERED_NAME {
            return;
        }
        self.names.insert(number, name.to_owned());
        self.previous.insert(name.to_owned(), number);
    }

    /// Marks the restored numbers that no port has as free.
    pub(super) fn free_unused(&mut self) {
        let numbers = (self.first..self.next).chain(self.last + 1..self.spare);
        let numbers = numbers.filter_map(|number| u16::try_from(number).ok());
        self.freed = numbers
            .filter(|number| !self.used.contains_key(number))
            .collect();
    }

    /// Returns the refusal for the case that [`choose`](Self::choose) returned `None`.
    pub(super) fn none_left(&self) -> Refusal {
        Refusal::NoNumber {
            first: self.first,
            last: self.last.max(self.most),
        }
    }

    /// Records that a live port has `number`.
    pub(super) fn take(&mut self, number: u16) {
        *self.used.entry(number).or_default() += 1;
    }

    /// Records that a live port with `number` is gone.
    pub(super) fn free(&mut self, number: u16) {
        let Some(count) = self.used.get_mut(&number) else {
            return;
        };
        *count -= 1;
        if *count > 0 {
            return;
        }
        self.used.remove(&number);
        if self.is_ours(number) && !self.freed.contains(&number) {
            self.freed.push_back(number);
        }
    }
}

/// Counts from 1; numbers that are returned are reused first, smallest first.
#[derive(Debug)]
struct Counter {
    next: u32,
    freed: BTreeSet<u32>,
}

impl Counter {
    /// Numbers further ahead than this are not tracked; they are skipped when the counter reaches
    /// them.
    const GAP: u32 = 100_000;

    fn from(next: u32) -> Self {
        let freed = BTreeSet::new();
        Self { next, freed }
    }

    fn take(&mut self) -> u32 {
        self.freed.pop_first().unwrap_or_else(|| {
            self.next += 1;
            self.next - 1
        })
    }

    fn free(&mut self, number: u32) {
        if number < self.next {
            self.freed.insert(number);
        }
    }

    /// Records that `number` is in use; lower numbers may be free.
    fn restore(&mut self, number: u32) {
        if number >= self.next && number < self.next + Self::GAP {
            self.freed.extend(self.next..number);
            self.next = number + 1;
        } else {
            self.freed.remove(&number);
        }
    }
}

/// Anonymous names: `/tmp/port/1`, `/tmp/port/2`...
#[derive(Debug)]
pub(super) struct AnonymousNames(Counter);

impl AnonymousNames {
    const PREFIX: &str = "/tmp/port/";

    pub(super) fn new() -> Self {
        Self(Counter::from(1))
    }

    /// Returns a name for which `taken` is false, with `suffix` appended: stock makes
    /// `/tmp/port/3=x` of `=x`.
    pub(super) fn choose(&mut self, suffix: &str, taken: impl Fn(&str) -> bool) -> String {
        loop {
            let name = format!("{}{}{suffix}", Self::PREFIX, self.0.take());
            if !taken(&name) {
                return name;
            }
        }
    }

    /// Returns an anonymous name to the pool; other names are ignored.
    pub(super) fn free(&mut self, name: &str) {
        if let Some(number) = Self::number(name) {
            self.0.free(number);
        }
    }

    /// Records that a port of an earlier registry has `name`.
    pub(super) fn restore(&mut self, name: &str) {
        if let Some(number) = Self::number(name) {
            self.0.restore(number);
        }
    }

    fn number(name: &str) -> Option<u32> {
        let rest = name.strip_prefix(Self::PREFIX)?;
        let suffix = rest.find('=').unwrap_or(rest.len());
        rest[..suffix].parse().ok()
    }
}

/// Pool of multicast groups: `224.1.1.3`, `224.1.1.4`...
#[derive(Debug)]
pub(super) struct MulticastGroups(Counter);

impl MulticastGroups {
    /// Number of groups, after which the second last byte would be 256.
    const COUNT: u32 = 255 * 255;

    pub(super) fn new() -> Self {
        Self(Counter::from(2))
    }

    /// Returns a group for which `taken` is false, or `None` if all are in use.
    pub(super) fn choose(&mut self, taken: impl Fn(&str) -> bool) -> Option<String> {
        loop {
            let index = self.0.take();
            if index >= Self::COUNT {
                self.0.next = Self::COUNT;
                return None;
            }
            let group = Self::address(index).to_string();
            if !taken(&group) {
                return Some(group);
            }
        }
    }

    /// Returns a group to the pool; other addresses are ignored.
    pub(super) fn free(&mut self, group: &str) {
        if let Some(index) = Self::index(group) {
            self.0.free(index);
        }
    }

    /// Records that a port of an earlier registry has `group`.
    pub(super) fn restore(&mut self, group: &str) {
        if let Some(index) = Self::index(group) {
            self.0.restore(index);
        }
    }

    fn index(group: &str) -> Option<u32> {
        let address: Ipv4Addr = group.parse().ok()?;
        let [_, _, high, low] = address.octets().map(u32::from);
        let index = high.saturating_sub(1) * 255 + low.saturating_sub(1);
        let ours = (2..Self::COUNT).contains(&index) && Self::address(index) == address;
        ours.then_some(index)
    }

    /// Returns stock's address `224.1.(n/255+1).(n%255+1)`.
    fn address(index: u32) -> Ipv4Addr {
        Ipv4Addr::new(224, 1, (index / 255 + 1) as u8, (index % 255 + 1) as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn take(numbers: &mut PortNumbers, name: &str) -> Option<u16> {
        let number = numbers.choose(name)?;
        numbers.take(number);
        Some(number)
    }

    #[test]
    fn a_name_gets_its_number_back() {
        let mut numbers = PortNumbers::above(10000);
        assert_eq!(take(&mut numbers, "/a"), Some(10002));
        assert_eq!(take(&mut numbers, "/b"), Some(10003));
        numbers.free(10002);
        assert_eq!(take(&mut numbers, "/c"), Some(10004));
        assert_eq!(take(&mut numbers, "/a"), Some(10002));
        assert_eq!(take(&mut numbers, "/d"), Some(10005));
    }

    #[test]
    fn numbers_return_when_the_range_is_used_up() {
        let mut numbers = PortNumbers::above(10000);
        for number in 10002..=19999 {
            assert_eq!(take(&mut numbers, &format!("/{number}")), Some(number));
        }
        numbers.free(15000);
        numbers.free(12000);
        assert_eq!(take(&mut numbers, "/more"), Some(15000));
        assert_eq!(take(&mut numbers, "/more2"), Some(12000));
    }

    /// Stock exits when 9998 ports have asked for a number; a lab may have 10 000 names.
    #[test]
    fn more_ports_than_stock_has_numbers_for() {
        let mut numbers = PortNumbers::above(10000);
        for number in 10002..=32767 {
            assert_eq!(take(&mut numbers, &format!("/{number}")), Some(number));
        }
        assert_eq!(take(&mut numbers, "/more"), None);
        numbers.free(25000);
        assert_eq!(take(&mut numbers, "/more"), Some(25000));

        let mut again = PortNumbers::above(10000);
        for number in (10002..=19999).chain([20001]) {
            again.restore(&format!("/{number}"), number);
        }
        again.free_unused();
        assert_eq!(take(&mut again, "/more"), Some(20000));
        assert_eq!(take(&mut again, "/more2"), Some(20002));
    }

    #[test]
    fn numbers_asked_for_by_ports_are_left_out() {
        let mut numbers = PortNumbers::above(10000);
        numbers.take(10002);
        numbers.take(10002);
        assert_eq!(take(&mut numbers, "/a"), Some(10003));
        numbers.free(10002);
        numbers.free(10002);
        numbers.free(10002);
        assert_eq!(numbers.freed, [10002]);
    }

    #[test]
    fn the_range_ends_with_the_numbers() {
        let mut numbers = PortNumbers::above(65_532);
        assert_eq!(take(&mut numbers, "/a"), Some(65_534));
        assert_eq!(take(&mut numbers, "/b"), Some(65_535));
        assert_eq!(take(&mut numbers, "/c"), None);
        assert_eq!(take(&mut PortNumbers::above(65_535), "/a"), None);
    }

    #[test]
    fn groups_are_numbered_as_in_stock() {
        let mut groups = MulticastGroups::new();
        assert_eq!(groups.choose(|_| false).unwrap(), "224.1.1.3");
        assert_eq!(groups.choose(|_| false).unwrap(), "224.1.1.4");
        groups.free("224.1.1.3");
        groups.free("224.1.1.200");
        groups.free("10.0.0.1");
        groups.free("nonsense");
        assert_eq!(groups.choose(|_| false).unwrap(), "224.1.1.3");
        assert_eq!(groups.choose(|_| false).unwrap(), "224.1.1.5");
        assert_eq!(MulticastGroups::address(254).to_string(), "224.1.1.255");
        assert_eq!(MulticastGroups::address(255).to_string(), "224.1.2.1");
    }

    #[test]
    fn exhausted_groups_are_refused() {
        let mut groups = MulticastGroups::new();
        let count = std::iter::from_fn(|| groups.choose(|_| false)).count();
        assert_eq!(count, 255 * 255 - 2);
        assert_eq!(groups.choose(|_| false), None);
        groups.free("224.1.7.7");
        assert_eq!(groups.choose(|_| false).unwrap(), "224.1.7.7");
    }

    #[test]
    fn anonymous_names_are_reused() {
        let mut names = AnonymousNames::new();
        assert_eq!(
            names.choose("", |name| name == "/tmp/port/1"),
            "/tmp/port/2"
        );
        assert_eq!(names.choose("=x", |_| false), "/tmp/port/3=x");
        names.free("/tmp/port/3=x");
        names.free("/tmp/port/99");
        names.free("/other");
        assert_eq!(names.choose("", |_| false), "/tmp/port/3");
        assert_eq!(names.choose("", |_| false), "/tmp/port/4");
    }
}
