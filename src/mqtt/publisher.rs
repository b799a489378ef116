//! The thread that publishes snapshots to the broker.

use super::broker::Broker;
use super::discovery::discovery;
use super::names::Names;
use super::password::Password;
use super::published::Published;
use super::snapshot::{messages, tenths};
use crate::api::{Mailbox, Snapshot, Tap};
use crate::priority;
use bytes::Bytes;
use rumqttc::{AsyncClient, ConnectReturnCode, ConnectionError, Event, EventLoop, LastWill, MqttOptions, Packet, QoS};
use slamd_core::{ModelEvent, Raster, SensorState};
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

/// The account at the broker.
#[derive(Clone, Debug)]
pub struct Account {
    /// The user's name.
    pub user: String,
    /// The password; none if the broker needs none.
    pub password: Option<Password>,
}

/// Publishes a session from its own thread until it is dropped.
#[derive(Debug)]
pub struct MqttThread {
    mailbox: Arc<Mailbox>,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// Period of snapshots.
const PERIOD: Duration = Duration::from_secs(1);
/// Period of map images, in snapshots: drawing one takes a small board some time.
const MAP_PERIOD: u32 = 10;
/// A live session answers within this: its loop runs at least every 2.5 s.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(4);
/// The first wait before a reconnection; it doubles up to the last.
const FIRST_RETRY: Duration = Duration::from_secs(1);
const LAST_RETRY: Duration = Duration::from_secs(30);
/// MQTT keep-alive interval: the client pings this often, and the broker drops it after 1.5 intervals of silence.
const KEEP_ALIVE: Duration = Duration::from_secs(10);
const CONNECT_TIMEOUT_S: u64 = 5;
/// Time to send "offline" and to disconnect at the end.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);
/// Length of the client's message queue: twice the messages of a ring of 32 sensors.
const QUEUE: usize = 256;
/// Largest MQTT packet, bytes; a map image is much smaller.
const MAX_PACKET_BYTES: usize = 8 << 20;

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
                let (client, mut events) = AsyncClient::new(options, QUEUE);
                events.network_options.set_connection_timeout(CONNECT_TIMEOUT_S);
                let connection = Rc::new(Connection::default());
                LocalSet::new().block_on(&runtime, async move {
                    let transport = spawn_local(drive(events, broker, Rc::clone(&connection)));
                    MqttPublisher::new(names, client, Rc::clone(&connection)).run(&mailbox, is_over).await;
                    if connection.is_up.get() {
                        let _ = timeout(CLOSE_TIMEOUT, transport).await;
                    }
                });
                // Does not wait for a pending DNS lookup.
                runtime.shutdown_background();
            })?
        };
        Ok(Self { mailbox, end: Some(end), thread: Some(thread) })
    }

    /// The tap that copies the session of this robot.
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
    options.set_keep_alive(KEEP_ALIVE).set_max_packet_size(MAX_PACKET_BYTES, MAX_PACKET_BYTES);
    options.set_last_will(LastWill::new(names.topic("availability"), "offline", QoS::AtLeastOnce, true));
    if let Some(account) = account {
        options.set_credentials(&account.user, account.password.as_ref().map_or("", Password::reveal));
    }
    options
}

/// State of the connection to the broker.
#[derive(Debug, Default)]
struct Connection {
    is_up: Cell<bool>,
    /// Nothing was published on this connection yet.
    is_new: Cell<bool>,
    is_ending: Cell<bool>,
}

