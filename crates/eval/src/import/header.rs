//! Headers of other names: `millis,encL,encR,sonar_1,...`. What is unambiguous is read, and what was assumed is said; otherwise the option to
//! type is shown.

use super::column_names::{DIRECTIONS, Meaning, meaning};
use super::columns::Role;
use super::ranges::RangeUnit;
use super::times::TimeUnit;
use std::collections::BTreeMap;

/// What a header's names mean.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Layout {
    pub(super) roles: Vec<Role>,
    pub(super) time_unit: Option<TimeUnit>,
    pub(super) range_unit: Option<RangeUnit>,
    /// What was assumed; empty if nothing was.
    pub(super) said: String,
}

/// True for the fields of a line that has the time and one other column of a drive.
pub(super) fn is_header(names: &[String]) -> bool {
    let meanings = || names.iter().map(|name| meaning(name));
    meanings().any(|meaning| matches!(meaning, Meaning::Time(_)))
        && meanings().any(|meaning| matches!(meaning, Meaning::Ticks(..) | Meaning::Range(_, Some(_), _)))
}

/// The meaning of a header.
///
/// # Errors
/// A hint where it is not clear.
pub(super) fn guess(names: &[String], sensors: usize) -> Result<Layout, String> {
    let meanings: Vec<Meaning> = names.iter().map(|name| meaning(name)).collect();
    let mut found = Found { names, roles: vec![Role::Ignored; names.len()], problems: Vec::new() };
    let of = |test: &dyn Fn(&Meaning) -> bool| -> Vec<usize> {
        meanings.iter().enumerate().filter(|(_, meaning)| test(meaning)).map(|(column, _)| column).collect()
    };
    let time = found.one("the time", Role::Time, "t_s", of(&|meaning| matches!(meaning, Meaning::Time(_))));
    for (wheel, name, what) in [(0, "left_ticks", "the left encoder"), (1, "right_ticks", "the right encoder")] {
        let mut columns = of(&|meaning| *meaning == Meaning::Ticks(wheel, true));
        let is_direction = |name: &String| DIRECTIONS.contains(&name.to_lowercase().as_str());
        if columns.is_empty() && !names.iter().any(is_direction) {
            columns = of(&|meaning| *meaning == Meaning::Ticks(wheel, false));
        }
        found.one(what, Role::Ticks(wheel), name, columns);
    }
    let range_unit = found.ranges(&meanings, sensors);
    let time_unit = time.and_then(|column| match meanings.get(column) {
        Some(Meaning::Time(unit)) => *unit,
        _ => None,
    });
    if let Some(problem) = found.problems.first() {
        return Err(format!("{problem}; {}", hint(&found.roles, sensors)));
    }
    let used = names.iter().zip(&found.roles).filter(|(_, role)| **role != Role::Ignored);
    let ignored: Vec<&str> = names
        .iter()
        .zip(&found.roles)
        .filter(|(name, role)| **role == Role::Ignored && !name.is_empty())
        .map(|(name, _)| name.as_str())
        .collect();
    let renamed = used.filter(|(name, role)| !name.eq_ignore_ascii_case(&word(**role))).count();
    let mut said = if renamed > 0 {
        format!("the header is taken as --columns {}", list(&found.roles))
    } else {
        "the columns are found by their names".to_owned()
    };
    if let Some(unit) = time_unit.filter(|unit| *unit != TimeUnit::Seconds) {
        said += &format!(" --time-unit {}", unit.word());
    }
    if let Some(unit) = range_unit.filter(|unit| *unit != RangeUnit::Metres) {
        said += &format!(" --range-unit {}", unit.word());
    }
    if !ignored.is_empty() {
        said += &format!("; not used: {}", ignored.join(", "));
    }
    Ok(Layout { roles: found.roles, time_unit, range_unit, said })
}

struct Found<'a> {
    names: &'a [String],
    roles: Vec<Role>,
    problems: Vec<String>,
}

