//! Handles requests: applies them to the registry, stores the changes, and dispatches their
//! effects.

use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::mpsc;
use tokio::sync::mpsc::error::TrySendError;
use yarp_ports::{Answer, Network};
use yarp_wire::message::{Form, RawText};
use yarp_wire::name_service::{Command, Kind, Registration, Request, UNSUPPORTED_PREFIX};

use crate::name_server::lock;
use crate::prober;
use crate::probes::{Endpoint, Probes};
use crate::registry::{Body, ClaimResult, Effect, Probe, Registry, Reply};
use crate::shared::{self, LeaseForwarder, Precondition, WriterChannel};
use crate::shared_lists::SharedLists;
use crate::store::{Journal, StoreError, StoreResult};

/// Interval between two probes of an owner that may not listen yet.
const OWNER_PROBE_INTERVAL: Duration = Duration::from_millis(50);
/// Maximum number of owners of one name that are probed before a request is refused; each time
/// another request was faster.
const MAX_OWNERS_PROBED: usize = 5;

/// Memory of all registered names and properties, in bytes, above which a list of them is built in
/// turn with other large work of the process.
const LARGE_REGISTRY: usize = 1 << 20;

/// Refusal for a request that other requests overtook too often.
const TOO_MANY_REQUESTS: &str = "too many requests for this name at once, try again";
/// Reply for a client that would have to wait behind too many others.
const MANY_WAIT: &str = "too many wait already, try again";
/// Reply for a browser that requests the name of a port.
const NOT_BY_PAGE: &str = "somebody has this name, and browsers cannot take it";

/// Handles requests from any number of connections.
pub(crate) struct RequestHandler {
    registry: Arc<Mutex<Registry>>,
    persistence: Mutex<Persistence>,
    lists: SharedLists,
    /// Leases that ports renewed at this server, to be forwarded to the other servers.
    leases: Arc<LeaseForwarder>,
    effects: mpsc::Sender<Effect>,
    /// Gives a name to any port that asks for it.
    replace: bool,
    /// Looks at the owners of names that others want.
    probes: Probes,
    /// Network through which ports are reached.
    network: Network,
    /// Time for which a port must have been gone before its name expires; `None` means never.
    expire_after: Option<Duration>,
}

impl std::fmt::Debug for RequestHandler {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RequestHandler").finish_non_exhaustive()
    }
}

/// Storage of the names.
pub(crate) enum Persistence {
    /// In memory only, or no longer anywhere after [`RequestHandler::close`].
    Memory,
    /// In a journal of this server.
    Journal(Journal),
    /// In a store shared with other servers.
    Shared(Arc<WriterChannel>),
}

/// An answer, possibly pending.
enum Handled {
    Now(Body),
    /// To be sent once the changes are stored.
    OnceStored(Body, StoreResult),
}

impl RequestHandler {
    pub(crate) fn new(
        registry: Arc<Mutex<Registry>>,
        persistence: Persistence,
        effects: mpsc::Sender<Effect>,
        replace: bool,
        network: Network,
        expire_after: Option<Duration>,
        connections: usize,
    ) -> Self {
        Self {
            registry,
            persistence: Mutex::new(persistence),
            lists: SharedLists::default(),
            leases: Arc::default(),
            effects,
            replace,
            probes: Probes::new(&network, connections),
            network,
            expire_after,
        }
    }

