//! The link's states and messages without a port: received bytes go in, changes and recovery actions come out.

#![allow(clippy::unwrap_used, reason = "a test may")]

use slamd_core::{
    Board, Timestamp,
    link::{Link, LinkChange, LinkState, Reception, Remedy, USUAL_BAUDS},
};
use slamd_protocol::{Hello, Text};

struct Bench {
    link: Link,
    board: Board,
    frames: u64,
    groups: u64,
    restarts: u64,
    echoed: u64,
    ms: u64,
    remedies: Vec<Remedy>,
}

impl Bench {
    fn open() -> Self {
        let mut bench = Self {
            link: Link::new(115_200),
            board: Board::default(),
            frames: 0,
            groups: 0,
            restarts: 0,
            echoed: 0,
            ms: 0,
            remedies: Vec::new(),
        };
        bench.link.opened(Timestamp::default(), "/dev/ttyUSB0", &reception(&bench.board, [0; 4]));
        assert_eq!(bench.changes(), ["link: listening (/dev/ttyUSB0 is open at 115200 baud)"]);
        bench
    }

    fn numbers(&self) -> [u64; 4] {
        [self.frames, self.groups, self.restarts, self.echoed]
    }

    fn hear(&mut self, bytes: &[u8]) {
        let at = Timestamp::from_us(self.ms * 1000);
        self.link.heard(at, bytes, &reception(&self.board, self.numbers()));
    }

    /// A tick each millisecond.
    fn wait(&mut self, ms: u64) {
        for _ in 0..ms {
            self.ms += 1;
            self.link.tick(Timestamp::from_us(self.ms * 1000), &reception(&self.board, self.numbers()));
            self.remedies.extend(self.link.take_remedy());
        }
    }

    fn echoes(&mut self) {
        (self.frames, self.groups) = (self.frames + 1, self.groups + 1);
        self.hear(&[1, 2, 3]);
    }

    fn changes(&mut self) -> Vec<String> {
        std::iter::from_fn(|| self.link.poll_change()).map(|change: LinkChange| change.to_string()).collect()
    }
}

fn reception(board: &Board, [frames, groups, restarts, echoed]: [u64; 4]) -> Reception<'_> {
    Reception { frames, groups, restarts, echoed, board, trouble: None, waits_for_movement: false }
}

#[test]
fn a_healthy_board_streams_goes_stale_is_lost_and_comes_back() {
    let mut bench = Bench::open();
    bench.wait(100);
    bench.frames = 1;
    bench.hear(b"hello");
    assert_eq!(bench.changes(), ["link: handshake (the board speaks at 115200 baud)"]);
    for _ in 0..20 {
        bench.wait(25);
        bench.echoes();
    }
    assert_eq!(bench.changes(), ["link: streaming (/dev/ttyUSB0 at 115200 baud)"]);
    bench.wait(499);
    assert!(bench.changes().is_empty());
    bench.wait(1);
    assert_eq!(bench.changes(), ["link: stale (no echoes for 0.5 s; silence: check the cable and the board's supply)"]);
    bench.wait(1_499);
    assert!(bench.changes().is_empty());
    bench.wait(1);
    assert_eq!(bench.changes(), ["link: lost (no echoes for 2 s; silence: check the cable and the board's supply)"]);
    bench.echoes();
    assert_eq!(bench.link.state(), LinkState::Streaming);
    bench.wait(20_000);
    assert_eq!(bench.remedies, [Remedy::Reopen, Remedy::Reopen], "a dead line is opened anew each 10 s");
}

#[test]
fn a_machine_that_slept_does_not_take_the_line_for_dead() {
    let mut bench = Bench::open();
    bench.echoes();
    bench.changes();
    bench.ms += 3_600_000;
    bench.wait(400);
    assert!(bench.changes().is_empty() && bench.remedies.is_empty(), "nobody was there to hear");
    bench.echoes();
    bench.wait(499);
    assert!(bench.changes().is_empty());
    bench.wait(1);
    assert_eq!(bench.link.state(), LinkState::Stale, "awake again, it hears that nothing comes");
}

