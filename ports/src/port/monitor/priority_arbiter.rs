//! `recv.priority`: accepts the messages of one writer at a time.
//!
//! | option | meaning |
//! | --- | --- |
//! | `tc` | duration of a writer's stimulation after a message in seconds, 1 |
//! | `tr` | duration of its rest afterwards in seconds, 0 |
//! | `st` | stimulation per message, in tenths, 10; a stimulation of 10 activates the writer |
//! | `bs` | bias, in tenths, 10: the priority of an active writer |
//! | `ex` | lists of another writer and a weight in tenths: added to that writer's priority while this one is active |
//! | `virtual` | a writer that is never accepted and only affects others |
//!
//! With x = 1 for active writers and 0 for others, b the biases and A the weights, the priorities
//! are y = x (I - A)⁻¹ b. A message is delivered if its writer has the highest priority, above 0;
//! among equals, the writer that connected first.
//!
//! `[set]` takes `tc`, `tr`, `st`, `bs`, `virtual` and `ex`, here `st` and `bs` in ones; `[get]`
//! returns them. Source: 3.5.0, `carriers/priority_carrier`, and its answers.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use yarp_wire::{Bottle, Value};

use super::{Made, Monitor, MonitorSetup, Passing, parameter, wanted};

/// Stimulation from which on a writer is active.
const ACTIVATION_THRESHOLD: f64 = 1.0;
/// Maximum number of writers with this modifier per port: the cost grows with its cube.
const MAX_MEMBERS: usize = 64;

/// The writers of one port that wait for each other.
#[derive(Debug)]
pub(in crate::port) struct Arbiter {
    began: Instant,
    members: Mutex<Members>,
}

#[derive(Debug, Default)]
struct Members {
    next: u64,
    members: Vec<Member>,
}

impl Default for Arbiter {
    fn default() -> Self {
        Self {
            began: Instant::now(),
            members: Mutex::default(),
        }
    }
}

impl Arbiter {
    fn members(&self) -> MutexGuard<'_, Members> {
        self.members.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// One writer.
#[derive(Clone, Debug)]
struct Member {
    id: u64,
    from: String,
    lasts: f64,
    rests: f64,
    stimulation: f64,
    bias: f64,
    is_virtual: bool,
    /// `ex (NAME WEIGHT)...`, or nothing.
    excitation: Bottle,
    /// The stimulation at the last message, negative while it rests.
    stimulated: f64,
    /// Time of the last message.
    arrived: f64,
    is_active: bool,
}

impl Member {
    fn new(setup: &MonitorSetup) -> Result<Self, String> {
        let tenths = |name: &str| Ok::<_, String>(setup.number(name)?.unwrap_or(10.0) / 10.0);
        let stimulation = tenths("st")?.abs();
        Ok(Self {
            id: 0,
            from: setup.from.clone(),
            lasts: setup.number("tc")?.unwrap_or(1.0).abs(),
            rests: setup.number("tr")?.unwrap_or(0.0).abs(),
            stimulation: if stimulation == 0.0 {
                ACTIVATION_THRESHOLD
            } else {
                stimulation
            },
            bias: tenths("bs")?,
            is_virtual: setup.options.find_group("virtual").is_some(),
            excitation: setup.options.find_group("ex").cloned().unwrap_or_default(),
            stimulated: 0.0,
            arrived: f64::NEG_INFINITY,
            is_active: false,
        })
    }

    fn is_resting(&self, stimulation: f64) -> bool {
        self.rests > 0.0 && !(0.0..ACTIVATION_THRESHOLD).contains(&stimulation)
    }

    /// The stimulation that is left at `now`; one that has none left is active no more.
    fn left(&mut self, now: f64) -> f64 {
        let since = now - self.arrived;
        let full = self.stimulated >= ACTIVATION_THRESHOLD;
        if self.rests > 0.0 && since >= self.lasts && full {
            self.stimulated = -self.stimulated;
        }
        let left = if !self.is_resting(self.stimulated) {
            self.stimulated * decay(since, self.lasts)
        } else if self.stimulated > 0.0 {
            self.stimulated
        } else {
            self.stimulated * decay(since - self.lasts, self.rests)
        };
        if left <= 0.0 {
            self.is_active = false;
        }
        left
    }

    /// A message arrives.
    fn stimulate(&mut self, now: f64) {
        self.stimulated = self.left(now);
        if self.is_resting(self.stimulated) {
            return;
        }
        self.stimulated += self.stimulation;
        if self.stimulated >= ACTIVATION_THRESHOLD {
            self.stimulated = ACTIVATION_THRESHOLD;
            self.is_active = true;
        }
        self.arrived = now;
    }

