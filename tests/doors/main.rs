//! What other programs connect to: JSON API, Prometheus, MQTT, Rerun; and the log.

mod api;
mod browser;
#[cfg(feature = "mqtt")]
mod driving;
mod limits;
mod log;
#[cfg(feature = "mqtt")]
mod mqtt;
mod prometheus;
#[cfg(feature = "viewer")]
mod viewer;
