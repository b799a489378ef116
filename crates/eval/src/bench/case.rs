//! What is simulated in one row of the accuracy table, and which rows there are.

use slamd_core::Method;
use slamd_files::regular;
use slamd_sim::fault::FaultMix;
use slamd_sim::sonar::BeamShape;
use slamd_sim::world::World;
use std::path::Path;

/// One row: every seed drives under these conditions.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// A built-in world, `random` (another home for each seed) or a TOML file.
    pub world: String,
    /// The beams' shape.
    pub beam: BeamShape,
    /// The mix of broken sensors.
    pub mix: FaultMix,
    /// Sensors of the ring.
    pub sensors: u8,
    /// Scale of the odometry's errors.
    pub odometry_errors: f64,
    /// Length of the drive, seconds.
    pub seconds: f64,
    /// The method.
    pub method: Method,
}

/// The keys of a case and the values that the grid goes through.
const KEYS: [(&str, &[&str]); 5] = [
    ("world", &["flat", "office", "furnished", "home", "room"]),
    ("beam", &["cone", "point"]),
    ("faults", &["none", "paper", "late"]),
    ("sensors", &["8", "16", "24", "32"]),
    ("odometry", &["0", "1", "3"]),
];

/// A named set of rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Table {
    /// The three worlds under usual conditions.
    Usual,
    /// The rows that the project's targets speak of.
    Issue,
    /// Everything with everything.
    Grid,
}

/// `key=value` or `key=value,value`; the value `all` means every value of the grid.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    key: &'static str,
    values: Vec<String>,
}

impl std::str::FromStr for Choice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = KEYS.map(|(name, _)| name).join(", ");
        let (key, values) = text.split_once('=').ok_or_else(|| format!("\"{text}\" is not KEY=VALUE"))?;
        let &(key, known) = KEYS
            .iter()
            .find(|(name, _)| *name == key)
            .ok_or_else(|| format!("there is no key \"{key}\"; there are {names}"))?;
        let values = match values {
            "all" => known.iter().map(|value| (*value).to_owned()).collect(),
            list => list.split(',').map(str::to_owned).collect(),
        };
        let choice = Self { key, values };
        choice.values.iter().try_for_each(|value| Case::usual().set(key, value))?;
        Ok(choice)
    }
}

impl Case {
    /// The flat, cone beams, the paper's faults, 32 sensors, usual wheels, five minutes.
    #[must_use]
    pub fn usual() -> Self {
        Self {
            world: "flat".into(),
            beam: BeamShape::Cone,
            mix: FaultMix::Paper,
            sensors: 32,
            odometry_errors: 1.0,
            seconds: 300.0,
            method: Method::Walls,
        }
    }

    /// The rows of a table that fit all choices; without a table, every combination of the choices with what is usual for the rest.
    #[must_use]
    pub fn rows(table: Option<Table>, choices: &[Choice]) -> Vec<Self> {
        let Some(table) = table else { return combined(choices) };
        let rows = match table {
            Table::Usual => ["flat", "office", "furnished"].map(|world| Self::usual().with(&[("world", world)])).into(),
            Table::Issue => ISSUE.iter().map(|pairs| Self::usual().with(pairs)).collect(),
            Table::Grid => {
                let whole = |(key, known): (&'static str, &[&str])| Choice {
                    key,
                    values: known.iter().map(|value| (*value).to_owned()).collect(),
                };
                combined(&KEYS.map(whole))
            }
        };
        let fits = |case: &Self| choices.iter().all(|choice| choice.values.contains(&case.value(choice.key)));
        rows.into_iter().filter(fits).collect()
    }

    /// The row's value of a key, as in a [`Choice`].
    #[must_use]
    pub fn value(&self, key: &str) -> String {
        match key {
            "world" => self.world.clone(),
            "beam" => self.beam.word().into(),
            "faults" => self.mix.word().into(),
            "sensors" => self.sensors.to_string(),
            _ => self.odometry_errors.to_string(),
        }
    }

    /// The world of a seed's drive: the same for all seeds, except `random`.
    ///
    /// # Errors
    /// Where it is neither built in nor a readable world file.
    pub fn load_world(&self, seed: u64) -> Result<World, String> {
        if let Some(world) = World::for_seed(&self.world, seed) {
            return Ok(world);
        }
        let text = regular::read_text(Path::new(&self.world), World::MAX_FILE_BYTES).map_err(|error| {
            format!("world {}: {error}; built in are {}, random", self.world, World::BUILT_IN.join(", "))
        })?;
        World::from_toml(&self.world, &text).map_err(|error| error.to_string())
    }

