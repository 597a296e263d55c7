//! Who lives, and whose name may be given to another.
//!
//! Ports of ours hold a lease: they say every few seconds that they are there ([`Registry::lease`]).
//! The others are looked at now and then by the server ([`Registry::due_for_probe`], [`Registry::record_probe`]). The
//! registry only takes note: `list` and `query` answer as in stock, whoever lives.

use std::fmt;
use std::time::{Duration, Instant};

use yarp_wire::name_service::{LeaseHolder, RegisterRequest, Registration, plain_text};

use super::lookup::is_below;
use super::registry_limits::Refusal;
use super::{Body, Entry, FALLBACK, Registry};

/// How a port was found.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Liveness {
    /// It holds a lease, or answered when it was looked at.
    Alive,
    /// Nothing is known to be wrong, but it does not answer: its machine is away, or it is stuck.
    Unreachable,
    /// Its machine says that nobody listens there, or another port does.
    Gone,
}

impl fmt::Display for Liveness {
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
pub enum ProbeResult {
    /// It answered to its name.
    Answered,
    /// Somebody took the connection and said nothing: a port that is stopped or stuck.
    NoReply,
    /// There is no way there.
    Unroutable,
    /// Its machine refused the connection.
    Refused,
    /// Another port answered there.
    WrongPort,
}

/// What came of looking at a port, and why it was no better.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Probe {
    /// What came of it.
    pub result: ProbeResult,
    /// In words, if the port did not answer.
    pub reason: Option<String>,
}

impl From<ProbeResult> for Probe {
    fn from(result: ProbeResult) -> Self {
        let reason = None;
        Self { result, reason }
    }
}

impl ProbeResult {
    fn state(self) -> Liveness {
        match self {
            Self::Answered => Liveness::Alive,
            Self::NoReply | Self::Unroutable => Liveness::Unreachable,
            Self::Refused | Self::WrongPort => Liveness::Gone,
        }
    }
}

/// A registered port, and what is known of its life.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct PortStatus {
    /// Name and address.
    pub registration: Registration,
    /// How it was found last.
    pub state: Liveness,
    /// Since when.
    pub since: Instant,
    /// Why it is not alive, in words, if that is known.
    pub reason: Option<String>,
    /// Whether it holds a lease.
    pub leased: bool,
}

/// Whether a name may be given away.
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum ClaimResult {
    /// Nobody has it, or who asks has it already.
    Free,
    /// This port has it and must be looked at first.
    Held {
        /// Who has it.
        holder: Registration,
        /// It has just come and may not listen yet: if nobody does, look again until then.
        retry_until: Option<Instant>,
    },
    /// It cannot be had.
    Refused(Refusal),
}

/// A port that has registered needs some time until it listens.
const REGISTRATION_GRACE: Duration = Duration::from_secs(1);

/// What is known of the life of one port.
#[derive(Clone, Debug)]
pub(super) struct LivenessRecord {
    state: Liveness,
    /// Why the last look did not find it alive.
    reason: Option<Box<str>>,
    since: Option<Instant>,
    /// When it was registered, if that was in this life of the server.
    registered: Option<Instant>,
    probed_at: Option<Instant>,
    leased_until: Option<Instant>,
}

impl LivenessRecord {
    /// A port that has just registered speaks to us: it lives.
    pub(super) fn registered(now: Instant) -> Self {
        Self {
            state: Liveness::Alive,
            reason: None,
            since: Some(now),
            registered: Some(now),
            probed_at: Some(now),
            leased_until: None,
        }
    }

    /// Nothing is known of a port that was registered before the server started.
    pub(super) fn restored() -> Self {
        Self {
            state: Liveness::Unreachable,
            reason: None,
            since: None,
            registered: None,
            probed_at: None,
            leased_until: None,
        }
    }

    fn is_leased(&self, now: Instant) -> bool {
        self.leased_until.is_some_and(|until| now < until)
    }

    fn transition_to(&mut self, now: Instant, state: Liveness) {
        if self.state != state || self.since.is_none() {
            self.state = state;
            self.since = Some(now);
        }
    }

    fn state(&self, now: Instant) -> Liveness {
        match self.is_leased(now) {
            true => Liveness::Alive,
            false => self.state,
        }
    }
}

impl Registry {
    /// Whether `asked` may have its name.
    ///
    /// A group and a topic have no owner that could be asked: they are given away as in stock.
    pub fn claim(&self, now: Instant, asked: &RegisterRequest) -> ClaimResult {
        let Some(entry) = self.ports.get(&asked.name) else {
            return ClaimResult::Free;
        };
        let holder = &entry.registration;
        let number = asked.number.and_then(|number| u16::try_from(number).ok());
        let same_place = asked.host.as_ref() == Some(&holder.host) && number == Some(holder.port);
        if same_place || !has_owner(holder) {
            return ClaimResult::Free;
        }
        if self.is_ours(&asked.name) {
            return ClaimResult::Refused(taken(holder));
        }
        // One that has said what it is listens by now.
        let settled = entry.announced.is_some() || !entry.properties.get("process").is_empty();
        let registered = entry.liveness.registered.filter(|_| !settled);
        let retry_until = registered.map(|then| then + REGISTRATION_GRACE);
        ClaimResult::Held {
            holder: holder.clone(),
            retry_until: retry_until.filter(|until| now < *until),
        }
    }

