//! The thread that carries moments to the broker.

use super::broker::Broker;
use super::bulletin::Bulletin;
use super::discovery::discovery;
use super::names::Names;
use super::password::Password;
use super::snapshot::messages;
use crate::api::{Mailbox, Snapshot, Tap};
use crate::priority;
use bytes::Bytes;
use rumqttc::{AsyncClient, ConnectReturnCode, ConnectionError, Event, EventLoop, LastWill, MqttOptions, Packet, QoS};
use slamd_core::{Raster, SensorState};
use slamd_publish::{Sketch, Surroundings};
use std::cell::Cell;
use std::io;
use std::rc::Rc;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::sync::oneshot;
use tokio::task::{LocalSet, spawn_local};
use tokio::time::{Instant, MissedTickBehavior, interval, sleep, timeout};

/// Who slamd is to the broker.
#[derive(Clone, Debug)]
pub struct Account {
    /// The user's name.
    pub user: String,
    /// Its password; none where the broker wants none.
    pub password: Option<Password>,
}

/// Publishes a session, from a thread of its own, until it is dropped.
#[derive(Debug)]
pub struct MqttThread {
    mailbox: Arc<Mailbox>,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// From one snapshot to the next.
const EVERY: Duration = Duration::from_secs(1);
/// From one picture of the map to the next, in moments: drawing it takes a small board a while.
const MAP_EVERY: u32 = 10;
/// The session answers within this, or there is nothing new: it comes by at least every 2.5 s.
const ANSWER: Duration = Duration::from_secs(4);
/// A broker that is away is tried again after this long, then twice as long, up to the last.
const FIRST_RETRY: Duration = Duration::from_secs(1);
const LAST_RETRY: Duration = Duration::from_secs(30);
/// Whoever does not answer a ping within this is gone; the broker thinks the same of slamd after half as much again.
const KEEP_ALIVE: Duration = Duration::from_secs(10);
const CONNECT_S: u64 = 5;
/// How long the last words may take.
const LAST_WORDS: Duration = Duration::from_secs(2);
/// Messages that wait for the broker: all that a ring of 32 has to say, twice.
const ROOM: usize = 256;
/// A picture is well below.
const LARGEST_BYTES: usize = 8 << 20;

impl MqttThread {
    /// Begins to publish the session of the robot of this name.
    ///
    /// # Errors
    /// When the system refuses a thread or its event loop.
    pub fn begin(broker: Broker, account: Option<&Account>, robot: &str) -> io::Result<Self> {
        let mailbox = Arc::<Mailbox>::default();
        let names = Names::new(robot);
        let options = options(&broker, account, &names);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let (end, is_over) = oneshot::channel::<()>();
        let thread = {
            let mailbox = Arc::clone(&mailbox);
            std::thread::Builder::new().name("mqtt".into()).spawn(move || {
                priority::background();
                let (client, mut events) = AsyncClient::new(options, ROOM);
                events.network_options.set_connection_timeout(CONNECT_S);
                let connection = Rc::new(Connection::default());
                LocalSet::new().block_on(&runtime, async move {
                    let carrier = spawn_local(carry(events, broker, Rc::clone(&connection)));
                    MqttPublisher::new(names, client, Rc::clone(&connection)).work(&mailbox, is_over).await;
                    if connection.is_up.get() {
                        let _ = timeout(LAST_WORDS, carrier).await;
                    }
                });
                // A name that is still being looked up is not waited for.
                runtime.shutdown_background();
            })?
        };
        Ok(Self { mailbox, end: Some(end), thread: Some(thread) })
    }

