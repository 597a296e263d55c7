//! Reads which devices an action names.

use super::device_parameters::find;
use super::{Param, ParamValue};

/// Name of the list of all devices, to which `robotDescription_nws_yarp` attaches, as in stock.
pub(super) const STORAGE: &str = "yriDescriptionStorage";

/// Devices that an attach action names.
pub(super) enum AttachTargets {
    /// All devices.
    All,
    /// Name of each device, and the name that the attaching device uses for it.
    Named(Vec<(String, String)>),
}

impl AttachTargets {
    pub(super) fn one(device: String, network: &str) -> Self {
        Self::Named(vec![(device, network.to_owned())])
    }

    /// Reads the parameters of an attach action; errors are in words.
    pub(super) fn of(params: &[Param]) -> Result<Self, String> {
        let choices = ["network", "networks", "all"];
        let given = choices.iter().filter(|name| find(params, name).is_some());
        if given.count() > 1 {
            return Err("expected one of network, networks and all, got several".to_owned());
        }
        if let Some(device) = find(params, "device").and_then(Param::word) {
            let network = find(params, "network").and_then(Param::word);
            return Ok(Self::one(device, network.as_deref().unwrap_or("...")));
        }
        if find(params, "all").is_some() {
            return Ok(Self::All);
        }
        let Some(networks) = find(params, "networks") else {
            return Err("expected parameter device, networks or all, got none".to_owned());
        };
        let names = match &networks.value {
            ParamValue::Values(values) => match &values[..] {
                [one] => one
                    .as_list()
                    .map_or(values.clone(), |list| list.as_slice().to_vec()),
                several => several.to_vec(),
            },
            ParamValue::Group(_) => Vec::new(),
        };
        let names = names.iter().map(|name| name.to_plain_string());
        let named = names.map(|network| Ok((need(params, &network)?, network)));
        Ok(Self::Named(named.collect::<Result<_, String>>()?))
    }
}

/// Returns the name of a device that the parameter `name` is.
pub(super) fn need(params: &[Param], name: &str) -> Result<String, String> {
    let word = find(params, name).and_then(Param::word);
    word.ok_or_else(|| format!("parameter {name} is missing, expected the name of a device"))
}
