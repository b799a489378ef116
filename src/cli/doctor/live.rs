//! Examines the board at a port for some seconds.

use super::{DoctorArgs, host};
use crate::cli::{Failure, Kind, config, terminal};
use crate::doctor::{Examination, Finding, Level, Report};
use crate::port::{self, PortError, PortName};
use bytes::{Buf as _, Bytes};
use slamd_core::{Config, Timestamp};
use std::collections::VecDeque;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio_serial::{SerialPort as _, SerialStream};

/// Time to try all usual baud rates, which is needed if no valid frame arrives, seconds.
const BAUD_SCAN_S: f64 = 20.0;
const CHUNK: usize = 4096;
/// Update period of the progress bar.
const BAR_PERIOD: Duration = Duration::from_millis(100);

/// The report, and whether the port could be used.
pub(super) fn examine(args: &DoctorArgs, name: &PortName) -> Result<(Report, bool), Failure> {
    let config = config::of_robot(args.config.as_deref())?;
    let mut findings = host::findings(&args.out);
    let path = match name.resolve() {
        Ok(path) => path,
        Err(error) => return Ok(unusable(findings, &error)),
    };
    findings.extend(host::of_port(&path));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| Failure::new(Kind::Unavailable, format!("tokio: {error}")))?;
    let _guard = runtime.enter();
    let stream = match port::open(&path, args.baud) {
        Ok(stream) => stream,
        Err(error) => return Ok(unusable(findings, &error)),
    };
    let port = path.display().to_string();
    findings.push(Finding::ok("port.open", format!("{port} is open at {} baud", args.baud)));
    if !args.json {
        eprintln!(
            "Examining for {:.0} s: push the robot forward 30 cm now, then turn it left on the spot.",
            args.seconds
        );
    }
    let (examination, gone) = runtime.block_on(listen(args, &config, stream, &port));
    let (of_board, sensors) = examination.findings();
    findings.extend(of_board);
    if let Some(text) = &gone {
        let fix = "check the plug and the cable, and the board's supply";
        findings.push(Finding::new(Level::Problem, "port.gone", format!("{port} went away: {text}"), fix));
    }
    Ok((Report::new(findings, sensors), true))
}

fn unusable(mut findings: Vec<Finding>, error: &PortError) -> (Report, bool) {
    let text = error.to_string();
    let (text, fix) = text.split_once("; ").unwrap_or((&text, "see `slamd ports`"));
    findings.push(Finding::new(Level::Problem, "port.open", text, fix));
    (Report::new(findings, Vec::new()), false)
}

/// What woke the loop.
enum Wake {
    Read(std::io::Result<usize>),
    Wrote(std::io::Result<usize>),
    Deadline,
}

/// Examines the board for the given time. Also returns why the port was lost, if it was.
#[expect(clippy::disallowed_methods, reason = "the clock's time becomes an input here")]
async fn listen(args: &DoctorArgs, config: &Config, stream: SerialStream, port: &str) -> (Examination, Option<String>) {
    let mut examination = Examination::new(config, args.baud, port);
    let begin = Instant::now();
    let now = || Timestamp::default() + begin.elapsed();
    let bar = terminal::progress(Some(args.seconds));
    let (mut reader, mut writer) = tokio::io::split(stream);
    let mut outgoing: VecDeque<Bytes> = VecDeque::new();
    let mut chunk = vec![0; CHUNK];
    loop {
        let elapsed_s = now().seconds();
        let length_s = if examination.has_frames() { args.seconds } else { args.seconds.max(BAUD_SCAN_S) };
        if elapsed_s >= length_s {
            bar.finish_and_clear();
            return (examination, None);
        }
        terminal::show(&bar, elapsed_s);
        let deadline = examination.next_deadline().min(now() + BAR_PERIOD);
        let deadline = begin + Duration::from_micros(deadline.us());
        let wake = tokio::select! {
            read = reader.read(&mut chunk) => Wake::Read(read),
            wrote = write(&mut writer, outgoing.front()) => Wake::Wrote(wrote),
            () = tokio::time::sleep_until(deadline.into()) => Wake::Deadline,
        };
        let at = now();
        let failed = match wake {
            Wake::Read(Ok(0)) => Some("it hung up".into()),
            Wake::Read(Ok(count)) => {
                examination.received(at, chunk.get(..count).unwrap_or_default());
                None
            }
            Wake::Wrote(Ok(count)) => {
                if let Some(first) = outgoing.front_mut() {
                    let written = first.split_to(count.min(first.len()));
                    examination.sent(at, &written);
                }
                outgoing.pop_front_if(|first| !first.has_remaining());
                None
            }
            Wake::Read(Err(error)) | Wake::Wrote(Err(error)) => Some(error.to_string()),
            Wake::Deadline => {
                examination.run_until(at);
                None
            }
        };
        if failed.is_some() {
            bar.finish_and_clear();
            return (examination, failed);
        }
        outgoing.extend(examination.take_transmit());
        if let Some(baud) = examination.take_baud() {
            let mut stream = reader.unsplit(writer);
            let set = stream.set_baud_rate(baud);
            if let Err(error) = set {
                bar.finish_and_clear();
                return (examination, Some(error.to_string()));
            }
            (reader, writer) = tokio::io::split(stream);
        }
    }
}

/// Writes the frame; never completes if there is none.
async fn write(writer: &mut tokio::io::WriteHalf<SerialStream>, frame: Option<&Bytes>) -> std::io::Result<usize> {
    match frame {
        Some(frame) => writer.write(frame).await,
        None => std::future::pending().await,
    }
}
