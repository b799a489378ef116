//! `--mqtt`: the robot in Home Assistant.

use super::{Failure, Kind};
use crate::mqtt::{Account, Broker, MqttThread, Password};
use clap::Args;
use std::path::PathBuf;

/// Publishing a session to a broker.
#[derive(Debug, Args)]
pub(super) struct MqttArgs {
    /// Publish map, pose and faults to this MQTT broker, for Home Assistant (docs/home-assistant.md).
    #[arg(long, value_name = "HOST[:PORT]")]
    mqtt: Option<Broker>,
    /// The broker's user.
    #[arg(long, value_name = "NAME", requires = "mqtt")]
    mqtt_user: Option<String>,
    /// File whose first line is the user's password; only its owner may have permission to read it.
    #[arg(long, value_name = "FILE", requires = "mqtt_user")]
    mqtt_password_file: Option<PathBuf>,
}

/// The options' names, for commands that reject them.
pub(super) const NAMES: [&str; 3] = ["mqtt", "mqtt_user", "mqtt_password_file"];

impl MqttArgs {
    /// Begins to publish for the robot of this name; none without a broker.
    pub(super) fn begin(&self, robot: &str) -> Result<Option<MqttThread>, Failure> {
        let Some(broker) = &self.mqtt else { return Ok(None) };
        let password = self.mqtt_password_file.as_deref().map(Password::read).transpose();
        let password = password.map_err(|error| Failure::new(Kind::Config, error.to_string()))?;
        let account = self.mqtt_user.clone().map(|user| Account { user, password });
        let thread = MqttThread::begin(broker.clone(), account.as_ref(), robot);
        thread.map(Some).map_err(|error| Failure::new(Kind::Unavailable, format!("mqtt: {error}")))
    }
}
