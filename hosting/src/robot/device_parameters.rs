//! Converts the parameters of devices to settings.

use yarp_wire::settings::{Origin, Parameters, Setting, Settings};
use yarp_wire::{Bottle, Value};

use super::{Action, DeviceEntry, Param, ParamValue, Robot, RobotError};

/// Number of characters of a wrong value that a warning shows.
const MAX_SHOWN_TEXT: usize = 80;

impl Robot {
    /// Returns the parameters of a device: its own, those that the robot shares, and `device`, `id` and `robotName`.
    ///
    /// Groups of the same name are merged. Errors: [`RobotError::Repeated`].
    pub fn parameters(&self, device: &DeviceEntry) -> Result<Parameters, RobotError> {
        let mut settings = Settings::new();
        // As in stock, an empty prefix is no value.
        let prefix = Some(self.port_prefix.as_str()).filter(|prefix| !prefix.is_empty());
        let items = [Some("robotName"), prefix].into_iter().flatten();
        let items = items.map(|text| Setting::new(text.into(), &Origin::Program));
        settings.put_entry("robotName".to_owned(), items.collect());
        let given = [("id", &device.name), ("device", &device.kind)];
        for (name, value) in given {
            settings.put(name, value.as_str(), &Origin::Program);
        }
        let shared = self.params.iter().filter(|_| self.shares_params);
        for param in shared {
            // Devices may ignore these.
            let items = entry(param, Some(&Origin::Program));
            settings.put_entry(param.name.clone(), items);
        }
        let mut own: Vec<Param> = Vec::new();
        for param in &device.params {
            match own.iter_mut().find(|first| first.name == param.name) {
                None => own.push(param.clone()),
                Some(first) => match (&mut first.value, &param.value) {
                    (ParamValue::Group(first), ParamValue::Group(more)) => {
                        first.extend(more.iter().cloned());
                    }
                    _ => {
                        return Err(RobotError::Repeated {
                            origin: param.origin.clone(),
                            what: "parameter",
                            name: param.name.clone(),
                            first: first.origin.clone(),
                        });
                    }
                },
            }
        }
        for param in &own {
            settings.put_entry(param.name.clone(), entry(param, None));
        }
        Ok(Parameters::new(
            &device.name,
            settings,
            device.origin.clone(),
        ))
    }

    /// Replaces `${portprefix}`, `${portprefixnoslash}` and `${robotname}`.
    pub(super) fn replace_variables(&mut self) {
        let values = [
            (
                "${portprefixnoslash}",
                self.port_prefix.trim_start_matches('/').to_owned(),
            ),
            ("${portprefix}", self.port_prefix.clone()),
            ("${robotname}", self.name.clone()),
        ];
        replace(&mut self.params, &values);
        for device in &mut self.devices {
            replace(&mut device.params, &values);
            for action in &mut device.actions {
                replace(&mut action.params, &values);
            }
        }
    }
}

fn replace(params: &mut [Param], variables: &[(&str, String)]) {
    for param in params {
        match &mut param.value {
            ParamValue::Group(inner) => replace(inner, variables),
            ParamValue::Values(values) => {
                let items = std::mem::take(values).into_iter();
                values.extend(items.map(|value| with_variables(value, variables)));
            }
        }
    }
}

fn with_variables(value: Value, variables: &[(&str, String)]) -> Value {
    match value {
        Value::String(text) if text.to_lossy().contains("${") => {
            let text = text.to_lossy().into_owned();
            let put = |text: String, (name, value): &(&str, String)| text.replace(name, value);
            variables.iter().fold(text, put).into()
        }
        Value::List(list) => {
            let items = list.into_iter();
            Value::List(items.map(|item| with_variables(item, variables)).collect())
        }
        other => other,
    }
}

/// Returns the settings of a parameter: its name, and its values or the settings of its group.
fn entry(param: &Param, origin: Option<&Origin>) -> Vec<Setting> {
    let at = origin.unwrap_or(&param.origin);
    let mut items = vec![Setting::new(param.name.as_str().into(), at)];
    match &param.value {
        ParamValue::Values(values) => {
            items.extend(values.iter().map(|value| Setting::new(value.clone(), at)));
        }
        ParamValue::Group(params) => {
            let lists = params.iter();
            items.extend(lists.map(|param| {
                let at = origin.unwrap_or(&param.origin);
                Setting::list(entry(param, origin), at)
            }));
        }
    }
    items
}

impl Action {
    /// Returns the parameters as lists of a name and its values.
    pub fn to_bottle(&self) -> Bottle {
        let mut settings = Settings::new();
        for param in &self.params {
            settings.put_entry(param.name.clone(), entry(param, None));
        }
        settings.to_bottle()
    }
}

impl Param {
    /// Creates a parameter whose value is given on the command line.
    pub(super) fn given(name: String, given: &Setting) -> Self {
        Self {
            name,
            value: ParamValue::Values(vec![given.value()]),
            origin: given.origin().clone(),
        }
    }

    /// Creates a parameter whose value is the text of a bottle, as in XML.
    ///
    /// A parameter whose brackets or quotes are not balanced is lost, with a warning, as in stock: `None`. Errors:
    /// [`RobotError::Expected`] for lists that are nested too deeply.
    pub(super) fn from_text(
        name: String,
        text: &str,
        origin: Origin,
    ) -> Result<Option<Self>, RobotError> {
        if !is_balanced(text) {
            let beginning: String = text.trim().chars().take(MAX_SHOWN_TEXT).collect();
            tracing::warn!(
                "{origin}: parameter {name} is lost: expected a value with as many brackets and quotes that close as open, got {beginning}"
            );
            return Ok(None);
        }
        let values = Bottle::parse(text)
            .map_err(|error| RobotError::expected(&origin, "a value", error.to_string()))?;
        Ok(Some(Self {
            name,
            value: ParamValue::Values(values.into_items()),
            origin,
        }))
    }

    /// Returns the text of the first value.
    pub(super) fn word(&self) -> Option<String> {
        match &self.value {
            ParamValue::Values(values) => values.first().map(Value::to_plain_string),
            ParamValue::Group(_) => None,
        }
    }
}

/// Returns true for a value with as many brackets and quotes that close as open.
pub(super) fn is_balanced(text: &str) -> bool {
    let count = |c: char| text.matches(c).count();
    count('(') == count(')') && count('"').is_multiple_of(2)
}

/// Returns the parameter named `name`.
pub(super) fn find<'a>(params: &'a [Param], name: &str) -> Option<&'a Param> {
    params.iter().find(|param| param.name == name)
}
