//! Liveness of registered ports, and claims to names that are in use.
//!
//! Ports of this project hold a lease, which they renew every few seconds ([`Registry::lease`]).
//! The server probes all other ports periodically ([`Registry::due_for_probe`],
//! [`Registry::record_probe`]). The registry only records the results: `list` and `query` answer as
//! in stock, whatever the state of a port.

use std::fmt;
use std::net::IpAddr;
use std::time::{Duration, Instant};

use yarp_wire::name_service::{LeaseHolder, RegisterRequest, Registration, plain_text};

use super::name_queries::is_below;
use super::ownership::{has_owner, keeps_ownership};
use super::registry_limits::Refusal;
use super::{Body, Entry, FALLBACK, Registry};

/// Liveness of a port.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Liveness {
    /// The port holds a lease, or answered the last probe.
    Alive,
    /// The port does not answer and nothing else is known: its machine is unreachable, or the port
    /// is stuck.
    Unreachable,
    /// Its machine refuses connections at that address, or another port answers there.
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

/// Result of a probe.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum ProbeResult {
    /// The port answered with its name.
    Answered,
    /// The connection was accepted and nothing was received: the port is stopped or stuck.
    NoReply,
    /// The address could not be reached.
    Unroutable,
    /// The machine refused the connection.
    Refused,
    /// Another port answered at the address.
    WrongPort,
}

/// Result of a probe, with the reason for a failure.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Probe {
    /// Result of the probe.
    pub result: ProbeResult,
    /// Reason, if the port did not answer.
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

/// A registered port and its liveness.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct PortStatus {
    /// Name and address.
    pub registration: Registration,
    /// State after the last probe or lease renewal.
    pub state: Liveness,
    /// Time of the last change of state.
    pub since: Instant,
    /// Reason why the port is not alive, if known.
    pub reason: Option<String>,
    /// True while the port holds a lease.
    pub leased: bool,
}

/// Result of claiming a name.
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum ClaimResult {
    /// No port has the name, or the claiming port has it already.
    Free,
    /// This port has the name and must be probed first.
    Held {
        /// Present owner of the name.
        holder: Registration,
        /// The owner registered a moment ago and may not listen yet: repeat a failed probe until
        /// then.
        retry_until: Option<Instant>,
    },
    /// The name cannot be claimed.
    Refused(Refusal),
}

/// Time that a port may take from its registration until it listens.
const REGISTRATION_GRACE: Duration = Duration::from_secs(1);

/// Recorded liveness of one port.
#[derive(Clone, Debug)]
pub(super) struct LivenessRecord {
    state: Liveness,
    /// Reason why the last probe failed.
    reason: Option<Box<str>>,
    since: Option<Instant>,
    /// Time of registration, if it happened since the server started.
    registered: Option<Instant>,
    probed_at: Option<Instant>,
    leased_until: Option<Instant>,
    /// The address that the registration came from, if that was in this life of the server.
    pub(super) registered_by: Option<IpAddr>,
}

impl LivenessRecord {
    /// Returns the record of a port that has just registered, which counts as alive.
    pub(super) fn registered(now: Instant, by: Option<IpAddr>) -> Self {
        Self {
            state: Liveness::Alive,
            reason: None,
            since: Some(now),
            registered: Some(now),
            probed_at: Some(now),
            leased_until: None,
            registered_by: by.map(|by| by.to_canonical()),
        }
    }

