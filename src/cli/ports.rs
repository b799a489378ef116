//! `slamd ports`: lists the serial ports and the programs that hold them.

use super::{Failure, Kind, terminal};
use crate::port::{self, Holder, PortInfo, UsbId};
use clap::Args;
use serde::Serialize;

const EXAMPLES: &str = "Examples:
  slamd ports
  slamd ports --json | jq -r '.[].path'";

/// List the serial ports, the programs that hold them, and the name for --port.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct PortsArgs {
    /// Print JSON for programs
    #[arg(long)]
    json: bool,
}

/// A port in the list.
#[derive(Serialize)]
struct Entry {
    #[serde(flatten)]
    port: PortInfo,
    /// The name for `--port`.
    name: String,
    holders: Vec<Holder>,
}

impl PortsArgs {
    pub(super) fn run(self) -> Result<(), Failure> {
        let entries: Vec<Entry> = port::list().into_iter().map(Entry::new).collect();
        if self.json {
            let json = serde_json::to_string_pretty(&entries);
            terminal::say(json.map_err(|error| Failure::new(Kind::Data, error.to_string()))?);
            return Ok(());
        }
        for entry in &entries {
            terminal::say(entry);
        }
        if entries.is_empty() {
            terminal::say(
                "No serial port. Plug the board in with a cable that carries data, or simulate one with `slamd simulate --pty robot`.",
            );
        }
        Ok(())
    }
}

impl Entry {
    fn new(port: PortInfo) -> Self {
        let name = match (&port.by_id, &port.usb) {
            (Some(by_id), _) => by_id.display().to_string(),
            (None, Some(usb)) => usb.port_name(),
            (None, None) => port.path.display().to_string(),
        };
        Self { holders: port::holders(&port.path), name, port }
    }
}

impl std::fmt::Display for Entry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let what = self.port.usb.as_ref().map_or_else(|| "built in, not on USB".into(), usb_name);
        write!(f, "{}  {what}", self.port.path.display())?;
        if !self.holders.is_empty() {
            let holders: Vec<String> = self.holders.iter().map(Holder::to_string).collect();
            write!(f, "  held by {}", holders.join(" and "))?;
        }
        write!(f, "\n    slamd --port {}", self.name)
    }
}

fn usb_name(usb: &UsbId) -> String {
    let names = [&usb.manufacturer, &usb.product].into_iter().flatten().map(String::as_str);
    let name = names.collect::<Vec<_>>().join(" ");
    if name.is_empty() { format!("{:04x}:{:04x}", usb.vid, usb.pid) } else { name }
}
