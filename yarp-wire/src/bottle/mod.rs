//! Bottles: the lists of values that ports exchange.
//!
//! A [`Bottle`] has a binary form ([`Bottle::encode`], [`Bottle::decode`]), which depends on the
//! wire version of YARP ([`WireVersion`](crate::WireVersion)), and a text form (`Display` and
//! [`Bottle::parse`]), which does not. [`Scanner`] finds the end of a binary bottle while its bytes
//! still arrive.

mod binary_form;
mod list;
mod literal;
mod number_text;
mod parse;
mod scanner;
mod text_form;
mod value;

pub(crate) use binary_form::max_decoded_size;
pub use binary_form::{DecodeError, detect};
pub use list::Bottle;
pub use scanner::{Scan, Scanner};
pub use text_form::{BracketBalance, TextError};
pub use value::{Text, Value};
