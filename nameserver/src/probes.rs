//! Probes of the holders of names that others want, and who waits for them.
//!
//! All who want a name wait for one probe of its holder, and its result is good for some seconds. Those
//! who wait are bounded, in total and for each address, so that the server stays there for others; so
//! is the rate at which one address has others probed.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::{Semaphore, watch};
use tokio::task::JoinSet;
use yarp_ports::Network;
use yarp_wire::name_service::Registration;

use crate::prober;
use crate::registry::{Probe, ProbeResult};

/// Timeout of each step for the holder of a name that another client requests.
const PROBE_TIMEOUT: Duration = Duration::from_secs(2);
/// Probes at once.
const MAX_PROBES: usize = 64;
/// Time for which a reply of a holder counts.
const ANSWERED_VALIDITY: Duration = Duration::from_secs(1);
/// Time for which a missing reply of a holder counts.
const UNANSWERED_VALIDITY: Duration = Duration::from_secs(5);
/// Results that are kept before those that count no longer are looked for.
const MAX_RESULTS: usize = 256;
/// Requests of one address that wait for probes at once.
const MAX_WAITING_PER_ADDRESS: usize = 256;
/// Probes that one address may cause at once, without a pause.
const PROBE_BURST: f64 = 256.0;
/// Probes per second that one address may cause beyond that; more are late.
const PROBES_PER_SECOND: f64 = 32.0;

/// Probes the holders of names.
#[derive(Debug)]
pub(crate) struct Probes {
    network: Network,
    permits: Arc<Semaphore>,
    known: Arc<Mutex<HashMap<Registration, Known>>>,
    waiting: Arc<Mutex<Waiting>>,
    max_waiting: usize,
    rates: Mutex<HashMap<IpAddr, Rate>>,
    /// The probes; dropping it ends them.
    tasks: Mutex<JoinSet<()>>,
}

/// Last probe result of a holder.
#[derive(Debug)]
enum Known {
    /// It is being probed.
    Soon(watch::Receiver<Option<Probe>>),
    /// It was probed.
    Until(Instant, Probe),
}

#[derive(Debug, Default)]
struct Waiting {
    total: usize,
    by_address: HashMap<IpAddr, usize>,
}

/// A place among those who wait, given back on drop.
#[derive(Debug)]
pub(crate) struct Endpoint {
    waiting: Arc<Mutex<Waiting>>,
    /// Whose share it is taken from.
    from: Option<IpAddr>,
}

/// A bucket of probes that an address may still cause.
#[derive(Clone, Copy, Debug)]
struct Rate {
    left: f64,
    at: Instant,
}

