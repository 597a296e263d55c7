//! Feeds the bytes of each fuzz target to the parser of a device's protocol, and checks what must hold for any bytes.
//!
//! The same functions are replayed over the committed corpora by the tests `*fuzz_corpus.rs`.

pub mod can;
pub mod embedded;
pub mod hand;
