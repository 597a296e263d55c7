//! Futures that are compiled in this crate.
//!
//! The body of an `async fn` is compiled in each crate that awaits it, together with all that it awaits itself. What opens a
//! port thus contained everything that a port does, and was compiled once for every library and program that opens
//! one. A function that returns a boxed future is compiled here alone.
//!
//! For what happens once in a connection or a conversation: the messages themselves pass no such function.

use std::future::Future;
use std::pin::Pin;

/// A future whose body is compiled with the function that returns it.
///
/// That function is not generic, and `#[inline(never)]`: it is compiled elsewhere otherwise.
pub(crate) type CompiledHere<'a, T> = Pin<Box<dyn Future<Output = T> + Send + 'a>>;
