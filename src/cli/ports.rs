//! `slamd ports`: the serial ports there are, who holds them, whether this user may open them.

use super::{Failure, Kind, terminal};
use crate::port::{self, Holder, PortInfo, UsbId};
use clap::Args;
use serde::Serialize;

const EXAMPLES: &str = "Examples:
  slamd ports
  slamd ports --json | jq -r '.[].path'";

/// List the serial ports, who holds them, and the name to give to --port.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct PortsArgs {
    /// Print JSON for programs
    #[arg(long)]
    json: bool,
}

/// A port as this command tells it.
#[derive(Serialize)]
struct Line {
    #[serde(flatten)]
    port: PortInfo,
    /// What to give to `--port`.
    name: String,
    holders: Vec<Holder>,
}

impl PortsArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        let lines: Vec<Line> = port::list().into_iter().map(Line::new).collect();
        if self.json {
            let json = serde_json::to_string_pretty(&lines);
            terminal::say(json.map_err(|error| Failure::new(Kind::Data, error.to_string()))?);
            return Ok(());
        }
        for line in &lines {
            terminal::say(line);
        }
        if lines.is_empty() {
            terminal::say(
                "No serial port. Plug the board in with a cable that carries data; `slamd simulate --pty robot` plays one.",
            );
        }
        Ok(())
    }
}

impl Line {
    fn new(port: PortInfo) -> Self {
        let name = match (&port.by_id, &port.usb) {
            (Some(by_id), _) => by_id.display().to_string(),
            (None, Some(usb)) => usb.port_name(),
            (None, None) => port.path.display().to_string(),
        };
        Self { holders: port::holders(&port.path), name, port }
    }
}

impl std::fmt::Display for Line {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let what = self.port.usb.as_ref().map_or_else(|| "of this machine, not on USB".into(), words);
        write!(f, "{}  {what}", self.port.path.display())?;
        if !self.holders.is_empty() {
            let holders: Vec<String> = self.holders.iter().map(Holder::to_string).collect();
            write!(f, "  held by {}", holders.join(" and "))?;
        }
        write!(f, "\n    slamd --port {}", self.name)
    }
}

fn words(usb: &UsbId) -> String {
    let words = [&usb.manufacturer, &usb.product].into_iter().flatten().map(String::as_str);
    let words = words.collect::<Vec<_>>().join(" ");
    if words.is_empty() { format!("{:04x}:{:04x}", usb.vid, usb.pid) } else { words }
}
