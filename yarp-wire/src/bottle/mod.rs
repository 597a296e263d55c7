//! Bottles: the lists of values that ports exchange.
//!
//! A [`Bottle`] has a binary form ([`Bottle::encode`], [`Bottle::decode`]), which differs between
//! the generations of YARP ([`Dialect`](crate::Dialect)), and a text form (`Display` and
//! [`Bottle::parse`]), which does not. [`Scanner`] finds where a binary bottle ends while its
//! bytes still arrive.

mod binary;
mod list;
mod number_text;
mod scan;
mod text;
mod value;

pub use binary::{DecodeError, detect};
pub use list::Bottle;
pub use scan::{Scan, Scanner};
pub use text::{Balance, TextError};
pub use value::{Text, Value};
