//! Where requests are answered: the registry, the journal, and who else is told.

use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::{Semaphore, mpsc};
use yarp_ports::{Answer, Network};
use yarp_wire::message::RawText;
use yarp_wire::name_service::{Command, Registration, Request, UNSUPPORTED_PREFIX};

use crate::registry::{Body, Claim, Effect, Look, Registry, Reply};
use crate::server::lock;
use crate::shared::{self, Leases, Line, May};
use crate::store::{Journal, Kept, StoreError};
use crate::watch;

/// How long the owner of a name that somebody else wants has to answer.
const OWNER: Duration = Duration::from_secs(2);
/// Time between two looks at an owner that may not listen yet.
const AGAIN: Duration = Duration::from_millis(50);
/// Owners that are looked at at once, whoever wants their names.
const LOOKS: usize = 64;
/// Owners of one name that are looked at before the request is refused: each time somebody else was
/// faster.
const OWNERS: usize = 5;

/// What to tell somebody who was overtaken by others too often.
const CROWDED: &str = "many ask for this name at once, try again";

/// Takes requests from any number of connections.
pub(crate) struct Desk {
    registry: Arc<Mutex<Registry>>,
    keeping: Mutex<Keeping>,
    /// What ports have told this server alone, if there are others.
    leases: Arc<Leases>,
    effects: mpsc::Sender<Effect>,
    /// Whether a name goes to whoever asks for it.
    replace: bool,
    /// Owners that may be looked at at once.
    looks: Semaphore,
    /// How ports are spoken with.
    network: Network,
    /// How long a port must have been gone to be dropped; none if that never happens.
    drop_after: Option<Duration>,
}

impl std::fmt::Debug for Desk {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Desk").finish_non_exhaustive()
    }
}

/// Where names are kept.
pub(crate) enum Keeping {
    /// Nowhere, or nowhere any more.
    Nowhere,
    /// By this server alone.
    Journal(Journal),
    /// Together with other servers.
    Shared(Arc<Line>),
}

/// An answer that may have to wait.
enum Done {
    Now(Body),
    /// Once it is kept.
    Kept(Body, Kept),
}

impl Desk {
    pub(crate) fn new(
        registry: Arc<Mutex<Registry>>,
        keeping: Keeping,
        effects: mpsc::Sender<Effect>,
        replace: bool,
        network: Network,
        drop_after: Option<Duration>,
    ) -> Self {
        Self {
            registry,
            keeping: Mutex::new(keeping),
            leases: Arc::default(),
            effects,
            replace,
            looks: Semaphore::new(LOOKS),
            network,
            drop_after,
        }
    }