    pub(crate) fn registry(&self) -> MutexGuard<'_, Registry> {
        lock(&self.registry)
    }

    /// Returns the queue of effects.
    pub(crate) fn effects(&self) -> mpsc::Sender<Effect> {
        self.effects.clone()
    }

    /// Waits until all changes are stored; later changes are not stored.
    pub(crate) fn close(&self) {
        let persistence = std::mem::replace(&mut *self.persistence(), Persistence::Memory);
        drop(persistence);
    }

    fn persistence(&self) -> MutexGuard<'_, Persistence> {
        self.persistence
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the channel to the task that writes the shared store, if names are shared.
    fn writer_channel(&self) -> Option<Arc<WriterChannel>> {
        match &*self.persistence() {
            Persistence::Shared(channel) => Some(channel.clone()),
            _ => None,
        }
    }

    /// Returns the leases that ports renewed at this server.
    pub(crate) fn leases(&self) -> &Arc<LeaseForwarder> {
        &self.leases
    }

    /// Answers one request, a large list in this form; `by_page` tells whether a browser asks.
    pub(crate) fn answer(
        request_handler: &Arc<Self>,
        from: IpAddr,
        by_page: bool,
        form: Form,
        request: Request,
    ) -> Answer {
        if let Some(channel) = request_handler.writer_channel()
            && let Some(answer) =
                Self::answer_shared(request_handler, channel, from, by_page, &request)
        {
            return answer;
        }
        if let Some(answer) = Self::answer_large_list(request_handler, from, form, &request) {
            return answer;
        }
        let mut registry = request_handler.registry();
        match request_handler.claim(&registry, from, &request) {
            ClaimResult::Free => {}
            ClaimResult::Refused(refusal) => return to_answer(Body::refused(&refusal)),
            ClaimResult::Held { .. } if by_page => return to_answer(Body::refusal(NOT_BY_PAGE)),
            ClaimResult::Held {
                holder,
                retry_until,
            } => {
                drop(registry);
                let Some(place) = request_handler.probes.wait(from) else {
                    return to_answer(Body::refusal(MANY_WAIT));
                };
                let request_handler = request_handler.clone();
                return Answer::Later(Box::pin(async move {
                    request_handler
                        .contest(place, from, &request, holder, retry_until)
                        .await
                }));
            }
        }
        match request_handler.perform(&mut registry, Some(from), &request) {
            Handled::Now(body) => to_answer(body),
            Handled::OnceStored(body, kept) => Answer::Later(Box::pin(async move {
                to_answer(once_stored(body, kept, &request).await)
            })),
        }
    }

    /// Returns the answer to a request for a list of a large registry, which takes long to build; `None` for other requests.
    fn answer_large_list(
        request_handler: &Arc<Self>,
        from: IpAddr,
        form: Form,
        request: &Request,
    ) -> Option<Answer> {
        let Kind::Question { lists: true, .. } = request.command.rules().kind else {
            return None;
        };
        let bytes = request_handler.registry().size_bytes();
        if bytes <= LARGE_REGISTRY {
            return None;
        }
        let (request_handler, request) = (request_handler.clone(), request.clone());
        Some(Answer::Later(Box::pin(async move {
            let build = || {
                let mut registry = request_handler.registry();
                registry.handle(Instant::now(), Some(from), &request).body
            };
            let lists = &request_handler.lists;
            let request = request.to_string();
            lists.answer(from, request, form, bytes, build).await
        })))
    }

    /// Returns whether another port holds the name that `request` asks for.
    fn claim(&self, registry: &Registry, from: IpAddr, request: &Request) -> ClaimResult {
        match request.command.rules().kind {
            Kind::Claim(asked) if !self.replace => {
                registry.claim(Instant::now(), Some(from), asked)
            }
            _ => ClaimResult::Free,
        }
    }

    /// Registers a name that another port holds, if a probe shows that this port is gone.
    async fn contest(
        &self,
        place: Endpoint,
        from: IpAddr,
        request: &Request,
        mut holder: Registration,
        mut retry_until: Option<Instant>,
    ) -> Answer {
        let mut refusal = None;
        for _ in 0..MAX_OWNERS_PROBED {
            let how = self.probe_until(&place, from, &holder, retry_until).await;
            let now = Instant::now();
            let done = {
                let mut registry = self.registry();
                match self.claim(&registry, from, request) {
                    ClaimResult::Held {
                        holder: current,
                        retry_until: more,
                    } if current != holder => {
                        (holder, retry_until) = (current, more);
                        continue;
                    }
                    ClaimResult::Refused(refusal) => return to_answer(Body::refused(&refusal)),
                    _ => {}
                }
                refusal = registry.resolve_claim(now, &holder, how);
                match refusal {
                    Some(_) => break,
                    None => self.perform(&mut registry, Some(from), request),
                }
            };
            return to_answer(match done {
                Handled::Now(body) => body,
                Handled::OnceStored(body, kept) => once_stored(body, kept, request).await,
            });
        }
        to_answer(match refusal {
            Some(refusal) => Body::refused(&refusal),
            None => Body::refusal(TOO_MANY_REQUESTS),
        })
    }

    /// Answers a request as one of several servers; returns `None` if the shared store is not
    /// involved.
    fn answer_shared(
        request_handler: &Arc<Self>,
        channel: Arc<WriterChannel>,
        from: IpAddr,
        by_page: bool,
        request: &Request,
    ) -> Option<Answer> {
        let rules = request.command.rules();
        if let Kind::Lease {
            holders,
            passed: false,
        } = rules.kind
        {
            request_handler
                .leases
                .record(&request_handler.registry(), from, holders);
            let Some(place) = request_handler.probes.wait_briefly() else {
                return Some(to_answer(refused_by_this_server(request, MANY_WAIT)));
            };
            let request = request.clone();
            let request_handler = request_handler.clone();
            return Some(Answer::Later(Box::pin(async move {
                let _place = place;
                to_answer(request_handler.lease(&channel, from, &request).await)
            })));
        }
        if !rules.changes() {
            let reason = channel.staleness_error()?;
            return Some(to_answer(refused_by_this_server(request, &reason)));
        }
        // Each server keeps its own port to itself.
        if let Kind::Change { port: Some(name) } = rules.kind
            && request_handler.registry().is_ours(name)
        {
            return None;
        }
        let Some(place) = request_handler.probes.wait_briefly() else {
            return Some(to_answer(refused_by_this_server(request, MANY_WAIT)));
        };
        let request = request.clone();
        let request_handler = request_handler.clone();
        Some(Answer::Later(Box::pin(async move {
            let _place = place;
            to_answer(
                request_handler
                    .change_shared(&channel, from, by_page, request)
                    .await,
            )
        })))
    }

    /// Commits a change to the shared store.
    async fn change_shared(
        &self,
        channel: &WriterChannel,
        from: IpAddr,
        by_page: bool,
        request: Request,
    ) -> Body {
        let mut gone = None;
        let mut place = None;
        for _ in 0..MAX_OWNERS_PROBED {
            let precondition = match request.command.rules().kind {
                Kind::Claim(_) => Precondition::NameFree(gone),
                _ => Precondition::Always,
            };
            let outcome = channel
                .perform(Some(from), Some(request.clone()), precondition)
                .await;
            let (holder, retry_until) = match outcome {
                shared::WriteOutcome::Done(body) => return body,
                shared::WriteOutcome::Refused(refusal) => return Body::refused(&refusal),
                shared::WriteOutcome::Failed(reason) => {
                    return refused_by_this_server(&request, &reason);
                }
                shared::WriteOutcome::Held {
                    holder,
                    retry_until,
                } => (holder, retry_until),
            };
            if by_page {
                return Body::refusal(NOT_BY_PAGE);
            }
            // From the first look on it waits for others.
            let Some(place) = place.get_or_insert_with(|| self.probes.wait(from)) else {
                return Body::refusal(MANY_WAIT);
            };
            let how = self.probe_until(place, from, &holder, retry_until).await;
            let refusal = self.registry().resolve_claim(Instant::now(), &holder, how);
            if let Some(refusal) = refusal {
                return Body::refused(&refusal);
            }
            gone = Some(holder);
        }
        Body::refusal(TOO_MANY_REQUESTS)
    }

    /// Renews leases. Before it reports a port as not registered, it catches up with the shared
    /// store, because the port would give up its name.
    async fn lease(&self, channel: &WriterChannel, from: IpAddr, request: &Request) -> Body {
        let renew = || {
            let now = Instant::now();
            self.registry().handle(now, Some(from), request).body
        };
        let body = renew();
        let all = match &body {
            Body::Lines(lines) => !lines
                .iter()
                .any(|line| line.starts_with("lost ") || line.starts_with("taken ")),
            Body::Bottle(_) => true,
        };
        if all {
            return body;
        }
        match channel.perform(None, None, Precondition::Always).await {
            shared::WriteOutcome::Failed(reason) => refused_by_this_server(request, &reason),
            _ => renew(),
        }
    }

    /// Probes an owner, repeatedly until `retry_until` if it may not listen yet.
    async fn probe_until(
        &self,
        place: &Endpoint,
        from: IpAddr,
        holder: &Registration,
        retry_until: Option<Instant>,
    ) -> Probe {
        let mut how = self.probes.probe(place, from, holder).await;
        while prober::is_not_there(&how) && retry_until.is_some_and(|until| Instant::now() < until)
        {
            tokio::time::sleep(OWNER_PROBE_INTERVAL).await;
            how = self.probes.probe(place, from, holder).await;
        }
        how
    }

    /// Returns the network through which ports are reached.
    pub(crate) fn network(&self) -> &Network {
        &self.network
    }

    /// Records the result of a probe, and drops the port if it has expired.
    pub(crate) fn record_probe(&self, port: &Registration, probe: Probe) {
        let now = Instant::now();
        let drop = self
            .registry()
            .record_probe(now, self.expire_after, port, probe);
        if drop {
            self.expire_port(port);
        }
    }

    /// Unregisters a port that has expired, unless its address changed.
    fn expire_port(&self, port: &Registration) {
        let name = port.name.clone();
        let request = Request::plain(Command::Unregister { name });
        if let Some(channel) = self.writer_channel() {
            let port = port.clone();
            tokio::spawn(async move {
                let unmoved = Precondition::Unmoved(port.clone());
                // The error is ignored, as below.
                let outcome = channel.perform(None, Some(request), unmoved).await;
                // The answer is empty if the address changed.
                if let shared::WriteOutcome::Done(Body::Lines(lines)) = outcome
                    && !lines.is_empty()
                {
                    tracing::info!(
                        "{} expired: the port has been gone for too long, its name is free",
                        port.name
                    );
                }
            });
            return;
        }
        let mut registry = self.registry();
        if registry.find(&port.name).as_ref() == Some(port) {
            tracing::info!(
                "{} expired: the port has been gone for too long, its name is free",
                port.name
            );
            // If the change cannot be stored, the port expires again after the next probe.
            let _ = self.perform(&mut registry, None, &request);
        }
    }

    /// Applies a request. The answer must not be sent before the changes are stored.
    fn perform(&self, registry: &mut Registry, from: Option<IpAddr>, request: &Request) -> Handled {
        let Reply {
            body,
            effects,
            changes,
        } = registry.handle(Instant::now(), from, request);
        let persistence = match changes.is_empty() {
            false => self.persistence(),
            true => {
                dispatch_effects(&self.effects, effects);
                return Handled::Now(body);
            }
        };
        let Persistence::Journal(journal) = &*persistence else {
            dispatch_effects(&self.effects, effects);
            return Handled::Now(body);
        };
        let listeners = self.effects.clone();
        let kept = journal.append(changes, move || dispatch_effects(&listeners, effects));
        Handled::OnceStored(body, kept)
    }
}