    /// Returns the weight added to another writer's priority while this one is active.
    fn weight_for(&self, other: &str) -> Option<f64> {
        let mut lists = self.excitation.iter().filter_map(Value::as_list);
        let list = lists.find(|list| {
            list.get(0)
                .is_some_and(|name| name.to_plain_string() == other)
        });
        Some(list?.get(1)?.as_f64()? / 10.0)
    }
}

/// Returns the remaining fraction of a stimulation `since` seconds after the message, of `lasts`:
/// slow decay at first, then fast.
fn decay(since: f64, lasts: f64) -> f64 {
    if since > lasts {
        return 0.0;
    }
    // At the very moment of a message, which is all the time that it has.
    if lasts == 0.0 {
        return 1.0;
    }
    1.0 - ((since - lasts) / lasts * 5.0).exp() + (-5.0_f64).exp()
}

impl Members {
    /// Returns whether a message of this writer at `now` is to be delivered.
    fn accepts(&mut self, id: u64, now: f64) -> bool {
        for member in &mut self.members {
            if member.id == id {
                member.stimulate(now);
            }
        }
        let Some(priorities) = self.priorities(now) else {
            tracing::warn!(
                "the weights of recv.priority contradict each other: all messages are dropped"
            );
            return false;
        };
        let mut best = None;
        let mut highest = 0.0;
        for (member, priority) in self.members.iter().zip(priorities) {
            if !member.is_virtual && priority > highest {
                highest = priority;
                best = Some(member.id);
            }
        }
        best == Some(id)
    }

    /// The priority of each; `None` if the weights allow none.
    fn priorities(&mut self, now: f64) -> Option<Vec<f64>> {
        let active: Vec<f64> = self
            .members
            .iter_mut()
            .map(|member| {
                member.left(now);
                f64::from(u8::from(member.is_active))
            })
            .collect();
        let mut rows: Vec<Vec<f64>> = Vec::with_capacity(self.members.len());
        for (row, (member, active)) in self.members.iter().zip(&active).enumerate() {
            let mut equation: Vec<f64> = self
                .members
                .iter()
                .enumerate()
                .map(|(column, other)| match other.weight_for(&member.from) {
                    Some(weight) => -weight * active,
                    None => f64::from(u8::from(row == column)),
                })
                .collect();
            equation.push(member.bias * active);
            rows.push(equation);
        }
        let solved = solve(rows)?;
        Some(solved.iter().zip(&active).map(|(y, x)| y * x).collect())
    }
}

/// Solves linear equations, each with its right side last; `None` if there is no unique solution.
fn solve(mut rows: Vec<Vec<f64>>) -> Option<Vec<f64>> {
    let count = rows.len();
    for column in 0..count {
        let size = |row: &usize| rows[*row][column].abs();
        let pivot = (column..count).max_by(|a, b| size(a).total_cmp(&size(b)))?;
        rows.swap(column, pivot);
        let (above, below) = rows.split_at_mut(column + 1);
        let pivot = &above[column];
        // Also for NaN.
        if pivot[column] == 0.0 || !pivot[column].is_finite() {
            return None;
        }
        for row in below {
            let factor = row[column] / pivot[column];
            for (value, pivot) in row.iter_mut().zip(pivot).skip(column) {
                *value -= factor * pivot;
            }
        }
    }
    let mut solution = vec![0.0; count];
    for row in (0..count).rev() {
        let known = rows[row].iter().zip(&solution).skip(row + 1);
        let known: f64 = known.map(|(factor, value)| factor * value).sum();
        solution[row] = (rows[row][count] - known) / rows[row][row];
    }
    Some(solution)
}

/// One writer's entry among those of its port, removed on drop.
#[derive(Debug)]
pub(super) struct Priority {
    arbiter: Arc<Arbiter>,
    id: u64,
}

impl Priority {
    pub(super) fn make(setup: &MonitorSetup) -> Made {
        let mut member = Member::new(setup)?;
        let arbiter = setup.arbiter.clone();
        let mut members = arbiter.members();
        if members.members.len() >= MAX_MEMBERS {
            return Err(format!(
                "the port has {MAX_MEMBERS} connections that ask for it already"
            ));
        }
        members.next += 1;
        let id = members.next;
        member.id = id;
        members.members.push(member);
        drop(members);
        Ok(Arc::new(Self { arbiter, id }))
    }

    fn with<T>(&self, ask: impl FnOnce(&mut Member) -> T) -> Option<T> {
        let mut members = self.arbiter.members();
        let mut all = members.members.iter_mut();
        all.find(|member| member.id == self.id).map(ask)
    }
}

impl Drop for Priority {
    fn drop(&mut self) {
        let mut members = self.arbiter.members();
        members.members.retain(|member| member.id != self.id);
    }
}

impl Monitor for Priority {
    fn update(&self, message: Passing) -> Option<Passing> {
        let now = self.arbiter.began.elapsed().as_secs_f64();
        let mut members = self.arbiter.members();
        members.accepts(self.id, now).then_some(message)
    }

