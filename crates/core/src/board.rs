//! The board's identity and the geometry of its ring, as it reported them.

#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing, clippy::string_slice)]
#![deny(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
#![deny(clippy::allow_attributes, clippy::allow_attributes_without_reason)]

use crate::geometry::{Mounting, Pose2, Ring};
use slamd_protocol::{Geometry, Hello, MAX_SENSORS};

/// Plausible limits: encoder ticks per turn, distance of a sensor, half angle of a beam.
const MAX_TICKS: u32 = 10_000_000;
const MAX_MM: u16 = 2_000;
const MAX_HALF_ANGLE_CDEG: u16 = 6_000;

/// What is known of the board.
#[derive(Clone, Debug, Default)]
pub struct Board {
    hello: Option<Hello>,
    mountings: Vec<Option<Mounting>>,
}

impl Board {
    /// The board's last HELLO.
    #[must_use]
    pub fn hello(&self) -> Option<&Hello> {
        self.hello.as_ref()
    }

    /// Encoder ticks per wheel turn, if the board's version is compatible and it knows them.
    #[must_use]
    pub fn ticks_per_turn(&self) -> Option<u32> {
        let hello = self.hello.as_ref().filter(|hello| hello.check_version().is_ok())?;
        Some(hello.ticks_per_turn).filter(|&ticks| ticks > 0)
    }

    /// True if the board speaks another major version: its other messages must not be used.
    #[must_use]
    pub fn is_refused(&self) -> bool {
        self.hello.as_ref().is_some_and(|hello| hello.check_version().is_err())
    }

    /// Why the board's messages must not be used, and which side to update.
    #[must_use]
    pub fn refusal(&self) -> Option<String> {
        let refused = self.hello.as_ref()?.check_version().err()?;
        Some(format!("protocol mismatch: {refused}"))
    }

    /// Checks the board's own numbers. The error says what to do.
    ///
    /// # Errors
    /// One of its numbers is out of range.
    pub fn check(hello: &Hello) -> Result<(), String> {
        let sensors = usize::from(hello.sensors);
        if !(1..=MAX_SENSORS).contains(&sensors) {
            return Err(format!(
                "the board says it has {sensors} sensors, which must be 1 to {MAX_SENSORS}: correct its setting `sensors`"
            ));
        }
        if hello.ticks_per_turn > MAX_TICKS {
            return Err(format!(
                "the board says {} encoder ticks per turn, which must be 1 to {MAX_TICKS}: set robot.ticks_per_turn",
                hello.ticks_per_turn
            ));
        }
        Ok(())
    }

    /// Stores the board's HELLO. True if the board restarted since the last one.
    pub fn greet(&mut self, hello: Hello) -> bool {
        let before = self.hello.replace(hello);
        before.is_some_and(|before| Some(before.boot_id) != self.hello.as_ref().map(|hello| hello.boot_id))
    }

    /// Description of the board, for people.
    #[must_use]
    pub fn description(&self) -> String {
        let Some(hello) = &self.hello else { return "unknown board".into() };
        let who = format!(
            "{} {}, protocol {}.{}, {} sensors, {} ticks per turn",
            hello.board, hello.firmware, hello.major, hello.minor, hello.sensors, hello.ticks_per_turn
        );
        match hello.check_version() {
            Ok(()) => who,
            Err(error) => format!("{who}: {error}"),
        }
    }

    /// Stores a part of the ring's geometry. Returns the ring once all parts have arrived.
    ///
    /// # Errors
    /// A sensor's position is impossible, or the number of sensors differs from HELLO. The error says what to do.
    pub fn place(&mut self, geometry: &Geometry) -> Result<Option<Ring>, String> {
        if let Some(hello) = self.hello.as_ref().filter(|hello| hello.sensors != geometry.total()) {
            let (total, sensors) = (geometry.total(), hello.sensors);
            return Err(format!(
                "the board names the places of {total} sensors but says it has {sensors}: update its firmware, or name [ring.circle] in the robot's configuration"
            ));
        }
        for (sensor, place) in (usize::from(geometry.first())..).zip(geometry.placements()) {
            let far_mm = place.x_mm.unsigned_abs().max(place.y_mm.unsigned_abs());
            if far_mm > MAX_MM || place.half_angle_cdeg > MAX_HALF_ANGLE_CDEG {
                return Err(format!(
                    "the board says sensor {sensor} sits at {} mm, {} mm with a half angle of {} degrees, which must be within {MAX_MM} mm and 60 degrees: correct the board's settings, or name [ring.circle] in the robot's configuration",
                    place.x_mm,
                    place.y_mm,
                    f64::from(place.half_angle_cdeg) * 1e-2,
                ));
            }
        }
        if self.mountings.len() != usize::from(geometry.total()) {
            self.mountings = vec![None; usize::from(geometry.total())];
        }
        let places = self.mountings.iter_mut().skip(usize::from(geometry.first()));
        for (place, sensor) in places.zip(geometry.placements()) {
            *place = Some(Mounting {
                robot_from_sensor: Pose2::new(
                    f64::from(sensor.x_mm) * 1e-3,
                    f64::from(sensor.y_mm) * 1e-3,
                    (f64::from(sensor.bearing_cdeg) * 1e-2).to_radians(),
                ),
                half_angle_rad: (f64::from(sensor.half_angle_cdeg) * 1e-2).to_radians(),
                group: sensor.group,
            });
        }
        let mountings: Option<Vec<Mounting>> = self.mountings.iter().copied().collect();
        Ok(mountings.filter(|mountings| !mountings.is_empty()).map(|mountings| Ring { mountings }))
    }
}