#[test]
fn silence_is_reported_after_all_rates_were_tried_and_again_later() {
    let mut bench = Bench::open();
    bench.wait(3_999);
    assert!(bench.changes().is_empty());
    bench.wait(1);
    assert_eq!(bench.changes(), ["link: listening (silence: nothing arrives at 115200 baud; trying other rates)"]);
    bench.wait(12_000);
    let told = bench.changes();
    assert!(told.len() == 1 && told[0].contains("silence: the board says nothing at any usual rate"), "{told:?}");
    let tried: Vec<Remedy> = USUAL_BAUDS[1..].iter().chain(&USUAL_BAUDS[..1]).copied().map(Remedy::Baud).collect();
    assert_eq!(bench.remedies, tried);
    bench.wait(28_000);
    assert_eq!(bench.remedies.len(), 8);
    bench.wait(4_000);
    assert!(bench.remedies.len() > 8, "the rates are tried again");
}

#[test]
fn a_board_at_another_rate_is_found_and_the_option_named() {
    let mut bench = Bench::open();
    bench.hear(&[0x80; 40]);
    bench.wait(4_000);
    assert!(bench.changes()[0].contains("noise: bytes arrive but no valid frame at 115200 baud"));
    assert_eq!(bench.remedies, [Remedy::Baud(250_000)]);
    bench.wait(1_500);
    bench.frames = 1;
    bench.hear(b"hello");
    assert_eq!(
        bench.changes(),
        ["link: handshake (the board speaks at 500000 baud, not at 115200: start slamd with --baud 500000)"]
    );
}

#[test]
fn a_board_that_changes_its_rate_is_found_again() {
    let mut bench = Bench::open();
    bench.frames = 1;
    bench.hear(b"hello");
    bench.echoes();
    bench.changes();
    // From now on what arrives is no frame at this rate.
    for _ in 0..250 {
        bench.hear(&[0x80; 4]);
        bench.wait(100);
    }
    let told = bench.changes().join("\n");
    assert!(told.contains("noise: bytes arrive but no valid frame at 115200 baud; trying other rates"), "{told}");
    assert_eq!(bench.remedies.first(), Some(&Remedy::Baud(250_000)));
    bench.frames += 1;
    bench.hear(b"hello");
    assert!(bench.changes().join("").contains("the board speaks at"), "{:?}", bench.link.cause());
}

#[test]
fn noise_text_and_an_echo_are_distinguished() {
    let mut noise = Bench::open();
    for _ in 0..200 {
        noise.hear(&[0x80, 0xF3, 0x11, 0x07]);
        noise.wait(100);
    }
    assert!(
        noise
            .changes()
            .iter()
            .any(|change| change.contains("noise: bytes arrive but no valid frame at any usual rate"))
    );
    let mut text = Bench::open();
    text.hear(b"Distance: 12 cm\r\nno echo\r\nno echo\r\n");
    text.wait(4_000);
    let told = text.changes();
    assert!(told[0].contains("wrong firmware: the board prints \"Distance: 12 cm\""), "{told:?}");
    assert!(told[0].contains("flash protocol/firmware") && text.remedies.is_empty());
    let mut echo = Bench::open();
    (echo.frames, echo.echoed) = (1, 1);
    echo.hear(b"hello?");
    assert!(echo.changes()[0].contains("the line echoes what slamd sends"));
}

#[test]
fn another_version_and_a_board_that_restarts_repeatedly_are_reported() {
    let mut bench = Bench::open();
    let _ = bench.board.greet(Hello {
        major: 9,
        minor: 0,
        boot_id: 1,
        tick_hz: 1_000_000,
        sensors: 8,
        ticks_per_turn: 1,
        capabilities: 0,
        config_crc: 0,
        uid: [0; 8],
        board: Text::new("b"),
        firmware: Text::new("1"),
    });
    bench.frames = 1;
    bench.hear(b"hello");
    let told = bench.changes();
    assert!(told[0].contains("handshake (protocol mismatch") && told[0].contains("update slamd"), "{told:?}");
    for restarts in 1..=3 {
        bench.restarts = restarts;
        bench.hear(b"hello");
        bench.wait(5_000);
    }
    let told = bench.changes();
    assert!(told.iter().any(|change| change.contains("restarts again and again")), "{told:?}");
}
