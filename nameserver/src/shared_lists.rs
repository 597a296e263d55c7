//! Lists of a large registry, each built once for all who wait for it.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

use tokio::sync::{OnceCell, OwnedSemaphorePermit, Semaphore};
use yarp_ports::{Answer, SharedReply, run_large};
use yarp_wire::message::{Form, RawText};

use crate::registry::Body;

/// Lists that clients wait for and whose building has not begun, by the address of the clients, the request and the form of
/// the reply.
///
/// A list is as new as if it were built for each client: whoever asks later waits for another one. At most [`LISTS`] lists take
/// memory at a time.
pub(crate) struct SharedLists {
    awaited: Mutex<HashMap<Key, Weak<OnceCell<SharedReply>>>>,
    /// One permit for each list, until the last reply with it is sent.
    slots: Arc<Semaphore>,
    timeout: Duration,
}

type Key = (IpAddr, String, Form);

/// Maximum number of lists at a time, of which each may take as much memory as the registry.
const LISTS: usize = 3;
/// Time for which a client waits for its list; longer than peers may leave a list unread.
const TIMEOUT: Duration = Duration::from_secs(15);
/// Refusal for a client whose turn did not come.
const TOO_MANY_LISTS: &str = "too many ask for different lists of many names at a time, try again";

impl Default for SharedLists {
    fn default() -> Self {
        Self::with_timeout(TIMEOUT)
    }
}

impl SharedLists {
    fn with_timeout(timeout: Duration) -> Self {
        Self {
            awaited: Mutex::default(),
            slots: Arc::new(Semaphore::new(LISTS)),
            timeout,
        }
    }

    /// Returns the reply to a request for a list of about so many bytes, which `build` builds in turn with other large work. It
    /// is encoded in this form.
    pub(crate) async fn answer(
        &self,
        from: IpAddr,
        request: String,
        form: Form,
        bytes: usize,
        build: impl FnOnce() -> Body,
    ) -> Answer {
        let key = (from, request, form);
        let list = self.join(&key);
        let build = async || {
            let slot = self.slots.clone().acquire_owned().await.ok();
            let build = || {
                // Before the registry is read.
                self.leave(&key);
                encode(build(), form, slot)
            };
            run_large(bytes, build).await
        };
        // If the client that builds goes away, the next one builds.
        let list = tokio::time::timeout(self.timeout, list.get_or_init(build)).await;
        match list {
            Ok(list) => Answer::reply(list.clone()),
            Err(_) => Answer::reply(RawText(Body::refusal(TOO_MANY_LISTS).into_text())),
        }
    }

    /// Returns the list that others wait for, or a new one.
    fn join(&self, key: &Key) -> Arc<OnceCell<SharedReply>> {
        let mut lists = self.awaited.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(list) = lists.get(key).and_then(Weak::upgrade) {
            return list;
        }
        // All who waited are gone.
        lists.retain(|_, list| list.strong_count() > 0);
        let list = Arc::default();
        lists.insert(key.clone(), Arc::downgrade(&list));
        list
    }

    fn leave(&self, key: &Key) {
        let mut lists = self.awaited.lock().unwrap_or_else(PoisonError::into_inner);
        lists.remove(key);
    }
}

