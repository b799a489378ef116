//! Who drives the robot, and what reaches its motors: `slamd --drive`.
//!
//! `client → Order → Desk → (pipeline's thread) Helm → DRIVE → board`
//!
//! Standing still is the default everywhere. A command lasts a second at most, one client drives at a time, and a lost client, a link that
//! does not stream, or the end of the program stops the robot. The board stops on its own where it hears nothing. What was commanded, and by
//! whom, is in the DRIVE frames of the recording; the pipeline does not depend on them, so a replay stays bit-identical.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]

mod conditions;
mod desk;
mod helm;
pub mod keys;
mod limits;
mod order;

pub use conditions::Conditions;
pub use desk::{Answer, Desk};
pub use helm::Helm;
pub use order::{Driver, Granted, Order, Refusal, Twist, Wish};

use bytes::Bytes;
use slamd_core::{Config, Timestamp};
use std::sync::Arc;

/// The orders of all clients, and the helm that obeys one of them.
#[derive(Debug)]
pub struct Steering {
    desk: Arc<Desk>,
    helm: Helm,
}

impl Steering {
    /// Steering of the configured robot.
    #[must_use]
    pub fn new(config: &Config, desk: Arc<Desk>) -> Self {
        Self { desk, helm: Helm::new(config) }
    }

    /// Waits for an order.
    pub async fn ordered(&self) {
        self.desk.ordered().await;
    }

    /// When [`Steering::turn`] is due, unless an order comes earlier.
    #[must_use]
    pub const fn deadline(&self) -> Option<Timestamp> {
        self.helm.deadline()
    }

    /// Answers the orders; returns the frame for the board that is due now.
    pub fn turn(&mut self, at: Timestamp, conditions: &Conditions) -> Option<Bytes> {
        for (driver, order, answer) in self.desk.take() {
            let granted = self.helm.order(at, driver, order, conditions);
            // A client that has left needs no answer.
            let _ = answer.send(granted);
        }
        self.helm.tick(at, conditions)
    }

    /// Refuses the orders: there is no open port, and none is kept for one that comes.
    pub fn refuse(&mut self, at: Timestamp) {
        let _ = self.turn(at, &Conditions::default());
    }

    /// The frame that stops the robot; none where it stands.
    pub fn end(&mut self) -> Option<Bytes> {
        self.helm.end()
    }
}
