//! The terminal and the thread that draws on it. The pipeline never waits for it: it draws the newest dashboard.

use super::log::Log;
use super::sampler::Slot;
use crate::monitor::{Dashboard, Look, View, draw};
use ratatui::crossterm::cursor::Show;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode};
use ratatui::{Terminal, backend::CrosstermBackend};
use std::io::{self, Stdout, stdout};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::sync::Notify;

/// A terminal in use, given back as it was when this is closed or dropped.
pub(super) struct Screen {
    slot: Slot,
    desk: Arc<Desk>,
    thread: Option<JoinHandle<()>>,
}

/// What the drawing thread shares with whoever ends it.
#[derive(Default)]
struct Desk {
    closed: AtomicBool,
    /// Held while something is drawn or given back.
    pen: Mutex<()>,
}

/// Between two pictures.
const EVERY: Duration = Duration::from_millis(100);
/// A terminal that takes nothing is not waited for longer.
const PATIENCE: Duration = Duration::from_secs(1);
const LOOK_AGAIN: Duration = Duration::from_millis(5);

impl Screen {
    /// Takes the terminal and begins to draw; `asked` is notified when the person quits or the terminal goes away.
    pub(super) fn open(log: Log, look: Look, asked: Arc<Notify>) -> io::Result<Self> {
        let desk = Arc::new(Desk::default());
        enable_raw_mode()?;
        let opened =
            execute!(stdout(), EnterAlternateScreen).and_then(|()| Terminal::new(CrosstermBackend::new(stdout())));
        let terminal = opened.inspect_err(|_| give_back())?;
        give_back_on_panic(Arc::clone(&desk));
        let slot = Slot::default();
        let mut painter = Painter {
            terminal,
            log,
            look,
            view: View::default(),
            slot: Arc::clone(&slot),
            dashboard: Dashboard::default(),
        };
        let thread = {
            let desk = Arc::clone(&desk);
            std::thread::Builder::new().name(THREAD.into()).spawn(move || {
                let _told = ToldOnDrop(asked);
                // Without a terminal nobody watches.
                let _ = painter.paint(&desk);
            })
        };
        let thread = Some(thread.inspect_err(|_| give_back())?);
        Ok(Self { slot, desk, thread })
    }

    /// Where snapshots are left.
    pub(super) fn slot(&self) -> Slot {
        Arc::clone(&self.slot)
    }

    /// Gives the terminal back as it was. False where it takes nothing any more, as over a dead connection: whatever is written
    /// to it waits for ever.
    #[expect(clippy::disallowed_methods, reason = "a dead terminal is waited for in real time")]
    pub(super) fn close(&mut self) -> bool {
        let is_given_back = self.desk.closed.swap(true, Ordering::Relaxed);
        let begin = Instant::now();
        let Some(thread) = self.thread.take() else { return true };
        while !thread.is_finished() {
            if begin.elapsed() > PATIENCE {
                return false;
            }
            std::thread::sleep(LOOK_AGAIN);
        }
        let _ = thread.join();
        if !is_given_back {
            give_back();
        }
        true
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.close();
    }
}

/// However the painter ends, the session does not go on unseen.
struct ToldOnDrop(Arc<Notify>);

impl Drop for ToldOnDrop {
    fn drop(&mut self) {
        self.0.notify_one();
    }
}

const THREAD: &str = "screen";

/// Leaves the alternate screen, shows the cursor, and lets the terminal edit lines again.
fn give_back() {
    let _ = execute!(stdout(), LeaveAlternateScreen, Show);
    let _ = disable_raw_mode();
}

/// The words of a panic are to be read: they come after the terminal has been given back.
fn give_back_on_panic(desk: Arc<Desk>) {
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !desk.closed.swap(true, Ordering::Relaxed) {
            let is_painter = std::thread::current().name() == Some(THREAD);
            // The painter's own panic may have come with the pen in its hand.
            let _pen = (!is_painter).then(|| desk.pen.lock().unwrap_or_else(PoisonError::into_inner));
            give_back();
        }
        before(panic);
    }));
}

struct Painter {
    terminal: Terminal<CrosstermBackend<Stdout>>,
    log: Log,
    look: Look,
    view: View,
    slot: Slot,
    dashboard: Dashboard,
}

impl Painter {
    /// Draws and listens to keys until the person quits or the screen is closed.
    #[expect(clippy::disallowed_methods, reason = "pictures come in real time")]
    fn paint(&mut self, desk: &Desk) -> io::Result<()> {
        while !desk.closed.load(Ordering::Relaxed) {
            let next = Instant::now() + EVERY;
            self.picture(desk)?;
            loop {
                let wait = next.saturating_duration_since(Instant::now());
                if event::poll(wait)? {
                    match event::read()? {
                        Event::Key(key) if quits(key) => return Ok(()),
                        Event::Key(KeyEvent { code: KeyCode::Char(key), kind: KeyEventKind::Press, .. }) => {
                            self.view.key(key);
                        }
                        // The next picture fits the new size.
                        _ => {}
                    }
                }
                if wait.is_zero() {
                    break;
                }
            }
        }
        Ok(())
    }

    fn picture(&mut self, desk: &Desk) -> io::Result<()> {
        let newest = self.slot.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(newest) = newest.filter(|_| !self.view.paused) {
            self.dashboard = newest;
        }
        let log = self.log.lines();
        let _pen = desk.pen.lock().unwrap_or_else(PoisonError::into_inner);
        if desk.closed.load(Ordering::Relaxed) {
            return Ok(());
        }
        let (dashboard, view, look) = (&self.dashboard, self.view, self.look);
        self.terminal.draw(|frame| draw(frame.area(), frame.buffer_mut(), dashboard, &log, view, look))?;
        Ok(())
    }
}

fn quits(key: KeyEvent) -> bool {
    let is_control_c = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
    key.kind == KeyEventKind::Press && (is_control_c || matches!(key.code, KeyCode::Esc | KeyCode::Char('q')))
}
