//! Where the clients' threads hand in orders for the pipeline's thread.

use super::order::{Driver, Granted, Order, Refusal};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use tokio::sync::{Notify, oneshot};

/// What the helm says to an order.
pub type Answer = Result<Granted, Refusal>;

/// Orders that wait. Each client waits for its answer before it hands in the next, so there are no more than clients.
#[derive(Debug, Default)]
pub struct Desk {
    waiting: Mutex<Vec<(Driver, Order, oneshot::Sender<Answer>)>>,
    handed_in: Notify,
    drivers: AtomicU64,
}

impl Desk {
    /// A new client that came in by `source`.
    pub fn driver(&self, source: u8) -> Driver {
        Driver { number: self.drivers.fetch_add(1, Ordering::Relaxed), source }
    }

    /// Hands in an order; the answer comes when the pipeline's thread has read it.
    pub fn hand_in(&self, driver: Driver, order: Order) -> oneshot::Receiver<Answer> {
        let (answer, answered) = oneshot::channel();
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner).push((driver, order, answer));
        self.handed_in.notify_one();
        answered
    }

    /// The orders that wait, in the order in which they came.
    pub fn take(&self) -> Vec<(Driver, Order, oneshot::Sender<Answer>)> {
        std::mem::take(&mut *self.waiting.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Waits for an order.
    pub async fn ordered(&self) {
        self.handed_in.notified().await;
    }
}
