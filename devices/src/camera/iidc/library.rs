//! Loading of libdc1394.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::OnceLock;

use super::bindings::{Functions, LOG_KINDS};
use crate::DeviceError;

/// Names of the library, the newest first. Their functions and structures are the same since 2.2.0.
const NAMES: [&str; 3] = ["libdc1394.so.26", "libdc1394.so.25", "libdc1394.so.22"];

/// Returns the functions of the library, which stays loaded from the first call on.
pub(super) fn load() -> Result<&'static Functions, DeviceError> {
    static FUNCTIONS: OnceLock<Functions> = OnceLock::new();
    if let Some(functions) = FUNCTIONS.get() {
        return Ok(functions);
    }
    let functions = first_of(&NAMES)?;
    Ok(FUNCTIONS.get_or_init(|| functions))
}

fn first_of(names: &[&str]) -> Result<Functions, DeviceError> {
    let mut reasons = Vec::new();
    for name in names {
        match open(name) {
            Ok(functions) => {
                tracing::debug!("{name} is loaded");
                return Ok(functions);
            }
            Err(error) => reasons.push(error.to_string()),
        }
    }
    Err(DeviceError::Remote {
        peer: "libdc1394".to_owned(),
        step: format!("loading one of {}", names.join(", ")),
        advice:
            "installing it: apt install libdc1394-25 (Debian, Ubuntu), libdc1394 (other systems)"
                .to_owned(),
        source: Some(reasons.join("; ").into()),
    })
}

#[allow(unsafe_code, reason = "a library in C has no safe interface")]
fn open(name: &str) -> Result<Functions, libloading::Error> {
    // SAFETY: loading libdc1394 and the libraries that it needs runs nothing but their constructors, and it is never
    // unloaded: `forget` leaves it open. Its functions have the types of `bindings`.
    let functions = unsafe {
        let library = libloading::Library::new(name)?;
        let functions = Functions::find(&library)?;
        std::mem::forget(library);
        functions
    };
    for kind in LOG_KINDS {
        // SAFETY: the handler lives as long as the program, and takes no data.
        unsafe { (functions.log_register_handler)(kind, Some(log), std::ptr::null_mut()) };
    }
    Ok(functions)
}

/// Takes a message of the library, which would print it otherwise. Its errors are reported by the calls that fail.
#[allow(unsafe_code, reason = "called by a library in C")]
unsafe extern "C" fn log(_: c_int, message: *const c_char, _: *mut c_void) {
    // SAFETY: the library hands over a text that lives as long as this call.
    let message = unsafe { text(message) };
    tracing::debug!("libdc1394: {}", message.trim_end());
}

/// Returns a text of the library; an empty one for none.
///
/// # Safety
///
/// The text must end with 0, and live and stay as it is during this call; or it must be null.
#[allow(unsafe_code, reason = "texts of a library in C")]
pub(super) unsafe fn text(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: the caller promises it.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_library_is_named_with_a_remedy() {
        let refused = first_of(&["libnone.so.1", "libnone.so.2"]).err().unwrap();
        let words = crate::error::chain(&refused);
        for part in [
            "libnone.so.1, libnone.so.2",
            "loading",
            "apt install libdc1394-25",
        ] {
            assert!(words.contains(part), "{words}");
        }
        // A library that is not libdc1394 lacks its functions.
        let other = first_of(&["libc.so.6"]).err().unwrap();
        let words = crate::error::chain(&other);
        assert!(words.contains("dc1394_new"), "{words}");
    }
}
