//! What happens in a run, drawn from its seed.

use crate::faulty_disk::IoMode;
use slamd::recorder;
use slamd_sim::fault::FaultMix;
use slamd_sim::link::LinkFaults;
use slamd_sim::random::{Random, Stream};

pub const SECOND_US: u64 = 1_000_000;
const HOUR_US: u64 = 3_600 * SECOND_US;
/// Nothing goes wrong for so long at the end of a run: by then everything must have recovered.
pub const CALM_US: u64 = 16 * SECOND_US;

/// What a whole run is made of.
#[derive(Clone, Debug)]
pub struct Plan {
    pub world: &'static str,
    pub sensors: u8,
    pub mix: FaultMix,
    pub drift_ppm: f64,
    pub length_us: u64,
    /// Nothing but the disk and the wall clock goes wrong: the pose must be right.
    pub is_clean: bool,
    /// In order of time.
    pub happenings: Vec<(u64, Happening)>,
    pub recording: recorder::Plan,
    /// What the wall clock says when a session begins, and each time that it is looked at again: hours and years apart.
    pub wall_us: Option<u64>,
    /// The most bytes that one read of the port gives.
    pub read_most: usize,
    /// Bytes that the host's kernel keeps for a program that does not read; what comes then is lost.
    pub kernel_bytes: usize,
}

/// Something that goes wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Happening {
    /// Both directions suffer.
    Noise(LinkFaults, u64),
    /// So many random bytes come out of nowhere.
    Burst(usize),
    /// No byte passes, neither way.
    Dead(u64),
    /// The cable is pulled for so long; the board may lose its supply, and the port may then be busy for a while.
    Unplug { for_us: u64, loses_supply: bool, busy_us: u64 },
    /// The port takes no bytes.
    Clogged(u64),
    /// The board's supply breaks down.
    Reset,
    /// The program is not scheduled.
    Stall(u64),
    /// The machine sleeps.
    Suspend(u64, Sleep),
    /// The disk's mode.
    Disk(IoMode),
    /// The program is killed and begins again; with the power cut, what the disk had not yet taken is damaged.
    Death { power_cut: bool },
}

/// What goes on while the machine sleeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sleep {
    /// The host's clock and the board.
    All,
    /// The host's clock; the board has no supply.
    HostClock,
    /// The board; the host's clock stands still, as a virtual machine's may.
    Board,
}

/// Draws a number from `from` to `to`, every order of magnitude as likely.
fn logarithmic(random: &mut Random, from: u64, to: u64) -> u64 {
    let exponent = random.uniform(libm::log(from as f64), libm::log(to as f64));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between from and to")]
    let drawn = libm::exp(exponent) as u64;
    drawn
}

fn pick<T: Copy>(random: &mut Random, choices: &[T]) -> T {
    choices[random.below(choices.len())]
}

impl Plan {
    pub fn new(seed: u64) -> Self {
        let mut random = Random::new(!seed, Stream::Fault);
        let is_clean = random.chance(0.25);
        let length_us = SECOND_US * (35 + random.below(30) as u64) + CALM_US;
        let mut happenings = Vec::new();
        let end_us = length_us - CALM_US;
        let at = |random: &mut Random| random.below(usize::try_from(end_us).unwrap_or(usize::MAX)) as u64;
        for _ in 0..random.below(4) {
            happenings.push((at(&mut random), Happening::Disk(mode(&mut random))));
        }
        for _ in 0..if is_clean { 0 } else { 1 + random.below(6) } {
            let mut begin = at(&mut random);
            let happening = trouble(&mut random);
            // The end of what lasts is within the troubled part, too.
            begin = begin.min(end_us.saturating_sub(happening.lasts_us()));
            happenings.push((begin, happening));
        }
        // The disk is well when the run ends, or what waits for it could not be read back.
        if random.chance(0.8) {
            happenings.push((end_us, Happening::Disk(IoMode::Working)));
        }
        happenings.sort_by_key(|(at, _)| *at);
        let calendar = [0, SECOND_US, 20 * 365 * 24 * HOUR_US, 56 * 365 * 24 * HOUR_US, 180 * 365 * 24 * HOUR_US];
        Self {
            world: pick(&mut random, &["flat", "flat", "room", "furnished", "home", "office"]),
            sensors: pick(&mut random, &[8, 16, 24, 32]),
            mix: pick(&mut random, &[FaultMix::None, FaultMix::None, FaultMix::Paper]),
            drift_ppm: random.uniform(0.0, 5_000.0),
            length_us,
            is_clean,
            happenings,
            recording: recorder::Plan {
                most_bytes: random.chance(0.3).then(|| logarithmic(&mut random, 20_000, 400_000)),
                ..recorder::Plan::default()
            },
            wall_us: random.chance(0.8).then(|| pick(&mut random, &calendar) + random.bits() % HOUR_US),
            read_most: pick(&mut random, &[1, 7, 64, 4_096]),
            kernel_bytes: pick(&mut random, &[1_024, 4_096, 65_536]),
        }
    }
}

fn mode(random: &mut Random) -> IoMode {
    match random.below(6) {
        0 => IoMode::Short(1 + random.below(40)),
        1 => IoMode::Room(random.below(3_000)),
        2 => IoMode::Broken,
        3 => IoMode::Stale,
        _ => IoMode::Working,
    }
}

fn trouble(random: &mut Random) -> Happening {
    match random.below(12) {
        0 | 1 => {
            let mut rate = || if random.chance(0.6) { libm::pow(10.0, random.uniform(-4.5, -1.3)) } else { 0.0 };
            let faults = LinkFaults { bit_flips: rate(), drops: rate(), insertions: rate() };
            Happening::Noise(faults, logarithmic(random, SECOND_US / 10, 20 * SECOND_US))
        }
        2 => Happening::Burst(1 + random.below(2_000)),
        3 => Happening::Dead(logarithmic(random, SECOND_US / 100, 15 * SECOND_US)),
        4 | 5 => Happening::Unplug {
            for_us: logarithmic(random, SECOND_US / 50, 8 * SECOND_US),
            loses_supply: random.chance(0.5),
            busy_us: if random.chance(0.3) { logarithmic(random, SECOND_US / 10, 4 * SECOND_US) } else { 0 },
        },
        6 => Happening::Clogged(logarithmic(random, SECOND_US / 100, 10 * SECOND_US)),
        7 => Happening::Reset,
        8 => Happening::Stall(logarithmic(random, SECOND_US / 100, 6 * SECOND_US)),
        9 | 10 => Happening::Suspend(
            logarithmic(random, SECOND_US / 10, 400 * HOUR_US),
            pick(random, &[Sleep::All, Sleep::HostClock, Sleep::Board]),
        ),
        _ => Happening::Death { power_cut: random.chance(0.5) },
    }
}

impl Happening {
    /// How long it lasts by true time; a sleep takes none.
    pub fn lasts_us(self) -> u64 {
        match self {
            Self::Noise(_, us) | Self::Dead(us) | Self::Clogged(us) | Self::Stall(us) => us,
            Self::Unplug { for_us, busy_us, .. } => for_us + busy_us,
            Self::Burst(_) | Self::Reset | Self::Suspend(..) | Self::Disk(_) | Self::Death { .. } => 0,
        }
    }
}
