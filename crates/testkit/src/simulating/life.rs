//! One life of the program: the daemon's loop around [`LiveSession`], on the simulated world.
//!
//! What the loop does between two wakes is the daemon's own code. Here is what `src/daemon.rs` has of tokio, port and threads: waiting, reading,
//! writing, opening; and what the recorder's thread does.

use super::plan::{Plan, SECOND_US};
use super::tear::tear;
use super::watch::Watch;
use super::world::World;
use crate::faulty_disk::FaultyDisk;
use slamd::recorder::{Chunk, Losses, Tape};
use slamd::session_file;
use slamd::source::live::{LiveSession, MAX_OUTGOING};
use slamd::source::session::Session;
use slamd_capture::CaptureInfo;
use slamd_core::{
    Config, Start, Timestamp,
    link::{Link, LinkState, Remedy},
};
use std::cell::RefCell;
use std::path::Path;
use std::rc::Rc;
use std::time::Duration;

/// What wakes the loop.
enum Wake {
    Read,
    Write,
    Deadline,
    HungUp,
    /// The program's end, or its death.
    End,
}

/// What a life leaves behind.
pub struct Remains {
    pub session: Session,
    pub watch: Rc<RefCell<Watch>>,
    /// All that was handed to the recorder.
    pub chunks: Vec<Chunk>,
    pub disk: FaultyDisk,
    /// What the recording lacks, where the program lived to say so.
    pub losses: Option<Losses>,
    /// The disk never failed.
    pub was_well: bool,
    /// Time zero by the host's clock.
    pub begin_us: u64,
    /// The bytes of the last session file.
    pub saved: Option<Vec<u8>>,
    pub is_torn: bool,
}

/// From one session file to the next.
const SAVE: Duration = Duration::from_secs(10);
/// A missing port is looked for this often.
const LOOK_US: u64 = 100_000;
/// What waits for the disk, at most: the tape's bound, and the capture chunk that is open.
const MAX_WAITING: usize = 17 << 20;
/// The recorder's thread looks after a silent line this often.
const IDLE: Duration = Duration::from_secs(1);

/// A program that runs.
pub struct Life<'a> {
    world: &'a mut World,
    plan: &'a Plan,
    begin_us: u64,
    watch: Rc<RefCell<Watch>>,
    tape: Tape<FaultyDisk>,
    part: u32,
    was_well: bool,
    chunks: Vec<Chunk>,
    save_at: Timestamp,
    saved: Option<Vec<u8>>,
}

/// Lives until its end; none where that comes before the port can be opened.
pub fn live(world: &mut World, plan: &Plan, start: Start, folder: &Path) -> Option<Remains> {
    while !world.open(World::BAUD) {
        if is_over(world, plan) {
            return None;
        }
        world.advance(LOOK_US);
    }
    world.ledger.begins();
    world.disk = FaultyDisk::default();
    let mut session =
        Session::new(slamd_paper::pipeline(&Config::default(), start).expect("sound"), folder).expect("sound");
    let (watch, watcher) = Watch::new();
    session.watch(watcher);
    let info =
        CaptureInfo { config_toml: Config::default().to_toml(), unix_zero_us: plan.wall_us, ..CaptureInfo::default() };
    let tape = Tape::begin(world.disk.clone(), info, plan.recording).expect("a disk that is well");
    let (part, begin_us) = (tape.part(), world.host_us());
    let mut life = Life {
        world,
        plan,
        begin_us,
        watch,
        tape,
        part,
        was_well: true,
        chunks: Vec::new(),
        save_at: Timestamp::default() + SAVE,
        saved: None,
    };
    let mut link = Link::new(World::BAUD);
    life.run(&mut link, &mut session);
    Some(life.end(session))
}

fn is_over(world: &World, plan: &Plan) -> bool {
    world.died.is_some() || world.t_us >= plan.length_us
}

