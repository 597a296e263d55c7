//! Persistent connections that are due, made and ended a few at a time.
//!
//! Of equal requests for the same two ports one is done; of different ones the last, after the one that
//! is under way.

use std::collections::{HashMap, VecDeque};
use std::future::Future;

use tokio::task::JoinSet;
use yarp_ports::{Network, remote_admin};
use yarp_wire::name_service::Registration;

use crate::registry::Link;

/// Connections that are made or ended at once.
const MAX_TASKS: usize = 64;
/// Connections that are waited for; what is due beyond that is not done.
const MAX_PENDING: usize = 8192;

/// Action that is due for two ports.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(crate) enum Due {
    /// To connect them, unless they are.
    Connect(Link),
    /// To end their connection.
    Disconnect(Link),
}

/// The two ports, the writer first.
type Ends = (Registration, Registration);

impl Due {
    fn ends(&self) -> Ends {
        let (Self::Connect(link) | Self::Disconnect(link)) = self;
        (link.source.clone(), link.destination.clone())
    }

    /// Does it by `network`.
    pub(crate) async fn by(self, network: Network) {
        match self {
            Self::Connect(link) => connect(network, link).await,
            Self::Disconnect(link) => disconnect(network, link).await,
        }
    }
}

/// State of an action for two ports.
#[derive(Debug)]
enum Pending {
    /// It waits for its turn.
    Waits(Due),
    /// This is being done, and that afterwards.
    Runs(Due, Option<Due>),
}

/// Connections that are due, and the tasks that make them.
#[derive(Debug)]
pub(crate) struct Links {
    pending: HashMap<Ends, Pending>,
    /// Those who wait, in the order in which they came.
    queue: VecDeque<Ends>,
    tasks: JoinSet<Ends>,
}

impl Links {
    pub(crate) fn new() -> Self {
        Self {
            pending: HashMap::new(),
            queue: VecDeque::new(),
            tasks: JoinSet::new(),
        }
    }

    /// Takes note of what is due; tells whether there is room for it.
    pub(crate) fn add(&mut self, due: Due) -> bool {
        let ends = due.ends();
        let is_full = self.pending.len() >= MAX_PENDING;
        match self.pending.get_mut(&ends) {
            Some(Pending::Waits(waits)) => *waits = due,
            Some(Pending::Runs(runs, next)) => *next = (*runs != due).then_some(due),
            None if is_full => return false,
            None => {
                self.pending.insert(ends.clone(), Pending::Waits(due));
                self.queue.push_back(ends);
            }
        }
        true
    }

    /// Starts those whose turn it is.
    pub(crate) fn start<F>(&mut self, task: impl Fn(Due) -> F)
    where
        F: Future<Output = ()> + Send + 'static,
    {
        while self.tasks.len() < MAX_TASKS
            && let Some(ends) = self.queue.pop_front()
        {
            if let Some(Pending::Waits(due)) = self.pending.remove(&ends) {
                let doing = task(due.clone());
                self.pending.insert(ends.clone(), Pending::Runs(due, None));
                self.tasks.spawn(async move {
                    doing.await;
                    ends
                });
            }
        }
    }

    /// Waits for the end of one that was started; for ever if none was.
    pub(crate) async fn end_one(&mut self) {
        let Some(ended) = self.tasks.join_next().await else {
            return std::future::pending().await;
        };
        // One that panicked is never done again for the same ports.
        let Ok(ends) = ended else {
            return;
        };
        if let Some(Pending::Runs(_, Some(next))) = self.pending.remove(&ends) {
            self.add(next);
        }
    }
}

/// Makes a persistent connection, unless it is there.
async fn connect(network: Network, link: Link) {
    let (source, destination) = (&link.source, &link.destination);
    let known = remote_admin::connection(&network, source, &destination.name).await;
    if matches!(known, Ok(Some(_))) {
        return;
    }
    let carrier = Some(link.carrier.as_str());
    let made = remote_admin::connect(&network, &source.name, &destination.name, carrier).await;
    if let Err(error) = made {
        let (from, to) = (&source.name, &destination.name);
        tracing::warn!(from, to, "a persistent connection was not made: {error}");
    }
}

/// Ends a persistent connection.
async fn disconnect(network: Network, link: Link) {
    let request = yarp_wire::admin::remove(&link.destination.name);
    // A port that is gone has no connections left to end.
    let _ = remote_admin::administer(&network, &link.source, &request).await;
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::Mutex;

    use tokio::sync::Semaphore;

    use super::*;

    fn link(index: usize) -> Link {
        let port = |name: &str| {
            format!("registration name {name} ip h port 1 type tcp")
                .parse()
                .unwrap()
        };
        Link {
            source: port(&format!("/{index}")),
            destination: port("/reader"),
            carrier: "tcp".to_owned(),
        }
    }

    /// Started action, and the handle that ends it.
    #[derive(Clone)]
    struct Done {
        begun: Arc<Mutex<Vec<Due>>>,
        may_end: Arc<Semaphore>,
    }

    impl Done {
        fn new() -> Self {
            Self {
                begun: Arc::default(),
                may_end: Arc::new(Semaphore::new(0)),
            }
        }

        fn start(&self, links: &mut Links) {
            links.start(|due| {
                let done = self.clone();
                done.begun.lock().unwrap().push(due);
                async move { done.may_end.acquire().await.unwrap().forget() }
            });
        }

        async fn end_all(&self, links: &mut Links) {
            while !links.tasks.is_empty() {
                self.may_end.add_permits(1);
                links.end_one().await;
                self.start(links);
            }
        }
    }

    #[tokio::test]
    async fn equal_ones_are_done_once_and_few_at_a_time() {
        let (mut links, done) = (Links::new(), Done::new());
        for _ in 0..3 {
            for index in 0..200 {
                assert!(links.add(Due::Connect(link(index))));
            }
            done.start(&mut links);
            assert_eq!(links.tasks.len(), MAX_TASKS);
        }
        done.end_all(&mut links).await;
        assert_eq!(done.begun.lock().unwrap().len(), 200);
        assert!(links.pending.is_empty() && links.queue.is_empty());
    }

    #[tokio::test]
    async fn the_last_of_different_ones_is_done_after_the_first() {
        let (mut links, done) = (Links::new(), Done::new());
        links.add(Due::Connect(link(0)));
        done.start(&mut links);
        for _ in 0..3 {
            links.add(Due::Connect(link(0)));
            links.add(Due::Disconnect(link(0)));
        }
        done.start(&mut links);
        assert_eq!(links.tasks.len(), 1);
        done.end_all(&mut links).await;
        let expected = [Due::Connect(link(0)), Due::Disconnect(link(0))];
        assert_eq!(*done.begun.lock().unwrap(), expected);
    }

    #[tokio::test]
    async fn what_there_is_no_room_for_is_not_done() {
        let mut links = Links::new();
        let added = (0..MAX_PENDING + 10).filter(|index| links.add(Due::Connect(link(*index))));
        assert_eq!(added.count(), MAX_PENDING);
    }
}
