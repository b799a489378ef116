//! Pulling the cable and putting it back, many times.

use super::daemon::Daemon;
use super::{Board, Device, Plugged};
use std::time::{Duration, Instant};

/// What was measured.
#[derive(Debug)]
pub struct Replugs {
    /// From the node's return to the first sweep, milliseconds, sorted.
    pub recovered_ms: Vec<f64>,
    /// File descriptors after the first tenth and at the end.
    pub descriptors: [usize; 2],
    /// Resident memory after the first tenth and at the end, KiB.
    pub resident_kib: [u64; 2],
    /// Share of one core used while the port is absent.
    pub absent_cpu: f64,
}

/// A board without a boot loader speaks this long after it is plugged in.
const BOOT: Duration = Duration::from_millis(150);
const ABSENCE: Duration = Duration::from_secs(5);

/// Unplugs and replugs a robot; every other time its board is powered by the host and restarts.
#[expect(clippy::disallowed_methods, reason = "the test measures in real time")]
pub fn replug(cycles: u64, mut progress: impl FnMut()) -> Replugs {
    let folder = tempfile::tempdir().expect("a folder");
    let port = folder.path().join("robot");
    // With -v the log does not sum up what repeats.
    let mut daemon = Daemon::start_with(port.to_str().expect("plain"), &folder.path().join("out"), &["-v"]);
    let mut device = Device::new(Board::robot(1), 1);
    let mut measured = Replugs { recovered_ms: Vec::new(), descriptors: [0; 2], resident_kib: [0; 2], absent_cpu: 0.0 };
    for cycle in 0..cycles {
        if cycle % 2 == 1 {
            device.boots_in(BOOT);
        }
        let plugged = Plugged::new(&port, device);
        let back = Instant::now();
        let heard = daemon.expect("link: streaming", Duration::from_secs(10));
        measured.recovered_ms.push(heard.duration_since(back).as_secs_f64() * 1e3);
        if cycle == cycles / 10 || cycle + 1 == cycles {
            let when = usize::from(cycle + 1 == cycles);
            measured.descriptors[when] = daemon.descriptors();
            measured.resident_kib[when] = daemon.resident_kib();
        }
        device = plugged.unplug();
        daemon.expect("link: searching", Duration::from_secs(10));
        // From the next look at a missing port up to several of them.
        std::thread::sleep(Duration::from_millis(20 + 37 * cycle % 200));
        progress();
    }
    let before = daemon.cpu_ticks();
    std::thread::sleep(ABSENCE);
    measured.absent_cpu = (daemon.cpu_ticks() - before) as f64 * 0.01 / ABSENCE.as_secs_f64();
    measured.recovered_ms.sort_by(f64::total_cmp);
    daemon.end();
    measured
}

impl Replugs {
    /// The recovery time that a share of the cycles stays below, milliseconds.
    pub fn quantile_ms(&self, share: f64) -> f64 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
        let place = (share * (self.recovered_ms.len() - 1) as f64).round() as usize;
        self.recovered_ms[place]
    }

    /// What is promised.
    ///
    /// # Panics
    /// When a promise is broken.
    pub fn check(&self) {
        assert!(self.quantile_ms(1.0) <= 500.0, "{self:?}");
        assert_eq!(self.descriptors[0], self.descriptors[1], "{self:?}");
        assert!(self.resident_kib[1] <= self.resident_kib[0] + 4_096, "the map grows, nothing else: {self:?}");
        assert!(self.absent_cpu < 0.02, "{self:?}");
    }
}
