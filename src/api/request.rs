//! Parses a client's line into a request.
//!
//! A request is a line `?NAME;` or `?NAME=VALUE;`. The semicolon and a carriage return may be missing.

use crate::drive::{Twist, Wish};
use serde::{Deserialize, Serialize};

/// Longest accepted line, bytes.
pub const MAX_LINE_BYTES: usize = 64 << 10;

/// A client's request.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// `?VERSION;`: the program's and the API's version.
    Version,
    /// `?POLL;`: the newest of everything except the map.
    Poll,
    /// `?MAP;`: the newest map.
    Map,
    /// `?WATCH={...};`: reports from now on.
    Watch(Watch),
    /// `?TOKEN="...";`: authenticates the client.
    Token(String),
    /// `?DRIVE={...};`: a velocity for a short time.
    Drive(Drive),
    /// `?STOP;`: stops the robot.
    Stop,
}

/// Which reports a client subscribes to, and their highest rates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Watch {
    /// False ends the subscription.
    pub enable: bool,
    /// Poses per second; 0 for none.
    pub pose_hz: f64,
    /// Sweeps per second; 0 for none.
    pub sweep_hz: f64,
    /// Maps per second; 0 for none.
    pub map_hz: f64,
    /// Statistics per second; 0 for none.
    pub stats_hz: f64,
}

impl Default for Watch {
    fn default() -> Self {
        Self { enable: true, pose_hz: 10.0, sweep_hz: 0.0, map_hz: 0.0, stats_hz: 0.0 }
    }
}

/// A velocity for a short time, before slamd's limits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Drive {
    /// Forward, metres per second.
    pub forward_m_s: f64,
    /// Counter-clockwise, radians per second.
    pub turn_rad_s: f64,
    /// How long it holds, milliseconds.
    pub for_ms: u16,
    /// The client drives by slamd's pose: refused while that is uncertain.
    pub autonomous: bool,
}

impl Default for Drive {
    fn default() -> Self {
        Self { forward_m_s: 0.0, turn_rad_s: 0.0, for_ms: 300, autonomous: false }
    }
}

impl From<Drive> for Wish {
    fn from(drive: Drive) -> Self {
        let twist = Twist { forward_m_s: drive.forward_m_s, turn_rad_s: drive.turn_rad_s };
        Self { twist, for_ms: drive.for_ms, is_autonomous: drive.autonomous }
    }
}

/// Why a line is not a request.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RequestError {
    /// No known request.
    #[error(
        "unknown request: expected ?WATCH={{\"pose_hz\":5}};, ?POLL;, ?MAP;, ?VERSION;, ?TOKEN=\"...\";, ?DRIVE={{\"forward_m_s\":0.1}}; or ?STOP;, one on a line"
    )]
    Unknown,
    /// The bytes are not UTF-8.
    #[error("the line is not UTF-8")]
    NotText,
    /// A value for a request that takes none.
    #[error("?{0}; takes no value")]
    Surplus(&'static str),
    /// A value that is not JSON, or not of the expected form.
    #[error("?{name}: {error}; expected {expected}")]
    Value {
        /// The request.
        name: &'static str,
        /// What is wrong.
        error: String,
        /// What would be right.
        expected: &'static str,
    },
    /// How long a velocity holds, outside its range.
    #[error("?DRIVE: for_ms = {0} is out of range: it must be from 50 to 1000")]
    ForMs(u16),
    /// A rate outside its range.
    #[error("?WATCH: {key} = {value} is out of range: it must be 0, or from {MIN_HZ} to {most}")]
    Rate {
        /// The rate's key.
        key: &'static str,
        /// The given value.
        value: String,
        /// The highest allowed rate.
        most: u32,
    },
}

/// Lowest rate, hertz: once in 1,000 s.
const MIN_HZ: f64 = 0.001;
/// Highest rates, hertz. Sweeps are no faster; a map is copied whole, so it may come once a second.
const MAX_HZ: u32 = 50;
const MAX_MAP_HZ: u32 = 1;
/// Longest error text, characters: an error may quote the client's line, which may be long.
const MAX_ERROR_CHARS: usize = 120;

const WATCH: &str = "an object with enable, pose_hz, sweep_hz, map_hz or stats_hz";
const TOKEN: &str = "a JSON string";
const DRIVE: &str = "an object with forward_m_s, turn_rad_s, for_ms or autonomous";

/// Parses a line without its line feed; none if it is blank.
///
/// # Errors
/// What is wrong with the line, and what is expected.
pub fn parse(line: &[u8]) -> Result<Option<Request>, RequestError> {
    let text = std::str::from_utf8(line).map_err(|_| RequestError::NotText)?.trim();
    if text.is_empty() {
        return Ok(None);
    }
    let text = text.strip_suffix(';').unwrap_or(text);
    let (name, value) = text.split_once('=').map_or((text, None), |(name, value)| (name, Some(value.trim())));
    let request = match (name.trim_end(), value) {
        ("?VERSION", None) => Request::Version,
        ("?POLL", None) => Request::Poll,
        ("?MAP", None) => Request::Map,
        ("?WATCH", None) => Request::Watch(Watch::default()),
        ("?VERSION", Some(_)) => return Err(RequestError::Surplus("VERSION")),
        ("?POLL", Some(_)) => return Err(RequestError::Surplus("POLL")),
        ("?MAP", Some(_)) => return Err(RequestError::Surplus("MAP")),
        ("?WATCH", Some(value)) => Request::Watch(within(json("WATCH", value, WATCH)?)?),
        ("?TOKEN", value) => Request::Token(json("TOKEN", value.unwrap_or_default(), TOKEN)?),
        ("?DRIVE", value) => Request::Drive(lasting(json("DRIVE", value.unwrap_or_default(), DRIVE)?)?),
        ("?STOP", None) => Request::Stop,
        ("?STOP", Some(_)) => return Err(RequestError::Surplus("STOP")),
        _ => return Err(RequestError::Unknown),
    };
    Ok(Some(request))
}

