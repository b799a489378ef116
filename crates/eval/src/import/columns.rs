//! What each column of a ring CSV holds.

use super::header::{self, Layout};
use super::table::Record;
use super::{ImportError, SourceLine};
use std::collections::BTreeSet;
use std::str::FromStr;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Time,
    /// The left or the right encoder, 0 or 1.
    Ticks(usize),
    /// A sensor's range.
    Range(usize),
    Ignored,
}

/// The option `--columns`: the columns in order, or some by their names in the header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Columns {
    /// `t_s,-,left_ticks,right_ticks,r0-r15`: what each column holds; `-` is a column to ignore.
    InOrder(Vec<String>),
    /// `t_s=time,r0=front`: our name and the header's; other columns have our names or are ignored.
    Named(Vec<(String, String)>),
}

impl Columns {
    /// The header's name of the column with the stamps.
    pub(super) fn first(&self) -> &str {
        let pairs = if let Self::Named(pairs) = self { pairs.as_slice() } else { &[] };
        pairs.iter().find(|(ours, _)| ours == T_S).map_or(T_S, |(_, theirs)| theirs)
    }

    /// True if the names of a header are not needed.
    pub(super) const fn is_in_order(&self) -> bool {
        matches!(self, Self::InOrder(_))
    }
}

/// The name of the column with the stamps.
pub(super) const T_S: &str = "t_s";

impl FromStr for Columns {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let columns = Self::parse(text)?;
        match &columns {
            Self::InOrder(names) => {
                let used = names.iter().filter(|name| role(name) != Ok(Role::Ignored));
                once(used.map(|name| name.to_ascii_lowercase()))?;
            }
            Self::Named(pairs) => {
                once(pairs.iter().map(|(ours, _)| ours.to_ascii_lowercase()))?;
                once(pairs.iter().map(|(_, theirs)| theirs.clone()))?;
            }
        }
        Ok(columns)
    }
}

/// Refuses a name that comes twice.
fn once(names: impl Iterator<Item = String>) -> Result<(), String> {
    let mut seen = BTreeSet::new();
    for name in names {
        if seen.contains(&name) {
            return Err(format!("the column \"{name}\" is named twice"));
        }
        seen.insert(name);
    }
    Ok(())
}

impl Columns {
    fn parse(text: &str) -> Result<Self, String> {
        let items = || text.split(',').map(str::trim);
        if items().any(|item| item.contains('=')) {
            let mut pairs = Vec::new();
            for item in items() {
                let (ours, theirs) =
                    item.split_once('=').map_or((item, item), |(ours, theirs)| (ours.trim(), theirs.trim()));
                match (series(ours), numbered(theirs)) {
                    (Some(sensors), Some((name, first, last))) if last - first == sensors.len() - 1 => {
                        let theirs = (first..=last).map(|number| format!("{name}{number}"));
                        pairs.extend(sensors.into_iter().zip(theirs));
                    }
                    (Some(sensors), _) => {
                        let count = sensors.len();
                        return Err(format!(
                            "\"{item}\": {count} columns are named as in r0-r{}=front0-front{}",
                            count - 1,
                            count - 1
                        ));
                    }
                    (None, _) => {
                        role(ours)?;
                        pairs.push((ours.to_owned(), theirs.to_owned()));
                    }
                }
            }
            return Ok(Self::Named(pairs));
        }
        let mut names = Vec::new();
        for item in items() {
            if let Some(sensors) = series(item) {
                names.extend(sensors);
            } else {
                role(item)?;
                names.push(item.to_owned());
            }
        }
        Ok(Self::InOrder(names))
    }
}

/// The names that `r0-r15` stands for.
fn series(item: &str) -> Option<Vec<String>> {
    let (first, last) = item.split_once('-')?;
    match (role(first.trim()), role(last.trim())) {
        (Ok(Role::Range(first)), Ok(Role::Range(last))) if first <= last => {
            Some((first..=last).map(|sensor| format!("r{sensor}")).collect())
        }
        _ => None,
    }
}

/// The name, the first and the last number of `front0-front15`.
fn numbered(item: &str) -> Option<(&str, usize, usize)> {
    let (first, last) = item.split_once('-')?;
    let (first, last) = (first.trim(), last.trim());
    let name = first.trim_end_matches(|character: char| character.is_ascii_digit());
    let number = |item: &str| item.strip_prefix(name)?.parse::<usize>().ok().filter(|number| *number < 10_000);
    let (first, last) = (number(first)?, number(last)?);
    (first <= last).then_some((name, first, last))
}

/// More sensors than any ring has.
const MAX_SENSORS: usize = 256;
/// The header of a ring CSV up to the ranges.
const LEADING: [&str; 3] = [T_S, "left_ticks", "right_ticks"];