    fn with(mut self, pairs: &[(&str, &str)]) -> Self {
        for (key, value) in pairs {
            self.set(key, value).expect("the tables hold valid values");
        }
        self
    }

    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        let number = || format!("{key}={value}: a number is wanted");
        match key {
            "world" => self.world = value.into(),
            "beam" => self.beam = value.parse()?,
            "faults" => self.mix = value.parse()?,
            "sensors" => {
                self.sensors = value.parse().ok().filter(|count| (1..=64).contains(count)).ok_or_else(number)?;
            }
            _ => self.odometry_errors = value.parse().map_err(|_| number())?,
        }
        Ok(())
    }
}

impl std::fmt::Display for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let pairs: Vec<String> = KEYS.iter().map(|(key, _)| format!("{key}={}", self.value(key))).collect();
        f.write_str(&pairs.join(" "))
    }
}

/// Every combination of the choices' values, in the order of [`KEYS`].
fn combined(choices: &[Choice]) -> Vec<Case> {
    KEYS.iter().filter_map(|(key, _)| choices.iter().find(|choice| choice.key == *key)).fold(
        vec![Case::usual()],
        |rows, choice| {
            let each = |row: &Case| {
                choice.values.iter().map(|value| row.clone().with(&[(choice.key, value)])).collect::<Vec<Case>>()
            };
            rows.iter().flat_map(each).collect()
        },
    )
}

/// What differs from the usual in each row that a target speaks of.
const ISSUE: &[&[(&str, &str)]] = &[
    &[],
    &[("world", "office")],
    &[("world", "furnished")],
    &[("world", "home"), ("beam", "point")],
    &[("beam", "point")],
    &[("world", "furnished"), ("beam", "point")],
    &[("odometry", "3")],
    &[("world", "office"), ("odometry", "3")],
    &[("world", "furnished"), ("odometry", "3")],
    &[("sensors", "8"), ("faults", "none")],
    &[("world", "furnished"), ("sensors", "8"), ("faults", "none")],
    &[("sensors", "16")],
    &[("sensors", "24")],
    &[("faults", "none")],
    &[("world", "office"), ("faults", "none")],
    &[("world", "furnished"), ("faults", "none")],
    &[("world", "home"), ("beam", "point"), ("faults", "none")],
    &[("faults", "late")],
    &[("world", "office"), ("faults", "late")],
    &[("world", "furnished"), ("faults", "late")],
    &[("world", "random"), ("faults", "none")],
    &[("world", "random"), ("faults", "none"), ("sensors", "16")],
    &[("world", "random"), ("faults", "none"), ("sensors", "8")],
    &[("world", "random")],
];

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(table: Option<Table>, choices: &[&str]) -> Vec<String> {
        let choices: Vec<Choice> = choices.iter().map(|text| text.parse().unwrap()).collect();
        Case::rows(table, &choices).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn choices_combine_and_the_rest_is_usual() {
        let found = rows(None, &["sensors=8,16", "world=office"]);
        assert_eq!(
            found,
            [
                "world=office beam=cone faults=paper sensors=8 odometry=1",
                "world=office beam=cone faults=paper sensors=16 odometry=1"
            ]
        );
        assert_eq!(rows(None, &["odometry=all"]).len(), 3);
        assert_eq!(rows(None, &[]).len(), 1);
    }

    #[test]
    fn tables_are_filtered() {
        assert_eq!(rows(Some(Table::Grid), &[]).len(), 5 * 2 * 3 * 4 * 3);
        assert_eq!(rows(Some(Table::Usual), &["world=flat"]).len(), 1);
        let slippery = rows(Some(Table::Issue), &["odometry=3"]);
        assert!(slippery.len() == 3 && slippery.iter().all(|row| row.ends_with("odometry=3")), "{slippery:?}");
    }

    #[test]
    fn nonsense_is_refused_in_words() {
        for text in ["flat", "wheels=3", "beam=laser", "sensors=0", "odometry=much"] {
            assert!(text.parse::<Choice>().is_err(), "{text}");
        }
        assert!(Case { world: "moon".into(), ..Case::usual() }.load_world(1).unwrap_err().contains("moon"));
    }
}
