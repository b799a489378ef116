//! The robot in Home Assistant: publishes map, pose, link and faults to an MQTT broker, with discovery messages.
//!
//! `session → Tap → Mailbox → (thread) MqttPublisher → Published → broker`
//!
//! Once a second the thread requests the newest snapshot, as a client of `src/api` does, and publishes what has changed in it. The pipeline's
//! thread never waits. A lost connection is retried without limit; after each new connection everything is published again.
//! `docs/home-assistant.md` lists the topics.

mod broker;
mod discovery;
mod names;
mod password;
mod published;
mod publisher;
mod snapshot;

pub use broker::{Broker, BrokerError};
pub use discovery::discovery;
pub use names::Names;
pub use password::{Password, PasswordError};
pub use publisher::{Account, MqttThread};
