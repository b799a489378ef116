//! GEOMETRY: where the sensors sit.

use super::MessageError;
use super::wire::{Reader, Writer};
use arrayvec::ArrayVec;

/// Maximum number of sensors in one GEOMETRY; a larger ring takes several messages.
pub const MAX_PLACEMENTS: usize = 26;

/// Maximum number of GEOMETRY messages for one ring.
const MAX_PARTS: usize = (u8::MAX as usize).div_ceil(MAX_PLACEMENTS);

/// Where one sensor sits on the robot (x forward, y left, angles counter-clockwise).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Placement {
    /// Millimetres ahead of the middle of the axle.
    pub x_mm: i16,
    /// Millimetres to the left of the middle of the axle.
    pub y_mm: i16,
    /// Direction of the beam's axis in hundredths of a degree, −18000 to 18000.
    pub bearing_cdeg: i16,
    /// Half the beam's opening angle in hundredths of a degree, 0 (a point beam) to 9000.
    pub half_angle_cdeg: u16,
    /// The firing group: sensors of one group fire together.
    pub group: u8,
}

/// The placements of some consecutive sensors of the ring.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Geometry {
    total: u8,
    first: u8,
    placements: ArrayVec<Placement, MAX_PLACEMENTS>,
}

impl Geometry {
    /// The placements of the sensors from `first` on, in a ring of `total`.
    ///
    /// # Errors
    /// More than [`MAX_PLACEMENTS`] placements, sensors beyond `total`, or an angle out of its
    /// range.
    pub fn new(total: u8, first: u8, placements: &[Placement]) -> Result<Self, MessageError> {
        let count = placements.len();
        if usize::from(first) + count > usize::from(total) {
            return Err(MessageError::BeyondRing { first, count, total });
        }
        for placement in placements {
            placement.check()?;
        }
        let placements = ArrayVec::try_from(placements).map_err(|_| MessageError::Length {
            message: "GEOMETRY",
            got: 2 + 9 * count,
            expected: EXPECTED,
        })?;
        Ok(Self { total, first, placements })
    }

    /// The messages that describe a whole ring.
    ///
    /// # Errors
    /// More than 255 sensors, or an angle out of its range.
    pub fn of_ring(ring: &[Placement]) -> Result<ArrayVec<Self, MAX_PARTS>, MessageError> {
        let too_large = MessageError::BeyondRing { first: 0, count: ring.len(), total: u8::MAX };
        let total = u8::try_from(ring.len()).map_err(|_| too_large)?;
        (0..total)
            .step_by(MAX_PLACEMENTS)
            .zip(ring.chunks(MAX_PLACEMENTS))
            .map(|(at, part)| Self::new(total, at, part))
            .collect()
    }

    /// The number of sensors of the ring.
    #[must_use]
    pub const fn total(&self) -> u8 {
        self.total
    }

    /// The id of the first sensor in this message.
    #[must_use]
    pub const fn first(&self) -> u8 {
        self.first
    }

    /// The placements of sensor [`Self::first`] and its successors.
    #[must_use]
    pub fn placements(&self) -> &[Placement] {
        &self.placements
    }

    pub(super) fn parse(payload: &[u8]) -> Result<Self, MessageError> {
        let mut fields = Reader::new("GEOMETRY", EXPECTED, payload);
        let (total, first) = (fields.u8()?, fields.u8()?);
        let items = fields.items::<9>(MAX_PLACEMENTS)?;
        let placements: ArrayVec<_, MAX_PLACEMENTS> = items.iter().map(Placement::parse).collect();
        Self::new(total, first, &placements)
    }

    pub(super) fn emit(&self, out: &mut Writer<'_>) {
        out.u8(self.total).u8(self.first);
        for place in &self.placements {
            out.i16(place.x_mm).i16(place.y_mm).i16(place.bearing_cdeg).u16(place.half_angle_cdeg).u8(place.group);
        }
    }
}

impl Placement {
    fn parse(&[x0, x1, y0, y1, b0, b1, h0, h1, group]: &[u8; 9]) -> Self {
        Self {
            x_mm: i16::from_le_bytes([x0, x1]),
            y_mm: i16::from_le_bytes([y0, y1]),
            bearing_cdeg: i16::from_le_bytes([b0, b1]),
            half_angle_cdeg: u16::from_le_bytes([h0, h1]),
            group,
        }
    }

    fn check(&self) -> Result<(), MessageError> {
        if self.bearing_cdeg.unsigned_abs() > 18_000 {
            let got = self.bearing_cdeg.into();
            return Err(MessageError::Value { field: "bearing_cdeg of GEOMETRY", got, expected: "-18000 to 18000" });
        }
        if self.half_angle_cdeg > 9_000 {
            let got = self.half_angle_cdeg.into();
            return Err(MessageError::Value { field: "half_angle_cdeg of GEOMETRY", got, expected: "0 to 9000" });
        }
        Ok(())
    }
}

const EXPECTED: &str = "2 + 9k (k <= 26)";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_is_placed_in_parts() {
        let ring = [Placement::default(); 255];
        for count in [0, 1, 26, 27, 32, 255] {
            let parts = Geometry::of_ring(&ring[..count]).unwrap();
            let mut next = 0;
            for part in &parts {
                assert_eq!((usize::from(part.total()), usize::from(part.first())), (count, next));
                next += part.placements().len();
            }
            assert_eq!(next, count);
        }
    }

    #[test]
    fn a_ring_beyond_a_byte_is_refused() {
        assert!(Geometry::of_ring(&[Placement::default(); 256]).is_err());
    }
}
