//! s
/// s
pub struct Stamp;
