//! An HTTP connection: one request, one response, then it is closed.

use super::http::{MAX_HEAD_BYTES, Page, Status, answer, read, reason};
use super::metrics::page;
use super::server::ServerState;
use super::token::Token;
use super::waiting::Seat;
use slamd_core::{Snapshot, link::LinkState};
use std::io;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::time::timeout;

/// Longest time for the request, and for the response.
const TIMEOUT: Duration = Duration::from_secs(5);
/// A healthy session answers within this: its loop runs at least every 2.5 s, also while the port is lost.
const ANSWER: Duration = Duration::from_secs(4);

/// Answers one request. Until it has come, a newcomer may take the place.
pub(super) async fn serve(state: Rc<ServerState>, mut seat: Seat, mut stream: TcpStream, token: Option<Token>) {
    let asked = tokio::select! {
        asked = timeout(TIMEOUT, head(&mut stream, token.as_ref())) => asked,
        () = seat.lost() => {
            let told = (Status::Unavailable, "too many connections: send the request at once\n".into());
            // What the socket takes at once.
            let _ = timeout(Duration::ZERO, send(&mut stream, &told)).await;
            return;
        }
    };
    let Ok(Ok(asked)) = asked else { return };
    let (status, body) = match (asked, state.answering()) {
        (Err(status), _) => (status, reason(status).into()),
        (Ok(_), None) => (Status::Unavailable, "too many requests\n".into()),
        (Ok(page), Some(counted)) => {
            // A place of its own, from here on.
            drop(seat);
            let answered = respond(&state, page).await;
            send(&mut stream, &answered).await;
            drop(counted);
            return;
        }
    };
    send(&mut stream, &(status, body)).await;
}

async fn send(stream: &mut TcpStream, (status, body): &(Status, String)) {
    let _ = timeout(TIMEOUT, async {
        stream.write_all(&answer(*status, body)).await?;
        stream.shutdown().await
    })
    .await;
}

async fn head(stream: &mut TcpStream, token: Option<&Token>) -> io::Result<Result<Page, Status>> {
    let mut head = Vec::with_capacity(1024);
    loop {
        let count = (&mut *stream).take((MAX_HEAD_BYTES - head.len()) as u64).read_buf(&mut head).await?;
        if let Some(asked) = read(&head, token) {
            return Ok(asked);
        }
        if count == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
    }
}

async fn respond(state: &ServerState, asked: Page) -> (Status, String) {
    let mut snapshots = state.snapshot.subscribe();
    state.mailbox.ask();
    if timeout(ANSWER, snapshots.changed()).await.is_err() {
        return (Status::Unavailable, "the session does not answer\n".into());
    }
    let snapshot: Arc<Snapshot> = Arc::clone(&snapshots.borrow());
    match asked {
        Page::Metrics => (Status::Ok, page(&snapshot, state.served(), &state.disk.state())),
        Page::Health => {
            let status = if snapshot.link == LinkState::Streaming { Status::Ok } else { Status::Unavailable };
            let mut body = format!("{}: {}\n", snapshot.link.word(), snapshot.cause);
            // It does not change the status: a watchdog's restart would lose what waits in memory for the disk.
            for trouble in state.disk.state().troubles() {
                body += &trouble;
                body.push('\n');
            }
            (status, body)
        }
    }
}
