//! Clocks that jump or stand still: a virtual machine that was paused finds the board ahead.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_core::{Config, Timestamp, stages::Aligner};
use slamd_protocol::Encoder;

#[test]
fn a_board_that_ran_on_while_the_host_stood_still_is_matched_anew() {
    for jump_us in [1_000_000, 10_000_000, 1_800_000_000] {
        let mut aligner = Aligner::new(&Config::default().ring);
        let (mut host_us, mut board_us) = (1_000_000, 5_000_000);
        for i in 0..400 {
            (host_us, board_us) = (host_us + 20_000, board_us + 20_000);
            if i == 200 {
                board_us += jump_us;
            }
            let encoder = Encoder { t_us: board_us, left_ticks: 0, right_ticks: 0, flags: 0 };
            aligner.encoder(&encoder, Timestamp::from_us(host_us + 2_000)).unwrap();
            if i % 25 == 0 {
                let [sent, heard] = [0, 4_000].map(|us| Timestamp::from_us(host_us + us));
                aligner.round_trip(sent, board_us + 2_000, board_us + 2_000, heard).unwrap();
            }
        }
        let next = Timestamp::from_us(host_us + 22_000);
        assert!(aligner.continues(board_us + 20_000, next), "after {jump_us} us");
    }
}
