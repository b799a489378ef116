//! Columns of encoders that hold no counts: nothing at all, or the way of a wheel in metres, turns or radians.

use super::ImportError;
use super::columns::Role;
use super::counts::{Cells, Counting};
use super::table::Table;

/// What is known of the robot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wheels {
    pub(super) metres_per_tick: f64,
    pub(super) ticks_per_turn: f64,
}

/// Cells with fractions, of all, from which on a column does not hold counts.
const MIN_FRACTIONS: f64 = 0.3;
/// Both wheels together would have rolled less in a whole recording, metres.
const HARDLY_M: f64 = 0.2;
/// Less growth than this is the trembling of a robot that stands, in whatever unit.
const MIN_GROWTH: f64 = 0.2;
/// Counts by which the other wheel rolls before one that stands is asked about.
const MIN_ROLLED: f64 = 200.0;

/// What is doubtful of the encoders' cells.
///
/// # Errors
/// Where the cells are so small that they are of another unit. `counting` is what the user says.
pub(super) fn check(
    table: &Table<'_>,
    roles: &[Role],
    cells: &[Cells],
    (wheels, counting): (Wheels, Option<Counting>),
    file: &str,
) -> Result<Vec<String>, ImportError> {
    let error = |problem: String| Err(ImportError::Problem { file: file.into(), problem });
    let name = |wheel: usize| {
        let column = roles.iter().position(|role| *role == Role::Ticks(wheel))?;
        let name = table.header.as_ref().and_then(|header| header.fields.get(column));
        Some((
            column + 1,
            name.map_or_else(|| ["left_ticks", "right_ticks"].get(wheel).copied().unwrap_or("").into(), Clone::clone),
        ))
    };
    let known = |wheel: usize| -> Vec<f64> { cells.iter().filter_map(|cells| *cells.ticks.get(wheel)?).collect() };
    let [left, right] = [0, 1].map(known);
    let empty: Vec<(usize, (usize, String))> = [(0, &left), (1, &right)]
        .into_iter()
        .filter_map(|(wheel, counts)| Some((wheel, name(wheel).filter(|_| counts.is_empty())?)))
        .collect();
    let mut doubts = Vec::new();
    doubts.extend(without_counts(&empty, roles, cells.len()));
    let growth = |counts: &[f64]| -> f64 {
        counts.windows(2).filter_map(|pair| Some((pair.last()? - pair.first()?).abs())).sum()
    };
    let total: f64 = growth(&left) + growth(&right);
    let fractions = left.iter().chain(&right).filter(|count| count.fract() != 0.0).count();
    let all = left.len() + right.len();
    let is_told = counting.is_some();
    if fractions as f64 >= MIN_FRACTIONS * all as f64 && fractions > 0 && !is_told {
        let example = left.iter().chain(&right).find(|count| count.fract() != 0.0).copied().unwrap_or_default();
        let as_counts_m = 0.5 * total * wheels.metres_per_tick;
        if as_counts_m < HARDLY_M && total >= MIN_GROWTH {
            return error(format!(
                "the encoders' columns have fractions such as {example} and grow by {:.1} in all: as counts the wheels would have rolled {:.0} mm; \
                 are they metres, turns, radians or degrees of the wheels? --ticks metres, turns, radians or degrees (speeds must be summed up first); if they are counts: --ticks counts or deltas",
                0.5 * total,
                1e3 * as_counts_m
            ));
        }
        doubts.push(format!(
            "the encoders' columns have fractions such as {example}, taken as counts of which {} are a turn; if they are millimetres or degrees of \
             the wheels: --ticks millimetres or degrees",
            wheels.ticks_per_turn
        ));
    }
    for (wheel, (counts, other)) in [(&left, &right), (&right, &left)].into_iter().enumerate() {
        if let Some((column, name)) = name(wheel)
            && counts.len() > 1
            && growth(counts) == 0.0
            && growth(other) >= MIN_ROLLED
        {
            let count = counts.first().copied().unwrap_or_default();
            doubts.push(format!(
                "column {column}, `{name}`, is {count} in all rows while the other wheel rolls: is that encoder connected and exported?"
            ));
        }
    }
    Ok(doubts)
}

