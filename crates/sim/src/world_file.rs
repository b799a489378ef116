//! Reads worlds from TOML files.
//!
//! ```toml
//! start = [1.0, 1.0, 20.0]     # x and y in metres, heading in degrees
//! [[wall]]                     # a thin wall with two faces
//! from = [0.0, 0.0]
//! to = [4.0, 0.0]
//! [[box]]                      # four faces
//! center = [2.0, 2.0]
//! size = [0.6, 0.4]
//! angle_deg = 30.0             # counter-clockwise; 0 where absent
//! ```

use super::floor_plan::box_faces;
use super::world::{Segment, World};
use serde::Deserialize;
use slamd_core::{Point, wrap_angle};
use toml::Spanned;

/// Maximum coordinate of a world, metres.
pub const MAX_COORDINATE_M: f64 = 100.0;

/// A world file that cannot be used.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum WorldError {
    /// Not TOML, an unknown or missing key, or a value of the wrong type; the text holds line, column and key.
    #[error("{file}: {text}")]
    Syntax {
        /// The file's name.
        file: String,
        /// The parser's message.
        text: String,
    },
    /// A value out of its range.
    #[error("{file}: line {line}: {key} {problem}")]
    Value {
        /// The file's name.
        file: String,
        /// Line in the text, from 1.
        line: usize,
        /// The key.
        key: &'static str,
        /// What is wrong with the value.
        problem: String,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WorldText {
    start: Spanned<[f64; 3]>,
    #[serde(default, rename = "wall")]
    walls: Vec<WallText>,
    #[serde(default, rename = "box")]
    boxes: Vec<BoxText>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WallText {
    from: Spanned<[f64; 2]>,
    to: Spanned<[f64; 2]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoxText {
    center: Spanned<[f64; 2]>,
    size: Spanned<[f64; 2]>,
    #[serde(default)]
    angle_deg: Option<Spanned<f64>>,
}

impl World {
    /// Reads a world from the TOML text of `file`. The file's name becomes the world's name.
    ///
    /// # Errors
    /// Unknown and missing keys, values of the wrong type, coordinates beyond [`MAX_COORDINATE_M`],
    /// walls and boxes without extent; each with file, line and key.
    pub fn from_toml(file: &str, text: &str) -> Result<Self, WorldError> {
        let parsed: WorldText = toml::from_str(text)
            .map_err(|error| WorldError::Syntax { file: file.into(), text: error.to_string().trim_end().into() })?;
        let reader = Reader { file, text };
        let mut segments = Vec::new();
        for wall in &parsed.walls {
            let (from, to) = (reader.point("wall.from", &wall.from)?, reader.point("wall.to", &wall.to)?);
            if (to - from).norm() < 1e-3 {
                return Err(reader.value_error("wall.to", &wall.to, "is the same point as from"));
            }
            segments.push(Segment { from, to });
        }
        for block in &parsed.boxes {
            let centre = reader.point("box.center", &block.center)?;
            let size_m = *block.size.get_ref();
            if !size_m.iter().all(|side| (1e-3..=MAX_COORDINATE_M).contains(side)) {
                return Err(reader.value_error("box.size", &block.size, "must be two lengths from 0.001 to 100 m"));
            }
            segments.extend(box_faces(centre, size_m, reader.angle_rad("box.angle_deg", block.angle_deg.as_ref())?));
        }
        let [x, y, heading_deg] = *parsed.start.get_ref();
        if !(x.abs() <= MAX_COORDINATE_M && y.abs() <= MAX_COORDINATE_M && heading_deg.is_finite()) {
            return Err(reader.value_error(
                "start",
                &parsed.start,
                "must be x and y within 100 m and a heading in degrees",
            ));
        }
        Ok(Self::new(file, segments, Point::new(x, y), Some(wrap_angle(heading_deg.to_radians()))))
    }
}

/// Checks values and reports errors with file, line and key.
struct Reader<'a> {
    file: &'a str,
    text: &'a str,
}

impl Reader<'_> {
    fn point(&self, key: &'static str, value: &Spanned<[f64; 2]>) -> Result<Point, WorldError> {
        let [x, y] = *value.get_ref();
        if x.abs() <= MAX_COORDINATE_M && y.abs() <= MAX_COORDINATE_M {
            return Ok(Point::new(x, y));
        }
        Err(self.value_error(key, value, "must lie within 100 m of the origin"))
    }

    fn angle_rad(&self, key: &'static str, value: Option<&Spanned<f64>>) -> Result<f64, WorldError> {
        match value {
            None => Ok(0.0),
            Some(angle) if angle.get_ref().is_finite() => Ok(angle.get_ref().to_radians()),
            Some(angle) => Err(self.value_error(key, angle, "must be a number of degrees")),
        }
    }

    fn value_error<T>(&self, key: &'static str, value: &Spanned<T>, problem: &str) -> WorldError {
        let before = self.text.get(..value.span().start).unwrap_or_default();
        let line = 1 + before.matches('\n').count();
        WorldError::Value { file: self.file.into(), line, key, problem: problem.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_and_boxes_become_surfaces() {
        let text = "start = [1, 1, 20]\n[[wall]]\nfrom = [0, 0]\nto = [4, 0]\n[[box]]\ncenter = [2, 2]\nsize = [0.6, 0.4]\nangle_deg = 30\n";
        let world = World::from_toml("room.toml", text).unwrap();
        assert_eq!((world.segments.len(), world.start), (5, Point::new(1.0, 1.0)));
        assert!((world.start_heading_rad.unwrap().to_degrees() - 20.0).abs() < 1e-9);
    }

    #[test]
    fn a_bad_value_names_file_line_and_key() {
        let text = "start = [1, 1, 20]\n[[wall]]\nfrom = [0, 0]\nto = [0, 0]\n";
        let error = World::from_toml("room.toml", text).unwrap_err().to_string();
        assert_eq!(error, "room.toml: line 4: wall.to is the same point as from");
        let text = "start = [1, 1, 20]\n[[box]]\ncenter = [0, nan]\nsize = [1, 1]\n";
        let error = World::from_toml("room.toml", text).unwrap_err().to_string();
        assert_eq!(error, "room.toml: line 3: box.center must lie within 100 m of the origin");
    }

    #[test]
    fn unknown_and_missing_keys_are_named_with_their_line() {
        let error = World::from_toml("w.toml", "start = [1, 1, 20]\n[[wall]]\nfrm = [0, 0]\n").unwrap_err().to_string();
        assert!(error.contains("w.toml") && error.contains("line 3") && error.contains("frm"), "{error}");
        let error = World::from_toml("w.toml", "[[wall]]\nfrom = [0, 0]\n").unwrap_err().to_string();
        assert!(error.contains("line 1") && error.contains("`to`"), "{error}");
    }

    #[test]
    fn the_example_world_can_be_read() {
        World::from_toml("corner.toml", include_str!("../../../configs/worlds/corner.toml")).unwrap();
    }
}