impl Found<'_> {
    fn name(&self, column: usize) -> &str {
        self.names.get(column).map_or("", String::as_str)
    }

    fn set(&mut self, column: usize, role: Role) {
        if let Some(cell) = self.roles.get_mut(column) {
            *cell = role;
        }
    }

    /// Gives a role to the only column that can have it; our own name comes before others. Returns the column.
    fn one(&mut self, what: &str, role: Role, ours: &str, mut columns: Vec<usize>) -> Option<usize> {
        let exact: Vec<usize> =
            columns.iter().copied().filter(|column| self.name(*column).eq_ignore_ascii_case(ours)).collect();
        if exact.len() == 1 {
            columns = exact;
        }
        // A date alone is the same in all rows.
        let is_date = |column: &usize| self.name(*column).eq_ignore_ascii_case("date");
        if columns.len() == 2 && columns.iter().filter(|column| is_date(column)).count() == 1 {
            columns.retain(|column| !is_date(column));
        }
        let first = columns.first().copied();
        match first {
            Some(column) => self.set(column, role),
            None => self.problems.push(format!("no name is that of {what}")),
        }
        if let [one, two, ..] = columns.as_slice() {
            self.problems.push(format!("both `{}` and `{}` may be {what}", self.name(*one), self.name(*two)));
        }
        first
    }

    /// Finds the columns of the sensors. Returns their unit.
    fn ranges(&mut self, meanings: &[Meaning], sensors: usize) -> Option<RangeUnit> {
        let mut families: BTreeMap<&str, Vec<(usize, usize)>> = BTreeMap::new();
        for (column, meaning) in meanings.iter().enumerate() {
            if let Meaning::Range(family, number, _) = meaning
                && (number.is_some() || sensors == 1)
            {
                families.entry(family).or_default().push((number.unwrap_or_default(), column));
            }
        }
        families.values_mut().for_each(|family| family.sort_unstable());
        let is_whole = |family: &&Vec<(usize, usize)>| {
            let first = family.first().map_or(0, |(number, _)| *number);
            first <= 1 && family.len() == sensors && family.iter().zip(first..).all(|((number, _), at)| *number == at)
        };
        let whole: Vec<&Vec<(usize, usize)>> = families.values().filter(is_whole).collect();
        let Some(family) = whole.first() else {
            if let Some(family) = families.values().max_by_key(|family| family.len()).filter(|family| family.len() > 1)
            {
                let (first, last) = (family.first().copied()?, family.last().copied()?);
                self.problems.push(format!(
                    "the header has {} ranges (`{}` to `{}`), the configured ring has {sensors} sensors",
                    family.len(),
                    self.name(first.1),
                    self.name(last.1)
                ));
            } else {
                self.problems.push(format!("no names are those of the {sensors} sensors"));
            }
            return None;
        };
        if let [one, two, ..] = whole.as_slice() {
            let name = |family: &[(usize, usize)]| family.first().map_or("", |(_, column)| self.name(*column));
            let problem = format!("both `{}`, ... and `{}`, ... may be the ranges", name(one), name(two));
            self.problems.push(problem);
        }
        for (sensor, (_, column)) in family.iter().enumerate() {
            self.set(*column, Role::Range(sensor));
        }
        match meanings.get(family.first()?.1) {
            Some(Meaning::Range(_, _, unit)) => *unit,
            _ => None,
        }
    }
}

/// Our name of a column.
fn word(role: Role) -> String {
    match role {
        Role::Time => "t_s".into(),
        Role::Ticks(0) => "left_ticks".into(),
        Role::Ticks(_) => "right_ticks".into(),
        Role::Range(sensor) => format!("r{sensor}"),
        Role::Ignored => "-".into(),
    }
}

/// The value of `--columns`.
pub(super) fn list(roles: &[Role]) -> String {
    let mut items: Vec<String> = Vec::new();
    let mut run: Option<(usize, usize)> = None;
    let close = |run: &mut Option<(usize, usize)>, items: &mut Vec<String>| match run.take() {
        Some((first, last)) if last > first => items.push(format!("r{first}-r{last}")),
        Some((first, _)) => items.push(format!("r{first}")),
        None => {}
    };
    // Columns behind the last that is used need no name.
    let count = roles.iter().rposition(|role| *role != Role::Ignored).map_or(0, |last| last + 1);
    let has_more = count < roles.len();
    for role in roles.iter().take(count) {
        match (role, run) {
            (Role::Range(sensor), Some((first, last))) if *sensor == last + 1 => run = Some((first, *sensor)),
            (Role::Range(sensor), _) => {
                close(&mut run, &mut items);
                run = Some((*sensor, *sensor));
            }
            _ => {
                close(&mut run, &mut items);
                items.push(word(*role));
            }
        }
    }
    close(&mut run, &mut items);
    if has_more {
        items.extend(std::iter::repeat_n("-".to_owned(), roles.len() - count));
    }
    items.join(",")
}

/// An option to type for a file without a header, whose first row has these fields.
pub(super) fn headless(fields: &[String], sensors: usize) -> String {
    let numbers: Vec<usize> = (0..fields.len())
        .filter(|column| fields.get(*column).is_some_and(|field| field.is_empty() || field.parse::<f64>().is_ok()))
        .collect();
    let needed = [Role::Time, Role::Ticks(0), Role::Ticks(1)].into_iter().chain((0..sensors).map(Role::Range));
    let mut roles = vec![Role::Ignored; fields.len()];
    if numbers.len() < sensors + 3 {
        return hint(&roles, sensors);
    }
    for (column, role) in numbers.into_iter().zip(needed) {
        if let Some(cell) = roles.get_mut(column) {
            *cell = role;
        }
    }
    hint(&roles, sensors)
}

