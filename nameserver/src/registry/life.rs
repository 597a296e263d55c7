//! Who lives, and whose name may be given to another.
//!
//! Ports of ours hold a lease: they say every few seconds that they are there ([`Registry::lease`]).
//! The others are looked at now and then by the server ([`Registry::to_look_at`], [`Registry::seen`]). The
//! registry only takes note: `list` and `query` answer as in stock, whoever lives.

use std::fmt;
use std::time::{Duration, Instant};

use yarp_wire::name_service::{LeaseHolder, RegisterRequest, Registration, plain_text};

use super::limits::Refusal;
use super::lookup::is_below;
use super::{Body, Entry, FALLBACK, Registry};

/// How a port was found.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum State {
    /// It holds a lease, or answered when it was looked at.
    Alive,
    /// Nothing is known to be wrong, but it does not answer: its machine is away, or it is stuck.
    Unreachable,
    /// Its machine says that nobody listens there, or another port does.
    Gone,
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Alive => "alive",
            Self::Unreachable => "unreachable",
            Self::Gone => "gone",
        })
    }
}

/// What came of looking at a port.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Outcome {
    /// It answered to its name.
    Answered,
    /// Somebody took the connection and said nothing: a port that is stopped or stuck.
    Silent,
    /// There is no way there.
    NoWay,
    /// Its machine refused the connection.
    Refused,
    /// Another port answered there.
    Stranger,
}

/// What came of looking at a port, and why it was no better.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Look {
    /// What came of it.
    pub outcome: Outcome,
    /// In words, if the port did not answer.
    pub reason: Option<String>,
}

impl From<Outcome> for Look {
    fn from(outcome: Outcome) -> Self {
        let reason = None;
        Self { outcome, reason }
    }
}

impl Outcome {
    fn state(self) -> State {
        match self {
            Self::Answered => State::Alive,
            Self::Silent | Self::NoWay => State::Unreachable,
            Self::Refused | Self::Stranger => State::Gone,
        }
    }
}

/// A registered port, and what is known of its life.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Known {
    /// Name and address.
    pub registration: Registration,
    /// How it was found last.
    pub state: State,
    /// Since when.
    pub since: Instant,
    /// Why it is not alive, in words, if that is known.
    pub reason: Option<String>,
    /// Whether it holds a lease.
    pub leased: bool,
}

/// Whether a name may be given away.
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum Claim {
    /// Nobody has it, or who asks has it already.
    Free,
    /// This port has it and must be looked at first.
    Held {
        /// Who has it.
        holder: Registration,
        /// It has just come and may not listen yet: if nobody does, look again until then.
        patience: Option<Instant>,
    },
    /// It cannot be had.
    Refused(Refusal),
}

/// A port that has registered needs some time until it listens.
const YOUNG: Duration = Duration::from_secs(1);

/// What is known of the life of one port.
#[derive(Clone, Debug)]
pub(super) struct Life {
    state: State,
    /// Why the last look did not find it alive.
    reason: Option<Box<str>>,
    since: Option<Instant>,
    /// When it was registered, if that was in this life of the server.
    registered: Option<Instant>,
    looked: Option<Instant>,
    leased_until: Option<Instant>,
}

impl Life {
    /// A port that has just registered speaks to us: it lives.
    pub(super) fn registered(now: Instant) -> Self {
        Self {
            state: State::Alive,
            reason: None,
            since: Some(now),
            registered: Some(now),
            looked: Some(now),
            leased_until: None,
        }
    }

    /// Nothing is known of a port that was registered before the server started.
    pub(super) fn restored() -> Self {
        Self {
            state: State::Unreachable,
            reason: None,
            since: None,
            registered: None,
            looked: None,
            leased_until: None,
        }
    }

    fn is_leased(&self, now: Instant) -> bool {
        self.leased_until.is_some_and(|until| now < until)
    }

    fn become_(&mut self, now: Instant, state: State) {
        if self.state != state || self.since.is_none() {
            self.state = state;
            self.since = Some(now);
        }
    }

    fn state(&self, now: Instant) -> State {
        match self.is_leased(now) {
            true => State::Alive,
            false => self.state,
        }
    }
}

