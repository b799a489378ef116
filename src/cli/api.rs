//! `--listen`, `--socket`, `--metrics`: serves a session to other programs.

use super::{Failure, Kind};
use crate::api::{DriveAccess, Listener, ListenerError, Server, Token};
use crate::drive::Desk;
use crate::recorder::DiskHealth;
use clap::Args;
use slamd_files::OutputGuard;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;

/// Serving a session to other programs.
#[derive(Debug, Args)]
pub(super) struct ApiArgs {
    /// Serve JSON lines over TCP (docs/api.md); without an address on 127.0.0.1:9878. Addresses other than loopback need --token-file.
    #[arg(long, value_name = "IP:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:9878", value_parser = address)]
    listen: Option<SocketAddr>,
    /// Serve JSON lines on a Unix socket that only this user can open; without a path on slamd.sock in XDG_RUNTIME_DIR.
    #[arg(long, value_name = "PATH")]
    socket: Option<Option<PathBuf>>,
    /// Serve /metrics for Prometheus and /healthz over HTTP; without an address on 127.0.0.1:9879. Addresses other than loopback need
    /// --token-file.
    #[arg(long, value_name = "IP:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:9879", value_parser = address)]
    metrics: Option<SocketAddr>,
    /// TCP clients must send the token in the first line of this file.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Let clients drive the robot (docs/drive.md): those of --socket, and TCP clients with the token of --drive-token-file. Without this
    /// option slamd moves no motor.
    #[arg(long)]
    drive: bool,
    /// TCP clients that send the token in the first line of this file may drive, too.
    #[arg(long, value_name = "FILE", requires = "drive", requires = "listen")]
    drive_token_file: Option<PathBuf>,
}

/// Parses an address to listen at.
fn address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| "it must be IP:PORT, for example 127.0.0.1:9878 or [::1]:9878".into())
}

/// The options' names, for commands that reject them.
pub(super) const NAMES: [&str; 6] = ["listen", "socket", "metrics", "token_file", "drive", "drive_token_file"];

impl ApiArgs {
    /// Where clients hand in orders to drive; none without `--drive`.
    pub(super) fn desk(&self) -> Result<Option<Arc<Desk>>, Failure> {
        if self.drive && self.socket.is_none() && self.drive_token_file.is_none() {
            return Err(Failure::new(
                Kind::Usage,
                "--drive: nobody could drive: add --socket for this user, or --listen and --drive-token-file FILE for the network",
            ));
        }
        Ok(self.drive.then(Arc::default))
    }

    /// The tokens of those that read and of those that drive.
    fn tokens(&self) -> Result<[Option<Token>; 2], Failure> {
        let failure = |text: String| Failure::new(Kind::Config, text);
        let read = |file: &Option<PathBuf>| {
            file.as_deref().map(Token::read).transpose().map_err(|error| failure(error.to_string()))
        };
        let tokens = [read(&self.token_file)?, read(&self.drive_token_file)?];
        if let ([Some(reads), Some(drives)], Some(path)) = (tokens, &self.drive_token_file)
            && reads == drives
        {
            let text = format!("{}: it is the token of --token-file, too: who may read would drive", path.display());
            return Err(failure(text));
        }
        Ok(tokens)
    }

    /// Begins to serve, with the disk's state on the pages; none if no option asks for it.
    /// The socket is no input and no other output of the command, which `guard` knows.
    pub(super) fn begin(
        &self,
        guard: &OutputGuard,
        disk: &Arc<DiskHealth>,
        desk: Option<&Arc<Desk>>,
    ) -> Result<Option<Server>, Failure> {
        let options = [("--listen", self.listen), ("--metrics", self.metrics)];
        let open = options
            .iter()
            .find_map(|(option, address)| Some((option, (*address)?)).filter(|(_, it)| !it.ip().is_loopback()));
        if let (Some((option, address)), None) = (open, &self.token_file) {
            return Err(Failure::new(
                Kind::Usage,
                format!(
                    "{option} {address} is open to everyone in this machine's network: add --token-file FILE (`(umask 077; \
                     openssl rand -hex 32 > token)` makes one), or listen on 127.0.0.1 and connect through `ssh -L`"
                ),
            ));
        }
        let [token, drive_token] = self.tokens()?;
        let socket = self.socket.clone().map(socket_path).transpose()?;
        socket.as_deref().map(|path| guard.check_name(path)).transpose()?;
        let listeners =
            [self.listen.map(Listener::tcp), socket.as_deref().map(Listener::unix), self.metrics.map(Listener::http)];
        let listeners: Result<Vec<Listener>, ListenerError> = listeners.into_iter().flatten().collect();
        let listeners = listeners.map_err(|error| Failure::new(Kind::Unavailable, error.to_string()))?;
        if listeners.is_empty() {
            return Ok(None);
        }
        listeners.iter().for_each(|listener| tracing::info!("api: listening at {}", listener.address()));
        let drive = desk.map(|desk| DriveAccess { desk: Arc::clone(desk), token: drive_token });
        let server = Server::begin(listeners, token, drive, Arc::clone(disk));
        server.map(Some).map_err(|error| Failure::new(Kind::Unavailable, format!("api: {error}")))
    }
}

/// The socket's path, or the default one.
pub(super) fn socket_path(path: Option<PathBuf>) -> Result<PathBuf, Failure> {
    if let Some(path) = path {
        return Ok(path);
    }
    let folder = std::env::var_os("XDG_RUNTIME_DIR").filter(|folder| !folder.is_empty());
    let folder = folder
        .ok_or_else(|| Failure::new(Kind::Usage, "XDG_RUNTIME_DIR is not set: name a path with --socket PATH"))?;
    Ok(PathBuf::from(folder).join("slamd.sock"))
}