    pub(crate) fn registry(&self) -> MutexGuard<'_, Registry> {
        lock(&self.registry)
    }

    /// The registry, for who changes it besides.
    pub(crate) fn shared_registry(&self) -> Arc<Mutex<Registry>> {
        self.registry.clone()
    }

    /// Who sees to what requests cause.
    pub(crate) fn effects(&self) -> mpsc::Sender<Effect> {
        self.effects.clone()
    }

    /// Waits until everything is kept; what is asked later is not.
    pub(crate) fn close(&self) {
        let keeping = std::mem::replace(&mut *self.keeping(), Keeping::Nowhere);
        drop(keeping);
    }

    fn keeping(&self) -> MutexGuard<'_, Keeping> {
        self.keeping.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The way to what is shared with other servers, if names are.
    fn line(&self) -> Option<Arc<Line>> {
        match &*self.keeping() {
            Keeping::Shared(line) => Some(line.clone()),
            _ => None,
        }
    }

    /// What ports have told this server alone.
    pub(crate) fn leases(&self) -> &Arc<Leases> {
        &self.leases
    }

    /// Answers one request.
    pub(crate) fn answer(desk: &Arc<Self>, from: IpAddr, request: Request) -> Answer {
        if let Some(line) = desk.line()
            && let Some(answer) = Self::answer_together(desk, line, from, &request)
        {
            return answer;
        }
        let mut registry = desk.registry();
        match desk.claim(&registry, &request) {
            Claim::Free => {}
            Claim::Refused(refusal) => return put(Body::refused(&refusal)),
            Claim::Held { holder, patience } => {
                drop(registry);
                let desk = desk.clone();
                return Answer::Later(Box::pin(async move {
                    desk.contest(from, &request, holder, patience).await
                }));
            }
        }
        match desk.perform(&mut registry, Some(from), &request) {
            Done::Now(body) => put(body),
            Done::Kept(body, kept) => {
                Answer::Later(Box::pin(
                    async move { put(settled(body, kept, &request).await) },
                ))
            }
        }
    }

    /// Whether somebody else has the name that `request` wants.
    fn claim(&self, registry: &Registry, request: &Request) -> Claim {
        match &request.command {
            Command::Register(asked) if !self.replace => registry.claim(Instant::now(), asked),
            _ => Claim::Free,
        }
    }

    /// Registers a name that somebody has, if that one turns out not to be there.
    async fn contest(
        &self,
        from: IpAddr,
        request: &Request,
        mut holder: Registration,
        mut patience: Option<Instant>,
    ) -> Answer {
        let mut refusal = None;
        for _ in 0..OWNERS {
            let how = self.look_patiently(&holder, patience).await;
            let now = Instant::now();
            let done = {
                let mut registry = self.registry();
                match self.claim(&registry, request) {
                    Claim::Held {
                        holder: current,
                        patience: more,
                    } if current != holder => {
                        (holder, patience) = (current, more);
                        continue;
                    }
                    Claim::Refused(refusal) => return put(Body::refused(&refusal)),
                    _ => {}
                }
                refusal = registry.judge(now, &holder, how);
                match refusal {
                    Some(_) => break,
                    None => self.perform(&mut registry, Some(from), request),
                }
            };
            return put(match done {
                Done::Now(body) => body,
                Done::Kept(body, kept) => settled(body, kept, request).await,
            });
        }
        put(match refusal {
            Some(refusal) => Body::refused(&refusal),
            None => Body::refusal(CROWDED),
        })
    }

    /// The answer of one of several servers, or none if the others have nothing to do with it.
    fn answer_together(
        desk: &Arc<Self>,
        line: Arc<Line>,
        from: IpAddr,
        request: &Request,
    ) -> Option<Answer> {
        let command = &request.command;
        if let Command::Lease { holders } = command {
            desk.leases.note(&desk.registry(), holders);
            let request = request.clone();
            let desk = desk.clone();
            return Some(Answer::Later(Box::pin(async move {
                put(desk.lease(&line, from, &request).await)
            })));
        }
        if !shared::is_change(command) {
            let reason = line.is_stale()?;
            return Some(put(elsewhere(request, &reason)));
        }
        let own = match command {
            Command::Set { name, .. }
            | Command::Announce { name, .. }
            | Command::Unregister { name } => desk.registry().is_ours(name),
            _ => false,
        };
        if own {
            return None;
        }
        let request = request.clone();
        let desk = desk.clone();
        Some(Answer::Later(Box::pin(async move {
            put(desk.change(&line, from, request).await)
        })))
    }

    /// Has a change done that all servers see.
    async fn change(&self, line: &Line, from: IpAddr, request: Request) -> Body {
        let mut gone = None;
        for _ in 0..OWNERS {
            let may = match request.command {
                Command::Register(_) => May::Displace(gone),
                _ => May::Always,
            };
            let outcome = line.perform(Some(from), Some(request.clone()), may).await;
            let (holder, patience) = match outcome {
                shared::Outcome::Done(body) => return body,
                shared::Outcome::Refused(refusal) => return Body::refused(&refusal),
                shared::Outcome::Failed(reason) => return elsewhere(&request, &reason),
                shared::Outcome::Held { holder, patience } => (holder, patience),
            };
            let how = self.look_patiently(&holder, patience).await;
            let refusal = self.registry().judge(Instant::now(), &holder, how);
            if let Some(refusal) = refusal {
                return Body::refused(&refusal);
            }
            gone = Some(holder);
        }
        Body::refusal(CROWDED)
    }

    /// Renews leases. That a port is not registered is said only by who is up to date: the port would
    /// give up its name.
    async fn lease(&self, line: &Line, from: IpAddr, request: &Request) -> Body {
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
        match line.perform(None, None, May::Always).await {
            shared::Outcome::Failed(reason) => elsewhere(request, &reason),
            _ => renew(),
        }
    }

    /// Looks at an owner, again and again if it may not listen yet.
    async fn look_patiently(&self, holder: &Registration, patience: Option<Instant>) -> Look {
        let mut how = self.look(holder).await;
        while watch::is_gone(&how) && patience.is_some_and(|until| Instant::now() < until) {
            tokio::time::sleep(AGAIN).await;
            how = self.look(holder).await;
        }
        how
    }

    /// Looks at an owner, once there is room for it.
    async fn look(&self, holder: &Registration) -> Look {
        let _room = self.looks.acquire().await;
        watch::look(&self.network, holder, OWNER).await
    }

    /// How ports are spoken with.
    pub(crate) fn network(&self) -> &Network {
        &self.network
    }

    /// Takes note of what came of looking at a port, and drops it if it has been gone for long.
    pub(crate) fn note(&self, port: &Registration, look: Look) {
        let now = Instant::now();
        let drop = self.registry().seen(now, self.drop_after, port, look);
        if drop {
            self.drop_port(port);
        }
    }

    /// Forgets a port that is gone, unless it has moved.
    fn drop_port(&self, port: &Registration) {
        let name = port.name.clone();
        let request = Request::plain(Command::Unregister { name });
        if let Some(line) = self.line() {
            let port = port.clone();
            tokio::spawn(async move {
                let drop = May::Drop(port.clone());
                // As below.
                let outcome = line.perform(None, Some(request), drop).await;
                // Nothing is said of one that has moved.
                if let shared::Outcome::Done(Body::Lines(lines)) = outcome
                    && !lines.is_empty()
                {
                    tracing::info!("{} has been gone for long, its name is free", port.name);
                }
            });
            return;
        }
        let mut registry = self.registry();
        if registry.find(&port.name).as_ref() == Some(port) {
            tracing::info!("{} has been gone for long, its name is free", port.name);
            // If it cannot be kept, it will be gone the next time as well.
            let _ = self.perform(&mut registry, None, &request);
        }
    }

    /// Does as asked. The answer must not go out before what changed is kept.
    fn perform(&self, registry: &mut Registry, from: Option<IpAddr>, request: &Request) -> Done {
        let Reply {
            body,
            effects,
            changes,
        } = registry.handle(Instant::now(), from, request);
        let keeping = match changes.is_empty() {
            false => self.keeping(),
            true => {
                tell(&self.effects, effects);
                return Done::Now(body);
            }
        };
        let Keeping::Journal(journal) = &*keeping else {
            tell(&self.effects, effects);
            return Done::Now(body);
        };
        let listeners = self.effects.clone();
        let kept = journal.keep(changes, move || tell(&listeners, effects));
        Done::Kept(body, kept)
    }
}

