//! Actuators of a fleet: the files of a folder, or those of a list.

use std::fs;
use std::path::Path;

use super::Entry;

/// Endings of files that are not records: files of hystctl, and files often stored with records.
const NOT_RECORDS: &[&str] = &["json", "toml", "html", "svg", "png", "md", "journal", "pdf", "py", "m", "tdms_index"];

/// Returns the actuators in a folder or in a list.
///
/// A folder is searched with its subfolders, in the order of the names, without hidden files. Files whose name starts
/// with that of `output` (the results) are left out.
///
/// A list is text with one path per line, or a CSV table with the column `file` and optionally `test`, `serial` and
/// `date`. Fields of a table may be quoted. Paths are relative to the folder of the list.
///
/// # Errors
/// A message with file and line when there is no record or a line is wrong.
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
            format!("{shown}: {error}; give a folder of records or a list (one path per line, or a CSV table with the column file)")
        })?;
        listed(&text, &path.display().to_string(), path.parent().unwrap_or(Path::new("")))?
    };
    if !path.is_dir() && !found.is_empty() && found.iter().all(|entry| !Path::new(&entry.file).exists()) {
        let first = &found[0].file;
        return Err(format!(
            "{shown}: none of the files in this list exists, for example {first}; give one path per line, or a CSV table \
             with the column file"
        ));
    }
    let mut seen = std::collections::BTreeSet::new();
    if let Some(twice) = found.iter().find(|entry| !seen.insert((&entry.file, &entry.test))) {
        return Err(format!("{shown}: {} is listed twice; give one line for each actuator", twice.file));
    }
    if found.is_empty() {
        return Err(format!("{shown}: no records; give a folder of records or a list of records"));
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
        // Links to folders are not followed: they may lead to a folder that is searched anyway.
        if each.file_type()?.is_dir() {
            walk(&path, found)?;
        } else if path.is_file() && !ending.ends_with('~') && !NOT_RECORDS.contains(&ending.as_str()) {
            found.push(Entry { file: path.display().to_string(), test: None, serial: None, date: None });
        }
    }
    Ok(())
}

/// Separators of tables.
const SEPARATORS: [u8; 3] = [b',', b';', b'\t'];

fn listed(text: &str, list: &str, folder: &Path) -> Result<Vec<Entry>, String> {
    let text = text.trim_start_matches('\u{feff}');
    let at = |cell: &str| folder.join(cell).display().to_string();
    let header = text.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or_default();
    let is_table = |separator: &u8| cells(header, *separator).iter().any(|name| name == "file");
    let Some(separator) = SEPARATORS.into_iter().find(|separator| is_table(separator)) else {
        let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
        return Ok(lines.map(|line| Entry { file: at(line), test: None, serial: None, date: None }).collect());
    };
    let mut found = Vec::new();
    let mut columns: Option<[Option<usize>; 4]> = None;
    for row in reader(text, separator).records() {
        let row = row.map_err(|error| format!("{list}: {error}"))?;
        if row.iter().all(str::is_empty) {
            continue;
        }
        let column = |name: &str| row.iter().position(|own| own == name);
        let Some([file, test, serial, date]) = columns else {
            columns = Some(["file", "test", "serial", "date"].map(column));
            continue;
        };
        let cell = |column: Option<usize>| {
            column.and_then(|k| row.get(k)).filter(|cell| !cell.is_empty()).map(ToOwned::to_owned)
        };
        let Some(path) = cell(file) else {
            let number = row.position().map_or(0, csv::Position::line);
            return Err(format!("{list}, line {number}: the column \"file\" is empty; give the path of a record"));
        };
        found.push(Entry {
            file: at(&path),
            test: cell(test).map(|path| at(&path)),
            serial: cell(serial),
            date: cell(date),
        });
    }
    Ok(found)
}

/// Returns a reader of a table: fields may be quoted, and rows may have fewer or more fields than the header.
fn reader(text: &str, separator: u8) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new()
        .delimiter(separator)
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes())
}

/// Returns the fields of a line.
fn cells(line: &str, separator: u8) -> Vec<String> {
    let first = reader(line, separator).records().next();
    first.and_then(Result::ok).map_or_else(Vec::new, |row| row.iter().map(ToOwned::to_owned).collect())
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
        let quoted = "\"serial\";\"file\"\n\"P-7; \"\"left\"\"\";\"c.csv\"\n\nP-8;b/a.csv;\n";
        for (separator, text) in [(';', quoted.to_owned()), (',', quoted.replace(';', ","))] {
            fs::write(&list, text).unwrap();
            let entries = of(&list, &at("r.parquet")).unwrap();
            assert_eq!(entries[0].serial, Some(format!("P-7{separator} \"left\"")));
            assert_eq!(files(entries), own(&["c.csv", "b/a.csv"]));
        }
        fs::write(&list, "file,serial\n\n\"c.csv\",\"two\nlines\"\n,P-9\n").unwrap();
        assert!(of(&list, &at("r.parquet")).unwrap_err().contains("list.txt, line 5"));
        for (text, why) in [("c.csv\nc.csv\n", "listed twice"), ("no.csv\nnone.csv\n", "none of the files")] {
            fs::write(&list, text).unwrap();
            assert!(of(&list, &at("r.parquet")).unwrap_err().contains(why));
        }
        fs::write(&list, "serial,file\nP-7,\n").unwrap();
        assert!(of(&list, &at("r.parquet")).unwrap_err().contains("list.txt, line 2"));
        assert!(of(&at("b").join("none"), &at("r.parquet")).unwrap_err().contains("give a folder"));
    }
}