fn json<'a, T: Deserialize<'a>>(name: &'static str, value: &'a str, expected: &'static str) -> Result<T, RequestError> {
    serde_json::from_str(value).map_err(|error| {
        let error: String = error.to_string().chars().take(MAX_ERROR_CHARS).collect();
        RequestError::Value { name, error, expected }
    })
}

fn lasting(drive: Drive) -> Result<Drive, RequestError> {
    let is_valid = slamd_protocol::Drive::VALID_MS.contains(&drive.for_ms);
    if is_valid { Ok(drive) } else { Err(RequestError::ForMs(drive.for_ms)) }
}

fn within(watch: Watch) -> Result<Watch, RequestError> {
    let rates = [
        ("pose_hz", watch.pose_hz, MAX_HZ),
        ("sweep_hz", watch.sweep_hz, MAX_HZ),
        ("map_hz", watch.map_hz, MAX_MAP_HZ),
        ("stats_hz", watch.stats_hz, MAX_HZ),
    ];
    for (key, value, most) in rates {
        if value != 0.0 && !(MIN_HZ..=f64::from(most)).contains(&value) {
            return Err(RequestError::Rate { key, value: value.to_string(), most });
        }
    }
    Ok(watch)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn requests_are_parsed_with_and_without_a_semicolon() {
        for end in ["", ";", ";\r", " ; "] {
            assert_eq!(parse(format!("?POLL{end}").as_bytes()), Ok(Some(Request::Poll)), "{end:?}");
        }
        assert_eq!(parse(b" \r"), Ok(None));
        let watch = Watch { pose_hz: 5.0, map_hz: 0.2, ..Watch::default() };
        let line = br#"?WATCH={"enable":true,"pose_hz":5,"map_hz":0.2};"#;
        assert_eq!(parse(line), Ok(Some(Request::Watch(watch))));
        assert_eq!(parse(br#"?TOKEN="a=b;c";"#), Ok(Some(Request::Token("a=b;c".into()))));
        let drive = Drive { forward_m_s: -0.1, for_ms: 50, ..Drive::default() };
        assert_eq!(parse(br#"?DRIVE={"forward_m_s":-0.1,"for_ms":50};"#), Ok(Some(Request::Drive(drive))));
        assert_eq!(parse(b"?STOP;"), Ok(Some(Request::Stop)));
    }

    #[test]
    fn errors_name_what_is_expected() {
        let message = |line: &str| parse(line.as_bytes()).unwrap_err().to_string();
        assert!(message("GET / HTTP/1.1").contains("expected ?WATCH"));
        assert!(message("?MAP=1;").contains("takes no value"));
        assert!(message(r#"?WATCH={"pose":1};"#).contains("unknown field `pose`"));
        assert!(message(r#"?WATCH={"pose_hz":1e999};"#).contains("out of range"));
        assert!(
            message(r#"?WATCH={"map_hz":2};"#).contains("map_hz = 2 is out of range: it must be 0, or from 0.001 to 1")
        );
        assert!(message(r#"?WATCH={"pose_hz":-1};"#).contains("pose_hz = -1"));
        assert!(message("?TOKEN;").contains("a JSON string"));
        assert!(message("?DRIVE;").contains("an object with forward_m_s"));
        for line in
            [r#"{"for_ms":49}"#, r#"{"for_ms":1001}"#, r#"{"for_ms":-1}"#, r#"{"forward_m_s":1e999}"#, r#"{"x":1}"#]
        {
            assert!(message(&format!("?DRIVE={line};")).starts_with("?DRIVE: "), "{line}");
        }
        assert!(message("?STOP=1;").contains("takes no value"));
        assert!(message(&format!(r#"?WATCH={{"{}":1}};"#, "x".repeat(60_000))).len() < 300);
        assert_eq!(parse(b"?POLL\xff"), Err(RequestError::NotText));
    }

    proptest! {
        #[test]
        fn any_watch_in_range_survives_the_round_trip(pose_hz in 0.001..50.0f64, map_hz in 0.001..1.0f64, enable: bool) {
            let watch = Watch { enable, pose_hz, map_hz, ..Watch::default() };
            let line = format!("?WATCH={};", serde_json::to_string(&watch).unwrap());
            prop_assert_eq!(parse(line.as_bytes()), Ok(Some(Request::Watch(watch))));
        }

        #[test]
        fn any_token_survives_the_round_trip(token: String) {
            let line = format!("?TOKEN={};", serde_json::to_string(&token).unwrap());
            prop_assert_eq!(parse(line.as_bytes()), Ok(Some(Request::Token(token))));
        }

        #[test]
        fn any_bytes_are_a_request_or_an_error(line: Vec<u8>) {
            let _ = parse(&line);
        }
    }
}
