//! A connection for a page: one request, one answer, closed.

use super::http::{LONGEST_HEAD, Page, Status, answer, read};
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

/// A page is asked for, and taken, within this each.
const PATIENCE: Duration = Duration::from_secs(5);
/// The session answers within this, or does not fare well: it looks at itself, and for a lost port, at least every 2.5 s.
const ANSWER: Duration = Duration::from_secs(4);

/// Answers one request.
pub(super) async fn serve(state: Rc<ServerState>, _counted: Counted, mut stream: TcpStream, token: Option<Token>) {
    let Ok(Ok(asked)) = timeout(PATIENCE, head(&mut stream, token.as_ref())).await else { return };
    let (status, body) = match asked {
        Ok(page) => made(&state, page).await,
        Err(status) => (status, String::new()),
    };
    let _ = timeout(PATIENCE, async {
        stream.write_all(&answer(status, &body)).await?;
        stream.shutdown().await
    })
    .await;
}

async fn head(stream: &mut TcpStream, token: Option<&Token>) -> io::Result<Result<Page, Status>> {
    let mut head = Vec::with_capacity(1024);
    loop {
        let count = (&mut *stream).take((LONGEST_HEAD - head.len()) as u64).read_buf(&mut head).await?;
        if let Some(asked) = read(&head, token) {
            return Ok(asked);
        }
        if count == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
    }
}

async fn made(state: &ServerState, asked: Page) -> (Status, String) {
    let mut moments = state.moment.subscribe();
    state.mailbox.ask();
    if timeout(ANSWER, moments.changed()).await.is_err() {
        return (Status::Unavailable, "the session does not answer\n".into());
    }
    let moment: Arc<Snapshot> = Arc::clone(&moments.borrow());
    match asked {
        Page::Metrics => (Status::Ok, page(&moment, state.served())),
        Page::Health => {
            let status = if moment.link == LinkState::Streaming { Status::Ok } else { Status::Unavailable };
            (status, format!("{}: {}\n", moment.link.word(), moment.cause))
        }
    }
}
