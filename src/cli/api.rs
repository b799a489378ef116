//! `--listen`, `--socket`, `--metrics`: whom a session is served to.

use super::{Failure, Kind};
use crate::api::{Listener, ListenerError, Server, Token};
use clap::Args;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Serving a session to other programs.
#[derive(Debug, Args)]
pub(super) struct ApiArgs {
    /// Serve JSON lines over TCP (docs/api.md), without an address on 127.0.0.1:9878; another than loopback needs --token-file.
    #[arg(long, value_name = "IP:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:9878")]
    listen: Option<SocketAddr>,
    /// Serve JSON lines at a socket in the file system, for this user alone; without a path at slamd.sock in XDG_RUNTIME_DIR.
    #[arg(long, value_name = "PATH")]
    socket: Option<Option<PathBuf>>,
    /// Serve /metrics for Prometheus and /healthz over HTTP, without an address on 127.0.0.1:9879; another than loopback needs --token-file.
    #[arg(long, value_name = "IP:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:9879")]
    metrics: Option<SocketAddr>,
    /// Whoever comes over TCP must know the first line of this file.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
}

/// The options, for commands that have no use for them.
pub(super) const NAMES: [&str; 4] = ["listen", "socket", "metrics", "token_file"];

impl ApiArgs {
    /// Begins to serve; none where nobody is to be served.
    pub(super) fn begin(&self) -> Result<Option<Server>, Failure> {
        let options = [("--listen", self.listen), ("--metrics", self.metrics)];
        let open = options
            .iter()
            .find_map(|(option, address)| Some((option, (*address)?)).filter(|(_, it)| !it.ip().is_loopback()));
        if let (Some((option, address)), None) = (open, &self.token_file) {
            return Err(Failure::new(
                Kind::Usage,
                format!(
                    "{option} {address} lets in whoever reaches this machine's network: name a --token-file they must know, as `(umask 077; \
                     openssl rand -hex 32 > token)` makes it, or listen on 127.0.0.1 and come through `ssh -L`"
                ),
            ));
        }
        let token = self.token_file.as_deref().map(Token::read).transpose();
        let token = token.map_err(|error| Failure::new(Kind::Config, error.to_string()))?;
        let socket = self.socket.clone().map(named).transpose()?;
        let doors =
            [self.listen.map(Listener::tcp), socket.as_deref().map(Listener::unix), self.metrics.map(Listener::http)];
        let doors: Result<Vec<Listener>, ListenerError> = doors.into_iter().flatten().collect();
        let doors = doors.map_err(|error| Failure::new(Kind::Unavailable, error.to_string()))?;
        if doors.is_empty() {
            return Ok(None);
        }
        doors.iter().for_each(|door| tracing::info!("api: listening at {}", door.place()));
        let server = Server::begin(doors, token);
        server.map(Some).map_err(|error| Failure::new(Kind::Unavailable, format!("api: {error}")))
    }
}

/// The socket's path.
fn named(path: Option<PathBuf>) -> Result<PathBuf, Failure> {
    if let Some(path) = path {
        return Ok(path);
    }
    let folder = std::env::var_os("XDG_RUNTIME_DIR").filter(|folder| !folder.is_empty());
    let folder = folder
        .ok_or_else(|| Failure::new(Kind::Usage, "there is no XDG_RUNTIME_DIR: name a path with --socket PATH"))?;
    Ok(PathBuf::from(folder).join("slamd.sock"))
}
