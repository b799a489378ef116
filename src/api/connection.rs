//! A client's connection: passes bytes and times to its [`Client`] and writes its lines.

use super::client::{Client, End, Pending};
use super::helmsman::Helmsman;
use super::report::Report;
use super::right::Right;
use super::server::{Counted, Place, ServerState, TOO_MANY};
use super::token::Token;
use crate::drive::Answer;
use slamd_core::Timestamp;
use std::io;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _};
use tokio::time::{sleep_until, timeout};

/// Before a connection is closed, unread input is discarded, for so long and so many bytes. With unread input, closing would reset the connection
/// and lose the last line.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(1);
const MAX_DRAINED: u64 = 1 << 20;
const CHUNK: usize = 4096;
/// What a stranger is told whose place a newcomer takes.
const SENT_AWAY: &str =
    "too many connections wait without the token: a newcomer has this place; connect again and send ?TOKEN at once";

/// What woke the loop.
enum Wake {
    Read(io::Result<usize>),
    Wrote(io::Result<usize>),
    Snapshot,
    Map,
    Answer(Option<Answer>),
    Time,
}

/// Serves one client until it disconnects or is dropped.
pub(super) async fn serve<S>(
    state: Rc<ServerState>,
    mut place: Place,
    stream: S,
    peer: String,
    (token, right): (Option<Token>, Right),
) where
    S: AsyncRead + AsyncWrite + Unpin,
{
    let (mut reader, mut writer) = tokio::io::split(stream);
    let mut client = Client::with_right(state.now(), token, right);
    let mut helmsman = Helmsman::new(state.desk());
    let (mut snapshots, mut maps) = (state.snapshot.subscribe(), state.map.subscribe());
    let mut watching = Watching { state: Rc::clone(&state), is_on: false };
    let (mut asked, mut reads, mut is_logged, mut chunk) = (Pending::default(), true, false, [0; CHUNK]);
    loop {
        let now = state.now();
        client.tick(now);
        if client.is_known() && client.end().is_none() && !place.take(&state) {
            client.refuse(now, TOO_MANY);
        }
        watching.set(client.is_watching());
        if let Some(end) = client.end()
            && !std::mem::replace(&mut is_logged, true)
        {
            reads = false;
            state.count(end);
            log_end(&peer, end);
        }
        if client.is_over(now) {
            break;
        }
        if let Some((order, source)) = client.take_order() {
            helmsman.hand_in(order, source);
        }
        ask(&state, &mut client, &mut asked, now);
        let helmsman_waits = helmsman.waits();
        let deadline = state.begin + Duration::from_micros(client.deadline().us());
        let wake = tokio::select! {
            read = reader.read(&mut chunk), if reads && !helmsman_waits => Wake::Read(read),
            written = writer.write(client.outgoing()), if !client.outgoing().is_empty() => Wake::Wrote(written),
            answered = helmsman.answered(), if helmsman_waits => Wake::Answer(answered),
            _ = snapshots.changed() => Wake::Snapshot,
            _ = maps.changed() => Wake::Map,
            () = sleep_until(deadline.into()) => Wake::Time,
            () = place.lost() => return send_away(&mut client, state.now(), &mut reader, &mut writer).await,
        };
        let now = state.now();
        match wake {
            Wake::Read(Ok(0)) => {
                reads = false;
                client.peer_closed(now);
            }
            Wake::Read(Ok(count)) => client.received(now, &chunk[..count]),
            Wake::Wrote(Ok(count)) if count > 0 => client.wrote(now, count),
            // The client disconnected.
            Wake::Read(Err(_)) | Wake::Wrote(_) => return,
            Wake::Snapshot => {
                let snapshot = Arc::clone(&snapshots.borrow_and_update());
                client.update(now, &snapshot, state.served().clients);
                asked.snapshot = false;
            }
            Wake::Map => {
                let line = maps.borrow_and_update().clone();
                client.map(now, line.as_ref());
                asked.map = false;
            }
            Wake::Answer(answered) => {
                // Without an answer the session has ended.
                let Some(answered) = answered else { return };
                client.answered(now, &answered);
            }
            Wake::Time => {}
        }
    }
    // The robot stops before the connection's last bytes are waited for.
    drop(helmsman);
    close(&mut reader, &mut writer).await;
}

/// Asks the session for what the client's requests need.
fn ask(state: &ServerState, client: &mut Client, asked: &mut Pending, now: Timestamp) {
    if client.pending().map
        && let Some(map) = state.fresh_map(now)
    {
        client.map(now, map.as_ref());
    }
    let asks = client.pending();
    if asks.snapshot && !asked.snapshot {
        state.mailbox.ask();
    }
    if asks.map && !asked.map {
        state.mailbox.ask_map();
    }
    *asked = asks;
}

/// Sends the reason to a client that is refused.
pub(super) async fn refuse<S: AsyncRead + AsyncWrite + Unpin>(_counted: Counted, stream: S) {
    let (mut reader, mut writer) = tokio::io::split(stream);
    let message = Report::Error { message: TOO_MANY };
    let _ = timeout(DRAIN_TIMEOUT, writer.write_all(&message.line())).await;
    close(&mut reader, &mut writer).await;
}

/// Sends a stranger, whose place a newcomer has taken, what the socket takes at once.
async fn send_away(
    client: &mut Client,
    at: Timestamp,
    reader: &mut (impl AsyncRead + Unpin),
    writer: &mut (impl AsyncWrite + Unpin),
) {
    client.refuse(at, SENT_AWAY);
    // A timeout of zero tries once and never waits.
    let sent = timeout(Duration::ZERO, async {
        while !client.outgoing().is_empty() {
            let count = writer.write(client.outgoing()).await?;
            if count == 0 {
                return Err(io::ErrorKind::WriteZero.into());
            }
            client.wrote(at, count);
        }
        writer.shutdown().await
    });
    let _: Result<io::Result<()>, _> = sent.await;
    // Unread input would make the close a reset, which loses the line.
    let _ = timeout(Duration::ZERO, tokio::io::copy(&mut reader.take(MAX_DRAINED), &mut tokio::io::sink())).await;
}

async fn close(reader: &mut (impl AsyncRead + Unpin), writer: &mut (impl AsyncWrite + Unpin)) {
    let _ = timeout(DRAIN_TIMEOUT, async {
        writer.shutdown().await?;
        tokio::io::copy(&mut reader.take(MAX_DRAINED), &mut tokio::io::sink()).await
    })
    .await;
}

fn log_end(peer: &str, end: End) {
    match end {
        End::Done | End::Refused => {}
        End::Slow => tracing::warn!("api: client {peer} dropped: too slow"),
        End::Idle => tracing::info!("api: client {peer} dropped: idle"),
        End::Http => tracing::warn!("api: client {peer} dropped: it speaks HTTP"),
        End::LineTooLong => tracing::warn!("api: client {peer} dropped: line too long"),
        End::Unauthorized => tracing::warn!("api: client {peer} dropped: wrong or missing token"),
    }
}

/// Counts a client among the mailbox's watchers while it subscribes to sweeps.
struct Watching {
    state: Rc<ServerState>,
    is_on: bool,
}

impl Watching {
    fn set(&mut self, is_on: bool) {
        let watchers = &self.state.mailbox.watchers;
        match (std::mem::replace(&mut self.is_on, is_on), is_on) {
            (false, true) => drop(watchers.fetch_add(1, Ordering::Relaxed)),
            (true, false) => drop(watchers.fetch_sub(1, Ordering::Relaxed)),
            _ => {}
        }
    }
}

impl Drop for Watching {
    fn drop(&mut self) {
        self.set(false);
    }
}