/// Returns the answer once its changes are stored, or an error if they are not.
async fn once_stored(body: Body, kept: StoreResult, request: &Request) -> Body {
    let error = match kept.await {
        Ok(Ok(())) => return body,
        Ok(Err(error)) => error,
        Err(_) => Arc::new(StoreError::Ended),
    };
    refused(
        request,
        &format!("the name server cannot store the change: {error}"),
    )
}

/// Returns a refusal that concerns this server only: another server of the same names may accept
/// the request.
fn refused_by_this_server(request: &Request, reason: &str) -> Body {
    let said = UNSUPPORTED_PREFIX.trim_start_matches("refused: ");
    refused(request, &format!("{said}: {reason}"))
}

/// Returns a refusal in the form that the request expects.
fn refused(request: &Request, reason: &str) -> Body {
    match request.command.rules().structured {
        true => Body::failure(reason),
        false => Body::refusal(reason),
    }
}

/// Hands on what requests cause besides their answers.
pub(crate) fn dispatch_effects(listeners: &mpsc::Sender<Effect>, effects: Vec<Effect>) {
    let all = effects.len();
    let dropped = hand_on(listeners, effects);
    if dropped > 0 {
        tracing::warn!(
            "too much happens at once: {dropped} of {all} things that a request causes are not done"
        );
    }
}

