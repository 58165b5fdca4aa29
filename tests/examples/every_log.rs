//! Makes a log of every kind of run, for tests of other log readers:
//! `cargo run -p hyst-tests --example every_log -- FOLDER`.

use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args_os().nth(1).ok_or("give a folder for the logs")?);
    let logs = hyst_tests::logs::every_log(&folder);
    println!("{} logs in {}", logs.as_array().map_or(0, Vec::len), folder.display());
    Ok(())
}
