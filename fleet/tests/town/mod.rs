//! A network of namespaces: a switch, and a machine at the end of each cable. Cables can be cut.

#![allow(dead_code, reason = "each user takes what it needs")]

use std::path::Path;
use std::process::{Child, Command, Stdio};

/// Namespaces that are gone when it is dropped, with all that runs in them.
pub(crate) struct Town {
    prefix: String,
    machines: Vec<String>,
    running: Vec<(String, Child)>,
}

fn ip(arguments: &str) -> Result<(), String> {
    let output = Command::new("ip").args(arguments.split(' ')).output().map_err(|error| format!("ip: {error}"))?;
    if output.status.success() {
        Ok(())
    } else {
        Err(format!("ip {arguments}: {}", String::from_utf8_lossy(&output.stderr)))
    }
}

impl Town {
    /// A switch and machines at 10.77.0.1, .2 and so on; why not, where that is not permitted.
    pub(crate) fn build(machines: &[&str]) -> Result<Self, String> {
        let prefix = format!("fleet{}", std::process::id());
        let mut town = Self { prefix, machines: Vec::new(), running: Vec::new() };
        let switch = town.space("switch");
        ip(&format!("netns add {switch}"))?;
        town.machines.push("switch".into());
        ip(&format!("-n {switch} link add switch type bridge"))?;
        ip(&format!("-n {switch} link set switch up"))?;
        for (place, machine) in machines.iter().enumerate() {
            let space = town.space(machine);
            ip(&format!("netns add {space}"))?;
            town.machines.push((*machine).into());
            ip(&format!("-n {switch} link add {machine} type veth peer name eth0 netns {space}"))?;
            ip(&format!("-n {switch} link set {machine} master switch"))?;
            ip(&format!("-n {switch} link set {machine} up"))?;
            ip(&format!("-n {space} addr add 10.77.0.{}/24 dev eth0", place + 1))?;
            ip(&format!("-n {space} link set lo up"))?;
            ip(&format!("-n {space} link set eth0 up"))?;
        }
        Ok(town)
    }

    fn space(&self, machine: &str) -> String {
        format!("{}-{machine}", self.prefix)
    }

    /// Cuts a machine's cable at the switch, or mends it.
    pub(crate) fn cable(&self, machine: &str, is_whole: bool) {
        let state = if is_whole { "up" } else { "down" };
        ip(&format!("-n {} link set {machine} {state}", self.space("switch"))).unwrap();
    }

    /// Starts a program on a machine; its log goes to a file.
    pub(crate) fn start(&mut self, machine: &str, arguments: &[&str], log: &Path) {
        let log = std::fs::OpenOptions::new().create(true).append(true).open(log).unwrap();
        let child = Command::new("ip")
            .args(["netns", "exec", &self.space(machine), env!("CARGO_BIN_EXE_slamd-fleet")])
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .unwrap();
        self.running.push((machine.into(), child));
    }

    /// Kills what runs on a machine: no farewell, nothing is flushed.
    pub(crate) fn kill(&mut self, machine: &str) {
        // `ip netns exec` becomes the program: it has its number.
        for (_, child) in self.running.iter_mut().filter(|(known, _)| known == machine) {
            child.kill().unwrap();
            child.wait().unwrap();
        }
        self.running.retain(|(known, _)| known != machine);
    }

    /// A program that ended without being killed.
    pub(crate) fn ended(&mut self) -> Option<String> {
        let mut running = self.running.iter_mut();
        running.find_map(|(machine, child)| matches!(child.try_wait(), Ok(Some(_))).then(|| machine.clone()))
    }
}

impl Drop for Town {
    fn drop(&mut self) {
        for (_, child) in &mut self.running {
            let _ = child.kill();
            let _ = child.wait();
        }
        for machine in &self.machines {
            let _ = ip(&format!("netns del {}", self.space(machine)));
        }
    }
}
