//! The command line of zerre.
fn main() {}
