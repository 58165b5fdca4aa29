//! The index of a pandas table.

use super::Table;

/// The prefix of the pandas name of an index without a name. A number follows.
const NAMELESS: &str = "__index_level_";
/// The name of such a column here.
const INDEX: &str = "index";

/// Returns the index column of a pandas table, if the index has times.
///
/// `json` is the metadata that pandas adds. An index without a name is renamed to `index`. Integers without a unit are
/// row numbers, not times.
pub(super) fn index_of_times(table: &mut Table, json: &str) -> Option<usize> {
    let metadata: serde_json::Value = serde_json::from_str(json).ok()?;
    // An index of several levels is not a time. An index that counts the rows is described, not stored.
    let [name] = metadata.get("index_columns")?.as_array()?.as_slice() else { return None };
    let name = name.as_str()?;
    let column = table.heads.iter().position(|head| head.name == name)?;
    if name.starts_with(NAMELESS) && table.heads.iter().all(|head| head.name != INDEX) {
        INDEX.clone_into(&mut table.heads[column].name);
    }
    let whole = || table.values[column].iter().all(|value| value.fract() == 0.0);
    (table.heads[column].unit.is_some() || !whole()).then_some(column)
}

#[cfg(test)]
mod tests {
    use super::super::super::{Axis, Head};
    use super::super::apply_statements;
    use super::*;

    fn axis_of(index: &str, unit: Option<&str>, values: [f64; 2], json: &str) -> (Axis, String) {
        let mut table = Table::new("x");
        table.push(Head::new("u"), vec![1.0, 2.0]);
        table.push(Head { unit: unit.map(str::to_owned), ..Head::new(index) }, values.to_vec());
        apply_statements(&mut table, [("pandas", json)]);
        (table.heads[0].axis, table.heads[1].name.clone())
    }

    #[test]
    fn an_index_of_times_is_the_axis_of_the_other_columns() {
        let json = r#"{"index_columns": ["t"], "columns": []}"#;
        assert_eq!(axis_of("t", None, [0.0, 0.5], json), (Axis::Column(1), "t".to_owned()));
        assert_eq!(axis_of("t", Some("s"), [0.0, 1.0], json).0, Axis::Column(1));
        let nameless = r#"{"index_columns": ["__index_level_0__"]}"#;
        assert_eq!(axis_of("__index_level_0__", None, [0.0, 0.5], nameless), (Axis::Column(1), "index".to_owned()));
    }

    #[test]
    fn row_numbers_are_not_times() {
        assert_eq!(axis_of("n", None, [0.0, 1.0], r#"{"index_columns": ["n"]}"#).0, Axis::Unknown);
        for json in [
            r#"{"index_columns": [{"kind": "range"}]}"#,
            r#"{"index_columns": ["n", "u"]}"#,
            "{",
            "[]",
            r#"{"index_columns": ["q"]}"#,
        ] {
            assert_eq!(axis_of("n", None, [0.0, 0.5], json).0, Axis::Unknown, "{json}");
        }
    }
}
