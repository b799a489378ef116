//! The broker's address.

use std::fmt;
use std::str::FromStr;

/// A broker's address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Broker {
    /// A name or an IP address; an IPv6 address has no brackets here.
    pub host: String,
    /// The TCP port.
    pub port: u16,
}

/// Text that is not a broker's address.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("it must be HOST or HOST:PORT, such as homeassistant.local, 192.168.1.5:1883 or [fd00::1]:1883")]
pub struct BrokerError;

/// MQTT's default port.
const PORT: u16 = 1883;

impl FromStr for Broker {
    type Err = BrokerError;

    fn from_str(text: &str) -> Result<Self, BrokerError> {
        let (host, port) = split(text).ok_or(BrokerError)?;
        let port = port.map_or(Ok(PORT), str::parse).map_err(|_| BrokerError)?;
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-._:".contains(c);
        if port == 0 || host.is_empty() || !host.chars().all(is_plain) {
            return Err(BrokerError);
        }
        Ok(Self { host: host.into(), port })
    }
}

/// Splits the host from the port, if there is one.
fn split(text: &str) -> Option<(&str, Option<&str>)> {
    if let Some(rest) = text.strip_prefix('[') {
        let (host, rest) = rest.split_once(']')?;
        return if rest.is_empty() { Some((host, None)) } else { Some((host, Some(rest.strip_prefix(':')?))) };
    }
    match text.split_once(':') {
        Some((host, port)) if !port.contains(':') => Some((host, Some(port))),
        // An IPv6 address without a port has more than one colon.
        _ => Some((text, None)),
    }
}

impl Broker {
    /// The host as written in front of a port.
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
        for (text, address) in [
            ("homeassistant.local", "homeassistant.local:1883"),
            ("192.168.1.5:1884", "192.168.1.5:1884"),
            ("[fd00::1]", "[fd00::1]:1883"),
            ("[::1]:1884", "[::1]:1884"),
            ("::1", "[::1]:1883"),
        ] {
            assert_eq!(read(text).as_deref(), Ok(address));
        }
        for text in ["", ":1883", "host:", "host:0", "host:70000", "host:mqtt", "mqtt://host", "a b", "[::1]x", "[::1"]
        {
            assert_eq!(read(text), Err(BrokerError), "{text}");
        }
    }
}
