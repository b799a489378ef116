//! Examines the board at a port for some seconds.

use super::{DoctorArgs, host};
use crate::cli::serial::{self, Ended, Timed};
use crate::cli::{Failure, config, run};
use crate::daemon::Shutdown;
use crate::doctor::{Examination, Finding, Level, Report};
use crate::port::{self, PortError, PortName};

/// The report, and whether the port could be used.
pub(super) fn examine(args: &DoctorArgs, name: &PortName) -> Result<(Report, bool), Failure> {
    let config = config::of_robot(args.config.as_deref())?;
    let mut findings = host::findings(&args.out);
    let path = match name.resolve() {
        Ok(path) => path,
        Err(error) => return Ok(unusable(findings, &error)),
    };
    findings.extend(host::of_port(&path));
    let runtime = run::runtime()?;
    let _guard = runtime.enter();
    let mut stream = match port::open(&path, args.baud) {
        Ok(stream) => stream,
        Err(error) => return Ok(unusable(findings, &error)),
    };
    let port = path.display().to_string();
    findings.push(Finding::ok("port.open", format!("{port} is open at {} baud", args.baud)));
    let examination = Examination::new(&config, args.baud, &port);
    let mut timed = Timed { examination, seconds: args.seconds };
    let mut shutdown = Shutdown::new(None)?;
    // A signal ends it early: what was found until then is told.
    let ended = runtime.block_on(serial::listen(&mut timed, &mut stream, &mut shutdown, args.json));
    let (of_board, sensors) = timed.examination.findings();
    findings.extend(of_board);
    if let Some(Ended::Gone(text)) = &ended {
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