/// An option to type: what is known of the columns, and in the places of unknown ones what is missing, in order.
fn hint(roles: &[Role], sensors: usize) -> String {
    let all = [Role::Time, Role::Ticks(0), Role::Ticks(1)].into_iter().chain((0..sensors).map(Role::Range));
    let mut missing = all.filter(|role| !roles.contains(role)).collect::<Vec<_>>().into_iter();
    let filled: Vec<Role> = roles
        .iter()
        .map(|role| if *role == Role::Ignored { missing.next().unwrap_or(Role::Ignored) } else { *role })
        .collect();
    if missing.next().is_some() {
        let (has, needed) = (roles.len(), sensors + 3);
        return format!("it has {has} of the {needed} columns that are needed: t_s,left_ticks,right_ticks,r0,r1,...");
    }
    format!("if its columns are in this order, type --columns {}", list(&filled))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(header: &str, sensors: usize) -> Result<(String, Option<TimeUnit>, Option<RangeUnit>), String> {
        let names: Vec<String> = header.split(',').map(str::to_owned).collect();
        guess(&names, sensors).map(|guess| (list(&guess.roles), guess.time_unit, guess.range_unit))
    }

    #[test]
    fn usual_names_are_read() {
        let (ms, us) = (Some(TimeUnit::Milliseconds), Some(TimeUnit::Microseconds));
        let cm = Some(RangeUnit::Centimetres);
        for (header, expected, time_unit, range_unit) in [
            ("time,encL,encR,sonar_0,sonar_1", "t_s,left_ticks,right_ticks,r0-r1", None, None),
            ("t_ms,left_enc,right_enc,dist1,dist2", "t_s,left_ticks,right_ticks,r0-r1", ms, None),
            ("millis,ticks_l,ticks_r,us0,us1", "t_s,left_ticks,right_ticks,r0-r1", ms, None),
            ("micros,rticks,lticks,d1,d0", "t_s,right_ticks,left_ticks,r1,r0", us, None),
            ("id,Time [ms],Left Encoder,Right Encoder,S1,S2,battery", "-,t_s,left_ticks,right_ticks,r0-r1,-", ms, None),
            ("timestamp_ms,enc_left,enc_right,range_0_cm,range_1_cm", "t_s,left_ticks,right_ticks,r0-r1", ms, cm),
            ("date,time,encL,encR,d0,d1", "-,t_s,left_ticks,right_ticks,r0-r1", None, None),
            ("t,left,right,d0,d1,yaw", "t_s,left_ticks,right_ticks,r0-r1,-", None, None),
            (
                "seq,t_s,left_ticks,right_ticks,r0,r1",
                "-,t_s,left_ticks,right_ticks,r0-r1",
                Some(TimeUnit::Seconds),
                None,
            ),
            ("ts,leftTicks,rightTicks,HC-SR04_1,HC-SR04_2", "t_s,left_ticks,right_ticks,r0-r1", None, None),
            (
                "time_us,L_ticks,R_ticks,echo_us_0,echo_us_1",
                "t_s,left_ticks,right_ticks,r0-r1",
                us,
                Some(RangeUnit::Microseconds),
            ),
        ] {
            assert_eq!(of(header, 2), Ok((expected.to_owned(), time_unit, range_unit)), "{header}");
        }
        assert_eq!(of("time,left_ticks,right_ticks,distance_cm", 1).unwrap().2, cm);
    }

    #[test]
    fn what_was_assumed_is_said() {
        let said = |header: &str| guess(&header.split(',').map(str::to_owned).collect::<Vec<_>>(), 2).unwrap().said;
        assert_eq!(
            said("id,millis,encL,encR,d1_cm,d2_cm,battery"),
            "the header is taken as --columns -,t_s,left_ticks,right_ticks,r0-r1,- --time-unit ms --range-unit cm; not used: id, battery"
        );
        assert_eq!(said("t_s,left_ticks,right_ticks,r0,r1,yaw"), "the columns are found by their names; not used: yaw");
    }

    #[test]
    fn what_is_not_clear_is_refused_with_the_option_to_type() {
        for (header, problem) in [
            ("time,millis,encL,encR,d0,d1", "both `time` and `millis` may be the time"),
            ("time,encL,encR,d0,d1,s0,s1", "both `d0`, ... and `s0`, ... may be the ranges"),
            ("time,encL,encR,d0,d1,d2", "the header has 3 ranges (`d0` to `d2`), the configured ring has 2 sensors"),
        ] {
            assert!(of(header, 2).unwrap_err().starts_with(problem), "{header}: {:?}", of(header, 2));
        }
        for (header, option) in [
            ("time,enc1,enc2,d0,d1", "type --columns t_s,left_ticks,right_ticks,r0-r1"),
            ("zeit,links,rechts,a,b,akku", "type --columns t_s,left_ticks,right_ticks,r0-r1,-"),
            ("time,encL,encR,front,left", "type --columns t_s,left_ticks,right_ticks,r0-r1"),
            ("time,front,left,right", "it has 4 of the 5 columns that are needed"),
        ] {
            assert!(of(header, 2).unwrap_err().contains(option), "{header}: {:?}", of(header, 2));
        }
    }
}
