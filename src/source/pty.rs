//! The simulated board on a pseudo-terminal, in real time.

use serialport::{SerialPort, TTYPort};
use slamd_capture::Record;
use slamd_core::Timestamp;
use slamd_sim::simulation::Simulation;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Longest wait for the host's bytes; the simulation advances between two waits.
const WAIT: Duration = Duration::from_millis(2);

/// The symbolic link to the pseudo-terminal, removed on drop unless it leads elsewhere by then.
struct Symlink {
    name: PathBuf,
    device: PathBuf,
}

impl Symlink {
    fn create(name: &Path, device: PathBuf) -> io::Result<Self> {
        if let Ok(target) = std::fs::read_link(name) {
            if target.exists() {
                let text =
                    format!("it leads to {}: another simulator serves it, choose another name", target.display());
                return Err(io::Error::new(io::ErrorKind::AlreadyExists, text));
            }
            std::fs::remove_file(name)?;
        }
        std::os::unix::fs::symlink(&device, name).map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => {
                io::Error::new(error.kind(), "a file of that name is there already: choose another name")
            }
            _ => error,
        })?;
        Ok(Self { name: name.into(), device })
    }
}

impl Drop for Symlink {
    fn drop(&mut self) {
        if std::fs::read_link(&self.name).is_ok_and(|target| target == self.device) {
            let _ = std::fs::remove_file(&self.name);
        }
    }
}

/// Serves the simulated board under `name` until its session ends. Unread bytes are lost, as on a real line.
///
/// # Errors
/// When no pseudo-terminal is free, or `name` exists and is not an abandoned link.
#[expect(clippy::disallowed_methods, reason = "a board in real time is a clock")]
pub fn serve(mut simulation: Simulation, name: &Path) -> io::Result<()> {
    let (mut master, slave) = TTYPort::pair()?;
    master.set_timeout(WAIT)?;
    let device = slave.name().ok_or_else(|| io::Error::other("the pseudo-terminal has no name"))?;
    // An open descriptor here would lock the device for the host.
    drop(slave);
    let _link = Symlink::create(name, device.into())?;
    let _ = writeln!(io::stdout(), "{}", name.display());
    let begin = std::time::Instant::now();
    let mut buffer = [0; 256];
    loop {
        let now = Timestamp::default() + begin.elapsed();
        if now >= simulation.duration() {
            return Ok(());
        }
        while let Some(record) = simulation.poll(now) {
            let Record::Received { bytes, .. } = record else { continue };
            let _ = master.write_all(&bytes);
        }
        match master.read(&mut buffer) {
            Ok(count) => simulation.hear(now, buffer.get(..count).unwrap_or(&buffer)),
            // A timeout, or the other end is not open: the board treats both alike.
            Err(_) => std::thread::sleep(WAIT),
        }
    }
}
