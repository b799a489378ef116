//! Layers of configuration, each over the one before: TOML texts and single values.
//!
//! Tables are merged key by key. A value replaces the one below; so does a list, as a whole. Each layer is checked alone, then all
//! together at the end. All errors are collected.

use super::Config;
use super::effective::Effective;
use super::keys::{Key, joined, keys, values};
use super::nearest::nearest;
use super::problem::{ConfigError, Origin, Problem};
use super::shape::{Shape, as_number, shown};
use serde::Deserialize as _;
use std::collections::BTreeMap;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// The origin of each value, by its dotted key; list items by their index.
pub(super) type Origins = BTreeMap<String, Origin>;

/// The layers over the defaults so far.
#[derive(Debug, Default)]
pub struct Layers {
    merged: toml::Table,
    origins: Origins,
    problems: Vec<Problem>,
}

/// Errors reported per layer: nobody reads more.
const MAX_PROBLEMS: usize = 50;

impl Layers {
    /// Adds a TOML text as a layer. Errors name its lines, and `name` if there is one.
    pub fn text(&mut self, name: Option<&str>, text: &str) {
        let at = |start: usize| {
            let line = 1 + text.bytes().take(start).filter(|byte| *byte == b'\n').count();
            name.map_or(Origin::Line(line), |name| Origin::File(name.into(), line))
        };
        let mut reading = Reading { at: &at, origins: &mut self.origins, problems: Vec::new() };
        match DeTable::parse(text) {
            Ok(table) => reading.table("", &keys(), table.get_ref(), &mut self.merged),
            Err(error) => {
                let start = error.span().map_or(text.len(), |span| span.start);
                reading.problem(start, || error.message().into());
            }
        }
        let mut problems = reading.problems;
        problems.sort();
        self.problems.append(&mut problems);
    }

    /// Adds one value as a layer: `key` is one of [`values`], `origin` its environment variable or option. A text is taken as it
    /// is, another value is read as TOML.
    pub fn value(&mut self, origin: &str, key: &str, words: &str) {
        let at = |_| Origin::Named(origin.into());
        let mut reading = Reading { at: &at, origins: &mut self.origins, problems: Vec::new() };
        let Some((path, leaf)) = values().into_iter().find(|(path, _)| path == key) else {
            reading.problem(0, || format!("there is no key {key}"));
            self.problems.append(&mut reading.problems);
            return;
        };
        let value = match leaf.shape {
            Shape::Text | Shape::Choice(_) => Ok(Spanned::new(0..0, DeValue::String(words.into()))),
            _ => DeValue::parse(words.trim()),
        };
        match value {
            Ok(value) => {
                if let Some(table) = table_of(&path, &mut self.merged) {
                    reading.entry(&path, &leaf, &value, table);
                }
            }
            Err(_) => reading.problem(0, || {
                format!("{path} = {} does not fit: it must be {}", shown(words), leaf.shape.words(&path))
            }),
        }
        self.problems.append(&mut reading.problems);
    }

    /// The merged configuration.
    ///
    /// # Errors
    /// All errors found.
    pub fn finish(mut self) -> Result<Effective, ConfigError> {
        self.check_required("", &keys(), &self.merged.clone());
        if self.problems.is_empty() {
            // Values that pass the check fit the types.
            match toml::Value::Table(self.merged.clone()).try_into::<Config>() {
                Ok(config) => {
                    self.check_contradictions("", &keys(), &config.to_table());
                    if self.problems.is_empty() {
                        return Ok(Effective::new(config, self.origins));
                    }
                }
                Err(error) => self.problems.push(Problem { origin: Origin::Line(1), words: error.message().into() }),
            }
        }
        Err(ConfigError { problems: self.problems })
    }

    /// Finds tables without a required key.
    fn check_required(&mut self, path: &str, keys: &[Key], table: &toml::Table) {
        for key in keys {
            let inner = joined(path, key.name);
            match (&key.shape, table.get(key.name)) {
                (Shape::Table(keys), Some(toml::Value::Table(table))) => self.check_required(&inner, keys, table),
                (Shape::List(keys, _), Some(toml::Value::Array(list))) => {
                    for (i, item) in list.iter().enumerate().filter_map(|(i, item)| Some((i, item.as_table()?))) {
                        self.check_required(&joined(&inner, &i.to_string()), keys, item);
                    }
                }
                // A key that is there but wrong was reported already.
                (shape, None) if key.is_required && !self.origins.contains_key(&inner) => {
                    let words = format!("{inner} is missing: it must be {}", shape.words(&inner));
                    self.report(&[path], words);
                }
                _ => {}
            }
        }
    }

