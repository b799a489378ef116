//! What other programs connect to: JSON API, Prometheus, MQTT, Rerun.

mod api;
#[cfg(feature = "mqtt")]
mod mqtt;
mod prometheus;
#[cfg(feature = "viewer")]
mod viewer;
