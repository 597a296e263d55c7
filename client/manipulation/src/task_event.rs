//! Events of a task, for displays.

use yarp_devices::kinematics::Joints;

use crate::item::Item;
use crate::picker::Step;

/// An event of a task.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum TaskEvent<'a> {
    /// These objects are on the table.
    Detected {
        /// The objects.
        items: &'a [Item],
    },
    /// So many objects are where they belong, of so many.
    Progress {
        /// Number of objects that are done.
        done: usize,
        /// Number of all objects that are known.
        all: usize,
    },
    /// The task goes on with this object.
    Chosen {
        /// The object.
        item: &'a Item,
        /// The place for it, such as `the basket of glasses`.
        destination: &'a str,
    },
    /// A step begins.
    Step {
        /// The step.
        step: Step,
        /// Postures along the path of the arm, rad; empty if only the hand moves.
        path: &'a [Joints<7>],
    },
    /// An attempt failed; the task goes on.
    Failed {
        /// Reason.
        reason: &'a str,
    },
    /// The task ended.
    Ended {
        /// True if somebody stopped it.
        stopped: bool,
        /// The error that ended it early.
        error: Option<&'a str>,
    },
}

type Callback = Box<dyn FnMut(&TaskEvent<'_>) + Send>;

/// A callback for the events of a task, or none.
#[derive(Default)]
pub(crate) struct Observer(Option<Callback>);

impl Observer {
    pub(crate) fn new(callback: impl FnMut(&TaskEvent<'_>) + Send + 'static) -> Self {
        Self(Some(Box::new(callback)))
    }

    /// Returns whether anybody wants events: what is costly to describe need not be described otherwise.
    pub(crate) fn is_watching(&self) -> bool {
        self.0.is_some()
    }

    pub(crate) fn notify(&mut self, event: &TaskEvent<'_>) {
        if let Some(callback) = &mut self.0 {
            callback(event);
        }
    }
}

impl std::fmt::Debug for Observer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Observer")
            .field(&self.is_watching())
            .finish()
    }
}