    /// What to tell somebody who wants the name of `holder`, now that it was looked at: nothing, if
    /// it may be had.
    ///
    /// Who takes connections keeps the name. So does who cannot be reached but holds a lease.
    pub fn resolve_claim(
        &mut self,
        now: Instant,
        holder: &Registration,
        how: impl Into<Probe>,
    ) -> Option<Refusal> {
        let probe = how.into();
        let how = probe.result;
        self.apply_probe(now, holder, probe);
        let entry = self.ports.get(&holder.name);
        let keeps = match how {
            ProbeResult::Answered | ProbeResult::NoReply => true,
            ProbeResult::Unroutable => entry.is_some_and(|entry| entry.liveness.is_leased(now)),
            ProbeResult::Refused | ProbeResult::WrongPort => false,
        };
        keeps.then(|| taken(holder))
    }

    /// The ports that are to be looked at, each once in `every`, at most `most`; they count as looked
    /// at.
    pub fn due_for_probe(
        &mut self,
        now: Instant,
        every: Duration,
        most: usize,
    ) -> Vec<Registration> {
        let own = self.settings.name.clone();
        // Each of several servers looks for itself, all together no more often than configured.
        let servers = u32::try_from(self.settings.others.len()).map_or(u32::MAX, |n| n + 1);
        let every = every.saturating_mul(servers);
        let waits = |entry: &Entry| {
            let liveness = &entry.liveness;
            let due = liveness.probed_at.is_none_or(|then| now >= then + every);
            due && !liveness.is_leased(now)
        };
        let due = self.ports.iter_mut().filter(|(name, entry)| {
            **name != own && has_owner(&entry.registration) && waits(entry)
        });
        due.take(most)
            .map(|(_, entry)| {
                entry.liveness.probed_at = Some(now);
                entry.registration.clone()
            })
            .collect()
    }

    /// Takes note of what came of looking at `port`; tells whether it is to be dropped now.
    /// `expire_after`: how long a port must have been gone to be dropped; none if that never happens.
    pub fn record_probe(
        &mut self,
        now: Instant,
        expire_after: Option<Duration>,
        port: &Registration,
        how: impl Into<Probe>,
    ) -> bool {
        let Some(liveness) = self.apply_probe(now, port, how.into()) else {
            return false;
        };
        let waited = |after| liveness.since.is_some_and(|then| now >= then + after);
        liveness.state == Liveness::Gone && expire_after.is_some_and(waited)
    }

    /// Takes note of what came of looking at `port`, unless it has moved.
    pub(super) fn apply_probe(
        &mut self,
        now: Instant,
        port: &Registration,
        how: Probe,
    ) -> Option<&LivenessRecord> {
        let entry = self.ports.get_mut(&port.name);
        let entry = entry.filter(|entry| entry.registration == *port)?;
        let liveness = &mut entry.liveness;
        liveness.probed_at = Some(now);
        liveness.transition_to(now, how.result.state());
        liveness.reason = how.reason.map(String::into_boxed_str);
        if liveness.state == Liveness::Gone {
            // Whoever held it has no need of it any more.
            liveness.leased_until = None;
        }
        Some(liveness)
    }

    /// Every registered port with its state, sorted by name.
    pub fn port_statuses(&self, now: Instant) -> impl Iterator<Item = PortStatus> {
        self.ports
            .values()
            .map(move |entry| self.port_status(now, entry))
    }

    fn port_status(&self, now: Instant, entry: &Entry) -> PortStatus {
        let liveness = &entry.liveness;
        let registration = entry.registration.clone();
        let certain = self.is_ours(&registration.name) || !has_owner(&registration);
        let state = match certain {
            true => Liveness::Alive,
            false => liveness.state(now),
        };
        let reason = match (&liveness.reason, liveness.probed_at) {
            (None, None) => Some("it has not been probed since the server was started"),
            (reason, _) => reason.as_deref(),
        };
        PortStatus {
            state,
            reason: reason
                .filter(|_| state != Liveness::Alive)
                .map(str::to_owned),
            since: liveness.since.unwrap_or(now),
            leased: liveness.is_leased(now),
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
                    registration,
                    liveness,
                    ..
                }) => {
                    if (&registration.host, registration.port) == (&holder.host, holder.number) {
                        liveness.transition_to(now, Liveness::Alive);
                        liveness.leased_until = Some(now + lease);
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
        let known = self.port_statuses(now);
        let known = known.filter(|known| is_below(&known.registration.name, prefix));
        Body::lines(known.map(|known| format!("{} state {}", known.registration, known.state)))
    }

    /// Whether it is the server itself, or its group.
    pub(crate) fn is_ours(&self, name: &str) -> bool {
        name == self.settings.name || name == FALLBACK
    }
}

/// MulticastGroups and topics are only words between ports.
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
    const EXPIRE_AFTER: Option<Duration> = Some(Duration::from_secs(600));

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