    /// Returns the record of a port that was registered before the server started: nothing is known
    /// of it.
    pub(super) fn restored() -> Self {
        Self {
            state: Liveness::Unreachable,
            reason: None,
            since: None,
            registered: None,
            probed_at: None,
            leased_until: None,
            registered_by: None,
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

    pub(super) fn state(&self, now: Instant) -> Liveness {
        match self.is_leased(now) {
            true => Liveness::Alive,
            false => self.state,
        }
    }

    /// Returns whether the port is known to be gone.
    pub(super) fn is_gone(&self, now: Instant) -> bool {
        self.state(now) == Liveness::Gone
    }
}

impl Registry {
    /// Returns whether `asked` may have its name.
    ///
    /// A group and a topic have no owner that could be asked: they are given away as in stock. The
    /// owner, who asks at `from`, gets the place that it has, unless it asks to be a group or topic.
    pub fn claim(
        &self,
        now: Instant,
        from: Option<IpAddr>,
        asked: &RegisterRequest,
    ) -> ClaimResult {
        let Some(entry) = self.ports.get(&asked.name) else {
            return ClaimResult::Free;
        };
        let holder = &entry.registration;
        let number = asked.number.and_then(|number| u16::try_from(number).ok());
        let same_place = asked.host.as_ref() == Some(&holder.host) && number == Some(holder.port);
        let is_owner = same_place && keeps_ownership(asked, holder) && self.is_owner(entry, from);
        if is_owner || !has_owner(holder) {
            return ClaimResult::Free;
        }
        if self.is_ours(&asked.name) {
            return ClaimResult::Refused(taken(holder));
        }
        // A port that has set its properties listens by now.
        let settled = entry.announced.is_some() || !entry.properties.get("process").is_empty();
        let registered = entry.liveness.registered.filter(|_| !settled);
        let retry_until = registered.map(|then| then + REGISTRATION_GRACE);
        ClaimResult::Held {
            holder: holder.clone(),
            retry_until: retry_until.filter(|until| now < *until),
        }
    }

    /// Decides a claim to the name of `holder` after a probe; returns a refusal, or `None` if the
    /// name is free.
    ///
    /// An owner that accepts connections keeps its name, as does an unreachable owner that holds a
    /// lease.
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

    /// Returns at most `most` ports that are due for a probe, each once per `every`, and marks them
    /// as probed.
    pub fn due_for_probe(
        &mut self,
        now: Instant,
        every: Duration,
        most: usize,
    ) -> Vec<Registration> {
        let own = self.settings.name.clone();
        // Each of several servers probes all ports; together they do so no more often than
        // configured.
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

    /// Records the result of a probe of `port`; returns true if its name expires now.
    /// `expire_after`: time for which a port must have been gone; `None` means never.
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

    /// Records the result of a probe of `port`, unless its address changed since.
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
            // The owner of the lease is gone.
            liveness.leased_until = None;
        }
        Some(liveness)
    }

    /// Returns every registered port with its liveness, sorted by name.
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
    ///
    /// Only the owner is believed that its port is there; others are told the same, and the port is
    /// probed as before.
    pub(super) fn lease(
        &mut self,
        now: Instant,
        from: Option<IpAddr>,
        holders: &[LeaseHolder],
    ) -> Body {
        let (incarnation, lease) = (self.settings.incarnation, self.settings.lease);
        let first = format!("lease {} server {incarnation}", lease.as_secs());
        let mut lines = vec![first];
        for holder in holders {
            let name = plain_text(&holder.name);
            let entry = self.ports.get(&holder.name);
            let believed = entry.is_some_and(|entry| self.is_owner(entry, from));
            match self.ports.get_mut(&holder.name) {
                None => lines.push(format!("lost {name}")),
                Some(Entry {
                    registration,
                    liveness,
                    ..
                }) => {
                    if (&registration.host, registration.port) == (&holder.host, holder.number) {
                        if believed {
                            liveness.transition_to(now, Liveness::Alive);
                            liveness.leased_until = Some(now + lease);
                        }
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

    /// Handles `state [PREFIX]`: the lines of `list`, each followed by a state.
    pub(super) fn states(&self, now: Instant, prefix: &str) -> Body {
        let known = self.port_statuses(now);
        let known = known.filter(|known| is_below(&known.registration.name, prefix));
        Body::lines(known.map(|known| format!("{} state {}", known.registration, known.state)))
    }

    /// Returns true for the name of the server itself and of its group.
    pub(crate) fn is_ours(&self, name: &str) -> bool {
        name == self.settings.name || name == FALLBACK
    }
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
            reply.body.into_text().replace("\r\n", "|")
        }

        fn state(&self, name: &str) -> Liveness {
            let mut known = self.registry.port_statuses(self.now);
            let known = known.find(|known| known.registration.name == name);
            known.unwrap().state
        }

        fn claim(&self, line: &str) -> ClaimResult {
            match Request::parse(line).unwrap().command {
                yarp_wire::name_service::Command::Register(asked) => {
                    self.registry.claim(self.now, None, &asked)
                }
                other => panic!("{other:?}"),
            }
        }

        fn probe_due(&mut self, outcome: ProbeResult) -> Vec<(String, bool)> {
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
    fn probes_keep_to_their_interval() {
        let mut asked = Asked::after(&[PORT, "register /g mcast", "register /t topic"]);
        assert_eq!(asked.probe_due(ProbeResult::Answered), []);
        asked.pass(30);
        assert_eq!(
            asked.probe_due(ProbeResult::Answered),
            [("/a".to_owned(), false)]
        );
        asked.pass(29);
        assert_eq!(asked.probe_due(ProbeResult::Answered), []);
        asked.pass(1);
        assert_eq!(asked.probe_due(ProbeResult::Answered).len(), 1);
    }

    #[test]
    fn states_follow_probe_results() {
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
            asked.probe_due(outcome);
            assert_eq!(asked.state("/a"), state);
        }
        let line = "registration name /a ip h port 1 type tcp state gone|*** end of message|";
        assert_eq!(asked.ask("state /a"), line);
        assert_eq!(asked.ask("list /a"), line.replace(" state gone", ""));
    }

    #[test]
    fn only_ports_gone_for_long_expire() {
        let mut asked = Asked::after(&[PORT]);
        let looks = |asked: &mut Asked, outcome, times| {
            let mut dropped = false;
            for _ in 0..times {
                asked.pass(30);
                dropped |= asked.probe_due(outcome)[0].1;
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
    fn leases_replace_probes() {
        let mut asked = Asked::after(&[PORT]);
        asked.pass(30);
        asked.probe_due(ProbeResult::Refused);
        let told = asked.ask("lease /a h 1 /b h 2");
        assert_eq!(told, "lease 20 server 0|lost /b|*** end of message|");
        assert_eq!(
            asked.ask("lease /a elsewhere 1").split('|').nth(1),
            Some("taken /a")
        );
        assert_eq!(asked.state("/a"), Liveness::Alive);
        asked.pass(19);
        assert_eq!(asked.probe_due(ProbeResult::Refused), []);
        asked.pass(11);
        assert_eq!(asked.probe_due(ProbeResult::Refused).len(), 1);
        assert_eq!(asked.state("/a"), Liveness::Gone);
    }

    #[test]
    fn claims_require_a_probe_of_the_owner() {
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
    fn owners_that_accept_connections_keep_their_names() {
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