/// What is doubtful where wheels have a column without any count: each wheel with the number and the name of its column.
fn without_counts(empty: &[(usize, (usize, String))], roles: &[Role], rows: usize) -> Option<String> {
    if empty.is_empty() || rows < 2 {
        return None;
    }
    let columns: Vec<String> = empty.iter().map(|(_, (column, name))| format!("column {column}, `{name}`")).collect();
    let (columns, is_one) = (columns.join(" and "), empty.len() == 1);
    let roles = empty.iter().fold(roles.to_vec(), |roles, (wheel, _)| without(&roles, *wheel));
    let left_out = format!("--columns {}", super::header::list(&roles));
    Some(if is_one {
        format!(
            "{columns} is empty in all {rows} rows, taken as an encoder that never counts: export the counts; if the robot has no such \
             encoder, leave the column out: {left_out}"
        )
    } else {
        format!(
            "{columns} are empty in all {rows} rows, taken as a robot without encoders, which has no poses: export the counts; if it has \
             none, leave the columns out: {left_out}"
        )
    })
}

/// The columns without those of an encoder.
fn without(roles: &[Role], wheel: usize) -> Vec<Role> {
    roles.iter().map(|role| if *role == Role::Ticks(wheel) { Role::Ignored } else { *role }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "t_s,left_ticks,right_ticks,r0\n";
    const ROLES: [Role; 4] = [Role::Time, Role::Ticks(0), Role::Ticks(1), Role::Range(0)];

    /// The verdict on counts that grow by so much in each of 200 rows; 1440 are a turn of 0.22 m.
    fn checked(left: Option<f64>, right: Option<f64>, counting: Option<Counting>) -> Result<Vec<String>, String> {
        let cell =
            |k: u32| Cells { t_s: 0.1 * f64::from(k), ticks: [left, right].map(|step| Some(step? * f64::from(k))) };
        let cells: Vec<Cells> = (0..200).map(cell).collect();
        let table = Table::read(TEXT, "t_s", false);
        let wheels = Wheels { metres_per_tick: 1.527e-4, ticks_per_turn: 1440.0 };
        check(&table, &ROLES, &cells, (wheels, counting), "a.csv").map_err(|error| error.to_string())
    }

    #[test]
    fn counts_are_taken_in_silence() {
        assert_eq!(checked(Some(150.0), Some(148.0), None), Ok(vec![]));
        assert_eq!(checked(Some(0.0), Some(0.0), None), Ok(vec![]), "a robot that stands");
        assert_eq!(checked(Some(1.0), Some(1.0), None), Ok(vec![]), "a slow one");
    }

    #[test]
    fn metres_turns_and_radians_are_refused() {
        for step in [0.023, 0.1, 0.66] {
            let text = checked(Some(step), Some(step), None).unwrap_err();
            assert!(text.contains(&format!("have fractions such as {step} and grow by")), "{text}");
            assert!(
                text.contains("are they metres, turns, radians or degrees of the wheels? --ticks metres, turns,"),
                "{text}"
            );
            assert_eq!(checked(Some(step), Some(step), Some(Counting::Metres)), Ok(vec![]));
            assert_eq!(checked(Some(step), Some(step), Some(Counting::Counts)), Ok(vec![]));
        }
        let text = &checked(Some(23.4), Some(23.4), None).unwrap()[0];
        assert!(text.contains("have fractions such as 23.4, taken as counts of which 1440 are a turn"), "{text}");
    }

    #[test]
    fn columns_without_a_count_are_named() {
        assert_eq!(
            checked(None, Some(150.0), None).unwrap(),
            [
                "column 2, `left_ticks` is empty in all 200 rows, taken as an encoder that never counts: export the counts; if the robot has no such \
              encoder, leave the column out: --columns t_s,-,right_ticks,r0"
            ]
        );
        let both = checked(None, None, None).unwrap().remove(0);
        assert!(
            both.contains("column 2, `left_ticks` and column 3, `right_ticks` are empty in all 200 rows"),
            "{both}"
        );
        assert!(both.ends_with("--columns t_s,-,-,r0"), "{both}");
        let text = &checked(Some(150.0), Some(0.0), None).unwrap()[0];
        assert!(text.starts_with("column 3, `right_ticks`, is 0 in all rows while the other wheel rolls"), "{text}");
    }
}
