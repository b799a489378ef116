//! The command line of a bench: `--name value`, whatever else cargo adds to it.

#![allow(dead_code, unreachable_pub, reason = "each bench uses its part")]

use std::fmt::Debug;
use std::str::FromStr;

/// True where the option is there.
pub fn has(name: &str) -> bool {
    std::env::args().any(|argument| argument == name)
}

/// The option's value, or the default.
pub fn text(name: &str, default: &str) -> String {
    let mut arguments = std::env::args().skip_while(|argument| argument != name);
    arguments.nth(1).unwrap_or_else(|| default.to_owned())
}

/// The same as a number.
///
/// # Panics
/// Where it is none.
pub fn number<T: FromStr<Err: Debug>>(name: &str, default: T) -> T {
    let mut arguments = std::env::args().skip_while(|argument| argument != name);
    arguments.nth(1).map_or(default, |number| number.parse().expect("a number"))
}
