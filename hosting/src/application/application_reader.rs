//! Reads applications from XML.

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use yarp_wire::settings::Origin;

use super::text_variables::TextVariables;
use super::{
    Application, ApplicationError, Arbitrator, Connection, Module, NestedApplication, RequiredPort,
};
use crate::robot::Problem;
use crate::text_file;
use crate::tolerant_xml::{self, XmlElement};

/// Maximum number of bytes of a file.
const MAX_BYTES: u64 = 32 << 20;
/// Maximum number of elements of a file.
const MAX_ELEMENTS: usize = 1_000_000;
/// Maximum number of characters of a number.
const MAX_NUMBER: usize = 40;
/// Maximum number of problems; later ones are not listed.
const MAX_PROBLEMS: usize = 1000;
/// Elements of an application that are read before its programs and connections, or by editors only.
const OTHER_ELEMENTS: [&str; 7] = [
    "name",
    "description",
    "version",
    "var",
    "dependencies",
    "authors",
    "geometry",
];
/// Elements of a module that are read, or by editors only.
const MODULE_ELEMENTS: [&str; 15] = [
    "name",
    "node",
    "parameters",
    "prefix",
    "environment",
    "workdir",
    "stdio",
    "deployer",
    "display",
    "rank",
    "dependencies",
    "ensure",
    "portmap",
    "tag",
    "geometry",
];

pub(super) fn read(
    file: &Path,
    environment: &dyn Fn(&str) -> Option<String>,
) -> Result<Application, ApplicationError> {
    let name: Arc<str> = file.display().to_string().into();
    let (mut bytes, mut elements) = (MAX_BYTES, MAX_ELEMENTS);
    let text = text_file::read(file, &mut bytes, MAX_BYTES);
    let text = text.map_err(|source| ApplicationError::Read {
        file: name.to_string(),
        source,
    })?;
    let document = tolerant_xml::parse(&text, &mut elements);
    let document = document.map_err(|error| ApplicationError::Syntax {
        origin: Origin::line(name.clone(), error.line),
        what: error.what,
    })?;
    let root = document.root;
    if !root.name.eq_ignore_ascii_case("application") {
        return Err(ApplicationError::Other {
            origin: Origin::line(name, root.line),
            found: root.name,
        });
    }
    let mut reader = Reader {
        file: name,
        variables: TextVariables::new(environment),
        application: Application::default(),
        external: HashSet::new(),
    };
    for (line, what) in document.lints {
        reader.problem_at(line, what);
    }
    reader.application(&root);
    Ok(reader.application)
}

struct Reader<'e> {
    file: Arc<str>,
    variables: TextVariables<'e>,
    application: Application,
    /// Names of ports that belong to no program, in small letters.
    external: HashSet<String>,
}