    /// Finds values that contradict each other.
    fn check_contradictions(&mut self, path: &str, keys: &[Key], table: &toml::Table) {
        for key in keys {
            let inner = joined(path, key.name);
            let Some(value) = table.get(key.name) else { continue };
            if let (Shape::Table(keys), toml::Value::Table(table)) = (&key.shape, value) {
                self.check_contradictions(&inner, keys, table);
            }
            if let Some(other) = key.instead_of.filter(|other| table.contains_key(*other)) {
                let other = joined(path, other);
                self.report(&[&inner, &other], format!("{inner} and {other} are both given: take one of them away"));
            }
            let bound = key.at_most.and_then(|other| Some((joined(path, other), table.get(other)?)));
            if let Some((other, most)) = bound
                && as_number(value) > as_number(most)
            {
                let words = format!("{inner} = {value} is out of range: it must be at most {other}, which is {most}");
                self.report(&[&inner, &other], words);
            }
        }
    }

    /// Reports an error at the origin of the first of these keys that has one, and names the origins of the others.
    fn report(&mut self, paths: &[&str], words: String) {
        let mut origins = paths.iter().filter_map(|path| self.origin(path));
        let origin = origins.next().cloned().unwrap_or(Origin::Line(1));
        let others: Vec<String> = origins.map(|other| format!(" (see {other})")).collect();
        self.problems.push(Problem { origin, words: words + &others.concat() });
    }

    /// Origin of a value; for a table made of single values, the origin of one of them.
    fn origin(&self, path: &str) -> Option<&Origin> {
        let inside = || self.origins.iter().find(|(key, _)| key.starts_with(&format!("{path}.")));
        self.origins.get(path).or_else(|| inside().map(|(_, origin)| origin))
    }
}

/// The table that holds the value of a dotted key, created if there is none.
fn table_of<'a>(path: &str, root: &'a mut toml::Table) -> Option<&'a mut toml::Table> {
    let Some((above, _)) = path.rsplit_once('.') else { return Some(root) };
    above
        .split('.')
        .try_fold(root, |table, name| table.entry(name).or_insert_with(|| toml::Table::new().into()).as_table_mut())
}

/// Reads one layer into the others.
struct Reading<'a> {
    /// Origin of the byte with this index.
    at: &'a dyn Fn(usize) -> Origin,
    origins: &'a mut Origins,
    problems: Vec<Problem>,
}

impl Reading<'_> {
    fn problem(&mut self, start: usize, words: impl FnOnce() -> String) {
        if self.problems.len() < MAX_PROBLEMS {
            self.problems.push(Problem { origin: (self.at)(start), words: words() });
        }
    }

    fn table(&mut self, path: &str, keys: &[Key], found: &DeTable<'_>, into: &mut toml::Table) {
        for (name, value) in found {
            match keys.iter().find(|key| key.name == name.get_ref()) {
                Some(key) => self.entry(&joined(path, key.name), key, value, into),
                None => self.problem(name.span().start, || unknown(path, name.get_ref(), keys)),
            }
        }
    }

    fn entry(&mut self, path: &str, key: &Key, value: &Spanned<DeValue<'_>>, into: &mut toml::Table) {
        let start = value.span().start;
        let read = match (&key.shape, value.get_ref()) {
            (Shape::Table(keys), DeValue::Table(found)) => {
                let inner = into.entry(key.name).or_insert_with(|| toml::Table::new().into());
                if let Some(inner) = inner.as_table_mut() {
                    self.table(path, keys, found, inner);
                }
                self.origins.insert(path.into(), (self.at)(start));
                return;
            }
            (Shape::List(keys, most), DeValue::Array(found)) if found.len() <= usize::from(*most) => {
                self.origins.retain(|known, _| !known.starts_with(&format!("{path}.")));
                let items = found.iter().enumerate();
                toml::Value::Array(
                    items.map(|(i, item)| self.item(&joined(path, &i.to_string()), keys, item)).collect(),
                )
            }
            _ => match toml::Value::deserialize(ValueDeserializer::from(value.clone())) {
                Ok(read) => {
                    if let Some(refusal) = key.shape.refusal(path, &read) {
                        self.origins.insert(path.into(), (self.at)(start));
                        return self.problem(start, || refusal);
                    }
                    read
                }
                Err(error) => return self.problem(start, || format!("{path}: {}", error.message())),
            },
        };
        self.origins.insert(path.into(), (self.at)(start));
        into.insert(key.name.into(), read);
    }

    fn item(&mut self, path: &str, keys: &[Key], item: &Spanned<DeValue<'_>>) -> toml::Value {
        let (start, mut inner) = (item.span().start, toml::Table::new());
        match item.get_ref() {
            DeValue::Table(found) => self.table(path, keys, found, &mut inner),
            _ => self.problem(start, || format!("{path} does not fit: it must be a table")),
        }
        self.origins.insert(path.into(), (self.at)(start));
        inner.into()
    }
}

