//! Sends a hundred million noisy bytes through the decoder;
//! `cargo bench -p slamd-protocol --bench noise` sends a thousand million.

mod messages;
mod noisy_line;

use noisy_line::{Line, send_in_parallel};

#[test]
fn no_wrong_frame_is_accepted() {
    for (line, bytes) in [
        (Line { errors_per_million: 1_000, slips_per_million: 100 }, 100_000_000),
        (Line { errors_per_million: 10_000, slips_per_million: 1_000 }, 10_000_000),
        (Line { errors_per_million: 50_000, slips_per_million: 5_000 }, 10_000_000),
    ] {
        let outcome = send_in_parallel(line, bytes, |_| ());
        println!("{line:?}: {outcome:?}");
        assert_eq!(outcome.wrong, 0);
        assert!(outcome.bytes >= bytes);
        assert!(outcome.accepted > outcome.sent / 100, "too few frames were accepted for a meaningful test");
        assert!(outcome.crc_errors > 1_000, "too few checksums failed for a meaningful test");
    }
}
