//! Rates, pose and wheels in numbers.

use crate::monitor::dashboard::{Dashboard, Tone};
use crate::monitor::view::Look;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use slamd_core::{EncoderState, Wheel};

/// Eleven lines of at most 26 characters.
pub(super) fn lines(dashboard: &Dashboard, look: Look) -> Vec<Line<'static>> {
    let (rates, counters) = (&dashboard.rates, &dashboard.session.counters);
    let mut lines = vec![
        rate("sweeps", rates.sweeps, counters.sweeps, look),
        rate("frames", rates.frames, counters.frames, look),
        trouble("CRC err", rates.crc_errors, counters.crc_errors, look),
        trouble("lost fr", rates.lost_frames, counters.lost_frames, look),
        trouble("drops", rates.dropped_sweeps, counters.dropped_sweeps, look),
    ];
    lines.extend(pose(dashboard, look));
    lines.extend(wheels(dashboard, look));
    lines
}

fn rate(name: &str, per_second: f64, count: u64, look: Look) -> Line<'static> {
    Line::from(vec![
        Span::styled(format!("{name:<8}"), look.faint()),
        Span::raw(format!("{per_second:6.1}/s {:>8}", short(count))),
    ])
}

/// A rate that should be 0: highlighted while it is not.
fn trouble(name: &str, per_second: f64, count: u64, look: Look) -> Line<'static> {
    let line = rate(name, per_second, count, look);
    if per_second > 0.0 { line.patch_style(look.tone(Tone::Bad)) } else { line }
}

/// A count in at most 8 characters.
fn short(count: u64) -> String {
    match count {
        0..=99_999_999 => count.to_string(),
        _ => format!("{:.1e}", count as f64),
    }
}

fn pose(dashboard: &Dashboard, look: Look) -> Vec<Line<'static>> {
    let Some(estimate) = &dashboard.session.estimate else {
        return ["x", "y", "heading"].map(|name| value(name, "not known yet".into(), look)).into();
    };
    let sigma = |axis: usize| libm::sqrt(estimate.covariance[(axis, axis)].max(0.0));
    let metres = |m: f64, axis| format!("{m:7.3} {} {:.3} m", look.plus_minus(), sigma(axis));
    let (pose, unit) = (estimate.pose, look.degree());
    let heading =
        format!("{:5.1} {} {:.1}{unit}", pose.theta_rad.to_degrees(), look.plus_minus(), sigma(2).to_degrees());
    vec![value("x", metres(pose.x_m, 0), look), value("y", metres(pose.y_m, 1), look), value("heading", heading, look)]
}

fn wheels(dashboard: &Dashboard, look: Look) -> Vec<Line<'static>> {
    let Some(wheels) = &dashboard.session.calibration else {
        return vec![value("wheels", "not learnt".into(), look)];
    };
    let sign = look.plus_minus();
    vec![
        encoders(dashboard, look),
        value("ratio", format!("{:.4} {sign} {:.4}", wheels.wheel_ratio, wheels.wheel_ratio_sigma), look),
        value("base", format!("{:.4} {sign} {:.4} m", wheels.wheel_base_m, wheels.wheel_base_sigma_m), look),
    ]
}

/// A heading, or instead of it the encoder that is broken.
fn encoders(dashboard: &Dashboard, look: Look) -> Line<'static> {
    let broken = |wheel: usize| dashboard.session.encoders[wheel] != EncoderState::Healthy;
    (0..2).find(|&wheel| broken(wheel)).map_or_else(
        || Line::styled("wheels, right to left", look.faint()),
        |wheel| {
            let (word, state) = (Wheel::BOTH[wheel].word(), dashboard.session.encoders[wheel].word());
            Line::styled(format!("{word} encoder {state}"), look.tone(Tone::Bad))
        },
    )
}

fn value(name: &str, words: String, look: Look) -> Line<'static> {
    Line::from(vec![Span::styled(format!("{name:<8}"), look.faint()), Span::styled(words, Style::new())])
}