impl Registry {
    /// Whether `asked` may have its name.
    ///
    /// A group and a topic have no owner that could be asked: they are given away as in stock.
    pub fn claim(&self, now: Instant, asked: &RegisterRequest) -> Claim {
        let Some(entry) = self.ports.get(&asked.name) else {
            return Claim::Free;
        };
        let holder = &entry.registration;
        let number = asked.number.and_then(|number| u16::try_from(number).ok());
        let same_place = asked.host.as_ref() == Some(&holder.host) && number == Some(holder.port);
        if same_place || !has_owner(holder) {
            return Claim::Free;
        }
        if self.is_ours(&asked.name) {
            return Claim::Refused(taken(holder));
        }
        // One that has said what it is listens by now.
        let settled = entry.announced.is_some() || !entry.properties.get("process").is_empty();
        let registered = entry.life.registered.filter(|_| !settled);
        let patience = registered.map(|then| then + YOUNG);
        Claim::Held {
            holder: holder.clone(),
            patience: patience.filter(|until| now < *until),
        }
    }

    /// What to tell somebody who wants the name of `holder`, now that it was looked at: nothing, if
    /// it may be had.
    ///
    /// Who takes connections keeps the name. So does who cannot be reached but holds a lease.
    pub fn judge(
        &mut self,
        now: Instant,
        holder: &Registration,
        how: impl Into<Look>,
    ) -> Option<Refusal> {
        let look = how.into();
        let how = look.outcome;
        self.found(now, holder, look);
        let entry = self.ports.get(&holder.name);
        let keeps = match how {
            Outcome::Answered | Outcome::Silent => true,
            Outcome::NoWay => entry.is_some_and(|entry| entry.life.is_leased(now)),
            Outcome::Refused | Outcome::Stranger => false,
        };
        keeps.then(|| taken(holder))
    }

    /// The ports that are to be looked at, each once in `every`, at most `most`; they count as looked
    /// at.
    pub fn to_look_at(&mut self, now: Instant, every: Duration, most: usize) -> Vec<Registration> {
        let own = self.settings.name.clone();
        // Each of several servers looks for itself, all together no more often than configured.
        let servers = u32::try_from(self.settings.others.len()).map_or(u32::MAX, |n| n + 1);
        let every = every.saturating_mul(servers);
        let waits = |entry: &Entry| {
            let life = &entry.life;
            let due = life.looked.is_none_or(|then| now >= then + every);
            due && !life.is_leased(now)
        };
        let due = self.ports.iter_mut().filter(|(name, entry)| {
            **name != own && has_owner(&entry.registration) && waits(entry)
        });
        due.take(most)
            .map(|(_, entry)| {
                entry.life.looked = Some(now);
                entry.registration.clone()
            })
            .collect()
    }

    /// Takes note of what came of looking at `port`; tells whether it is to be dropped now.
    /// `drop_after`: how long a port must have been gone to be dropped; none if that never happens.
    pub fn seen(
        &mut self,
        now: Instant,
        drop_after: Option<Duration>,
        port: &Registration,
        how: impl Into<Look>,
    ) -> bool {
        let Some(life) = self.found(now, port, how.into()) else {
            return false;
        };
        let waited = |after| life.since.is_some_and(|then| now >= then + after);
        life.state == State::Gone && drop_after.is_some_and(waited)
    }

    /// Takes note of what came of looking at `port`, unless it has moved.
    pub(super) fn found(&mut self, now: Instant, port: &Registration, how: Look) -> Option<&Life> {
        let entry = self.ports.get_mut(&port.name);
        let entry = entry.filter(|entry| entry.registration == *port)?;
        let life = &mut entry.life;
        life.looked = Some(now);
        life.become_(now, how.outcome.state());
        life.reason = how.reason.map(String::into_boxed_str);
        if life.state == State::Gone {
            // Whoever held it has no need of it any more.
            life.leased_until = None;
        }
        Some(life)
    }

    /// Every registered port with its state, sorted by name.
    pub fn known(&self, now: Instant) -> impl Iterator<Item = Known> {
        self.ports
            .values()
            .map(move |entry| self.known_one(now, entry))
    }

    fn known_one(&self, now: Instant, entry: &Entry) -> Known {
        let life = &entry.life;
        let registration = entry.registration.clone();
        let certain = self.is_ours(&registration.name) || !has_owner(&registration);
        let state = match certain {
            true => State::Alive,
            false => life.state(now),
        };
        let reason = match (&life.reason, life.looked) {
            (None, None) => Some("it has not been looked at since the server was started"),
            (reason, _) => reason.as_deref(),
        };
        Known {
            state,
            reason: reason.filter(|_| state != State::Alive).map(str::to_owned),
            since: life.since.unwrap_or(now),
            leased: life.is_leased(now),
            registration,
        }
    }

