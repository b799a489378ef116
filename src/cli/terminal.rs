//! Output for people: a progress bar during the run, a few lines at the end.

use super::{Failure, Kind};
use indicatif::{ProgressBar, ProgressStyle};
use slamd_core::FaultEvent;
use slamd_publish::Summary;
use std::io::{IsTerminal as _, Write as _};
use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;

/// A progress bar over the session's seconds, shown only on a terminal.
pub(super) fn progress(seconds: Option<f64>) -> ProgressBar {
    let bar = match seconds {
        Some(seconds) => ProgressBar::new(tenths(seconds)).with_style(style("{bar:40} {percent}% {msg}")),
        None => ProgressBar::new_spinner().with_style(style("{spinner} {prefix} {msg}")),
    };
    bar.set_draw_target(indicatif::ProgressDrawTarget::stderr());
    bar
}

/// A progress bar over `count` items, shown only on a terminal.
pub(super) fn progress_over(count: usize) -> ProgressBar {
    let bar = ProgressBar::new(count as u64).with_style(style("{bar:40} {pos} of {len}, {elapsed} {msg}"));
    bar.set_draw_target(indicatif::ProgressDrawTarget::stderr());
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    bar
}

/// Moves the bar.
pub(super) fn show(bar: &ProgressBar, seconds: f64) {
    let now = tenths(seconds);
    if now != bar.position() {
        bar.set_position(now);
        bar.set_message(format!("{seconds:.0} s of the drive"));
    }
}

/// Tells the person at the robot what to do: a live line on a terminal, otherwise a line for each new step, on standard error.
pub(super) struct Guide {
    bar: ProgressBar,
    is_terminal: bool,
    is_quiet: bool,
    step: String,
}

impl Guide {
    /// A guide that says nothing if it `is_quiet`.
    pub(super) fn new(is_quiet: bool) -> Self {
        let is_terminal = std::io::stderr().is_terminal();
        let bar = ProgressBar::new(0).with_style(style("{bar:20} {msg}"));
        bar.set_draw_target(if is_quiet {
            indicatif::ProgressDrawTarget::hidden()
        } else {
            indicatif::ProgressDrawTarget::stderr()
        });
        Self { bar, is_terminal, is_quiet, step: String::new() }
    }

    /// Shows the instruction, whose part before the colon names the step.
    pub(super) fn show(&mut self, elapsed_s: f64, length_s: f64, instruction: &str) {
        if self.is_terminal {
            self.bar.set_length(tenths(length_s));
            self.bar.set_position(tenths(elapsed_s));
            self.bar.set_message(format!("{elapsed_s:.0} s: {instruction}"));
            return;
        }
        let step = instruction.split(':').next().unwrap_or_default();
        if !self.is_quiet && step != self.step {
            step.clone_into(&mut self.step);
            tell(step);
        }
    }

    /// Says something that stays.
    pub(super) fn tell(&self, line: &str) {
        if !self.is_quiet {
            self.bar.suspend(|| tell(line));
        }
    }
}

