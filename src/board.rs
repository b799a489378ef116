//! What the board has said of itself: who it is and where its sensors sit.

use crate::geometry::{Mounting, Pose2, Ring};
use slamd_protocol::{Geometry, Hello};

/// The board as far as it is known.
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

    /// True where the board speaks another major version: nothing else that it sends may be used.
    #[must_use]
    pub fn is_refused(&self) -> bool {
        self.hello.as_ref().is_some_and(|hello| hello.check_version().is_err())
    }

    /// The board introduces itself. True where it has restarted since it last did.
    pub fn greet(&mut self, hello: Hello) -> bool {
        let before = self.hello.replace(hello);
        before.is_some_and(|before| Some(before.boot_id) != self.hello.as_ref().map(|hello| hello.boot_id))
    }

    /// Who it is, in words.
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

    /// Part of the ring's geometry. The ring, once all its parts have arrived.
    pub fn place(&mut self, geometry: &Geometry) -> Option<Ring> {
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
        mountings.filter(|mountings| !mountings.is_empty()).map(|mountings| Ring { mountings })
    }
}
