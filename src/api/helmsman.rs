//! A client's place at the desk where orders to drive are handed in.

use crate::drive::{Answer, Desk, Driver, Order};
use std::sync::Arc;
use tokio::sync::oneshot;

/// The robot that a client drives stops when this is dropped, however the connection ends.
pub(super) struct Helmsman {
    desk: Option<Arc<Desk>>,
    driver: Option<Driver>,
    answer: Option<oneshot::Receiver<Answer>>,
}

impl Helmsman {
    /// A client that has ordered nothing; without a desk it never can.
    pub(super) const fn new(desk: Option<Arc<Desk>>) -> Self {
        Self { desk, driver: None, answer: None }
    }

    /// Hands in an order.
    pub(super) fn hand_in(&mut self, order: Order, source: u8) {
        let Some(desk) = &self.desk else { return };
        let driver = *self.driver.get_or_insert_with(|| desk.driver(source));
        self.answer = Some(desk.hand_in(driver, order));
    }

    /// True while an order is not answered: the client's next lines wait.
    pub(super) const fn waits(&self) -> bool {
        self.answer.is_some()
    }

    /// Waits for the answer; none if the session has ended.
    pub(super) async fn answered(&mut self) -> Option<Answer> {
        let answered = match &mut self.answer {
            Some(answer) => answer.await.ok(),
            None => std::future::pending().await,
        };
        self.answer = None;
        answered
    }
}

impl Drop for Helmsman {
    fn drop(&mut self) {
        if let (Some(desk), Some(driver)) = (&self.desk, self.driver) {
            drop(desk.hand_in(driver, Order::Leave));
        }
    }
}