    /// What looks at the session of this robot.
    #[must_use]
    pub fn tap(&self, robot: &str) -> Tap {
        Tap::new(Arc::clone(&self.mailbox), robot.into())
    }
}

impl Drop for MqttThread {
    fn drop(&mut self) {
        self.end.take();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn options(broker: &Broker, account: Option<&Account>, names: &Names) -> MqttOptions {
    let mut options = MqttOptions::new(names.device(), broker.quoted_host(), broker.port);
    options.set_keep_alive(KEEP_ALIVE).set_max_packet_size(LARGEST_BYTES, LARGEST_BYTES);
    options.set_last_will(LastWill::new(names.topic("availability"), "offline", QoS::AtLeastOnce, true));
    if let Some(account) = account {
        options.set_credentials(&account.user, account.password.as_ref().map_or("", Password::reveal));
    }
    options
}

/// How it fares with the broker.
#[derive(Debug, Default)]
struct Connection {
    is_up: Cell<bool>,
    /// Since the last connection nothing has been told yet.
    is_new: Cell<bool>,
    is_ending: Cell<bool>,
}

/// Carries messages, and connects for as long as it takes.
async fn carry(mut events: EventLoop, broker: Broker, connection: Rc<Connection>) {
    let (mut retry, mut last_words, mut since) = (FIRST_RETRY, String::new(), Instant::now());
    loop {
        match events.poll().await {
            Ok(Event::Incoming(Packet::ConnAck(_))) => {
                tracing::info!("mqtt: connected to {broker}");
                (last_words, since) = (String::new(), Instant::now());
                connection.is_up.set(true);
                connection.is_new.set(true);
            }
            Ok(_) => {}
            Err(_) if connection.is_ending.get() => return,
            Err(error) => {
                // Who lets slamd in and throws it out at once is not asked each second.
                if connection.is_up.replace(false) && since.elapsed() > LAST_RETRY {
                    retry = FIRST_RETRY;
                }
                let words = explained(&error);
                if words != last_words {
                    tracing::warn!("mqtt: {broker}: {words}; it is tried again until it works");
                    last_words = words;
                }
                sleep(retry).await;
                retry = (retry * 2).min(LAST_RETRY);
            }
        }
    }
}

/// What went wrong, and what to do about it.
fn explained(error: &ConnectionError) -> String {
    match error {
        ConnectionError::ConnectionRefused(
            ConnectReturnCode::BadUserNamePassword | ConnectReturnCode::NotAuthorized,
        ) => "it refuses user or password: give --mqtt-user and --mqtt-password-file as the broker knows them".into(),
        error => error.to_string(),
    }
}

/// Writes the messages.
struct MqttPublisher {
    names: Names,
    client: AsyncClient,
    connection: Rc<Connection>,
    bulletin: Bulletin,
    sketch: Sketch,
    /// Moments until the next picture of the map.
    until_map: u32,
}

impl MqttPublisher {
    fn new(names: Names, client: AsyncClient, connection: Rc<Connection>) -> Self {
        Self { names, client, connection, bulletin: Bulletin::default(), sketch: Sketch::default(), until_map: 0 }
    }

    /// Works until the end, and says that it is.
    async fn work(mut self, mailbox: &Mailbox, mut is_over: oneshot::Receiver<()>) {
        let mut ticks = interval(EVERY);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                _ = ticks.tick() => {}
                _ = &mut is_over => break,
            }
            mailbox.ask();
            self.until_map = self.until_map.saturating_sub(1);
            if self.connection.is_up.get() && (self.until_map == 0 || self.connection.is_new.get()) {
                mailbox.ask_map();
            }
            tokio::select! {
                answer = timeout(ANSWER, mailbox.next()) => {
                    let Ok((snapshot, map)) = answer else { continue };
                    self.tell(&snapshot, map.map(|(_, raster)| raster));
                }
                _ = &mut is_over => break,
            }
        }
        self.connection.is_ending.set(true);
        if self.connection.is_up.get() {
            self.publish("availability", "offline".into());
        }
        let _ = self.client.try_disconnect();
    }

    fn tell(&mut self, snapshot: &Snapshot, map: Option<Raster>) {
        if let Some(estimate) = &snapshot.estimate {
            self.sketch.estimate(estimate);
        }
        if !self.connection.is_up.get() {
            return;
        }
        if self.connection.is_new.replace(false) {
            self.bulletin.forget();
        }
        let dropped = self.bulletin.dropped;
        for (topic, payload) in discovery(&self.names, snapshot.ring.len()) {
            self.publish_at(topic, payload.into());
        }
        self.publish("availability", "online".into());
        for (topic, payload) in messages(&self.names, snapshot) {
            self.publish_at(topic, payload.into());
        }
        if let Some(raster) = map.filter(|raster| !raster.occupancy.is_empty()) {
            self.draw(snapshot, &raster);
        }
        if self.bulletin.dropped > dropped {
            tracing::warn!("mqtt: the broker is slow: {} messages have had no room so far", self.bulletin.dropped);
        }
    }

    fn draw(&mut self, snapshot: &Snapshot, raster: &Raster) {
        let mut states = vec![SensorState::Healthy; snapshot.ring.len()];
        for change in snapshot.faulty() {
            if let Some(state) = states.get_mut(change.sensor) {
                *state = change.state;
            }
        }
        let around = Surroundings { raster, ring: &snapshot.ring, states: &states, robot_name: &snapshot.robot };
        match self.sketch.draw(around) {
            Ok(picture) => {
                self.publish("map", picture.into());
                self.until_map = MAP_EVERY;
            }
            Err(error) => tracing::warn!("mqtt: the map cannot be drawn: {error}"),
        }
    }

    fn publish(&mut self, what: &str, payload: Bytes) {
        self.publish_at(self.names.topic(what), payload);
    }

    /// Retained: whoever comes later is told, too.
    fn publish_at(&mut self, topic: String, payload: Bytes) {
        let client = &self.client;
        self.bulletin
            .tell(topic, payload, |topic, payload| client.try_publish(topic, QoS::AtLeastOnce, true, payload).is_ok());
    }
}
