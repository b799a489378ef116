//! A client's right to drive, and its orders on the way to the helm.

use super::token::Token;
use crate::drive::Order;
use slamd_protocol::Drive;
use std::collections::VecDeque;

/// Whether and why a client may drive. The default is a client that only reads.
#[derive(Clone, Copy, Debug, Default)]
pub struct Right {
    /// slamd runs with `--drive`.
    pub(super) is_offered: bool,
    /// The token that gives the right.
    pub(super) token: Option<Token>,
    /// How the client got the right: the source of its commands.
    pub(super) source: Option<u8>,
}

impl Right {
    /// The right of a client at the owner's socket.
    #[must_use]
    pub const fn of_owner() -> Self {
        Self { is_offered: true, token: None, source: Some(Drive::FROM_SOCKET) }
    }

    /// The right that a client from the network gets with this token; without one it never gets it.
    #[must_use]
    pub const fn with_token(token: Option<Token>) -> Self {
        Self { is_offered: true, token, source: None }
    }

    /// True if `word` is the token; then the client may drive.
    pub(super) fn claim(&mut self, word: &str) -> bool {
        let is_right = self.token.is_some_and(|token| token.is(word));
        if is_right {
            self.source = Some(Drive::FROM_TOKEN);
        }
        is_right
    }

    /// Why the client may not drive.
    pub(super) const fn refusal(&self) -> &'static str {
        if self.is_offered {
            "this connection may only read: drive over the owner's --socket, or send the token of --drive-token-file first"
        } else {
            "slamd runs without --drive: nobody can drive"
        }
    }
}

/// Orders of one client; the next is handed in when the last is answered.
#[derive(Debug, Default)]
pub(super) struct Orders {
    waiting: VecDeque<Order>,
    is_handed_in: bool,
}

impl Orders {
    /// A stop overtakes and discards what waits.
    pub(super) fn push(&mut self, order: Order) {
        if order == Order::Stop {
            self.waiting.clear();
        }
        self.waiting.push_back(order);
    }

    pub(super) fn next(&mut self) -> Option<Order> {
        let next = if self.is_handed_in { None } else { self.waiting.pop_front() };
        self.is_handed_in |= next.is_some();
        next
    }

    pub(super) const fn answered(&mut self) {
        self.is_handed_in = false;
    }

    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty() && !self.is_handed_in
    }
}