impl Reader<'_> {
    fn origin(&self, element: &XmlElement) -> Origin {
        Origin::line(self.file.clone(), element.line)
    }

    fn problem(&mut self, element: &XmlElement, what: impl Into<String>) {
        self.problem_at(element.line, what);
    }

    fn problem_at(&mut self, line: usize, what: impl Into<String>) {
        if self.application.problems.len() < MAX_PROBLEMS {
            let (origin, what) = (Origin::line(self.file.clone(), line), what.into());
            self.application.problems.push(Problem { origin, what });
        }
    }

    /// Returns the text of an element with its variables replaced; `None` if it has none.
    fn text(&mut self, element: &XmlElement) -> Option<String> {
        let text = element.text.as_deref()?;
        let replaced = self.variables.replace(text);
        if let Some(what) = replaced.problem {
            self.problem(element, what);
        }
        Some(replaced.text).filter(|text| !text.is_empty())
    }

    /// Returns the text of the first element of this name inside another.
    fn inner(&mut self, element: &XmlElement, name: &str) -> Option<String> {
        self.text(child(element, name)?)
    }

    fn application(&mut self, root: &XmlElement) {
        // As in stock: everything with a name from the first one on.
        let rest = root.children.iter().skip_while(|child| child.name != "var");
        for var in rest {
            let name = attribute(var, "name").filter(|name| !name.is_empty());
            if let (Some(name), Some(_)) = (name, &var.text) {
                let value = self.text(var).unwrap_or_default();
                self.variables.set(name, value);
            }
        }
        match self.inner(root, "name") {
            Some(name) => self.application.name = name.replace(' ', "_"),
            None => self.problem(root, "the application has no <name>"),
        }
        self.application.description = self.inner(root, "description");
        self.application.version = self.inner(root, "version");
        if let Some(dependencies) = child(root, "dependencies") {
            // Stock reads the names alone.
            for port in self.required_ports(dependencies) {
                self.require(port.name);
            }
        }
        for element in &root.children {
            match element.name.to_ascii_lowercase().as_str() {
                "module" => self.module(element),
                "application" => self.nested(element),
                "arbitrator" => self.arbitrator(element),
                "connection" => {}
                _ if OTHER_ELEMENTS.contains(&element.name.as_str()) => {}
                _ => {
                    let what = format!("<{}> is not read", element.name);
                    self.problem(element, what);
                }
            }
        }
        // Last, as in stock: ports that the dependencies name belong to no program.
        for element in &root.children {
            if element.name.eq_ignore_ascii_case("connection") {
                self.connection(element);
            }
        }
    }

    /// Adds a port that belongs to no program.
    fn require(&mut self, name: String) {
        self.external.insert(name.to_ascii_lowercase());
        self.application.ports.push(RequiredPort {
            name,
            ..RequiredPort::default()
        });
    }

    fn required_ports(&mut self, dependencies: &XmlElement) -> Vec<RequiredPort> {
        let mut ports = Vec::new();
        for element in &dependencies.children {
            if !element.name.eq_ignore_ascii_case("port") {
                let what = format!("<{}> in <dependencies> is not read", element.name);
                self.problem(element, what);
                continue;
            }
            // Empty ones are usual.
            let Some(name) = self.text(element) else {
                continue;
            };
            ports.push(RequiredPort {
                name,
                timeout: attribute(element, "timeout").map(seconds),
                request: attribute(element, "request").map(str::to_owned),
                reply: attribute(element, "reply").map(str::to_owned),
            });
        }
        ports
    }

    fn module(&mut self, element: &XmlElement) {
        let Some(name) = self.inner(element, "name") else {
            return self.problem(element, "a <module> without a <name> is left out");
        };
        let mut module = Module {
            name,
            node: self.inner(element, "node"),
            parameters: self.inner(element, "parameters"),
            prefix: self.inner(element, "prefix"),
            environment: self.inner(element, "environment"),
            workdir: self.inner(element, "workdir"),
            stdio: self.inner(element, "stdio"),
            deployer: self.inner(element, "deployer"),
            display: self.inner(element, "display"),
            rank: self
                .inner(element, "rank")
                .map(|text| seconds(&text) as i32),
            ports: Vec::new(),
            waits: [0.0; 2],
            port_names: Vec::new(),
            origin: self.origin(element),
        };
        for part in &element.children {
            let is_read = |known: &&str| known.eq_ignore_ascii_case(&part.name);
            if !MODULE_ELEMENTS.iter().any(is_read) {
                let what = format!("<{}> in <module> is not read", part.name);
                self.problem(part, what);
            }
        }
        if let Some(dependencies) = child(element, "dependencies") {
            module.ports = self.required_ports(dependencies);
        }
        for wait in child(element, "ensure")
            .into_iter()
            .flat_map(|ensure| &ensure.children)
        {
            self.wait(wait, &mut module.waits);
        }
        let maps = element.children.iter();
        for map in maps.filter(|child| child.name.eq_ignore_ascii_case("portmap")) {
            if let (Some(old), Some(new)) = (self.inner(map, "old"), self.inner(map, "new")) {
                module.port_names.push((old, new));
            }
        }
        self.application.modules.push(module);
    }

    fn wait(&mut self, element: &XmlElement, waits: &mut [f64; 2]) {
        if !element.name.eq_ignore_ascii_case("wait") {
            let what = format!("<{}> in <ensure> is not read", element.name);
            return self.problem(element, what);
        }
        let when = attribute(element, "when").unwrap_or_default();
        let which = match when.to_ascii_lowercase().as_str() {
            "" | "start" => 0,
            "stop" => 1,
            _ => return self.problem(element, "expected start or stop as when of <wait>"),
        };
        waits[which] = self.text(element).map_or(0.0, |text| seconds(&text));
    }

    fn nested(&mut self, element: &XmlElement) {
        let Some(name) = self.inner(element, "name") else {
            return self.problem(element, "an <application> without a <name> is left out");
        };
        let nested = NestedApplication {
            name,
            prefix: self.inner(element, "prefix"),
            origin: self.origin(element),
        };
        self.application.applications.push(nested);
    }

    fn arbitrator(&mut self, element: &XmlElement) {
        let Some(port) = self.inner(element, "port") else {
            return self.problem(element, "an <arbitrator> without a <port> is left out");
        };
        let mut rules = Vec::new();
        for rule in element
            .children
            .iter()
            .filter(|child| child.name.eq_ignore_ascii_case("rule"))
        {
            if let Some(connection) = attribute(rule, "connection") {
                let connection = connection.to_owned();
                rules.push((connection, self.text(rule).unwrap_or_default()));
            }
        }
        self.application
            .arbitrators
            .push(Arbitrator { port, rules });
    }

    fn connection(&mut self, element: &XmlElement) {
        let end = |names: [&str; 2]| names.into_iter().find_map(|name| child(element, name));
        let ends = [end(["from", "output"]), end(["to", "input"])];
        let [Some(from), Some(to)] = ends else {
            let what = "a <connection> without <from> and <to> is left out";
            return self.problem(element, what);
        };
        let (Some(sender), Some(receiver)) = (self.text(from), self.text(to)) else {
            let what = "a <connection> without the name of both ports is left out";
            return self.problem(element, what);
        };
        let qos = |end: &XmlElement| {
            let own = attribute(end, "qos").or_else(|| attribute(element, "qos"));
            own.map(str::to_owned)
        };
        for (end, name) in [(from, &sender), (to, &receiver)] {
            if is_true(end, "external") {
                self.require(name.clone());
            }
        }
        let external =
            [&sender, &receiver].map(|name| self.external.contains(&name.to_ascii_lowercase()));
        let connection = Connection {
            carrier: self.inner(element, "protocol"),
            external,
            qos: [qos(from), qos(to)],
            persistent: is_true(element, "persist"),
            id: attribute(element, "id").map(str::to_owned),
            origin: self.origin(element),
            from: sender,
            to: receiver,
        };
        self.application.connections.push(connection);
    }
}

fn child<'x>(element: &'x XmlElement, name: &str) -> Option<&'x XmlElement> {
    element.children.iter().find(|child| child.name == name)
}

fn attribute<'x>(element: &'x XmlElement, name: &str) -> Option<&'x str> {
    let found = element.attributes.iter().find(|(known, _)| known == name);
    found.map(|(_, value)| value.as_str())
}

fn is_true(element: &XmlElement, name: &str) -> bool {
    attribute(element, name).is_some_and(|value| value.eq_ignore_ascii_case("true"))
}

/// Returns the number at the beginning of a text as C's `atof` does, 0 if there is none; finite.
fn seconds(text: &str) -> f64 {
    let text = text.trim_start();
    let ends = (1..=text.len()).filter(|end| text.is_char_boundary(*end));
    let numbers = ends
        .take(MAX_NUMBER)
        .filter_map(|end| text[..end].parse::<f64>().ok());
    numbers
        .filter(|number| number.is_finite())
        .last()
        .unwrap_or(0.0)
}
