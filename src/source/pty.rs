//! The simulated board on a pseudo-terminal, in real time.

use serialport::{SerialPort, TTYPort};
use slamd_capture::Record;
use slamd_core::Timestamp;
use slamd_sim::simulation::Simulation;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long one wait for the host's bytes takes: the simulation advances between two.
const WAIT: Duration = Duration::from_millis(2);

/// The name of the pseudo-terminal, gone when dropped unless another has taken it.
struct Link {
    name: PathBuf,
    device: PathBuf,
}

impl Link {
    fn create(name: &Path, device: PathBuf) -> io::Result<Self> {
        if let Ok(target) = std::fs::read_link(name) {
            if target.exists() {
                let words =
                    format!("it leads to {}: another simulator serves it, choose another name", target.display());
                return Err(io::Error::new(io::ErrorKind::AlreadyExists, words));
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

impl Drop for Link {
    fn drop(&mut self) {
        if std::fs::read_link(&self.name).is_ok_and(|target| target == self.device) {
            let _ = std::fs::remove_file(&self.name);
        }
    }
}

/// Serves the simulated board under `name` until its session ends. Bytes that nobody reads are lost, as on a real line.
///
/// # Errors
/// When there is no pseudo-terminal to be had, or `name` is taken by something that is not a link.
#[expect(clippy::disallowed_methods, reason = "a board in real time is a clock")]
pub fn serve(mut simulation: Simulation, name: &Path) -> io::Result<()> {
    let (mut master, slave) = TTYPort::pair()?;
    master.set_timeout(WAIT)?;
    let device = slave.name().ok_or_else(|| io::Error::other("the pseudo-terminal has no name"))?;
    // Whoever holds it locks it.
    drop(slave);
    let _link = Link::create(name, device.into())?;
    let _ = writeln!(io::stdout(), "{}", name.display());
    let begin = std::time::Instant::now();
    let mut heard = [0; 256];
    loop {
        let now = Timestamp::default() + begin.elapsed();
        if now >= simulation.duration() {
            return Ok(());
        }
        while let Some(record) = simulation.poll(now) {
            let Record::Received { bytes, .. } = record else { continue };
            let _ = master.write_all(&bytes);
        }
        match master.read(&mut heard) {
            Ok(count) => simulation.hear(now, heard.get(..count).unwrap_or(&heard)),
            // A timeout, or nobody has the other end open: a board does not know the difference.
            Err(_) => std::thread::sleep(WAIT),
        }
    }
}
