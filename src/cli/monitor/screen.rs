//! The terminal and the thread that draws the newest dashboard on it. The pipeline never waits for this thread.

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

/// A terminal in use; closing or dropping restores it.
pub(super) struct Screen {
    slot: Slot,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// State shared by the drawing thread and the thread that closes the screen.
#[derive(Default)]
struct Shared {
    closed: AtomicBool,
    /// Held while the terminal is drawn on or restored.
    terminal: Mutex<()>,
}

/// Time between two frames.
const PERIOD: Duration = Duration::from_millis(100);
/// Longest wait for a terminal that accepts no output.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);
const POLL_PERIOD: Duration = Duration::from_millis(5);

impl Screen {
    /// Sets up the terminal and starts drawing; `asked` is notified when the user quits or the terminal is closed.
    pub(super) fn open(log: Log, look: Look, asked: Arc<Notify>) -> io::Result<Self> {
        let shared = Arc::new(Shared::default());
        enable_raw_mode()?;
        let opened =
            execute!(stdout(), EnterAlternateScreen).and_then(|()| Terminal::new(CrosstermBackend::new(stdout())));
        let terminal = opened.inspect_err(|_| restore())?;
        restore_on_panic(Arc::clone(&shared));
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
            let shared = Arc::clone(&shared);
            std::thread::Builder::new().name(THREAD.into()).spawn(move || {
                let _notify = NotifyOnDrop(asked);
                // An error here means that the terminal is gone.
                let _ = painter.paint(&shared);
            })
        };
        let thread = Some(thread.inspect_err(|_| restore())?);
        Ok(Self { slot, shared, thread })
    }

    /// The slot for new dashboards.
    pub(super) fn slot(&self) -> Slot {
        Arc::clone(&self.slot)
    }

    /// Restores the terminal. False if it accepts no output any more, as over a dead connection: a write to it would block for ever.
    #[expect(clippy::disallowed_methods, reason = "the wait for a dead terminal is in real time")]
    pub(super) fn close(&mut self) -> bool {
        let is_restored = self.shared.closed.swap(true, Ordering::Relaxed);
        let begin = Instant::now();
        let Some(thread) = self.thread.take() else { return true };
        while !thread.is_finished() {
            if begin.elapsed() > CLOSE_TIMEOUT {
                return false;
            }
            std::thread::sleep(POLL_PERIOD);
        }
        let _ = thread.join();
        if !is_restored {
            restore();
        }
        true
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.close();
    }
}

/// Ends the session when the painter ends for any reason.
struct NotifyOnDrop(Arc<Notify>);

impl Drop for NotifyOnDrop {
    fn drop(&mut self) {
        self.0.notify_one();
    }
}

const THREAD: &str = "screen";

/// Leaves the alternate screen, shows the cursor and disables raw mode.
fn restore() {
    let _ = execute!(stdout(), LeaveAlternateScreen, Show);
    let _ = disable_raw_mode();
}

/// Restores the terminal before a panic message is printed, so that the message can be read.
fn restore_on_panic(shared: Arc<Shared>) {
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !shared.closed.swap(true, Ordering::Relaxed) {
            let is_painter = std::thread::current().name() == Some(THREAD);
            // A panicking painter may already hold the lock.
            let _lock = (!is_painter).then(|| shared.terminal.lock().unwrap_or_else(PoisonError::into_inner));
            restore();
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
    /// Draws and handles keys until the user quits or the screen is closed.
    #[expect(clippy::disallowed_methods, reason = "frames are drawn in real time")]
    fn paint(&mut self, shared: &Shared) -> io::Result<()> {
        while !shared.closed.load(Ordering::Relaxed) {
            let next = Instant::now() + PERIOD;
            self.picture(shared)?;
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

    fn picture(&mut self, shared: &Shared) -> io::Result<()> {
        let newest = self.slot.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(newest) = newest.filter(|_| !self.view.paused) {
            self.dashboard = newest;
        }
        let log = self.log.lines();
        let _lock = shared.terminal.lock().unwrap_or_else(PoisonError::into_inner);
        if shared.closed.load(Ordering::Relaxed) {
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