/// The answer once its changes are kept, or why they are not.
async fn settled(body: Body, kept: Kept, request: &Request) -> Body {
    let error = match kept.await {
        Ok(Ok(())) => return body,
        Ok(Err(error)) => error,
        Err(_) => Arc::new(StoreError::Ended),
    };
    refused(request, &format!("the name server cannot keep it: {error}"))
}

/// A refusal that is about this server: another one of the same names may do it.
fn elsewhere(request: &Request, reason: &str) -> Body {
    let said = UNSUPPORTED_PREFIX.trim_start_matches("refused: ");
    refused(request, &format!("{said}: {reason}"))
}

/// A refusal in the form in which the request is answered.
fn refused(request: &Request, reason: &str) -> Body {
    match request.command.is_structured() {
        true => Body::failure(reason),
        false => Body::refusal(reason),
    }
}

pub(crate) fn tell(listeners: &mpsc::Sender<Effect>, effects: Vec<Effect>) {
    for effect in effects {
        if let Err(error) = listeners.try_send(effect) {
            tracing::warn!("too much happens at once, one thing is not done: {error}");
        }
    }
}

fn put(body: Body) -> Answer {
    match body {
        Body::Bottle(bottle) => Answer::reply(bottle),
        lines @ Body::Lines(_) => Answer::reply(RawText(lines.to_text())),
    }
}
