//! `/metrics` and `/healthz` of the real program, as Prometheus and a watchdog meet them.
//!
//! The test makes a Python environment in Cargo's target folder: it needs `python3` with `venv`, and PyPI the first time.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_testkit::mock_port::Board;
use slamd_testkit::python;
use slamd_testkit::served::{SOON, Served, get};
use std::path::PathBuf;
use std::process::Command;

const PROMETHEUS: &str = "prometheus_client==0.22.1";
/// Reads a page as Prometheus does; prints each sample's name and value, and what is not described.
const SCRIPT: &str = r"
import sys, urllib.request
from prometheus_client.parser import text_string_to_metric_families
with urllib.request.urlopen(sys.argv[1]) as page:
    families = list(text_string_to_metric_families(page.read().decode()))
for family in families:
    assert family.documentation and family.type in ('counter', 'gauge') and family.samples, family
    for sample in family.samples:
        print(sample.name, ','.join(sample.labels.values()), sample.value)
";

/// Python with Prometheus' client library.
fn python() -> PathBuf {
    python::python(env!("CARGO_TARGET_TMPDIR"), "prometheus", "prometheus_client", &[PROMETHEUS])
}

#[test]
fn prometheus_reads_the_metrics_and_healthz_reports_the_state() {
    let python = python();
    let mut served = Served::new(&["--metrics", "127.0.0.1:0"]);
    let address = served.address();
    let sick = get(&address, "/healthz", "");
    assert!(sick.starts_with("HTTP/1.1 503 ") && sick.contains("searching: port missing"), "{sick}");
    assert!(get(&address, "/", "").starts_with("HTTP/1.1 404 "));
    let board = served.plug_in(Board::robot(3));
    served.daemon.expect("poses and map begin", SOON);
    let well = get(&address, "/healthz", "");
    assert!(well.starts_with("HTTP/1.1 200 ") && well.contains("\r\n\r\nstreaming: "), "{well}");
    let output = Command::new(python).args(["-c", SCRIPT, &format!("http://{address}/metrics")]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let value = |name: &str| -> f64 {
        let line = text.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("no {name} in\n{text}"));
        line.rsplit(' ').next().unwrap().parse().unwrap()
    };
    assert!(value("slamd_sweeps_total ") >= 1.0 && value("slamd_dropped_sweeps_total ") < 1.0, "{text}");
    assert!(value("slamd_sensors ") > 31.0 && value("slamd_link_state streaming") > 0.0, "{text}");
    assert!(
        value("slamd_sensor_faulty 31") < 1.0
            && value("slamd_model_findings ") < 1.0
            && value("slamd_position_sigma_metres ") > 0.0,
        "{text}"
    );
    board.unplug();
    served.daemon.expect("link: searching", SOON);
    assert!(get(&address, "/healthz", "").starts_with("HTTP/1.1 503 "));
    served.daemon.end();
}
