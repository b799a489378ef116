//! GEOMETRY: where the sensors sit.

use super::wire::{Reader, Writer};
use super::{MAX_SENSORS, MessageError};
use arrayvec::ArrayVec;

/// Maximum number of sensors in one GEOMETRY; a larger ring takes several messages.
pub const MAX_PLACEMENTS: usize = 26;

/// [`MAX_SENSORS`] as the byte of `total`.
const MAX_TOTAL: u8 = 64;
const _: () = assert!(MAX_TOTAL as usize == MAX_SENSORS);

/// Maximum number of GEOMETRY messages for one ring.
const MAX_PARTS: usize = MAX_SENSORS.div_ceil(MAX_PLACEMENTS);

/// Where one sensor sits on the robot (x forward, y left, angles counter-clockwise).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Placement {
    /// Millimetres ahead of the middle of the axle.
    pub x_mm: i16,
    /// Millimetres to the left of the middle of the axle.
    pub y_mm: i16,
    /// Direction of the beam's axis in hundredths of a degree. [`Geometry`] takes whole turns off:
    /// there it is −18000 to 18000.
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
    /// More than [`MAX_PLACEMENTS`] placements, sensors beyond `total`, a `total` beyond
    /// [`MAX_SENSORS`], or a half angle out of its range.
    pub fn new(total: u8, first: u8, placements: &[Placement]) -> Result<Self, MessageError> {
        let count = placements.len();
        if usize::from(total) > MAX_SENSORS {
            return Err(MessageError::Value { field: "total of GEOMETRY", got: total.into(), expected: "1 to 64" });
        }
        if usize::from(first) + count > usize::from(total) {
            return Err(MessageError::BeyondRing { first, count, total });
        }
        for placement in placements {
            placement.check()?;
        }
        let mut placements = ArrayVec::<_, MAX_PLACEMENTS>::try_from(placements).map_err(|_| MessageError::Length {
            message: "GEOMETRY",
            got: 2 + 9 * count,
            expected: EXPECTED,
        })?;
        let counts_to_360 = placements.iter().any(|placement| placement.bearing_cdeg > HALF_TURN);
        for placement in &mut placements {
            placement.bearing_cdeg = within_half_turn(placement.bearing_cdeg, counts_to_360);
        }
        Ok(Self { total, first, placements })
    }

    /// The messages that describe a whole ring.
    ///
    /// # Errors
    /// More than [`MAX_SENSORS`] sensors, or a half angle out of its range.
    pub fn of_ring(ring: &[Placement]) -> Result<ArrayVec<Self, MAX_PARTS>, MessageError> {
        let too_large = MessageError::BeyondRing { first: 0, count: ring.len(), total: MAX_TOTAL };
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
        if self.half_angle_cdeg > 9_000 {
            let got = self.half_angle_cdeg.into();
            return Err(MessageError::Value { field: "half_angle_cdeg of GEOMETRY", got, expected: "0 to 9000" });
        }
        Ok(())
    }
}

/// Half a turn, hundredths of a degree.
const HALF_TURN: i16 = 18_000;

/// A bearing without whole turns. A board that counts from 0 to 360 degrees writes those beyond
/// 327.67 as unsigned numbers, which read as negative ones.
fn within_half_turn(bearing_cdeg: i16, counts_to_360: bool) -> i16 {
    const TURN: i32 = 2 * HALF_TURN as i32;
    let signed = i32::from(bearing_cdeg);
    let unsigned = i32::from(bearing_cdeg.cast_unsigned());
    let whole = if counts_to_360 && unsigned < TURN { unsigned } else { signed };
    let within = if whole > TURN / 2 {
        whole - TURN
    } else if whole < -TURN / 2 {
        whole + TURN
    } else {
        whole
    };
    i16::try_from(within).unwrap_or(bearing_cdeg)
}

const EXPECTED: &str = "2 + 9k (k <= 26)";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_is_placed_in_parts() {
        let ring = [Placement::default(); MAX_SENSORS];
        for count in [0, 1, 26, 27, 32, MAX_SENSORS] {
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
    fn a_ring_of_too_many_sensors_is_refused() {
        assert!(Geometry::of_ring(&[Placement::default(); MAX_SENSORS + 1]).is_err());
        assert!(Geometry::of_ring(&[Placement::default(); 256]).is_err());
        let error = MessageError::Value { field: "total of GEOMETRY", got: 65, expected: "1 to 64" };
        assert_eq!(Geometry::new(65, 0, &[Placement::default()]), Err(error));
    }

    /// Bearings as the host reads them, whatever turn the board counts them in.
    fn read(bearings_cdeg: &[u16]) -> ArrayVec<i16, MAX_PLACEMENTS> {
        let place = |&bearing: &u16| Placement { bearing_cdeg: bearing.cast_signed(), ..Placement::default() };
        let ring: ArrayVec<Placement, MAX_PLACEMENTS> = bearings_cdeg.iter().map(place).collect();
        let total = u8::try_from(ring.len()).unwrap();
        Geometry::new(total, 0, &ring).unwrap().placements().iter().map(|placement| placement.bearing_cdeg).collect()
    }

    #[test]
    fn bearings_of_any_whole_turn_are_accepted() {
        let signed = |cdeg: i16| cdeg.cast_unsigned();
        assert_eq!(read(&[0, 9_000, 18_000, signed(-9_000)])[..], [0, 9_000, 18_000, -9_000]);
        // Sixteen sensors from 0 to 360 degrees: two of them exceed the largest signed number.
        let up: ArrayVec<u16, 16> = (0..16).map(|sensor| 2_250 * sensor).collect();
        assert_eq!(read(&up)[7..], [15_750, 18_000, -15_750, -13_500, -11_250, -9_000, -6_750, -4_500, -2_250]);
        // Clockwise, from 0 to -360 degrees.
        let down: ArrayVec<u16, 8> = (0..8).map(|sensor| signed(-4_500 * sensor)).collect();
        assert_eq!(read(&down)[..], [0, -4_500, -9_000, -13_500, -18_000, 13_500, 9_000, 4_500]);
        assert_eq!(read(&[35_999, 31_500])[..], [-1, -4_500]);
    }
}
