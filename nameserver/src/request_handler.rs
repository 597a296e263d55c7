//! Handles requests: applies them to the registry, stores the changes, and dispatches their
//! effects.

use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::{Semaphore, mpsc};
use yarp_ports::{Answer, Network};
use yarp_wire::message::RawText;
use yarp_wire::name_service::{Command, Registration, Request, UNSUPPORTED_PREFIX};

use crate::name_server::lock;
use crate::prober;
use crate::registry::{Body, ClaimResult, Effect, Probe, Registry, Reply};
use crate::shared::{self, LeaseForwarder, Precondition, WriterChannel};
use crate::store::{Journal, StoreError, StoreResult};

/// Timeout for probing the owner of a name that another port asks for.
const OWNER_PROBE_TIMEOUT: Duration = Duration::from_secs(2);
/// Interval between two probes of an owner that may not listen yet.
const OWNER_PROBE_INTERVAL: Duration = Duration::from_millis(50);
/// Maximum number of owners that are probed concurrently.
const MAX_CONCURRENT_OWNER_PROBES: usize = 64;
/// Maximum number of owners of one name that are probed before a request is refused; each time
/// another request was faster.
const MAX_OWNERS_PROBED: usize = 5;

/// Refusal for a request that other requests overtook too often.
const TOO_MANY_REQUESTS: &str = "too many requests for this name at once, try again";

/// Handles requests from any number of connections.
pub(crate) struct RequestHandler {
    registry: Arc<Mutex<Registry>>,
    persistence: Mutex<Persistence>,
    /// LeaseForwarder that ports renewed at this server, to be forwarded to the other servers.
    leases: Arc<LeaseForwarder>,
    effects: mpsc::Sender<Effect>,
    /// Gives a name to any port that asks for it.
    replace: bool,
    /// Permits for concurrent probes of owners.
    probe_permits: Semaphore,
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

/// Where names are kept.
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
    ) -> Self {
        Self {
            registry,
            persistence: Mutex::new(persistence),
            leases: Arc::default(),
            effects,
            replace,
            probe_permits: Semaphore::new(MAX_CONCURRENT_OWNER_PROBES),
            network,
            expire_after,
        }
    }

    pub(crate) fn registry(&self) -> MutexGuard<'_, Registry> {
        lock(&self.registry)
    }

    /// Returns the registry, for other tasks that change it.
    pub(crate) fn shared_registry(&self) -> Arc<Mutex<Registry>> {
        self.registry.clone()
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

    /// Answers one request.
    pub(crate) fn answer(request_handler: &Arc<Self>, from: IpAddr, request: Request) -> Answer {
        if let Some(channel) = request_handler.writer_channel()
            && let Some(answer) = Self::answer_shared(request_handler, channel, from, &request)
        {
            return answer;
        }
        let mut registry = request_handler.registry();
        match request_handler.claim(&registry, &request) {
            ClaimResult::Free => {}
            ClaimResult::Refused(refusal) => return to_answer(Body::refused(&refusal)),
            ClaimResult::Held {
                holder,
                retry_until,
            } => {
                drop(registry);
                let request_handler = request_handler.clone();
                return Answer::Later(Box::pin(async move {
                    request_handler
                        .contest(from, &request, holder, retry_until)
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

    /// Returns whether another port holds the name that `request` asks for.
    fn claim(&self, registry: &Registry, request: &Request) -> ClaimResult {
        match &request.command {
            Command::Register(asked) if !self.replace => registry.claim(Instant::now(), asked),
            _ => ClaimResult::Free,
        }
    }

    /// Registers a name that another port holds, if a probe shows that this port is gone.
    async fn contest(
        &self,
        from: IpAddr,
        request: &Request,
        mut holder: Registration,
        mut retry_until: Option<Instant>,
    ) -> Answer {
        let mut refusal = None;
        for _ in 0..MAX_OWNERS_PROBED {
            let how = self.probe_until(&holder, retry_until).await;
            let now = Instant::now();
            let done = {
                let mut registry = self.registry();
                match self.claim(&registry, request) {
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
        request: &Request,
    ) -> Option<Answer> {
        let command = &request.command;
        if let Command::Lease { holders } = command {
            request_handler
                .leases
                .record(&request_handler.registry(), holders);
            let request = request.clone();
            let request_handler = request_handler.clone();
            return Some(Answer::Later(Box::pin(async move {
                to_answer(request_handler.lease(&channel, from, &request).await)
            })));
        }
        if !shared::is_change(command) {
            let reason = channel.staleness_error()?;
            return Some(to_answer(refused_by_this_server(request, &reason)));
        }
        let own = match command {
            Command::Set { name, .. }
            | Command::Announce { name, .. }
            | Command::Unregister { name } => request_handler.registry().is_ours(name),
            _ => false,
        };
        if own {
            return None;
        }
        let request = request.clone();
        let request_handler = request_handler.clone();
        Some(Answer::Later(Box::pin(async move {
            to_answer(request_handler.change_shared(&channel, from, request).await)
        })))
    }

    /// Commits a change to the shared store.
    async fn change_shared(&self, channel: &WriterChannel, from: IpAddr, request: Request) -> Body {
        let mut gone = None;
        for _ in 0..MAX_OWNERS_PROBED {
            let precondition = match request.command {
                Command::Register(_) => Precondition::NameFree(gone),
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
            let how = self.probe_until(&holder, retry_until).await;
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
    async fn probe_until(&self, holder: &Registration, retry_until: Option<Instant>) -> Probe {
        let mut how = self.probe(holder).await;
        while prober::is_not_there(&how) && retry_until.is_some_and(|until| Instant::now() < until)
        {
            tokio::time::sleep(OWNER_PROBE_INTERVAL).await;
            how = self.probe(holder).await;
        }
        how
    }

    /// Probes an owner as soon as a permit is free.
    async fn probe(&self, holder: &Registration) -> Probe {
        let _room = self.probe_permits.acquire().await;
        prober::probe(&self.network, holder, OWNER_PROBE_TIMEOUT).await
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
    match request.command.is_structured() {
        true => Body::failure(reason),
        false => Body::refusal(reason),
    }
}

pub(crate) fn dispatch_effects(listeners: &mpsc::Sender<Effect>, effects: Vec<Effect>) {
    for effect in effects {
        if let Err(error) = listeners.try_send(effect) {
            tracing::warn!("the effect queue is full, one effect is dropped: {error}");
        }
    }
}

fn to_answer(body: Body) -> Answer {
    match body {
        Body::Bottle(bottle) => Answer::reply(bottle),
        lines @ Body::Lines(_) => Answer::reply(RawText(lines.to_text())),
    }
}