    /// `lease NAME HOST NUMBER ...`: these ports are there. The answer tells how long that holds,
    /// which server it is, who of them is registered no longer (`lost`) or elsewhere (`taken`), and
    /// where other servers of the same names are (`also HOST PORT`).
    pub(super) fn lease(&mut self, now: Instant, holders: &[LeaseHolder]) -> Body {
        let (incarnation, lease) = (self.settings.incarnation, self.settings.lease);
        let first = format!("lease {} server {incarnation}", lease.as_secs());
        let mut lines = vec![first];
        for holder in holders {
            let name = plain_text(&holder.name);
            match self.ports.get_mut(&holder.name) {
                None => lines.push(format!("lost {name}")),
                Some(Entry {
                    registration, life, ..
                }) => {
                    if (&registration.host, registration.port) == (&holder.host, holder.number) {
                        life.become_(now, State::Alive);
                        life.leased_until = Some(now + lease);
                    } else {
                        lines.push(format!("taken {name}"));
                    }
                }
            }
        }
        let others = self.settings.others.iter();
        lines.extend(others.map(|(host, port)| format!("also {} {port}", plain_text(host))));
        Body::lines(lines)
    }

    /// `state [PREFIX]`: the lines of `list`, each with a state behind it.
    pub(super) fn states(&self, now: Instant, prefix: &str) -> Body {
        let known = self.known(now);
        let known = known.filter(|known| is_below(&known.registration.name, prefix));
        Body::lines(known.map(|known| format!("{} state {}", known.registration, known.state)))
    }

    /// Whether it is the server itself, or its group.
    pub(crate) fn is_ours(&self, name: &str) -> bool {
        name == self.settings.name || name == FALLBACK
    }
}

/// Groups and topics are only words between ports.
fn has_owner(registration: &Registration) -> bool {
    !matches!(registration.carrier.as_str(), "mcast" | "topic")
}

