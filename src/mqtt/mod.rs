//! The robot in Home Assistant: what it knows, published to an MQTT broker, with the messages by which Home Assistant finds it.
//!
//! `session → Tap → Mailbox → (thread) MqttPublisher → Bulletin → broker`
//!
//! Once a second the thread asks for the newest snapshot, as a client of `src/api` does, and publishes what has changed in it; the pipeline's thread
//! answers when it comes by, and never waits. A broker that is away is tried again for ever, and told everything anew when it is back.
//! `docs/home-assistant.md` has the topics.

mod broker;
mod bulletin;
mod discovery;
mod names;
mod password;
mod publisher;
mod snapshot;

pub use broker::{Broker, BrokerError};
pub use discovery::discovery;
pub use names::Names;
pub use password::{Password, PasswordError};
pub use publisher::{Account, MqttThread};