    fn set(&self, parameters: &Bottle) {
        self.with(|member| {
            for (name, place) in [
                ("tc", &mut member.lasts),
                ("tr", &mut member.rests),
                ("st", &mut member.stimulation),
            ] {
                if let Some(number) = wanted(parameters, name) {
                    *place = number.abs();
                }
            }
            if let Some(bias) = wanted(parameters, "bs") {
                member.bias = bias;
            }
            if let Some(flag) = wanted(parameters, "virtual") {
                member.is_virtual = flag != 0.0;
            }
            if let Some(excitation) = parameters.find_group("ex") {
                member.excitation = excitation.clone();
            }
        });
    }

    fn get(&self) -> Bottle {
        let parameters = self.with(|member| {
            Bottle::from_iter([
                parameter("tc", member.lasts),
                parameter("tr", member.rests),
                parameter("st", member.stimulation),
                parameter("bs", member.bias),
                parameter("virtual", i32::from(member.is_virtual)),
                parameter("ex", member.excitation.to_string()),
            ])
        });
        parameters.unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::super::MonitorSide;
    use super::*;

    fn group(writers: &[(&str, &str)]) -> Members {
        let member = |(id, (from, options)): (usize, &(&str, &str))| {
            let setup = MonitorSetup {
                side: MonitorSide::Receive,
                from: (*from).to_owned(),
                to: "/r".to_owned(),
                options: Bottle::parse(options).unwrap(),
                arbiter: Arc::default(),
            };
            let id = id as u64;
            Member {
                id,
                ..Member::new(&setup).unwrap()
            }
        };
        let members = writers.iter().enumerate().map(member).collect();
        Members { next: 0, members }
    }

    #[test]
    fn the_higher_bias_is_accepted_while_active() {
        let mut group = group(&[("/low", "(bs 5)"), ("/high", "(bs 20) (tc 2)")]);
        assert!(group.accepts(0, 0.0));
        assert!(group.accepts(1, 1.0));
        assert!(!group.accepts(0, 1.5));
        assert!(!group.accepts(0, 2.9));
        // Two seconds after its message the other one is inactive.
        assert!(group.accepts(0, 3.1));
    }

    #[test]
    fn a_writer_needs_as_many_messages_as_its_stimulation_says() {
        let mut group = group(&[("/weak", "(st 4)")]);
        let heard: Vec<_> = (0..4)
            .map(|i| group.accepts(0, f64::from(i) * 0.01))
            .collect();
        assert_eq!(heard, [false, false, true, true]);
        assert!(!group.accepts(0, 10.0));
    }

    #[test]
    fn a_stimulation_of_no_duration_is_accepted_once() {
        let mut group = group(&[("/low", "(bs 5) (tc 9)"), ("/high", "(bs 20) (tc 0)")]);
        let writers = [0, 1, 0, 1].into_iter().zip([0.0, 0.1, 0.2, 0.3]);
        for (id, at) in writers {
            assert!(group.accepts(id, at));
        }
    }

    #[test]
    fn a_writer_rests_after_its_stimulation() {
        let mut group = group(&[("/a", "(tc 1) (tr 2)")]);
        assert!(group.accepts(0, 0.0));
        assert!(group.accepts(0, 0.5));
        assert!(!group.accepts(0, 1.5));
        assert!(!group.accepts(0, 2.5));
        assert!(group.accepts(0, 3.5));
    }

    /// The example of stock's own: a third writer switches between two.
    #[test]
    fn a_virtual_writer_only_counts_for_others() {
        let mut group = group(&[
            ("/ball", "(st 10) (tc 10) (bs 0)"),
            ("/line", "(st 10) (tc 10) (bs 10)"),
            (
                "/selector",
                "(st 10) (tc 2) (virtual) (ex (/line -10) (/ball 10))",
            ),
        ]);
        assert!(!group.accepts(0, 0.0));
        assert!(group.accepts(1, 0.1));
        assert!(!group.accepts(2, 0.2));
        assert!(group.accepts(0, 0.3));
        assert!(!group.accepts(1, 0.4));
        assert!(!group.accepts(0, 3.0));
        assert!(group.accepts(1, 3.1));
    }

    #[test]
    fn contradictory_weights_drop_all_messages() {
        let mut group = group(&[("/a", "(ex (/b 10))"), ("/b", "(ex (/a 10))")]);
        assert!(group.accepts(0, 0.0));
        assert!(!group.accepts(1, 0.1));
    }

    #[test]
    fn equations_are_solved() {
        let rows = vec![vec![0.0, 2.0, 4.0], vec![1.0, 1.0, 3.0]];
        assert_eq!(solve(rows), Some(vec![1.0, 2.0]));
        assert_eq!(solve(vec![vec![0.0, 1.0]]), None);
        assert_eq!(solve(vec![vec![f64::NAN, 1.0]]), None);
        assert_eq!(solve(Vec::new()), Some(Vec::new()));
    }
}
