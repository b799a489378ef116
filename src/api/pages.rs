//! An HTTP connection: one request, one response, then it is closed.

use super::http::{MAX_HEAD_BYTES, Page, Status, answer, read};
use super::metrics::page;
use super::server::{Counted, ServerState};
use super::token::Token;
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

/// Answers one request.
pub(super) async fn serve(state: Rc<ServerState>, _counted: Counted, mut stream: TcpStream, token: Option<Token>) {
    let Ok(Ok(asked)) = timeout(TIMEOUT, head(&mut stream, token.as_ref())).await else { return };
    let (status, body) = match asked {
        Ok(page) => respond(&state, page).await,
        Err(status) => (status, String::new()),
    };
    let _ = timeout(TIMEOUT, async {
        stream.write_all(&answer(status, &body)).await?;
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
        Page::Metrics => (Status::Ok, page(&snapshot, state.served())),
        Page::Health => {
            let status = if snapshot.link == LinkState::Streaming { Status::Ok } else { Status::Unavailable };
            (status, format!("{}: {}\n", snapshot.link.word(), snapshot.cause))
        }
    }
}
