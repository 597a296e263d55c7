//! Network wrappers: devices served on ports, and remote devices cast back
