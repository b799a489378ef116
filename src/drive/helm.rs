//! One client drives at a time: orders, conditions and times go in, DRIVE frames come out. It has no socket and no clock.

use super::conditions::Conditions;
use super::limits::Limits;
use super::order::{Driver, Granted, Order, Refusal, Twist, Wish};
use bytes::Bytes;
use slamd_core::{Config, Timestamp};
use slamd_protocol::{Drive, FrameEncoder, Message, MotionState, WheelSpeeds};
use std::time::Duration;

/// A DRIVE is sent so often, and holds for so long: the line may lose one or two.
const PERIOD: Duration = Duration::from_millis(50);
const VALID_MS: u16 = 200;
/// The DRIVE that stops need not hold.
const STOP_MS: u16 = *Drive::VALID_MS.start();

/// Who may drive, and what is sent.
#[derive(Debug)]
pub struct Helm {
    limits: Limits,
    lease: Duration,
    /// Who holds the helm, and until when if no other order comes.
    holder: Option<(Driver, Timestamp)>,
    /// What the holder ordered, and until when it holds.
    ordered: Option<(Wish, Timestamp)>,
    /// What was commanded last, and when the next frame is due.
    moving: Option<(Twist, Timestamp)>,
    /// A stop that is not sent yet, and who ordered it.
    stop: Option<u8>,
    encoder: FrameEncoder,
}

impl Helm {
    /// The helm of the configured robot, which stands.
    #[must_use]
    pub fn new(config: &Config) -> Self {
        Self {
            limits: Limits::new(config),
            lease: Duration::from_secs_f64(config.drive.lease_s.clamp(0.0, 3_600.0)),
            holder: None,
            ordered: None,
            moving: None,
            stop: None,
            encoder: FrameEncoder::default(),
        }
    }

    /// When [`Helm::tick`] is due; none where the robot stands.
    #[must_use]
    pub const fn deadline(&self) -> Option<Timestamp> {
        match self.moving {
            Some((_, due)) => Some(due),
            None => None,
        }
    }

    /// Takes an order.
    ///
    /// # Errors
    /// Why it is not obeyed. A command of the holder that is refused ends the one before.
    pub fn order(
        &mut self,
        at: Timestamp,
        driver: Driver,
        order: Order,
        conditions: &Conditions,
    ) -> Result<Granted, Refusal> {
        self.holder.take_if(|(_, until)| *until <= at);
        let motors = conditions.motors.map(MotionState::word);
        match order {
            Order::Drive(wish) => {
                if let Some((holder, until)) = self.holder.filter(|(holder, _)| *holder != driver) {
                    let left = Duration::from_micros(until.us().saturating_sub(at.us()));
                    return Err(Refusal::Taken { by: holder.word(), left });
                }
                let wish = Wish { twist: self.limits.within(wish.twist), ..wish };
                if let Err(refusal) = conditions.permit(wish.is_autonomous) {
                    self.let_go(driver.source);
                    return Err(refusal);
                }
                if self.holder.is_none() {
                    tracing::info!("drive: {} drives", driver.word());
                }
                self.holder = Some((driver, at + self.lease));
                self.ordered = Some((wish, at + Duration::from_millis(wish.for_ms.into())));
                self.moving.get_or_insert_with(|| (Twist::default(), at));
                Ok(Granted { twist: wish.twist, for_ms: wish.for_ms, motors })
            }
            Order::Stop => {
                self.let_go(driver.source);
                self.stop = Some(driver.source);
                self.holder = None;
                Ok(Granted { motors, ..Granted::default() })
            }
            Order::Leave => {
                if self.holder.is_some_and(|(holder, _)| holder == driver) {
                    tracing::info!("drive: {} has gone", driver.word());
                    self.let_go(driver.source);
                    self.holder = None;
                }
                Ok(Granted::default())
            }
        }
    }

    /// The frame for the board that is due at `at`, if one is.
    pub fn tick(&mut self, at: Timestamp, conditions: &Conditions) -> Option<Bytes> {
        if let Some((wish, until)) = self.ordered {
            let refusal = conditions.permit(wish.is_autonomous).err();
            if let Some(refusal) = &refusal {
                tracing::warn!("drive: stopped: {refusal}");
            }
            if refusal.is_some() || until <= at {
                self.let_go(self.source());
            }
        }
        if let Some(source) = self.stop.take() {
            return Some(self.frame(WheelSpeeds::ZERO, STOP_MS, source));
        }
        let ((wish, until), (now, due)) = (self.ordered?, self.moving?);
        if at < due {
            return None;
        }
        let twist = self.limits.ramped(now, wish.twist, PERIOD.as_secs_f64());
        self.moving = Some((twist, (at + PERIOD).min(until)));
        Some(self.frame(self.limits.wheels(twist), VALID_MS, self.source()))
    }

    /// The frame that stops the robot at the program's end; none where it stands.
    pub fn end(&mut self) -> Option<Bytes> {
        self.let_go(self.source());
        self.holder = None;
        let source = self.stop.take()?;
        Some(self.frame(WheelSpeeds::ZERO, STOP_MS, source))
    }

    /// Ends the present command: a stop is due if the robot was driven.
    fn let_go(&mut self, source: u8) {
        self.ordered = None;
        if self.moving.take().is_some() {
            self.stop = Some(source);
        }
    }

    fn source(&self) -> u8 {
        self.holder.map_or(0, |(driver, _)| driver.source)
    }

    fn frame(&mut self, speeds: WheelSpeeds, valid_ms: u16, source: u8) -> Bytes {
        // Both constants are valid; a DRIVE that cannot be made would be none.
        let drive = Drive::new(speeds, valid_ms, source).map(Message::Drive);
        drive.map_or_else(|_| Bytes::new(), |drive| Bytes::copy_from_slice(&self.encoder.encode(&drive)))
    }
}

#[cfg(test)]
#[path = "helm_tests.rs"]
mod tests;
