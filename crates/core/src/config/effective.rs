//! The configuration merged from all layers, and the origin of each value.

use super::Config;
use super::keys::{Key, joined, keys};
use super::layers::Origins;
use super::shape::Shape;
use std::fmt::Write as _;

/// A configuration with the origins of its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Effective {
    /// The configuration.
    pub config: Config,
    origins: Origins,
}

impl Effective {
    pub(super) const fn new(config: Config, origins: Origins) -> Self {
        Self { config, origins }
    }

    /// The TOML text of this configuration; [`Config::from_toml`] reads it back. A comment after each value that is not the default
    /// names its origin.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let mut text = String::new();
        self.write("", &keys(), &self.config.to_table(), Some(&Config::default().to_table()), &mut text);
        text.trim_start().into()
    }

    /// Values first, then tables: in TOML, a value below a table's head belongs to that table.
    fn write(&self, path: &str, keys: &[Key], table: &toml::Table, default: Option<&toml::Table>, text: &mut String) {
        let found = || keys.iter().filter_map(|key| Some((key, joined(path, key.name), table.get(key.name)?)));
        for (key, path, value) in found().filter(|(key, ..)| !matches!(key.shape, Shape::Table(_) | Shape::List(..))) {
            let _ = write!(text, "{} = {value}", key.name);
            if default.and_then(|default| default.get(key.name)) != Some(value) {
                self.comment(&path, text);
            }
            text.push('\n');
        }
        for (key, path, value) in found() {
            match (&key.shape, value) {
                (Shape::Table(keys), toml::Value::Table(table)) => {
                    let _ = writeln!(text, "\n[{path}]");
                    let default = default.and_then(|default| default.get(key.name)?.as_table());
                    self.write(&path, keys, table, default, text);
                }
                (Shape::List(keys, _), toml::Value::Array(list)) => {
                    for (i, item) in list.iter().enumerate().filter_map(|(i, item)| Some((i, item.as_table()?))) {
                        let _ = writeln!(text, "\n[[{path}]]");
                        self.write(&joined(&path, &i.to_string()), keys, item, None, text);
                    }
                }
                _ => {}
            }
        }
    }

    fn comment(&self, path: &str, text: &mut String) {
        if let Some(origin) = self.origins.get(path) {
            // A file's name must not end the comment.
            let origin = origin.to_string().replace(|c: char| c.is_control(), "?");
            let _ = write!(text, "  # {origin}");
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::config::{Config, Layers};

    const ROBOT: &str = "[robot]\nname = \"r2\"\nwheel_base_m = 0.5\nwheel_ratio = 1.0\n[[ring.sensors]]\nbearing_deg = 90\nhalf_angle_deg = 15\n";

    #[test]
    fn each_value_tells_where_it_is_from_and_all_is_read_back() {
        let mut layers = Layers::default();
        layers.text(Some("robot\n.toml"), ROBOT);
        layers.value("SLAMD_ROBOT__WHEEL_BASE_M", "robot.wheel_base_m", "0.3");
        let effective = layers.finish().unwrap();
        let text = effective.to_toml();
        for line in [
            "method = \"walls\"\n",
            "name = \"r2\"  # robot?.toml:2\n",
            "wheel_base_m = 0.3  # SLAMD_ROBOT__WHEEL_BASE_M\n",
            "wheel_ratio = 1.0\n",
            "bearing_deg = 90.0  # robot?.toml:6\n",
        ] {
            assert!(text.contains(line), "{line} is not in\n{text}");
        }
        assert_eq!(Config::from_toml(&text), Ok(effective.config));
    }

    #[test]
    fn the_defaults_are_shown_without_comments() {
        let text = Layers::default().finish().unwrap().to_toml();
        assert!(!text.contains('#') && text.starts_with("method = "), "{text}");
        assert_eq!(Config::from_toml(&text), Ok(Config::default()));
    }
}
