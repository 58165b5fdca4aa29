//! Groups with the same columns and a number in their names, which are joined as segments of one record.

use std::collections::HashMap;

use super::{Clock, Column};

/// Largest integer up to which a double is exact.
const LARGEST: u64 = 1 << 53;

/// Splits a name into its stem and the number at its end: `run_12` is `run` and 12.
pub(crate) fn number_of(name: &str) -> Option<(&str, u64)> {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let number = name[stem.len()..].parse().ok().filter(|number| *number <= LARGEST)?;
    Some((stem.trim_end_matches(['_', '-', ' ', '.', '#']), number))
}

/// A group with its number, path and columns.
pub(crate) struct Part {
    pub(crate) number: u64,
    pub(crate) path: String,
    pub(crate) columns: Vec<Column>,
}

/// Joins groups with the same columns in the order of their numbers, and adds a column `segment` of these numbers.
///
/// # Errors
/// Returns the groups if their columns differ.
pub(crate) fn join(stem: &str, separator: char, mut parts: Vec<Part>) -> Result<Vec<Column>, Vec<Part>> {
    parts.sort_by_key(|part| part.number);
    let Some(rows) = parts.iter().map(rows_of).collect::<Option<Vec<usize>>>().filter(|_| are_alike(&parts)) else {
        return Err(parts);
    };
    // Only columns that have the rows of the signals in every group are joined. A matrix of gains, for example, has
    // other rows.
    let count = parts[0].columns.len();
    let joined: Vec<usize> = (0..count)
        .filter(|at| parts.iter().zip(&rows).all(|(part, rows)| part.columns[*at].values.len() == *rows))
        .collect();
    if joined.is_empty() {
        return Err(parts);
    }
    let clocks: Vec<Clock> = joined.iter().map(|at| common_clock(&parts, *at)).collect();
    let place = |parts: &[Part], path: &str| format!("{stem}{}", &path[parts[0].path.len()..]);
    let mut columns = Vec::with_capacity(joined.len() + 1);
    let numbers =
        parts.iter().zip(&rows).flat_map(|(part, rows)| std::iter::repeat_n(part.number as f64, *rows)).collect();
    let segment = Column::new(format!("{stem}{separator}segment"), numbers);
    columns.push(Column { owner: stem.to_owned(), label: Some("segment".to_owned()), ..segment });
    for (at, clock) in joined.into_iter().zip(clocks) {
        let mut values = Vec::with_capacity(rows.iter().sum());
        for part in &mut parts {
            values.append(&mut part.columns[at].values);
        }
        let first = &parts[0].columns[at];
        let owner = if first.owner.starts_with(&parts[0].path) { place(&parts, &first.owner) } else { stem.to_owned() };
        let (path, label, unit) = (place(&parts, &first.path), first.label.clone(), first.unit.clone());
        columns.push(Column { path, owner, label, unit, clock, identity: first.identity, values });
    }
    Ok(columns)
}

/// Returns the number of rows of most columns of a group; of two equally frequent numbers, the larger.
fn rows_of(part: &Part) -> Option<usize> {
    let mut count: HashMap<usize, usize> = HashMap::new();
    for column in &part.columns {
        *count.entry(column.values.len()).or_default() += 1;
    }
    count.into_iter().max_by_key(|(rows, columns)| (*columns, *rows)).map(|(rows, _)| rows)
}

/// Returns whether there are at least two groups, all with the same columns in the same order and different numbers.
fn are_alike(parts: &[Part]) -> bool {
    let alike = |part: &Part, one: &Column, first: &Column| {
        let place = |part: &Part, column: &Column| column.path.strip_prefix(part.path.as_str()).map(str::to_owned);
        let (own, other) = (place(part, one), place(&parts[0], first));
        own.is_some() && own == other && one.label == first.label && one.unit == first.unit
    };
    let like_first = |part: &Part| {
        part.columns.len() == parts[0].columns.len()
            && part.columns.iter().zip(&parts[0].columns).all(|(one, first)| alike(part, one, first))
    };
    parts.len() > 1 && parts.windows(2).all(|pair| pair[0].number != pair[1].number) && parts.iter().all(like_first)
}

/// Returns the clock that a column has in every group.
fn common_clock(parts: &[Part], at: usize) -> Clock {
    let target = |part: &Part| match part.columns[at].clock {
        Clock::Column(identity) => part.columns.iter().position(|column| column.identity == Some(identity)),
        _ => None,
    };
    let first = parts[0].columns[at].clock;
    let same = match first {
        Clock::Column(_) => target(&parts[0]).is_some() && parts.iter().all(|part| target(part) == target(&parts[0])),
        clock => parts.iter().all(|part| part.columns[at].clock == clock),
    };
    if same { first } else { Clock::Unknown }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(number: u64, rows: usize) -> Part {
        let path = format!("/run_{number}");
        let column = |name: &str, rows: usize| Column::new(format!("{path}/{name}"), vec![number as f64; rows]);
        let columns = vec![
            Column { identity: Some(number), ..column("t", rows) },
            Column { clock: Clock::Column(number), ..column("x", rows) },
            column("gain", 2),
        ];
        Part { number, path, columns }
    }

    #[test]
    fn numbers_at_the_end_of_names_are_split_off() {
        assert_eq!(number_of("run_12"), Some(("run", 12)));
        assert_eq!(number_of("007"), Some(("", 7)));
        assert_eq!(number_of("run"), None);
        assert_eq!(number_of("r99999999999999999999"), None);
    }

    #[test]
    fn groups_are_joined_in_numeric_order() {
        let columns = join("/run", '/', vec![part(10, 3), part(2, 4)]).map_err(|_| ()).unwrap();
        let names: Vec<&str> = columns.iter().map(|c| c.path.as_str()).collect();
        assert_eq!(names, ["/run/segment", "/run/t", "/run/x"]);
        assert_eq!(columns[0].values, [2.0, 2.0, 2.0, 2.0, 10.0, 10.0, 10.0]);
        assert_eq!(columns[2].clock, Clock::Column(2));
        assert_eq!(columns[1].identity, Some(2));
    }

    #[test]
    fn groups_with_different_columns_are_not_joined() {
        let mut other = part(3, 4);
        other.columns.pop();
        assert!(join("/run", '/', vec![part(1, 4), other]).is_err());
        assert!(join("/run", '/', vec![part(1, 4)]).is_err());
        assert!(join("/run", '/', vec![part(1, 4), part(1, 4)]).is_err());
    }
}