/// Error text for an unknown key.
fn unknown(path: &str, name: &str, known: &[Key]) -> String {
    let key = shown(&joined(path, name));
    let siblings = || known.iter().map(|key| key.name);
    if let Some(meant) = nearest(name, siblings()) {
        return format!("unknown key {key}; did you mean {}?", joined(path, meant));
    }
    let elsewhere = values().into_iter().find(|(_, key)| key.name == name);
    if let Some((meant, _)) = elsewhere {
        return format!("unknown key {key}; did you mean {meant}?");
    }
    format!("unknown key {key}; there are {}", siblings().collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Error text for a configuration text.
    fn refusal(text: &str) -> String {
        Config::from_toml(text).unwrap_err().to_string()
    }

    #[test]
    fn a_value_out_of_range_names_line_key_and_range() {
        let text = "[robot]\nname = \"r\"\nwheel_base_m = 7.5\n";
        assert_eq!(refusal(text), "line 3: robot.wheel_base_m = 7.5 is out of range: it must be from 0.02 to 3");
        assert_eq!(
            refusal(
                "[[ring.sensors]]\nbearing_deg = 0\nhalf_angle_deg = 5\n[[ring.sensors]]\nbearing_deg = 0\nhalf_angle_deg = 95\n"
            ),
            "line 6: ring.sensors.1.half_angle_deg = 95 is out of range: it must be from 0 to 60"
        );
        assert_eq!(
            refusal("[[ring.corrections]]\nsensor = 2\nrange_bias_m = 3.0\n"),
            "line 3: ring.corrections.0.range_bias_m = 3.0 is out of range: it must be from -0.5 to 0.5"
        );
        assert_eq!(
            refusal("map.cell_m = nan"),
            "line 1: map.cell_m = nan is out of range: it must be from 0.01 to 0.5"
        );
        assert!(refusal("[board]\nslot_us = 9_999").contains("from 10000 to 60000"));
        assert!(refusal("board.clockwise = 2").contains("it must be true or false"));
        assert!(refusal("method = 'walks'").contains("out of range: it must be \"walls\" or \"paper\""));
    }

    #[test]
    fn a_value_of_the_wrong_kind_says_which_is_right() {
        let said = "line 1: robot.wheel_base_m = \"wide\" does not fit: it must be a number from 0.02 to 3";
        assert_eq!(refusal("robot.wheel_base_m = 'wide'"), said);
        assert_eq!(refusal("robot = 3"), "line 1: robot = 3 does not fit: it must be a table, [robot]");
        assert!(refusal("ring.circle.count = 8.0").contains("a whole number from 1 to 64"));
        assert!(refusal("ring.sensors = [1]").contains("ring.sensors.0 does not fit: it must be a table"));
        assert!(refusal(&format!("ring.sensors = [{}]", "{}, ".repeat(65))).contains("at most 64 tables"));
        assert!(refusal(&format!("robot.wheel_base_m = '{}'", "w".repeat(999))).len() < 200);
    }

    #[test]
    fn an_unknown_key_names_the_nearest() {
        assert_eq!(
            refusal("[robot]\nwheelbase_m = 3\n"),
            "line 2: unknown key robot.wheelbase_m; did you mean robot.wheel_base_m?"
        );
        assert_eq!(refusal("[rbot]\n"), "line 1: unknown key rbot; did you mean robot?");
        assert_eq!(refusal("cell_m = 0.1\n"), "line 1: unknown key cell_m; did you mean map.cell_m?");
        assert_eq!(refusal("map.colour = 1\n"), "line 1: unknown key map.colour; there are cell_m");
        assert!(refusal("board.slotus = 1\n").ends_with("did you mean board.slot_us?"));
        assert!(refusal("\"robot.name\" = 'x'\n").contains("unknown key robot.name"));
        assert!(refusal("\n[robot\n").starts_with("line 2: "));
    }

    #[test]
    fn all_errors_are_told_in_the_order_of_their_lines() {
        let text = "[robot]\nwheel_base_m = 9\nnaem = 'x'\n[map]\ncell_m = 9\n";
        let said = refusal(text);
        let lines: Vec<&str> = said.lines().map(|line| line.split(": ").next().unwrap()).collect();
        assert_eq!(lines, ["3 errors", "  line 2", "  line 3", "  line 5"]);
        let many: String = (0..1_000).map(|i| format!("key{i} = 1\n")).collect();
        assert_eq!(Config::from_toml(&many).unwrap_err().problems.len(), MAX_PROBLEMS);
    }

    #[test]
    fn values_that_do_not_go_together_are_refused() {
        let circle = "[ring.circle]\nradius_m = 0.1\nhalf_angle_deg = 9\n";
        assert_eq!(refusal(circle), "line 1: ring.circle.count is missing: it must be a whole number from 1 to 64");
        let whole = format!("{circle}count = 4\n");
        assert!(
            refusal(&format!("{whole}groups = 5\n")).contains("at most ring.circle.count, which is 4 (see line 4)")
        );
        let both = format!("{whole}[[ring.sensors]]\nbearing_deg = 1\nhalf_angle_deg = 1\n");
        assert_eq!(
            refusal(&both),
            "line 5: ring.sensors and ring.circle are both given: take one of them away (see line 1)"
        );
        assert!(refusal("[[ring.sensors]]\nbearing_deg = 1\n").contains("ring.sensors.0.half_angle_deg is missing"));
        assert!(refusal("ring.min_range_m = 4").contains("at most ring.max_range_m, which is 3.0"));
    }

    #[test]
    fn the_later_layer_wins_and_keeps_what_it_does_not_name() {
        let mut layers = Layers::default();
        layers.text(
            Some("a"),
            "[robot]\nname = 'a'\nwheel_base_m = 0.3\n[[ring.sensors]]\nbearing_deg = 1\nhalf_angle_deg = 1\n",
        );
        layers.text(Some("b"), "ring.sensors = []\n[robot]\nname = 'b'\n");
        layers.value("SLAMD_RING__MAX_RANGE_M", "ring.max_range_m", " 2 ");
        layers.value("--method", "method", "paper");
        let config = layers.finish().unwrap().config;
        assert_eq!((config.robot.name.as_str(), config.method), ("b", crate::config::Method::Paper));
        assert!((config.robot.wheel_base_m - 0.3).abs() < 1e-9 && (config.ring.max_range_m - 2.0).abs() < 1e-9);
        assert!(config.ring.sensors.is_empty());
    }

    #[test]
    fn a_single_value_is_one_value() {
        let refusal = |key: &str, words: &str| {
            let mut layers = Layers::default();
            layers.value("SLAMD_X", key, words);
            layers.finish().unwrap_err().to_string()
        };
        assert_eq!(
            refusal("robot.wheel_base_m", "7"),
            "SLAMD_X: robot.wheel_base_m = 7 is out of range: it must be from 0.02 to 3"
        );
        assert!(refusal("robot.wheel_base_m", "0.3\nmethod = 'paper'").contains("does not fit"));
        assert!(refusal("robot.wheel_base_m", "").contains("does not fit"));
        assert!(refusal("ring.circle.count", "8").contains("SLAMD_X: ring.circle.radius_m is missing"));
        assert_eq!(refusal("robot.wheels", "7"), "SLAMD_X: there is no key robot.wheels");
    }
}