impl Life<'_> {
    fn now(&self) -> Timestamp {
        Timestamp::from_us(self.world.host_us() - self.begin_us)
    }

    fn run(&mut self, link: &mut Link, session: &mut Session) {
        let mut line = LiveSession::begin("robot".into(), self.now(), link, session);
        loop {
            self.check(&mut line);
            let mut hung_up = None;
            let chunk = match self.wait(&line) {
                Wake::Read => {
                    let bytes = self.world.cable.read(self.plan.read_most);
                    self.world.ledger.heard(&bytes);
                    Some(line.read(self.now(), bytes))
                }
                Wake::Write => self.write(&mut line),
                Wake::Deadline => {
                    line.tick(self.now());
                    None
                }
                Wake::HungUp => {
                    hung_up = Some("robot is gone: it hung up");
                    None
                }
                Wake::End => return,
            };
            self.record(chunk);
            self.save(&mut line);
            if std::mem::replace(&mut self.part, self.tape.part()) != self.tape.part() {
                line.introduce();
            }
            let cause = match (hung_up, hung_up.is_none().then(|| line.take_remedy()).flatten()) {
                (Some(cause), _) => cause,
                (None, Some(Remedy::Reopen)) => "silent for 10 s",
                (None, Some(Remedy::Baud(baud))) => {
                    self.world.cable.set_baud(baud);
                    continue;
                }
                (None, None) => continue,
            };
            line.closed(self.now(), cause);
            let baud = line.parts().0.baud();
            self.check(&mut line);
            while !self.world.open(baud) {
                if is_over(self.world, self.plan) {
                    return;
                }
                self.world.advance(LOOK_US);
                let now = self.now();
                line.parts().0.closed(now, "port missing");
                self.watch.borrow_mut().link(line.parts().0);
            }
            self.world.ledger.opened();
            let chunk = line.reopened("robot".into(), self.now());
            self.record(Some(chunk));
        }
    }

    /// Waits as tokio does: for the port, the deadline or the end.
    fn wait(&mut self, line: &LiveSession<'_>) -> Wake {
        loop {
            if is_over(self.world, self.plan) {
                return Wake::End;
            }
            let world = &mut *self.world;
            if world.is_stalled() {
                world.advance(1_000);
                continue;
            }
            if world.cable.is_unplugged(world.t_us) {
                return Wake::HungUp;
            }
            let deadline_us = line.deadline().us().saturating_add(self.begin_us);
            let may_write = line.outgoing().is_some() && !world.cable.is_clogged(world.t_us);
            let may_read = world.cable.has_bytes();
            let is_due = deadline_us <= world.host_us();
            if !may_write && !may_read && !is_due {
                world.advance((deadline_us - world.host_us()).min(1_000));
                continue;
            }
            world.met.wakes += 1;
            let traffic = if may_write { Wake::Write } else { Wake::Read };
            let wake = match ((may_write || may_read), is_due) {
                (true, true) if world.random.chance(0.5) => Wake::Deadline,
                (true, _) => traffic,
                (false, _) => Wake::Deadline,
            };
            let latency_us = 10 + world.random.below(100) as u64;
            world.advance(latency_us);
            // What was there may be gone by now.
            let is_gone = world.cable.is_unplugged(world.t_us)
                || matches!(wake, Wake::Read if !world.cable.has_bytes())
                || matches!(wake, Wake::Write if world.cable.is_clogged(world.t_us));
            if !is_gone {
                return wake;
            }
        }
    }

    fn write(&mut self, line: &mut LiveSession<'_>) -> Option<Chunk> {
        let frame = line.outgoing()?.to_vec();
        let count = self.world.cable.takes(self.world.t_us, &frame)?;
        self.world.write(&frame[..count]);
        Some(line.wrote(self.now(), count))
    }

    /// What the recorder's thread does.
    fn record(&mut self, chunk: Option<Chunk>) {
        self.was_well &= self.world.disk.is_well();
        let now = self.now();
        // After a long sleep it is awake at once.
        for _ in 0..5 {
            let wait = self.tape.flush_in().unwrap_or(IDLE);
            if self.tape.now() + wait <= now {
                self.tape.advance(self.tape.now() + wait);
            }
        }
        if let Some(chunk) = chunk {
            self.chunks.push(chunk.clone());
            self.tape.push(chunk);
        }
        while let Some(notice) = self.tape.poll_notice() {
            self.world.met.disk_errors += u64::from(notice.starts_with("recording waits"));
        }
    }

    fn save(&mut self, line: &mut LiveSession<'_>) {
        if self.now() < self.save_at {
            return;
        }
        self.save_at = self.now() + SAVE;
        if let Some(memory) = line.parts().1.saved_state() {
            self.saved = Some(session_file::encode(&memory));
        }
    }

    /// What must hold at each step.
    fn check(&mut self, line: &mut LiveSession<'_>) {
        assert!(line.waiting() <= MAX_OUTGOING, "{} frames wait", line.waiting());
        assert!(self.tape.waiting_bytes() <= MAX_WAITING, "{} bytes wait for the disk", self.tape.waiting_bytes());
        let now = self.now();
        let (link, session) = line.parts();
        assert!(session.now() <= now, "the session is ahead of the clock");
        let frames = session.reception().frames;
        assert_eq!(frames, self.world.ledger.accepted, "frames accepted, and those that should have been");
        let mut watch = self.watch.borrow_mut();
        watch.link(link);
        let calm_us = self.world.t_us.saturating_sub(self.world.calm_since_us);
        if calm_us < RECOVERED_US {
            return;
        }
        assert_eq!(link.state(), LinkState::Streaming, "{calm_us} us after the last trouble: {}", link.cause());
        if let Some(estimate) = watch.estimate.filter(|_| watch.first_seen.is_some_and(|seen| seen + CAUGHT_UP <= now))
        {
            let age_s = now.seconds_since(estimate.at);
            assert!(age_s < FRESH_S, "the newest pose is {age_s} s old, {calm_us} us after the last trouble");
        }
    }

    fn end(self, session: Session) -> Remains {
        let died = self.world.died.take();
        let mut is_torn = false;
        let disk = self.world.disk.clone();
        let losses = match died {
            None => Some(self.tape.finish()),
            Some(power_cut) => {
                // A killed program closes nothing.
                drop(self.tape);
                if power_cut {
                    is_torn = true;
                    disk.damage_newest(|bytes| tear(bytes, &mut self.world.random));
                }
                None
            }
        };
        Remains {
            session,
            watch: self.watch,
            chunks: self.chunks,
            disk,
            losses,
            was_well: self.was_well,
            begin_us: self.begin_us,
            saved: self.saved,
            is_torn,
        }
    }
}

/// So long after the last disturbance sweeps arrive and poses are fresh.
const RECOVERED_US: u64 = 15 * SECOND_US;
const FRESH_S: f64 = 0.4;
/// The sweeps before the building's axis is known are used up within this.
const CAUGHT_UP: Duration = Duration::from_secs(12);
