//! A client's connection: carries bytes and time to its [`Client`], and lines back.

use super::client::{Asks, Client, End};
use super::report::Report;
use super::server::{Counted, ServerState};
use super::token::Token;
use std::io;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _};
use tokio::time::{sleep_until, timeout};

/// Who is dropped may still have sent something, which is read for so long and so far: else the system would throw the last words away.
const LAST_WORDS: Duration = Duration::from_secs(1);
const LAST_BYTES: u64 = 1 << 20;
const CHUNK: usize = 4096;

/// What woke the loop.
enum Wake {
    Read(io::Result<usize>),
    Wrote(io::Result<usize>),
    Moment,
    Map,
    Time,
}

/// Serves one client until it goes or is dropped.
pub(super) async fn serve<S>(state: Rc<ServerState>, _counted: Counted, stream: S, who: String, token: Option<Token>)
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    let (mut reader, mut writer) = tokio::io::split(stream);
    let mut client = Client::new(state.now(), token);
    let (mut moments, mut maps) = (state.moment.subscribe(), state.map.subscribe());
    let mut watching = Watching { state: Rc::clone(&state), is_on: false };
    let (mut asked, mut reads, mut is_told, mut chunk) = (Asks::default(), true, false, [0; CHUNK]);
    loop {
        let now = state.now();
        client.tick(now);
        watching.set(client.is_watching());
        if let Some(end) = client.end()
            && !std::mem::replace(&mut is_told, true)
        {
            reads = false;
            state.count(end);
            tell(&who, end);
        }
        if client.is_over(now) {
            break;
        }
        if client.asks().map
            && let Some(map) = state.fresh_map(now)
        {
            client.map(now, map.as_ref());
        }
        let asks = client.asks();
        if asks.moment && !asked.moment {
            state.mailbox.ask();
        }
        if asks.map && !asked.map {
            state.mailbox.ask_map();
        }
        asked = asks;
        let deadline = state.begin + Duration::from_micros(client.deadline().us());
        let wake = tokio::select! {
            read = reader.read(&mut chunk), if reads => Wake::Read(read),
            written = writer.write(client.outgoing()), if !client.outgoing().is_empty() => Wake::Wrote(written),
            _ = moments.changed() => Wake::Moment,
            _ = maps.changed() => Wake::Map,
            () = sleep_until(deadline.into()) => Wake::Time,
        };
        let now = state.now();
        match wake {
            Wake::Read(Ok(0)) => {
                reads = false;
                client.hung_up(now);
            }
            Wake::Read(Ok(count)) => client.received(now, &chunk[..count]),
            Wake::Wrote(Ok(count)) if count > 0 => client.wrote(now, count),
            // It is gone.
            Wake::Read(Err(_)) | Wake::Wrote(_) => return,
            Wake::Moment => {
                let moment = Arc::clone(&moments.borrow_and_update());
                client.news(now, &moment, state.served().clients);
                asked.moment = false;
            }
            Wake::Map => {
                let line = maps.borrow_and_update().clone();
                client.map(now, line.as_ref());
                asked.map = false;
            }
            Wake::Time => {}
        }
    }
    part(&mut reader, &mut writer).await;
}

/// Tells one client too many that it is.
pub(super) async fn turn_away<S: AsyncRead + AsyncWrite + Unpin>(_counted: Counted, stream: S) {
    let (mut reader, mut writer) = tokio::io::split(stream);
    let message = "too many clients: 64 are connected; try again later";
    let _ = timeout(LAST_WORDS, writer.write_all(&Report::Error { message }.line())).await;
    part(&mut reader, &mut writer).await;
}

async fn part(reader: &mut (impl AsyncRead + Unpin), writer: &mut (impl AsyncWrite + Unpin)) {
    let _ = timeout(LAST_WORDS, async {
        writer.shutdown().await?;
        tokio::io::copy(&mut reader.take(LAST_BYTES), &mut tokio::io::sink()).await
    })
    .await;
}

fn tell(who: &str, end: End) {
    match end {
        End::Done => {}
        End::Slow => tracing::warn!("api: a client at {who} is dropped: it is too slow"),
        End::Idle => tracing::info!("api: a client at {who} is dropped: it is idle"),
        End::Long => tracing::warn!("api: a client at {who} is dropped: its line does not end"),
        End::Stranger => tracing::warn!("api: a client at {who} is dropped: it does not know the token"),
    }
}

/// Whether sweeps are to be copied for a client.
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
