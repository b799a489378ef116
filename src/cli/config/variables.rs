//! Environment variables: `SLAMD_<SECTION>__<KEY>` for the configuration's values, `SLAMD_<OPTION>` for options of `slamd run`.

use crate::cli::{Failure, Kind};
use slamd_core::config::{nearest, values};
use std::ffi::OsString;

/// A value of the configuration.
#[derive(Debug, PartialEq)]
pub(super) struct Variable {
    pub(super) name: String,
    /// Its dotted key.
    pub(super) key: String,
    pub(super) value: String,
}

/// Options that can be set by variables: clap's name and the variable. The command line overrides the variable.
pub(in crate::cli) const OPTIONS: &[(&str, &str)] = &[
    ("port", "SLAMD_PORT"),
    ("baud", "SLAMD_BAUD"),
    ("out", "SLAMD_OUT"),
    ("record", "SLAMD_RECORD"),
    ("save_session", "SLAMD_SAVE_SESSION"),
    ("session", "SLAMD_SESSION"),
    ("listen", "SLAMD_LISTEN"),
    ("socket", "SLAMD_SOCKET"),
    ("metrics", "SLAMD_METRICS"),
    ("token_file", "SLAMD_TOKEN_FILE"),
    #[cfg(feature = "mqtt")]
    ("mqtt", "SLAMD_MQTT"),
    #[cfg(feature = "mqtt")]
    ("mqtt_user", "SLAMD_MQTT_USER"),
    #[cfg(feature = "mqtt")]
    ("mqtt_password_file", "SLAMD_MQTT_PASSWORD_FILE"),
    ("viewer", "SLAMD_VIEWER"),
];
/// Prefix of slamd's variables.
const PREFIX: &str = "SLAMD_";
/// The variable that every command uses.
const LOG_FORMAT: &str = "SLAMD_LOG_FORMAT";

/// The variables that set values of the configuration, in the order of their names.
///
/// # Errors
/// Unknown variables with slamd's prefix, and values that are not UTF-8.
pub(super) fn variables(environment: impl Iterator<Item = (OsString, OsString)>) -> Result<Vec<Variable>, Failure> {
    let (mut known, mut problems) = (Vec::new(), Vec::new());
    let keys: Vec<(String, String)> = values().into_iter().map(|(key, _)| (name(&key), key)).collect();
    for (name, value) in environment.filter_map(|(name, value)| Some((name.into_string().ok()?, value))) {
        if let Some((_, key)) = keys.iter().find(|(variable, _)| *variable == name) {
            match value.into_string() {
                Ok(value) => known.push(Variable { name, key: key.clone(), value }),
                Err(_) => problems.push(format!("{name}: it is no text in UTF-8")),
            }
        } else if name.starts_with(PREFIX) && !is_option(&name) {
            problems.push(unknown_message(&name));
        }
    }
    if !problems.is_empty() {
        problems.sort();
        return Err(Failure::new(Kind::Config, problems.join("\n")));
    }
    known.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(known)
}

/// An error message for each unknown variable with slamd's prefix.
pub(in crate::cli) fn unknown() -> Vec<String> {
    let names = std::env::vars_os().filter_map(|(name, _)| name.into_string().ok());
    let is_known = |variable: &str| is_option(variable) || values().iter().any(|(key, _)| name(key) == variable);
    names.filter(|name| name.starts_with(PREFIX) && !is_known(name)).map(|name| unknown_message(&name)).collect()
}

fn is_option(name: &str) -> bool {
    name == LOG_FORMAT || OPTIONS.iter().any(|(_, variable)| *variable == name)
}

/// The variable of a dotted key.
fn name(key: &str) -> String {
    PREFIX.to_owned() + &key.to_uppercase().replace('.', "__")
}

fn unknown_message(unknown: &str) -> String {
    let keys: Vec<String> = values().iter().map(|(key, _)| name(key)).collect();
    let options = OPTIONS.iter().map(|(_, variable)| *variable).chain([LOG_FORMAT]);
    match nearest(unknown, keys.iter().map(String::as_str).chain(options)) {
        Some(meant) => format!("{unknown}: there is no such variable; did you mean {meant}?"),
        None => format!("{unknown}: there is no such variable; docs/cli.md lists those of slamd"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn read(environment: &[(&str, &str)]) -> Result<Vec<Variable>, String> {
        let pairs = environment.iter().map(|(name, value)| (OsString::from(name), OsString::from(value)));
        variables(pairs).map_err(|failure| failure.to_string())
    }

    #[test]
    fn names_become_keys() {
        let found = read(&[
            ("SLAMD_ROBOT__WHEEL_BASE_M", "0.3"),
            ("PATH", "/bin"),
            ("SLAMD_METHOD", "paper"),
            ("SLAMD_PORT", "auto"),
        ])
        .unwrap();
        let found: Vec<(&str, &str)> = found.iter().map(|found| (found.key.as_str(), found.value.as_str())).collect();
        assert_eq!(found, [("method", "paper"), ("robot.wheel_base_m", "0.3")]);
    }

    #[test]
    fn an_unknown_variable_names_the_nearest() {
        let error =
            read(&[("SLAMD_ROBOT__WHEELBASE_M", "0.3"), ("SLAMD_PROT", "auto"), ("SLAMD_COLOUR_OF_THE_WALLS", "")])
                .unwrap_err();
        let lines: Vec<&str> = error.lines().collect();
        assert!(
            lines[0].starts_with("SLAMD_COLOUR_OF_THE_WALLS: ")
                && lines[0].ends_with("docs/cli.md lists those of slamd"),
            "{error}"
        );
        assert!(lines[1].ends_with("did you mean SLAMD_PORT?"), "{error}");
        assert!(lines[2].ends_with("did you mean SLAMD_ROBOT__WHEEL_BASE_M?"), "{error}");
    }

    #[test]
    fn no_option_has_the_name_of_a_key() {
        let keys: BTreeSet<String> = values().iter().map(|(key, _)| name(key)).collect();
        assert_eq!(keys.len(), values().len());
        assert!(OPTIONS.iter().all(|(_, variable)| !keys.contains(*variable)) && !keys.contains(LOG_FORMAT));
        assert!(OPTIONS.iter().all(|(option, variable)| *variable == name(option)));
    }

    #[test]
    fn every_variable_is_documented() {
        let page = include_str!("../../../docs/cli.md");
        let known = OPTIONS.iter().map(|(_, variable)| *variable).chain([LOG_FORMAT]);
        known.for_each(|variable| assert!(page.contains(&format!("`{variable}`")), "{variable} is in no table"));
    }
}