impl Drop for Guide {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Why standard output did not take something, as when it is a file on a full disk.
static REFUSED: OnceLock<std::io::Error> = OnceLock::new();

/// Prints a line on standard output. A closed pipe (`| head`) is no failure; others are found by [`taken`].
pub(super) fn say(line: impl std::fmt::Display) {
    put(format!("{}\n", plain(line)).as_bytes());
}

/// Writes bytes to standard output, as [`say`] does.
pub(super) fn put(bytes: &[u8]) {
    let mut output = std::io::stdout().lock();
    note(output.write_all(bytes).and_then(|()| output.flush()));
}

/// Notes how a write to standard output ended.
pub(super) fn note(result: std::io::Result<()>) {
    if let Err(error) = result
        && error.kind() != std::io::ErrorKind::BrokenPipe
        && !is_closed_terminal(&error)
    {
        // The first one is the cause of others.
        let _ = REFUSED.set(error);
    }
}

/// A terminal that was closed answers so; its reader is gone like that of a closed pipe.
fn is_closed_terminal(error: &std::io::Error) -> bool {
    let kind = || rustix::fs::fstat(std::io::stdout()).map(|it| rustix::fs::FileType::from_raw_mode(it.st_mode));
    error.raw_os_error() == Some(rustix::io::Errno::IO.raw_os_error())
        && kind() == Ok(rustix::fs::FileType::CharacterDevice)
}

/// Whether standard output has taken everything. It does not wait for a write that hangs.
///
/// # Errors
/// Why it has not.
pub(super) fn taken() -> Result<(), Failure> {
    match REFUSED.get() {
        None => Ok(()),
        Some(error) => {
            let text = format!("standard output: {error}; the output is incomplete, write it elsewhere");
            Err(Failure::new(Kind::Io, text))
        }
    }
}

/// Prints a line on standard error. A closed pipe (`2>&1 | head`) is no failure; `eprintln!` would panic there.
pub(super) fn tell(line: impl std::fmt::Display) {
    let _ = writeln!(std::io::stderr(), "{}", plain(line));
}

/// Text without control characters except line feeds and tabs: text from a file or a board must not control the terminal.
pub(super) fn plain(text: impl std::fmt::Display) -> String {
    text.to_string().chars().filter(|c| !c.is_control() || matches!(c, '\n' | '\t')).collect()
}

/// Prints the summary as text or JSON on standard output, with the folder of the results if they are kept. The last line of the text says what came of the run.
///
/// # Errors
/// When nothing was mapped, with the reason.
pub(super) fn report(
    summary: &Summary,
    faulty: &[FaultEvent],
    folder: Option<&Path>,
    json: bool,
) -> Result<(), Failure> {
    if let Some(remark) = &summary.remark {
        tracing::warn!("{remark}");
    }
    if json {
        say(summary.to_json());
    } else {
        say_text(summary, faulty, folder);
    }
    match summary.nothing_mapped {
        Some(_) => Err(Failure::new(Kind::NothingMapped, summary.last_line())),
        None => Ok(()),
    }
}

/// Longest wait for a terminal or pipe that does not take a live session's summary, which is also in `summary.json`.
const PATIENCE: Duration = Duration::from_secs(5);

/// Runs `report`, but does not wait long for a standard output that hangs: the session is over and saved.
///
/// # Errors
/// As `report`; when standard output hangs and nothing was mapped.
pub(super) fn patiently(
    is_mapped: bool,
    report: impl FnOnce() -> Result<(), Failure> + Send + 'static,
) -> Result<(), Failure> {
    let (sender, done) = std::sync::mpsc::channel();
    let thread = std::thread::Builder::new().spawn(move || sender.send(report()));
    match (thread, done.recv_timeout(PATIENCE)) {
        (Ok(_), Ok(result)) => result,
        _ => {
            tracing::warn!("standard output does not take the summary: it is in summary.json");
            if is_mapped { Ok(()) } else { Err(Failure::new(Kind::NothingMapped, "nothing mapped")) }
        }
    }
}

fn say_text(summary: &Summary, faulty: &[FaultEvent], folder: Option<&Path>) {
    say(format_args!("{} sweeps, {} dropped, {} CRC errors", summary.sweeps, summary.dropped, summary.crc_errors));
    if let (Some(mean), Some(p99)) = (summary.mean_us_per_sweep, summary.p99_us_per_sweep) {
        say(format_args!("{mean:.0} us per sweep, 99th percentile {p99:.0} us"));
    }
    if let Some(latency) = &summary.latency {
        say(latency);
    }
    if let Some(accuracy) = &summary.accuracy {
        say(format_args!(
            "ATE {:.3} m, greatest {:.3} m, heading {:.2} degrees RMS",
            accuracy.ate_m, accuracy.ate_max_m, accuracy.heading_rmse_deg
        ));
    }
    for fault in faulty {
        say(format_args!("{} (since {:.1} s)", fault.reason, fault.at.seconds()));
    }
    for fault in &summary.encoder_faults {
        say(format_args!("{} (since {:.1} s)", fault.reason, fault.found_s));
    }
    if summary.nothing_mapped.is_none() {
        if let Some(folder) = folder {
            say(format_args!("map: {}", folder.join("map.png").display()));
        }
        say(summary.last_line());
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "seconds of a session")]
fn tenths(seconds: f64) -> u64 {
    (seconds.max(0.0) * 10.0) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_cannot_clear_the_screen() {
        assert_eq!(plain("a\tb\n\u{1b}[2Jc\r\u{9b}31m\u{7}"), "a\tb\n[2Jc31m");
    }
}
