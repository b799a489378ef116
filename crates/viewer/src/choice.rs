//! The option `--viewer`: where the session is shown.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::str::FromStr;

/// The port on which Rerun's viewers listen.
const VIEWER_PORT: u16 = 9876;
/// Our server's port. It differs from [`VIEWER_PORT`], because `rerun URL` takes any listener there
/// for a viewer and would send our own data back to us.
const PORT: u16 = 9877;

/// The value of one `--viewer`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choice {
    /// Start a server and open the installed viewer.
    Spawn,
    /// Connect to a listening viewer: its URL, and its host and port.
    Connect(String, String),
    /// Start a server that viewers connect to.
    Serve(SocketAddr),
    /// Start a server, and the installed viewer's web server for browsers.
    Web,
    /// No viewer.
    Off,
    /// Write a recording.
    File(PathBuf),
}

/// The default address of `serve`: reachable from this machine only.
pub const HERE: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), PORT);

impl FromStr for Choice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (word, argument) = text.split_once('=').map_or((text, None), |(word, argument)| (word, Some(argument)));
        Ok(match (word, argument) {
            ("spawn", None) => Self::Spawn,
            ("web", None) => Self::Web,
            ("off", None) => Self::Off,
            ("serve", None) => Self::Serve(HERE),
            ("serve", Some(address)) => Self::Serve(socket(address)?),
            ("connect", argument) => connect(argument.unwrap_or("127.0.0.1"))?,
            _ if text.ends_with(".rrd") => Self::File(text.into()),
            _ => {
                return Err(
                    "it must be spawn, connect[=URL], serve[=IP:PORT], web, off, or a file that ends in .rrd".into()
                );
            }
        })
    }
}

/// Parses an address. The IP or the port may be missing.
fn socket(text: &str) -> Result<SocketAddr, String> {
    let ip = |text: &str| text.parse::<IpAddr>().ok().map(|ip| SocketAddr::new(ip, PORT));
    let port = |text: &str| text.parse().ok().map(|port| SocketAddr::new(HERE.ip(), port));
    let whole = text.parse().ok().or_else(|| ip(text)).or_else(|| port(text));
    whole.ok_or_else(|| format!("{text}: it must be IP:PORT, such as 0.0.0.0:{PORT} for every network of this machine"))
}

/// Parses a viewer's URL. Scheme, port and path may be missing.
fn connect(text: &str) -> Result<Choice, String> {
    let (scheme, rest) = text.split_once("://").unwrap_or(("rerun+http", text));
    let host = rest.strip_suffix("/proxy").unwrap_or(rest).trim_end_matches('/');
    let has_port = host.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
    let is_plain = !host.is_empty() && !host.contains(['/', ' ', '?']);
    if !is_plain || !["rerun+http", "rerun+https", "rerun"].contains(&scheme) {
        return Err(format!("{text}: it must be a viewer's URL, such as rerun+http://127.0.0.1:{VIEWER_PORT}/proxy"));
    }
    let host = if has_port { host.to_owned() } else { format!("{host}:{VIEWER_PORT}") };
    Ok(Choice::Connect(format!("{scheme}://{host}/proxy"), host))
}

/// The URL with which a viewer finds our server.
pub(super) fn url(address: SocketAddr) -> String {
    format!("rerun+http://{}/proxy", reached(address))
}

/// The address that reaches a server from this machine: the loopback address if it listens on all.
pub(super) fn reached(address: SocketAddr) -> SocketAddr {
    if address.ip().is_unspecified() { SocketAddr::new(HERE.ip(), address.port()) } else { address }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Choice {
        text.parse().unwrap()
    }

    #[test]
    fn choices_are_parsed() {
        assert_eq!(parsed("spawn"), Choice::Spawn);
        assert_eq!(parsed("serve"), Choice::Serve("127.0.0.1:9877".parse().unwrap()));
        assert_eq!(parsed("serve=0.0.0.0"), Choice::Serve("0.0.0.0:9877".parse().unwrap()));
        assert_eq!(parsed("serve=1234"), Choice::Serve("127.0.0.1:1234".parse().unwrap()));
        assert_eq!(parsed("serve=[::1]:7"), Choice::Serve("[::1]:7".parse().unwrap()));
        assert_eq!(parsed("out/drive.rrd"), Choice::File("out/drive.rrd".into()));
    }

    #[test]
    fn parts_of_a_viewers_url_may_be_missing() {
        let here = Choice::Connect("rerun+http://127.0.0.1:9876/proxy".into(), "127.0.0.1:9876".into());
        for text in
            ["connect", "connect=127.0.0.1", "connect=127.0.0.1:9876", "connect=rerun+http://127.0.0.1:9876/proxy"]
        {
            assert_eq!(parsed(text), here);
        }
        let there = Choice::Connect("rerun+https://laptop:1/proxy".into(), "laptop:1".into());
        assert_eq!(parsed("connect=rerun+https://laptop:1"), there);
    }

    #[test]
    fn invalid_choices_are_refused() {
        for text in ["", "sprawn", "serve=here", "connect=http://127.0.0.1", "connect=", "off=1", "drive.mcap"] {
            assert!(text.parse::<Choice>().is_err(), "{text}");
        }
    }

    #[test]
    fn a_server_on_all_addresses_is_reached_through_loopback() {
        assert_eq!(url("0.0.0.0:5".parse().unwrap()), "rerun+http://127.0.0.1:5/proxy");
    }
}
