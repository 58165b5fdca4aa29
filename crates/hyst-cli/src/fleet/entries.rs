//! Which actuators a fleet has: the files of a folder, or those that a list names.

use std::fs;
use std::path::Path;

use super::Entry;

/// Endings of files that are no records: what this program writes, and what lies beside records.
const NOT_RECORDS: &[&str] = &["json", "toml", "html", "svg", "png", "md", "journal", "pdf", "py", "m", "tdms_index"];

/// The files in a folder and the folders in it, in the order of their names, without hidden ones; or the lines of a list.
///
/// `output` is where the results go: it, and what lies beside it under its name, is no record.
///
/// A list is text with a path in each line, or a table (`,`) whose header names `file` and, of `test`, `serial` and `date`, what it has. Paths are
/// relative to the list's folder.
///
/// # Errors
/// In words, with file and line, where there is nothing or a line is wrong.
pub fn of(path: &Path, output: &Path) -> Result<Vec<Entry>, String> {
    let shown = path.display();
    let found = if path.is_dir() {
        let mut found = Vec::new();
        walk(path, &mut found).map_err(|error| format!("{shown}: {error}"))?;
        let own = output.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let is_own = |entry: &Entry| {
            Path::new(&entry.file).file_name().is_some_and(|name| name.to_string_lossy().starts_with(&own))
        };
        found.retain(|entry| !is_own(entry));
        found
    } else {
        let text = fs::read_to_string(path).map_err(|error| {
            format!("{shown}: {error}; give a folder of records, or a list of them (a path in each line, or a table with the column file)")
        })?;
        listed(&text, &path.display().to_string(), path.parent().unwrap_or(Path::new("")))?
    };
    if !path.is_dir() && !found.is_empty() && found.iter().all(|entry| !Path::new(&entry.file).exists()) {
        let first = &found[0].file;
        return Err(format!(
            "{shown}: none of the files in this list exists, as {first}; give a path in each line, or a CSV table with the column file"
        ));
    }
    let mut seen = std::collections::BTreeSet::new();
    if let Some(twice) = found.iter().find(|entry| !seen.insert((&entry.file, &entry.test))) {
        return Err(format!("{shown}: {} is named twice; an actuator has one line", twice.file));
    }
    if found.is_empty() {
        return Err(format!("{shown}: no records; give a folder of records or a list of them"));
    }
    Ok(found)
}

fn walk(folder: &Path, found: &mut Vec<Entry>) -> std::io::Result<()> {
    let mut all: Vec<_> = fs::read_dir(folder)?.collect::<Result<_, _>>()?;
    all.sort_by_key(fs::DirEntry::file_name);
    for each in all {
        let path = each.path();
        let hidden = each.file_name().to_string_lossy().starts_with('.');
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        if hidden {
            continue;
        }
        // A link to a folder may lead to one that is walked already.
        if each.file_type()?.is_dir() {
            walk(&path, found)?;
        } else if path.is_file() && !ending.ends_with('~') && !NOT_RECORDS.contains(&ending.as_str()) {
            found.push(Entry { file: path.display().to_string(), test: None, serial: None, date: None });
        }
    }
    Ok(())
}

fn listed(text: &str, list: &str, folder: &Path) -> Result<Vec<Entry>, String> {
    let mut lines =
        (1..).zip(text.trim_start_matches('\u{feff}').lines().map(str::trim)).filter(|(_, line)| !line.is_empty());
    let Some((_, first)) = lines.clone().next() else { return Ok(Vec::new()) };
    let names: Vec<&str> = first.split(',').map(str::trim).collect();
    let at = |cell: &str| folder.join(cell).display().to_string();
    let Some(file) = names.iter().position(|name| *name == "file") else {
        return Ok(lines.map(|(_, line)| Entry { file: at(line), test: None, serial: None, date: None }).collect());
    };
    lines.next();
    let column = |name: &str| names.iter().position(|own| *own == name);
    let (test, serial, date) = (column("test"), column("serial"), column("date"));
    lines
        .map(|(number, line)| {
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            let cell = |column: Option<usize>| {
                column.and_then(|k| cells.get(k)).filter(|cell| !cell.is_empty()).map(|cell| (*cell).to_owned())
            };
            let Some(path) = cell(Some(file)) else {
                return Err(format!("{list}, line {number}: no path in the column file"));
            };
            Ok(Entry {
                file: at(&path),
                test: cell(test).map(|path| at(&path)),
                serial: cell(serial),
                date: cell(date),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_and_lists_name_the_same_files() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("b")).unwrap();
        for name in ["c.csv", "b/a.csv", ".hidden", "model.json", "r.parquet", "r.parquet.journal"] {
            fs::write(at(name), "x").unwrap();
        }
        let own = |names: &[&str]| names.iter().map(|name| at(name).display().to_string()).collect::<Vec<_>>();
        let files = |entries: Vec<Entry>| entries.into_iter().map(|entry| entry.file).collect::<Vec<_>>();
        assert_eq!(files(of(folder.path(), &at("r.parquet")).unwrap()), own(&["b/a.csv", "c.csv"]));
        let list = at("list.txt");
        fs::write(&list, "c.csv\n\nb/a.csv\n").unwrap();
        assert_eq!(files(of(&list, &at("r.parquet")).unwrap()), own(&["c.csv", "b/a.csv"]));
        fs::write(&list, "serial, file, test, date\nP-7, c.csv,, 2026-05-02\nP-8, b/a.csv, c.csv\n").unwrap();
        let entries = of(&list, &at("r.parquet")).unwrap();
        assert_eq!(entries[0].serial.as_deref(), Some("P-7"));
        assert_eq!((entries[0].test.as_ref(), entries[0].date.as_deref()), (None, Some("2026-05-02")));
        assert_eq!(entries[1].test, Some(own(&["c.csv"]).remove(0)));
        for (text, why) in [("c.csv\nc.csv\n", "named twice"), ("no.csv\nnone.csv\n", "none of the files")] {
            fs::write(&list, text).unwrap();
            assert!(of(&list, &at("r.parquet")).unwrap_err().contains(why));
        }
        fs::write(&list, "serial,file\nP-7,\n").unwrap();
        assert!(of(&list, &at("r.parquet")).unwrap_err().contains("list.txt, line 2"));
        assert!(of(&at("b").join("none"), &at("r.parquet")).unwrap_err().contains("give a folder"));
    }
}