impl Rate {
    fn at(self, now: Instant) -> Self {
        let passed = now.saturating_duration_since(self.at).as_secs_f64();
        let left = (self.left + passed * PROBES_PER_SECOND).min(PROBE_BURST);
        Self { left, at: now }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Probes {
    /// Probes by `network`; `connections` is how many the server takes at once: at most half of them
    /// wait.
    pub(crate) fn new(network: &Network, connections: usize) -> Self {
        Self {
            network: network.clone(),
            permits: Arc::new(Semaphore::new(MAX_PROBES)),
            known: Arc::default(),
            waiting: Arc::default(),
            max_waiting: (connections / 2).max(1),
            rates: Mutex::default(),
            tasks: Mutex::default(),
        }
    }

    /// Returns a place among those who wait, or none if there are too many, or too many from there.
    pub(crate) fn wait(&self, from: IpAddr) -> Option<Endpoint> {
        let most = MAX_WAITING_PER_ADDRESS.min(self.max_waiting.div_ceil(2));
        let mut waiting = lock(&self.waiting);
        if waiting.total >= self.max_waiting {
            return None;
        }
        let own = waiting.by_address.entry(from).or_default();
        if *own >= most {
            return None;
        }
        *own += 1;
        waiting.total += 1;
        Some(Endpoint {
            waiting: self.waiting.clone(),
            from: Some(from),
        })
    }

    /// Returns a place among those who wait for something else, which takes a moment as a rule: no
    /// address has a share of those.
    pub(crate) fn wait_briefly(&self) -> Option<Endpoint> {
        let mut waiting = lock(&self.waiting);
        if waiting.total >= self.max_waiting {
            return None;
        }
        waiting.total += 1;
        Some(Endpoint {
            waiting: self.waiting.clone(),
            from: None,
        })
    }

    /// Probes a holder for `from`, who has a place, or returns what came of it a moment ago.
    pub(crate) async fn probe(&self, _: &Endpoint, from: IpAddr, holder: &Registration) -> Probe {
        loop {
            let (delay, soon) = self.begin(from, holder);
            let mut soon = match soon {
                Some(Known::Until(_, probe)) => return probe,
                Some(Known::Soon(soon)) => soon,
                None => {
                    tokio::time::sleep(delay).await;
                    continue;
                }
            };
            return match soon.wait_for(Option::is_some).await {
                Ok(probe) => probe.clone().unwrap_or(ProbeResult::NoReply.into()),
                // The server ends.
                Err(_) => ProbeResult::NoReply.into(),
            };
        }
    }

    /// Returns what is known of a holder; begins to probe it if that is nothing, unless `from` has to wait.
    fn begin(&self, from: IpAddr, holder: &Registration) -> (Duration, Option<Known>) {
        let now = Instant::now();
        let mut known = lock(&self.known);
        match known.get(holder) {
            Some(Known::Until(until, probe)) if now < *until => {
                return (Duration::ZERO, Some(Known::Until(*until, probe.clone())));
            }
            Some(Known::Soon(soon)) => {
                return (Duration::ZERO, Some(Known::Soon(soon.clone())));
            }
            _ => {}
        }
        let delay = self.delay(now, from);
        if !delay.is_zero() {
            return (delay, None);
        }
        if known.len() >= MAX_RESULTS {
            known.retain(|_, known| !matches!(known, Known::Until(until, _) if *until <= now));
        }
        let (tell, soon) = watch::channel(None);
        known.insert(holder.clone(), Known::Soon(soon.clone()));
        drop(known);
        self.start(holder.clone(), tell);
        (Duration::ZERO, Some(Known::Soon(soon)))
    }

    fn start(&self, holder: Registration, tell: watch::Sender<Option<Probe>>) {
        let (permits, known) = (self.permits.clone(), self.known.clone());
        let network = self.network.clone();
        let probing = async move {
            let _permit = permits.acquire().await;
            let probe = prober::probe(&network, &holder, PROBE_TIMEOUT).await;
            let validity = validity(probe.result);
            {
                let mut known = lock(&known);
                match validity {
                    Some(validity) => {
                        let until = Instant::now() + validity;
                        known.insert(holder, Known::Until(until, probe.clone()));
                    }
                    None => drop(known.remove(&holder)),
                }
            }
            tell.send_replace(Some(probe));
        };
        let mut tasks = lock(&self.tasks);
        while tasks.try_join_next().is_some() {}
        tasks.spawn(probing);
    }

    /// Returns how long `from` has to wait before it may cause another probe; if not at all, it has done so.
    fn delay(&self, now: Instant, from: IpAddr) -> Duration {
        let mut rates = lock(&self.rates);
        if rates.len() >= MAX_RESULTS {
            rates.retain(|_, rate| rate.at(now).left < PROBE_BURST);
        }
        let full = Rate {
            left: PROBE_BURST,
            at: now,
        };
        let rate = rates.entry(from).or_insert(full);
        *rate = rate.at(now);
        if rate.left >= 1.0 {
            rate.left -= 1.0;
            return Duration::ZERO;
        }
        Duration::from_secs_f64((1.0 - rate.left) / PROBES_PER_SECOND)
    }
}

impl Drop for Endpoint {
    fn drop(&mut self) {
        let mut waiting = lock(&self.waiting);
        waiting.total -= 1;
        let Some(from) = self.from else {
            return;
        };
        if let Some(own) = waiting.by_address.get_mut(&from) {
            *own -= 1;
            if *own == 0 {
                waiting.by_address.remove(&from);
            }
        }
    }
}

/// Returns how long the result of a probe counts; none for what makes a name free, which is never taken from an
/// older probe.
fn validity(outcome: ProbeResult) -> Option<Duration> {
    match outcome {
        ProbeResult::Answered => Some(ANSWERED_VALIDITY),
        ProbeResult::NoReply | ProbeResult::Unroutable => Some(UNANSWERED_VALIDITY),
        ProbeResult::Refused | ProbeResult::WrongPort => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(last: u8) -> IpAddr {
        [10, 0, 0, last].into()
    }

    #[test]
    fn one_address_leaves_places_to_others_and_all_leave_half() {
        let probes = Probes::new(&Network::none(), 8);
        let mut places: Vec<_> = (0..3).filter_map(|_| probes.wait(address(1))).collect();
        assert_eq!(places.len(), 2);
        places.extend((0..9).filter_map(|_| probes.wait(address(2))));
        assert_eq!(places.len(), 4);
        assert!(probes.wait(address(3)).is_none());
        places.remove(0);
        assert!(probes.wait(address(2)).is_none() && probes.wait(address(1)).is_some());
        places.clear();
        assert!(lock(&probes.waiting).by_address.is_empty());
        assert!(Probes::new(&Network::none(), 1).wait(address(1)).is_some());
        let brief: Vec<_> = (0..9).map_while(|_| probes.wait_briefly()).collect();
        assert_eq!(brief.len(), 4);
        assert!(probes.wait(address(1)).is_none());
        let large = Probes::new(&Network::none(), 100_000);
        let places: Vec<_> = (0..2000).map_while(|_| large.wait(address(1))).collect();
        assert_eq!(places.len(), MAX_WAITING_PER_ADDRESS);
    }

    #[test]
    fn one_address_causes_so_many_probes_and_no_more() {
        let probes = Probes::new(&Network::none(), 8);
        let now = Instant::now();
        let at_once = (0..1000).take_while(|_| probes.delay(now, address(1)).is_zero());
        assert_eq!(at_once.count(), PROBE_BURST as usize);
        assert!(probes.delay(now, address(2)).is_zero());
        let later = now + Duration::from_secs(1);
        let more = (0..1000).take_while(|_| probes.delay(later, address(1)).is_zero());
        assert_eq!(more.count(), PROBES_PER_SECOND as usize);
    }
}