fn taken(holder: &Registration) -> Refusal {
    let Registration {
        name, host, port, ..
    } = holder.clone();
    Refusal::Taken { name, host, port }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::Settings;
    use yarp_wire::name_service::Request;

    const EVERY: Duration = Duration::from_secs(30);
    const DROP_AFTER: Option<Duration> = Some(Duration::from_secs(600));

    struct Asked {
        registry: Registry,
        now: Instant,
    }

    impl Asked {
        fn after(lines: &[&str]) -> Self {
            let registry = Registry::new(Settings::at("192.0.2.2", 10310));
            let now = Instant::now();
            let mut asked = Self { registry, now };
            for line in lines {
                asked.ask(line);
            }
            asked
        }

        fn ask(&mut self, line: &str) -> String {
            let request = Request::parse(line).unwrap();
            let reply = self.registry.handle(self.now, None, &request);
            reply.body.to_text().replace("\r\n", "|")
        }

        fn state(&self, name: &str) -> State {
            let mut known = self.registry.known(self.now);
            let known = known.find(|known| known.registration.name == name);
            known.unwrap().state
        }

        fn claim(&self, line: &str) -> Claim {
            match Request::parse(line).unwrap().command {
                yarp_wire::name_service::Command::Register(asked) => {
                    self.registry.claim(self.now, &asked)
                }
                other => panic!("{other:?}"),
            }
        }

        fn look(&mut self, outcome: Outcome) -> Vec<(String, bool)> {
            let due = self.registry.to_look_at(self.now, EVERY, 100);
            due.iter()
                .map(|port| {
                    let drop = self.registry.seen(self.now, DROP_AFTER, port, outcome);
                    (port.name.clone(), drop)
                })
                .collect()
        }

        fn pass(&mut self, seconds: u64) {
            self.now += Duration::from_secs(seconds);
        }
    }

    const PORT: &str = "register /a tcp h 1";

    #[test]
    fn nobody_is_looked_at_more_often_than_configured() {
        let mut asked = Asked::after(&[PORT, "register /g mcast", "register /t topic"]);
        assert_eq!(asked.look(Outcome::Answered), []);
        asked.pass(30);
        assert_eq!(asked.look(Outcome::Answered), [("/a".to_owned(), false)]);
        asked.pass(29);
        assert_eq!(asked.look(Outcome::Answered), []);
        asked.pass(1);
        assert_eq!(asked.look(Outcome::Answered).len(), 1);
    }

    #[test]
    fn states_follow_what_is_seen() {
        let mut asked = Asked::after(&[PORT]);
        assert_eq!(asked.state("/a"), State::Alive);
        for (outcome, state) in [
            (Outcome::Silent, State::Unreachable),
            (Outcome::NoWay, State::Unreachable),
            (Outcome::Refused, State::Gone),
            (Outcome::Answered, State::Alive),
            (Outcome::Stranger, State::Gone),
        ] {
            asked.pass(30);
            asked.look(outcome);
            assert_eq!(asked.state("/a"), state);
        }
        let line = "registration name /a ip h port 1 type tcp state gone|*** end of message|";
        assert_eq!(asked.ask("state /a"), line);
        assert_eq!(asked.ask("list /a"), line.replace(" state gone", ""));
    }

    #[test]
    fn only_who_is_gone_for_long_is_dropped() {
        let mut asked = Asked::after(&[PORT]);
        let looks = |asked: &mut Asked, outcome, times| {
            let mut dropped = false;
            for _ in 0..times {
                asked.pass(30);
                dropped |= asked.look(outcome)[0].1;
            }
            dropped
        };
        assert!(!looks(&mut asked, Outcome::NoWay, 100));
        assert!(!looks(&mut asked, Outcome::Refused, 20));
        assert!(!looks(&mut asked, Outcome::Answered, 1));
        assert!(!looks(&mut asked, Outcome::Refused, 20));
        assert!(looks(&mut asked, Outcome::Refused, 1));
    }

    #[test]
    fn a_lease_keeps_alive_and_spares_the_looks() {
        let mut asked = Asked::after(&[PORT]);
        asked.pass(30);
        asked.look(Outcome::Refused);
        let told = asked.ask("lease /a h 1 /b h 2");
        assert_eq!(told, "lease 20 server 0|lost /b|*** end of message|");
        assert_eq!(
            asked.ask("lease /a elsewhere 1").split('|').nth(1),
            Some("taken /a")
        );
        assert_eq!(asked.state("/a"), State::Alive);
        asked.pass(19);
        assert_eq!(asked.look(Outcome::Refused), []);
        asked.pass(11);
        assert_eq!(asked.look(Outcome::Refused).len(), 1);
        assert_eq!(asked.state("/a"), State::Gone);
    }

    #[test]
    fn a_name_that_is_held_must_be_looked_at_first() {
        let mut asked = Asked::after(&[PORT, "register /g mcast", "register /t topic"]);
        for free in [
            "register /b",
            "register ...",
            PORT,
            "register /g mcast",
            "register /t",
        ] {
            assert_eq!(asked.claim(free), Claim::Free, "{free}");
        }
        for held in ["register /a", "register /a tcp h 2", "register /a tcp g 1"] {
            let Claim::Held { holder, patience } = asked.claim(held) else {
                panic!("{held} is not held");
            };
            assert_eq!((holder.port, patience.is_some()), (1, true), "{held}");
        }
        for settled in ["set /a process 5", "announce /a"] {
            let asked = Asked::after(&[PORT, settled]);
            let held = |claim| matches!(claim, Claim::Held { patience: None, .. });
            assert!(held(asked.claim("register /a")), "{settled}");
        }
        asked.pass(1);
        let claim = asked.claim("register /a");
        assert!(matches!(claim, Claim::Held { patience: None, .. }));
        assert!(matches!(asked.claim("register /root"), Claim::Refused(_)));
    }

    #[test]
    fn an_owner_that_takes_connections_keeps_its_name() {
        let mut asked = Asked::after(&[PORT]);
        let holder: Registration = "registration name /a ip h port 1 type tcp".parse().unwrap();
        let mut check = |keeping: [bool; 5]| {
            let outcomes = [
                Outcome::Answered,
                Outcome::Silent,
                Outcome::NoWay,
                Outcome::Refused,
                Outcome::Stranger,
            ];
            for (outcome, keeps) in outcomes.into_iter().zip(keeping) {
                let refusal = asked.registry.judge(asked.now, &holder, outcome);
                assert_eq!(refusal, keeps.then(|| taken(&holder)), "{outcome:?}");
            }
            asked.ask("lease /a h 1");
        };
        check([true, true, false, false, false]);
        check([true, true, true, false, false]);
    }
}
