//! `cargo bench -p slamd-protocol --bench noise [-- --bytes 1e9]`: sends noisy bytes through the
//! decoder and checks that it accepts no wrong frame.

#[path = "../tests/messages/mod.rs"]
mod messages;
#[path = "../tests/noisy_line/mod.rs"]
mod noisy_line;

use indicatif::{ProgressBar, ProgressStyle};
use noisy_line::{Line, send_in_parallel};

#[expect(clippy::disallowed_methods, reason = "a bench measures time")]
fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let bytes = arguments.iter().position(|argument| argument == "--bytes");
    let bytes = bytes.and_then(|place| arguments.get(place + 1)).map_or("1e9", String::as_str);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive number of bytes")]
    let bytes = bytes.parse::<f64>().expect("--bytes NUMBER") as u64;
    let style = ProgressStyle::with_template("{bar:40} {percent}% {bytes_per_sec} {eta}").expect("a template");
    println!(
        "| byte errors | slips | bytes | frames sent | accepted | lost | wrong | MB/s |\n|---|---|---|---|---|---|---|---|"
    );
    let mut is_good = true;
    for (errors_per_million, slips_per_million) in [(1_000, 100), (10_000, 1_000)] {
        let bar = ProgressBar::new(bytes).with_style(style.clone());
        let begin = std::time::Instant::now();
        let outcome = send_in_parallel(Line { errors_per_million, slips_per_million }, bytes, |part| bar.inc(part));
        bar.finish_and_clear();
        let mb_s = outcome.bytes as f64 * 1e-6 / begin.elapsed().as_secs_f64();
        println!(
            "| {:.0e} | {:.0e} | {:.2e} | {} | {} | {:.2} % | {} | {mb_s:.0} |",
            errors_per_million as f64 * 1e-6,
            slips_per_million as f64 * 1e-6,
            outcome.bytes as f64,
            outcome.sent,
            outcome.accepted,
            100.0 * (outcome.sent - outcome.accepted) as f64 / outcome.sent as f64,
            outcome.wrong,
        );
        is_good &= outcome.wrong == 0;
    }
    assert!(is_good, "a wrong frame was accepted");
}
