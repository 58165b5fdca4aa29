//! Links single functions of the bare library: measures their size, and checks that they cannot panic.

use super::toolchain::Toolchain;
use std::fs;
use std::path::Path;

/// Function that the panic handler of `tests/firmware/bare` calls, and that does not exist.
const PANIC_SYMBOL: &str = "this_can_panic";

/// Returns the functions of the library, such as `step.CASE.f32`, from the index of the archive.
pub(crate) fn functions(library: &Path) -> Result<Vec<String>, String> {
    let bytes = fs::read(library).map_err(|error| format!("{}: {error}", library.display()))?;
    let index = || {
        let header = bytes.strip_prefix(b"!<arch>\n")?.get(..60)?;
        let size: usize = std::str::from_utf8(header.get(48..58)?).ok()?.trim().parse().ok()?;
        let index = bytes.get(68..)?.get(..size).filter(|_| header.starts_with(b"/ "))?;
        // The count and one offset per name, big-endian, then the names.
        let count = u32::from_be_bytes(index.get(..4)?.try_into().ok()?) as usize;
        index.get(4 + 4 * count..)
    };
    let names = index().ok_or_else(|| format!("{} has no index", library.display()))?;
    let names = names.split(|b| *b == 0).filter_map(|name| std::str::from_utf8(name).ok());
    let mut ours: Vec<String> = names
        .filter(|name| ["build.", "reset.", "step."].iter().any(|start| name.starts_with(start)))
        .map(str::to_owned)
        .collect();
    ours.sort();
    Ok(ours)
}

/// Returns the functions that can panic; any other linker error is an error.
pub(crate) fn can_panic(toolchain: &Toolchain, library: &Path, functions: &[String]) -> Result<Vec<String>, String> {
    let mut found = Vec::new();
    let all: Vec<&str> = functions.iter().map(String::as_str).collect();
    match link(toolchain, library, &all) {
        Ok(_) => return Ok(found),
        Err(error) if !error.contains(PANIC_SYMBOL) => return Err(error),
        Err(_) => {}
    }
    for function in functions {
        match link(toolchain, library, &[function]) {
            Ok(_) => {}
            Err(error) if error.contains(PANIC_SYMBOL) => found.push(function.clone()),
            Err(error) => return Err(error),
        }
    }
    Ok(found)
}

/// Returns the flash size of functions, including all functions that they call (bytes).
pub(crate) fn flash(toolchain: &Toolchain, library: &Path, functions: &[&str]) -> Result<u32, String> {
    let image = link(toolchain, library, functions)?;
    let (flash, ram) = sections(&image).ok_or("the linker wrote no ELF file")?;
    // The caller stores coefficients and state, so a model has no static data.
    if ram == 0 { Ok(flash) } else { Err(format!("{} has {ram} bytes of static data", functions.join(", "))) }
}

fn link(toolchain: &Toolchain, library: &Path, functions: &[&str]) -> Result<Vec<u8>, String> {
    let image = library.with_extension("elf");
    let mut command = toolchain.linker();
    command.args(["--gc-sections", "-o"]).arg(&image);
    for (k, function) in functions.iter().enumerate() {
        command.args([if k == 0 { "-e" } else { "-u" }, function]);
    }
    let output = command.arg(library).output().map_err(|error| format!("the linker could not be started: {error}"))?;
    if output.status.success() {
        fs::read(&image).map_err(|error| format!("{}: {error}", image.display()))
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned())
    }
}

/// Returns the bytes of a 32-bit ELF file in flash and in RAM.
fn sections(elf: &[u8]) -> Option<(u32, u32)> {
    const ALLOCATED: u32 = 2;
    const WRITABLE: u32 = 1;
    let half = |at: usize| Some(u16::from_le_bytes(elf.get(at..at + 2)?.try_into().ok()?) as usize);
    let word = |at: usize| Some(u32::from_le_bytes(elf.get(at..at + 4)?.try_into().ok()?));
    let (table, entry, count) = (word(0x20)? as usize, half(0x2e)?, half(0x30)?);
    let (mut flash, mut ram) = (0, 0);
    for k in 0..count {
        let section = table + k * entry;
        let (flags, size) = (word(section + 8)?, word(section + 20)?);
        if flags & ALLOCATED != 0 {
            *if flags & WRITABLE == 0 { &mut flash } else { &mut ram } += size;
        }
    }
    Some((flash, ram))
}