/// Drives the MQTT connection, and reconnects without limit.
async fn drive(mut events: EventLoop, broker: Broker, connection: Rc<Connection>) {
    let (mut retry, mut last_message, mut since) = (FIRST_RETRY, String::new(), Instant::now());
    loop {
        match events.poll().await {
            Ok(Event::Incoming(Packet::ConnAck(_))) => {
                tracing::info!("mqtt: connected to {broker}");
                (last_message, since) = (String::new(), Instant::now());
                connection.is_up.set(true);
                connection.is_new.set(true);
            }
            Ok(_) => {}
            Err(_) if connection.is_ending.get() => return,
            Err(error) => {
                // Only a connection that lasted resets the wait, so that a broker that disconnects at once is not tried each second.
                if connection.is_up.replace(false) && since.elapsed() > LAST_RETRY {
                    retry = FIRST_RETRY;
                }
                let message = explained(&error);
                if message != last_message {
                    tracing::warn!("mqtt: {broker}: {message}; retrying");
                    last_message = message;
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
        ) => "user or password refused: check --mqtt-user and --mqtt-password-file".into(),
        error => error.to_string(),
    }
}

/// Publishes the messages.
struct MqttPublisher {
    names: Names,
    client: AsyncClient,
    connection: Rc<Connection>,
    published: Published,
    sketch: Sketch,
    /// Snapshots until the next map image.
    until_map: u32,
}

impl MqttPublisher {
    fn new(names: Names, client: AsyncClient, connection: Rc<Connection>) -> Self {
        Self { names, client, connection, published: Published::default(), sketch: Sketch::default(), until_map: 0 }
    }

    /// Publishes until the end, then publishes "offline".
    async fn run(mut self, mailbox: &Mailbox, mut is_over: oneshot::Receiver<()>) {
        let mut ticks = interval(PERIOD);
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
                answer = timeout(ANSWER_TIMEOUT, mailbox.next()) => {
                    let Ok((snapshot, map)) = answer else { continue };
                    self.publish_snapshot(&snapshot, map.map(|(_, raster)| raster));
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

    fn publish_snapshot(&mut self, snapshot: &Snapshot, map: Option<Raster>) {
        if let Some(estimate) = &snapshot.estimate {
            self.sketch.set_uncertain(snapshot.is_lost, estimate.at);
            self.sketch.estimate(estimate);
        }
        if !self.connection.is_up.get() {
            return;
        }
        if self.connection.is_new.replace(false) {
            self.published.clear();
        }
        let dropped = self.published.dropped;
        for (topic, payload) in discovery(&self.names, snapshot.ring.len()) {
            self.publish_at(topic, payload.into());
        }
        self.publish("availability", "online".into());
        for (topic, payload) in messages(&self.names, snapshot) {
            self.publish_at(topic, payload.into());
        }
        if snapshot.estimate.is_some() {
            self.publish("distance", tenths(self.sketch.path_m()).into());
        }
        if let Some(raster) = map.filter(|raster| !raster.occupancy.is_empty()) {
            self.draw(snapshot, &raster);
        }
        if self.published.dropped > dropped {
            tracing::warn!("mqtt: the broker is slow: {} messages dropped so far", self.published.dropped);
        }
    }

    fn draw(&mut self, snapshot: &Snapshot, raster: &Raster) {
        let mut states = vec![SensorState::Healthy; snapshot.ring.len()];
        for change in snapshot.faulty() {
            if let Some(state) = states.get_mut(change.sensor) {
                *state = change.state;
            }
        }
        let position = snapshot.is_lost.then(|| "the position is uncertain".into());
        let doubts: Vec<String> =
            position.into_iter().chain(snapshot.doubted_models().map(ModelEvent::sentence)).collect();
        let around = Surroundings {
            raster,
            ring: &snapshot.ring,
            states: &states,
            robot_name: &snapshot.robot,
            doubts: &doubts,
            began_unix_us: snapshot.unix_zero_us,
        };
        let drawing = self.sketch.drawing(around);
        match drawing.png() {
            Ok(picture) => {
                self.publish("area", tenths(drawing.floor_m2()).into());
                self.publish("map", picture.into());
                self.until_map = MAP_PERIOD;
            }
            Err(error) => tracing::warn!("mqtt: the map cannot be drawn: {error}"),
        }
    }

    fn publish(&mut self, what: &str, payload: Bytes) {
        self.publish_at(self.names.topic(what), payload);
    }

    /// Publishes a retained message, which later subscribers receive too.
    fn publish_at(&mut self, topic: String, payload: Bytes) {
        let client = &self.client;
        self.published.update(topic, payload, |topic, payload| {
            client.try_publish(topic, QoS::AtLeastOnce, true, payload).is_ok()
        });
    }
}