fn role(name: &str) -> Result<Role, String> {
    let sensor = || name.strip_prefix(['r', 'R'])?.parse().ok().filter(|sensor| *sensor < MAX_SENSORS);
    match name.to_ascii_lowercase().as_str() {
        "t_s" => Ok(Role::Time),
        "left_ticks" => Ok(Role::Ticks(0)),
        "right_ticks" => Ok(Role::Ticks(1)),
        "-" | "" => Ok(Role::Ignored),
        _ => sensor().map(Role::Range).ok_or_else(|| {
            format!("\"{name}\" is no column: there are t_s, left_ticks, right_ticks, r0, r1, ..., r0-r15, and - to ignore one")
        }),
    }
}

/// What the columns hold, by the header alone or with `--columns`.
///
/// # Errors
/// Where the header is not the ring CSV's, or a column is missing.
pub(super) fn roles(
    columns: Option<&Columns>,
    header: Option<&Record>,
    file: &str,
    sensors: usize,
) -> Result<Layout, ImportError> {
    let names: Vec<String> = header.map(|header| header.fields.clone()).unwrap_or_default();
    let line = SourceLine { file, number: header.map_or(1, |header| header.line) };
    let known = |name: &str| role(name).unwrap_or(Role::Ignored);
    let roles: Vec<Role> = match columns {
        None => return of_header(line, &names, sensors),
        Some(Columns::InOrder(names)) => names.iter().map(|name| known(name)).collect(),
        Some(Columns::Named(pairs)) => {
            if let Some((_, theirs)) = pairs.iter().find(|(_, theirs)| !names.iter().any(|name| name == theirs)) {
                let problem =
                    format!("line {}: the header has no column `{theirs}`: it has {}", line.number, names.join(", "));
                return Err(ImportError::Problem { file: file.into(), problem });
            }
            let ours = |name: &String| pairs.iter().find(|(_, theirs)| theirs == name).map(|(ours, _)| ours.as_str());
            names.iter().map(|name| known(ours(name).unwrap_or(name))).collect()
        }
    };
    let is_there = |role| roles.contains(&role);
    let missing = std::iter::once((Role::Time, "t_s".to_owned()))
        .chain((0..sensors).map(|sensor| (Role::Range(sensor), format!("r{sensor}"))))
        .find(|(role, _)| !is_there(*role));
    let unknown = roles.iter().find(|role| matches!(role, Role::Range(sensor) if *sensor >= sensors));
    match (missing, unknown) {
        (Some((_, name)), _) => Err(ImportError::Problem {
            file: file.into(),
            problem: format!("no column is {name}: the ring has {sensors} sensors; name the columns with --columns"),
        }),
        (None, Some(_)) => Err(ImportError::Problem {
            file: file.into(),
            problem: format!(
                "--columns names more than r{}: the ring has {sensors} sensors",
                sensors.saturating_sub(1)
            ),
        }),
        (None, None) => Ok(Layout { roles, ..Layout::default() }),
    }
}

/// The columns of the header that a ring CSV has, or of one with usual names.
fn of_header(line: SourceLine<'_>, names: &[String], sensors: usize) -> Result<Layout, ImportError> {
    let wanted = LEADING.iter().map(ToString::to_string).chain((0..sensors).map(|sensor| format!("r{sensor}")));
    let mut roles = Vec::with_capacity(LEADING.len() + sensors);
    // A header of fewer or more sensors than the ring has is that of another robot.
    let count = names
        .iter()
        .skip(LEADING.len())
        .enumerate()
        .take_while(|(sensor, name)| name.eq_ignore_ascii_case(&format!("r{sensor}")));
    let count = count.count();
    let is_leading = LEADING.iter().zip(names).all(|(ours, theirs)| theirs.eq_ignore_ascii_case(ours));
    if is_leading && count > 0 && count != sensors && names.iter().skip(LEADING.len() + count).all(String::is_empty) {
        let problem = format!(
            "line {}: the header has {count} sensors (r0 to r{}), the configured ring has {sensors}: name this robot's configuration with \
             --config, or the columns with --columns",
            line.number,
            count - 1
        );
        return Err(ImportError::Problem { file: line.file.into(), problem });
    }
    let other = wanted.enumerate().find_map(|(column, name)| {
        let field = names.get(column).map(String::as_str).unwrap_or_default();
        if field.eq_ignore_ascii_case(&name) {
            roles.push(role(&name).unwrap_or(Role::Ignored));
            return None;
        }
        Some((column, field, name))
    });
    let is_more = names.iter().skip(roles.len()).any(|name| !name.is_empty());
    if other.is_none() && !is_more {
        return Ok(Layout { roles, ..Layout::default() });
    }
    header::guess(names, sensors).map_err(|hint| {
        let hint = if is_headless(names) { headless(names, sensors) } else { hint };
        let (column, field, expected) = other.unwrap_or_else(|| {
            (roles.len(), names.get(roles.len()).map_or("", String::as_str), "the end of the line".into())
        });
        let header = "t_s,left_ticks,right_ticks,r0,r1,...";
        line.error(field, column, &format!("`{expected}` (the header of {sensors} sensors: {header}): {hint}"))
    })
}