/// Tells how many there was no room for.
fn hand_on(listeners: &mpsc::Sender<Effect>, effects: Vec<Effect>) -> usize {
    let all = effects.len();
    for (done, effect) in effects.into_iter().enumerate() {
        match listeners.try_send(effect) {
            Ok(()) => {}
            // The server ends, and so do its connections and who reads from it.
            Err(TrySendError::Closed(_)) => return 0,
            Err(TrySendError::Full(_)) => return all - done,
        }
    }
    0
}

fn to_answer(body: Body) -> Answer {
    match body {
        Body::Bottle(bottle) => Answer::reply(bottle),
        lines @ Body::Lines(_) => Answer::reply(RawText(lines.into_text())),
    }
}

#[cfg(test)]
mod tests {
    use bytes::BytesMut;

    use super::*;
    use crate::registry::Settings;

    /// Lists of thousands of long names, asked for over many connections at once, kept other clients waiting.
    #[tokio::test]
    async fn a_list_of_a_large_registry_is_built_in_turn() {
        let (effects, _listener) = mpsc::channel(10_000);
        let network = Network::at("127.0.0.1", 9);
        let registry = Registry::new(Settings::at("127.0.0.1", 9));
        let registry = Arc::new(Mutex::new(registry));
        let memory = Persistence::Memory;
        let handler = RequestHandler::new(registry, memory, effects, false, network, None, 100);
        let handler = Arc::new(handler);
        let from = IpAddr::from([127, 0, 0, 1]);
        let answer = |line: &str| {
            let request = Request::parse(line).unwrap();
            RequestHandler::answer(&handler, from, false, Form::Text, request)
        };
        let long = "n".repeat(900);
        let mut count = 0;
        while handler.registry().size_bytes() <= LARGE_REGISTRY {
            assert!(matches!(answer("list"), Answer::Reply(_)), "{count} names");
            answer(&format!("register /{count}/{long} tcp 127.0.0.1 9"));
            count += 1;
        }
        assert!(count > 100, "{count} names");
        assert!(matches!(answer("query /0"), Answer::Reply(_)));
        for line in ["list", "bot list", "state", "runners", "topic", "subscribe"] {
            let Answer::Later(later) = answer(line) else {
                panic!("{line} was answered at once");
            };
            let Answer::Reply(reply) = later.await else {
                panic!("no reply to {line}");
            };
            let mut text = BytesMut::new();
            reply.write_text(&mut text);
            let request = Request::parse(line).unwrap();
            let body = handler
                .registry()
                .handle(Instant::now(), Some(from), &request)
                .body;
            assert_eq!(text, body.into_text(), "{line}");
        }
    }

    /// A server that ended warned that too much happened.
    #[test]
    fn what_nobody_waits_for_is_not_missed() {
        let effects = || vec![Effect::Added("/a".to_owned()); 3];
        let (listeners, waiting) = mpsc::channel(2);
        assert_eq!(hand_on(&listeners, effects()), 1);
        drop(waiting);
        assert_eq!(hand_on(&listeners, effects()), 0);
    }
}
