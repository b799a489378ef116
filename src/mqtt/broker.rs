//! Where the broker is.

use std::fmt;
use std::str::FromStr;

/// A broker's address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Broker {
    /// A name or an IP address, an IPv6 one without brackets.
    pub host: String,
    /// The TCP port.
    pub port: u16,
}

/// Not a broker's address.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("it must be HOST or HOST:PORT, such as homeassistant.local, 192.168.1.5:1883 or [fe80::1]:1883")]
pub struct BrokerError;

/// MQTT's port.
const PORT: u16 = 1883;

impl FromStr for Broker {
    type Err = BrokerError;

    fn from_str(text: &str) -> Result<Self, BrokerError> {
        let (host, port) = match text.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
            Some((host, port)) => (host, port.strip_prefix(':').or_else(|| port.is_empty().then_some(""))),
            // More than one colon: an IPv6 address without a port.
            None if text.matches(':').count() > 1 => (text, Some("")),
            None => text.split_once(':').map_or((text, Some("")), |(host, port)| (host, Some(port))),
        };
        let port = match port.ok_or(BrokerError)? {
            "" if !text.ends_with(':') || text.matches(':').count() > 1 => PORT,
            port => port.parse().ok().filter(|port| *port > 0).ok_or(BrokerError)?,
        };
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-._:%".contains(c);
        let is_host = !host.is_empty() && host.chars().all(is_plain);
        if is_host { Ok(Self { host: host.into(), port }) } else { Err(BrokerError) }
    }
}

impl Broker {
    /// The host as it stands before a port.
    #[must_use]
    pub fn quoted_host(&self) -> String {
        if self.host.contains(':') { format!("[{}]", self.host) } else { self.host.clone() }
    }
}

impl fmt::Display for Broker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.quoted_host(), self.port)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hosts_with_and_without_a_port_are_understood() {
        let read = |text: &str| text.parse::<Broker>().map(|broker| broker.to_string());
        for (text, place) in [
            ("homeassistant.local", "homeassistant.local:1883"),
            ("192.168.1.5:1884", "192.168.1.5:1884"),
            ("[fe80::1]", "[fe80::1]:1883"),
            ("[::1]:1884", "[::1]:1884"),
            ("::1", "[::1]:1883"),
        ] {
            assert_eq!(read(text).as_deref(), Ok(place));
        }
        for text in ["", ":1883", "host:", "host:0", "host:70000", "host:mqtt", "mqtt://host", "a b", "[::1]x", "[::1"] {
            assert_eq!(read(text), Err(BrokerError), "{text}");
        }
    }
}