/// Encodes a list, which gives its slot back when the last reply is sent.
fn encode(list: Body, form: Form, slot: Option<OwnedSemaphorePermit>) -> SharedReply {
    match list {
        Body::Bottle(bottle) => SharedReply::encode(&bottle, form, slot),
        lines @ Body::Lines(_) => SharedReply::text(lines.into_text(), slot),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use bytes::BytesMut;
    use yarp_wire::{Bottle, WireVersion};

    use super::*;

    const LARGE: usize = 1 << 20;

    fn text_of(answer: Answer) -> String {
        let Answer::Reply(reply) = answer else {
            panic!("no reply");
        };
        let mut text = BytesMut::new();
        reply.write_text(&mut text);
        String::from_utf8(text.to_vec()).unwrap()
    }

    /// Takes the memory of all lists, so that nobody's turn comes until it is dropped.
    async fn take_slots(lists: &SharedLists) -> OwnedSemaphorePermit {
        let slots = lists.slots.clone().acquire_many_owned(3);
        slots.await.unwrap()
    }

    #[tokio::test]
    async fn those_who_wait_share_a_list_and_others_do_not() {
        let (lists, built) = (SharedLists::default(), AtomicUsize::new(0));
        let from = |last| IpAddr::from([10, 0, 0, last]);
        let ask = |from, request: &str| {
            let build = || {
                let number = built.fetch_add(1, Ordering::Relaxed);
                Body::lines([format!("list {number}")])
            };
            lists.answer(from, request.to_owned(), Form::Text, LARGE, build)
        };
        let slots = take_slots(&lists).await;
        let (first, second, other, below, ()) = tokio::join!(
            ask(from(1), "list"),
            ask(from(1), "list"),
            ask(from(2), "list"),
            ask(from(1), "list /a"),
            async { drop(slots) }
        );
        let texts = [first, second, other, below].map(text_of);
        assert_eq!(texts[0], texts[1]);
        assert_eq!(built.load(Ordering::Relaxed), 3, "{texts:?}");
        // What changed since then is in the next one, which those share who ask before it is built, and nobody later.
        let build = || {
            let awaited = lists.awaited.lock().unwrap();
            Body::lines([format!("{} wait", awaited.len())])
        };
        let next = lists.answer(from(1), "list".to_owned(), Form::Text, LARGE, build);
        assert!(text_of(next.await).starts_with("0 wait"));
    }

    #[tokio::test]
    async fn a_client_that_goes_away_leaves_the_list_to_the_next() {
        let lists = SharedLists::default();
        let ask = |request: String, line: &'static str| {
            let build = move || Body::lines([line]);
            Box::pin(lists.answer([127, 0, 0, 1].into(), request, Form::Text, LARGE, build))
        };
        async fn begun(asking: &mut (impl Future<Output = Answer> + Unpin)) {
            let waits = tokio::time::timeout(Duration::from_millis(1), asking).await;
            assert!(waits.is_err(), "there is no room for a list");
        }
        let slots = take_slots(&lists).await;
        let mut stays = ask("list".to_owned(), "stays");
        let mut gone = ask("list".to_owned(), "gone");
        begun(&mut gone).await;
        begun(&mut stays).await;
        drop(gone);
        // Requests of those who are gone are not kept.
        for number in 0..100 {
            begun(&mut ask(format!("list /{number}"), "never")).await;
        }
        assert!(lists.awaited.lock().unwrap().len() <= 2);
        drop(slots);
        assert!(text_of(stays.await).starts_with("stays"));
    }

    #[tokio::test]
    async fn lists_that_are_not_sent_yet_are_few() {
        let lists = SharedLists::with_timeout(Duration::from_millis(50));
        let ask = |last| {
            let build = || Body::lines(["/p"]);
            lists.answer(
                [10, 0, 0, last].into(),
                "list".to_owned(),
                Form::Text,
                LARGE,
                build,
            )
        };
        let mut unsent = vec![ask(1).await, ask(2).await, ask(3).await];
        let refusal = text_of(ask(4).await);
        assert!(refusal.starts_with("refused: too many"), "{refusal}");
        drop(unsent.pop());
        assert!(text_of(ask(4).await).starts_with("/p"));
    }

    #[tokio::test]
    async fn a_bottle_is_shared_by_those_who_need_the_same_form() {
        let (lists, built) = (SharedLists::default(), AtomicUsize::new(0));
        let ask = |form| {
            let build = || {
                built.fetch_add(1, Ordering::Relaxed);
                Body::Bottle(Bottle::of("ports"))
            };
            let from = IpAddr::from([127, 0, 0, 1]);
            lists.answer(from, "bot list".to_owned(), form, LARGE, build)
        };
        let slots = take_slots(&lists).await;
        let binary = Form::Binary(WireVersion::V4);
        let (first, second, text, ()) =
            tokio::join!(ask(binary), ask(binary), ask(Form::Text), async {
                drop(slots)
            });
        assert_eq!(built.load(Ordering::Relaxed), 2);
        for (answer, form) in [(first, binary), (second, binary), (text, Form::Text)] {
            let Answer::Reply(reply) = answer else {
                panic!("no reply");
            };
            assert!(reply.shared_bytes(form).is_some(), "{form:?} is copied");
            assert_eq!(text_of(Answer::Reply(reply)), "ports\r\n");
        }
    }
}
