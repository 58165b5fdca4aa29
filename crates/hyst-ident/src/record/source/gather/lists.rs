//! Lists of texts with the names and units of the columns of a matrix.

/// A list of texts, with its name in the file.
#[derive(Clone, Debug)]
pub(crate) struct TextList {
    pub(crate) name: String,
    pub(crate) texts: Vec<String>,
}

/// Words in the names of lists of column names.
const NAMING: [&str; 10] = ["name", "label", "head", "col", "chan", "var", "signal", "title", "item", "field"];
/// Words in the names of lists of units.
const UNITS: [&str; 2] = ["unit", "einheit"];

/// Returns names and units of the columns of a matrix with `columns` columns.
///
/// A list fits if it has one text per column. If several lists could be the names, the name of the list decides.
pub(crate) fn of_matrix(lists: &[TextList], columns: usize) -> (Option<&[String]>, Option<&[String]>) {
    if columns < 2 {
        return (None, None);
    }
    let called = |list: &TextList, words: &[&str]| {
        let name = list.name.to_lowercase();
        words.iter().any(|word| name.contains(word))
    };
    let fitting = || lists.iter().filter(|list| list.texts.len() == columns);
    let units = fitting().find(|list| called(list, &UNITS));
    let mut other = fitting().filter(|list| !called(list, &UNITS));
    let named = fitting().find(|list| !called(list, &UNITS) && called(list, &NAMING));
    let only = other.next().filter(|_| other.next().is_none());
    (named.or(only).map(|list| list.texts.as_slice()), units.map(|list| list.texts.as_slice()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_matching_length_are_column_names() {
        let list = |name: &str, texts: &[&str]| TextList {
            name: name.into(),
            texts: texts.iter().map(ToString::to_string).collect(),
        };
        let lists = [
            list("remarks", &["p", "q"]),
            list("Labels", &["a", "b"]),
            list("units", &["s", "V"]),
            list("x", &["1", "2", "3"]),
        ];
        let (names, units) = of_matrix(&lists, 2);
        assert_eq!(
            (names.unwrap(), units.unwrap()),
            (&["a".to_owned(), "b".into()][..], &["s".to_owned(), "V".into()][..])
        );
        assert_eq!(of_matrix(&lists, 3).0.unwrap().len(), 3);
        assert_eq!(of_matrix(&lists[..1], 2).0.unwrap(), ["p", "q"]);
        assert!(of_matrix(&[list("p", &["a", "b"]), list("q", &["c", "d"])], 2).0.is_none());
    }
}
