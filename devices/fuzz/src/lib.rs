//! What every fuzz target does with its bytes: feed them to a reader of a device's protocol, and check what must hold
//! whatever they are.
//!
//! The same functions are replayed over the committed corpora by the tests `*fuzz_corpus.rs`.

pub mod embedded;
