//! Values of parameters that several configurations read.

use yarp_devices::Limits;
use yarp_wire::settings::Parameters;

use crate::HostError;

/// Reads a switch, which is on if its name stands alone.
pub(crate) fn flag(parameters: &Parameters, name: &str) -> Result<bool, HostError> {
    Ok(match parameters.get::<bool>(name)? {
        Some(value) => value,
        None => parameters.has(name),
    })
}

/// Warns of parameters that are given and have no effect.
pub(crate) fn warn_of_ignored(parameters: &Parameters, names: &[impl AsRef<str>]) {
    for name in names.iter().map(AsRef::as_ref) {
        if parameters.has(name) {
            tracing::warn!("{}: parameter {name} has no effect", parameters.device());
        }
    }
}

/// Reads a list of `N` numbers within a range.
pub(crate) fn numbers<const N: usize>(
    parameters: &Parameters,
    name: &str,
    range: Limits,
    expected: &str,
) -> Result<Option<[f64; N]>, HostError> {
    let list = numbers_of(parameters, name, N, range, expected)?;
    Ok(list.and_then(|list| list.try_into().ok()))
}

/// Reads a list of `count` numbers within a range.
pub(crate) fn numbers_of(
    parameters: &Parameters,
    name: &str,
    count: usize,
    range: Limits,
    expected: &str,
) -> Result<Option<Vec<f64>>, HostError> {
    let list = parameters.list::<f64>(name)?;
    let fits =
        |list: &Vec<f64>| list.len() == count && list.iter().all(|&number| range.contains(number));
    match list {
        Some(list) if !fits(&list) => Err(parameters.refuse(name, expected).into()),
        list => Ok(list),
    }
}
