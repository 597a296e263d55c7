//! The ports of a view, and its life.

use std::sync::Arc;

use tokio::task::JoinHandle;
use yarp_ports::{Answer, Network, Port, PortError, PortOptions};
use yarp_wire::{Bottle, http};

use crate::log_lines::LogLines;
use crate::page_commands::Control;
use crate::page_files::PageFiles;
use crate::port_sources::{Sources, Subscription};
use crate::view_model::{Model, Role};
use crate::viewer_stream::ViewerStream;

/// Maximum number of bytes of a message that a view reads: an image of 16 million pixels.
const MAX_MESSAGE: usize = 64 << 20;
/// Maximum number of bytes that the system holds for a viewer that does not read, so that it is not shown what was long ago.
const MAX_UNSENT: u32 = 64 << 10;
/// Maximum number of bytes of a command of the page.
const MAX_COMMAND: usize = 64 << 10;

/// Ports that a view shows by default, apart from those of the robot.
const DEFAULT_SOURCES: [&str; 2] = ["/tidy/detections:o", "/tidy/plan:o"];

/// Options of a view.
#[derive(Clone, Debug)]
pub struct ViewOptions {
    name: String,
    arm: String,
    hand: Option<String>,
    camera: Option<String>,
    sources: Vec<String>,
    control: bool,
    log: LogLines,
}

impl ViewOptions {
    /// Creates a view of the arm with this prefix, such as `/wam`. Its name is the prefix and `/view`.
    pub fn new(arm: &str) -> Self {
        Self {
            name: format!("{arm}/view"),
            arm: arm.to_owned(),
            hand: None,
            camera: None,
            sources: DEFAULT_SOURCES.map(str::to_owned).into(),
            control: false,
            log: LogLines::new(),
        }
    }

    /// Sets the name of the view's port.
    pub fn name(mut self, name: &str) -> Self {
        name.clone_into(&mut self.name);
        self
    }

    /// Shows the hand with this prefix, such as `/hand`, on the arm.
    pub fn hand(mut self, prefix: &str) -> Self {
        self.hand = Some(prefix.to_owned());
        self
    }

    /// Shows the images of this port.
    pub fn camera(mut self, port: &str) -> Self {
        self.camera = Some(port.to_owned());
        self
    }

    /// Shows the messages of this port, which say themselves what they are (`docs/live-view.md`).
    pub fn source(mut self, port: &str) -> Self {
        self.sources.push(port.to_owned());
        self
    }

    /// Lets the page command arm and hand.
    pub fn control(mut self, control: bool) -> Self {
        self.control = control;
        self
    }

    /// Shows the lines of this log.
    pub fn log(mut self, log: LogLines) -> Self {
        self.log = log;
        self
    }

    /// Returns the ports that are shown, with their roles.
    fn subscriptions(&self) -> Vec<Subscription> {
        let mut all = vec![Subscription::new(
            format!("{}/stateExt:o", self.arm),
            Role::Arm,
        )];
        if let Some(hand) = &self.hand {
            all.push(Subscription::new(format!("{hand}/stateExt:o"), Role::Hand));
        }
        if let Some(camera) = &self.camera {
            all.push(Subscription::new(camera.clone(), Role::Camera));
        }
        let others = self.sources.iter().cloned();
        all.extend(others.map(|port| Subscription::new(port, Role::Other)));
        all
    }
}

/// A web page that shows a robot: two ports and the tasks behind them.
#[derive(Debug)]
pub struct View {
    page: Arc<Port>,
    input: Arc<Port>,
    control: Option<Arc<Control>>,
    tasks: Vec<JoinHandle<()>>,
}

impl View {
    /// Opens the ports. Arm, hand and camera need not be there yet.
    ///
    /// Errors: [`PortError`] if a name is refused or the name server cannot be reached.
    pub async fn open(network: &Network, options: ViewOptions) -> Result<Self, PortError> {
        let model = Arc::new(Model::new(options.log.clone()));
        let subscriptions = Arc::new(options.subscriptions());
        let (input_model, roles) = (model.clone(), subscriptions.clone());
        let input = PortOptions::new()
            .input_only()
            .no_browsers()
            .max_message(MAX_MESSAGE)
            .handler(move |message| {
                let known = roles.iter().find(|known| known.port == *message.from);
                input_model.take(known.map_or(Role::Other, |known| known.role), message);
                Answer::Nothing
            });
        let input = Port::open(network, &format!("{}/in:i", options.name), input).await?;
        let input = Arc::new(input);
        let control = options.control.then(|| {
            Arc::new(Control::new(
                network,
                &options.arm,
                options.hand.as_deref(),
                model.clone(),
            ))
        });
        let parts = [
            options.hand.is_some(),
            options.camera.is_some(),
            options.control,
        ];
        let files = PageFiles::new(network, &options.arm, parts);
        let files = Arc::new(files);
        let page = page_port(files.clone(), control.clone());
        let page = match Port::open(network, &options.name, page).await {
            Ok(page) => Arc::new(page),
            Err(error) => {
                close(input).await;
                return Err(error);
            }
        };
        let sources = Arc::new(Sources::new(input.clone(), subscriptions));
        let stream = ViewerStream::new(page.clone(), model.clone(), sources.clone(), files);
        let mut tasks = vec![
            tokio::spawn(sources.clone().run(model)),
            tokio::spawn(stream.run()),
        ];
        if let Some(control) = &control {
            tasks.push(tokio::spawn(control.clone().keep_ready(page.clone())));
        }
        Ok(Self {
            page,
            input,
            control,
            tasks,
        })
    }

    /// Returns the address of the page.
    pub fn url(&self) -> String {
        self.page.address().replacen("tcp://", "http://", 1)
    }

    /// Returns the name of the port of the page.
    pub fn name(&self) -> &str {
        self.page.name()
    }

    /// Closes the connections and unregisters the names, within a few seconds.
    pub async fn close(self) {
        for task in &self.tasks {
            task.abort();
        }
        for task in self.tasks {
            // It has been aborted.
            let _ = task.await;
        }
        close(self.page).await;
        close(self.input).await;
        if let Some(control) = self.control {
            control.close().await;
        }
    }
}

/// Returns the port that serves the page, streams to browsers, and takes their commands.
fn page_port(files: Arc<PageFiles>, control: Option<Arc<Control>>) -> PortOptions {
    PortOptions::new()
        .max_message(MAX_COMMAND)
        .max_unsent(MAX_UNSENT)
        .type_name("yarp/view")
        .pages(move |request: &http::Request| files.page(request))
        .handler(move |message| match (&control, message.bottle()) {
            (Some(control), Ok(command)) => {
                let control = control.clone();
                Answer::Later(Box::pin(async move {
                    Answer::reply(control.execute(&command).await)
                }))
            }
            (None, Ok(_)) => Answer::reply(
                Bottle::of("refused")
                    .with("this view only shows; start it with --control to command the robot"),
            ),
            (_, Err(error)) => Answer::reply(Bottle::of("refused").with(error.to_string())),
        })
}

/// Closes a port that a connection may still be using.
async fn close(port: Arc<Port>) {
    match Arc::try_unwrap(port) {
        Ok(port) => port.close().await,
        // Dropping it closes it in the background.
        Err(port) => drop(port),
    }
}
