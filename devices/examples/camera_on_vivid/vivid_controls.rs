//! Controls of vivid that are its own: what it shows, and which errors it makes.

use linuxvideo::Device;
use linuxvideo::controls::{ControlDesc, CtrlType};

/// Sets a control, given the name that the documentation of vivid has for it. The device is open only meanwhile: a
/// disconnected one comes back when nobody has it open.
pub(crate) fn set(device: &str, name: &str, value: i32) {
    let mut device = Device::open(device).expect("vivid can be opened");
    let control = find(&device, name);
    let set = device.write_control_raw(control.id(), value);
    set.unwrap_or_else(|error| panic!("{name} cannot be set to {value}: {error}"));
}

/// Presses a button.
pub(crate) fn press(device: &str, name: &str) {
    set(device, name, 1);
}

/// Chooses an item of a menu.
pub(crate) fn choose(device: &str, name: &str, item: &str) {
    let index = {
        let device = Device::open(device).expect("vivid can be opened");
        let control = find(&device, name);
        assert_eq!(control.control_type(), CtrlType::MENU, "{name}");
        let mut items = device
            .enumerate_menu(&control)
            .map(|item| item.expect("it has items"));
        let index = items.find(|one| one.name() == item).map(|one| one.index());
        index.unwrap_or_else(|| panic!("{name} has no {item}")) as i32
    };
    set(device, name, index);
}

fn find(device: &Device, name: &str) -> ControlDesc {
    let mut controls = device
        .controls()
        .map(|control| control.expect("it has controls"));
    controls
        .find(|one| one.name() == name)
        .unwrap_or_else(|| panic!("vivid has no {name}"))
}
