//! names
/// x
pub struct Contact; 
/// y
pub struct PortName;