/// True if most fields of a first line are numbers.
fn is_headless(names: &[String]) -> bool {
    2 * names.iter().filter(|name| name.parse::<f64>().is_ok()).count() > names.len()
}

fn headless(names: &[String], sensors: usize) -> String {
    format!("the file has no header; {}", header::headless(names, sensors))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(spec: Option<&str>, header: Option<&str>, sensors: usize) -> Result<Vec<Role>, String> {
        let columns = spec.map(|spec| spec.parse::<Columns>()).transpose()?;
        let header = header.map(|header| Record::new(1, header.split(',').map(str::to_owned).collect()));
        roles(columns.as_ref(), header.as_ref(), "a.csv", sensors)
            .map(|layout| layout.roles)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn columns_are_named_by_the_header_or_by_the_user() {
        use Role::{Ignored, Range, Ticks, Time};
        let plain = Ok(vec![Time, Ticks(0), Ticks(1), Range(0), Range(1)]);
        assert_eq!(of(None, Some("t_s,left_ticks,right_ticks,r0,r1"), 2), plain);
        assert_eq!(of(None, Some("T_S,Left_Ticks,RIGHT_ticks,R0,r1"), 2), plain);
        assert_eq!(of(Some("t_s,left_ticks,right_ticks,r0-r1"), None, 2), plain);
        assert_eq!(
            of(Some("t_s=time,r0=front"), Some("front,x,r1,time"), 2),
            Ok(vec![Range(0), Ignored, Range(1), Time])
        );
        assert_eq!(
            of(None, Some("t_s,left_ticks,right_ticks,r0,x"), 1),
            Ok(vec![Time, Ticks(0), Ticks(1), Range(0), Ignored])
        );
        assert_eq!(of(Some("-,r0,t_s"), None, 1), Ok(vec![Ignored, Range(0), Time]));
        assert_eq!(
            of(Some("t_s=time,r0-r1=sonar9-sonar10"), Some("sonar10,sonar9,time"), 2),
            Ok(vec![Range(1), Range(0), Time])
        );
        let error = of(Some("t_s=time,r0-r2=sonar1-sonar2"), None, 3).unwrap_err();
        assert!(error.contains("3 columns are named as in r0-r2=front0-front2"), "{error}");
    }

    #[test]
    fn what_is_wrong_with_columns_is_named() {
        let error = |spec, header, sensors| of(spec, header, sensors).unwrap_err();
        assert!(error(None, Some("time,left_ticks"), 2).contains("line 1, column 1: `time`: expected `t_s`"));
        assert!(
            error(None, Some("t_s,left_ticks,right_ticks,r0,r1"), 1).contains("the header has 2 sensors (r0 to r1)")
        );
        let error_of_two = error(None, Some("t_s,left_ticks,right_ticks,r0,r0"), 1);
        assert!(error_of_two.contains("column 5: `r0`: expected `the end of the line`"), "{error_of_two}");
        let headless = error(None, Some("0.1,0,0,1.2,1.3"), 2);
        assert!(
            headless.contains(
                "no header; if its columns are in this order, type --columns t_s,left_ticks,right_ticks,r0-r1"
            )
        );
        assert!(error(Some("t_s,r0,banana"), None, 1).contains("\"banana\" is no column"));
        let headless = error(None, Some("DATA,0.1,0,0,1.2,inf,x"), 2);
        assert!(headless.ends_with("type --columns -,t_s,left_ticks,right_ticks,r0-r1,-"), "{headless}");
        for (twice, name) in
            [("t_s,r0,r1,r0", "r0"), ("t_s,r0-r2,r1", "r1"), ("t_s=a,T_S=b,r0=c", "t_s"), ("t_s=a,r0=a", "a")]
        {
            assert!(error(Some(twice), None, 2).contains(&format!("the column \"{name}\" is named twice")));
        }
        assert!(of(Some("-,t_s,-,r0"), None, 1).is_ok());
        assert!(error(Some("t_s=zeit"), Some("time,r0"), 1).contains("the header has no column `zeit`"));
        assert!(error(Some("t_s,r0"), None, 2).contains("no column is r1"));
        assert!(error(Some("t_s,r0-r3"), None, 2).contains("more than r1"));
    }
}