        fn state(&self, name: &str) -> Liveness {
            let mut known = self.registry.port_statuses(self.now);
            let known = known.find(|known| known.registration.name == name);
            known.unwrap().state
        }

        fn claim(&self, line: &str) -> ClaimResult {
            match Request::parse(line).unwrap().command {
                yarp_wire::name_service::Command::Register(asked) => {
                    self.registry.claim(self.now, &asked)
                }
                other => panic!("{other:?}"),
            }
        }

        fn look(&mut self, outcome: ProbeResult) -> Vec<(String, bool)> {
            let due = self.registry.due_for_probe(self.now, EVERY, 100);
            due.iter()
                .map(|port| {
                    let drop = self
                        .registry
                        .record_probe(self.now, EXPIRE_AFTER, port, outcome);
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
        assert_eq!(asked.look(ProbeResult::Answered), []);
        asked.pass(30);
        assert_eq!(
            asked.look(ProbeResult::Answered),
            [("/a".to_owned(), false)]
        );
        asked.pass(29);
        assert_eq!(asked.look(ProbeResult::Answered), []);
        asked.pass(1);
        assert_eq!(asked.look(ProbeResult::Answered).len(), 1);
    }

    #[test]
    fn states_follow_what_is_seen() {
        let mut asked = Asked::after(&[PORT]);
        assert_eq!(asked.state("/a"), Liveness::Alive);
        for (outcome, state) in [
            (ProbeResult::NoReply, Liveness::Unreachable),
            (ProbeResult::Unroutable, Liveness::Unreachable),
            (ProbeResult::Refused, Liveness::Gone),
            (ProbeResult::Answered, Liveness::Alive),
            (ProbeResult::WrongPort, Liveness::Gone),
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
        assert!(!looks(&mut asked, ProbeResult::Unroutable, 100));
        assert!(!looks(&mut asked, ProbeResult::Refused, 20));
        assert!(!looks(&mut asked, ProbeResult::Answered, 1));
        assert!(!looks(&mut asked, ProbeResult::Refused, 20));
        assert!(looks(&mut asked, ProbeResult::Refused, 1));
    }

    #[test]
    fn a_lease_keeps_alive_and_spares_the_looks() {
        let mut asked = Asked::after(&[PORT]);
        asked.pass(30);
        asked.look(ProbeResult::Refused);
        let told = asked.ask("lease /a h 1 /b h 2");
        assert_eq!(told, "lease 20 server 0|lost /b|*** end of message|");
        assert_eq!(
            asked.ask("lease /a elsewhere 1").split('|').nth(1),
            Some("taken /a")
        );
        assert_eq!(asked.state("/a"), Liveness::Alive);
        asked.pass(19);
        assert_eq!(asked.look(ProbeResult::Refused), []);
        asked.pass(11);
        assert_eq!(asked.look(ProbeResult::Refused).len(), 1);
        assert_eq!(asked.state("/a"), Liveness::Gone);
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
            assert_eq!(asked.claim(free), ClaimResult::Free, "{free}");
        }
        for held in ["register /a", "register /a tcp h 2", "register /a tcp g 1"] {
            let ClaimResult::Held {
                holder,
                retry_until,
            } = asked.claim(held)
            else {
                panic!("{held} is not held");
            };
            assert_eq!((holder.port, retry_until.is_some()), (1, true), "{held}");
        }
        for settled in ["set /a process 5", "announce /a"] {
            let asked = Asked::after(&[PORT, settled]);
            let held = |claim| {
                matches!(
                    claim,
                    ClaimResult::Held {
                        retry_until: None,
                        ..
                    }
                )
            };
            assert!(held(asked.claim("register /a")), "{settled}");
        }
        asked.pass(1);
        let claim = asked.claim("register /a");
        assert!(matches!(
            claim,
            ClaimResult::Held {
                retry_until: None,
                ..
            }
        ));
        assert!(matches!(
            asked.claim("register /root"),
            ClaimResult::Refused(_)
        ));
    }

    #[test]
    fn an_owner_that_takes_connections_keeps_its_name() {
        let mut asked = Asked::after(&[PORT]);
        let holder: Registration = "registration name /a ip h port 1 type tcp".parse().unwrap();
        let mut check = |keeping: [bool; 5]| {
            let outcomes = [
                ProbeResult::Answered,
                ProbeResult::NoReply,
                ProbeResult::Unroutable,
                ProbeResult::Refused,
                ProbeResult::WrongPort,
            ];
            for (outcome, keeps) in outcomes.into_iter().zip(keeping) {
                let refusal = asked.registry.resolve_claim(asked.now, &holder, outcome);
                assert_eq!(refusal, keeps.then(|| taken(&holder)), "{outcome:?}");
            }
            asked.ask("lease /a h 1");
        };
        check([true, true, false, false, false]);
        check([true, true, true, false, false]);
    }
}
