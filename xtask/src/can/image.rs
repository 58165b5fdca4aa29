//! The root file system of the machine: programs, libraries, kernel modules and the init script.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::packages::Packages;
use super::programs::{PASSED, TESTS};
use crate::command::{output, passes_quietly};

/// Kernel modules, in the order in which they are loaded.
const MODULES: &[&str] = &[
    "drivers/net/can/dev/can-dev.ko",
    "drivers/net/can/vcan.ko",
    "drivers/net/can/slcan/slcan.ko",
    "net/can/can.ko",
    "net/can/can-raw.ko",
    "net/can/can-isotp.ko",
];
const UTILS: &[&str] = &["candump", "cansend", "slcand"];

/// Returns the init script. The tests expect `hystctl` two folders above themselves.
fn init() -> String {
    let mut script = String::from(
        "#!/bin/busybox sh
/bin/busybox --install -s /bin
export PATH=/bin RUST_BACKTRACE=1
mount -t proc proc /proc
mount -t sysfs sysfs /sys
mount -t devtmpfs devtmpfs /dev
mkdir -p /dev/pts /tmp
mount -t devpts devpts /dev/pts
ip link set lo up
",
    );
    for module in MODULES.iter().filter_map(|module| module.rsplit('/').next()) {
        script.push_str(&format!("insmod /modules/{module}\n"));
    }
    for (_, test) in TESTS {
        script.push_str(&format!(
            "echo 'hyst-can: starts {test}'\n/debug/deps/{test} --ignored --nocapture --test-threads=1 2>&1 && echo '{PASSED}{test}'\n"
        ));
    }
    script.push_str("poweroff -f\n");
    script
}

/// Writes the image and returns its path.
pub(crate) fn build(
    packages: &Packages,
    tests: &[(&str, PathBuf)],
    hystctl: &Path,
    folder: &Path,
) -> Result<PathBuf, String> {
    let root = folder.join("machine");
    // Remove the files of an earlier build.
    let _ = fs::remove_dir_all(&root);
    let mut files: Vec<(PathBuf, String)> =
        vec![(packages.busybox.clone(), "bin/busybox".to_owned()), (hystctl.to_owned(), "debug/hystctl".to_owned())];
    files.extend(tests.iter().map(|(name, program)| (program.clone(), format!("debug/deps/{name}"))));
    files.extend(UTILS.iter().map(|name| (packages.utils.join(name), format!("bin/{name}"))));
    for module in MODULES {
        let name = module.rsplit('/').next().unwrap_or(module);
        files.push((packages.modules.join(module), format!("modules/{name}")));
    }
    let mut libraries = BTreeSet::new();
    for (program, to) in &files {
        if !to.starts_with("modules/") && !to.ends_with("busybox") {
            libraries.extend(loaded(program)?);
        }
    }
    files.extend(libraries.into_iter().map(|library| (PathBuf::from(&library), library[1..].to_owned())));
    for (from, to) in &files {
        copy(from, &root.join(to), to.starts_with("debug/")).map_err(|error| format!("{}: {error}", from.display()))?;
    }
    let image = folder.join("machine.cpio");
    finish(&root, &packages.busybox, &image).map_err(|error| format!("{}: {error}", image.display()))?;
    Ok(image)
}

/// Returns the paths of the libraries that are loaded with a program.
fn loaded(program: &Path) -> Result<Vec<String>, String> {
    let text = output(Command::new("ldd").arg(program));
    let text = text.ok_or_else(|| format!("ldd failed for {}", program.display()))?;
    // "libc.so.6 => /lib/x86_64-linux-gnu/libc.so.6 (0x00007f…)", "/lib64/ld-linux-x86-64.so.2 (0x00007f…)"
    let path = |line: &str| line.split_whitespace().find(|word| word.starts_with('/')).map(str::to_owned);
    Ok(text.lines().filter_map(path).collect())
}

/// Copies a file.
///
/// Removes debug symbols of our programs if possible, because the machine has little memory.
fn copy(from: &Path, to: &Path, ours: bool) -> io::Result<()> {
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder)?;
    }
    if ours && passes_quietly(Command::new("strip").arg("-o").arg(to).arg(from)) {
        return Ok(());
    }
    fs::copy(from, to).map(|_| ())
}

/// Adds the init script and packs the root file system.
fn finish(root: &Path, busybox: &Path, image: &Path) -> io::Result<()> {
    let tool = |arguments: &[&str]| {
        let mut command = Command::new(busybox);
        command.args(arguments).current_dir(root).stderr(Stdio::null());
        command
    };
    fs::write(root.join("init"), init())?;
    let made = passes_quietly(&mut tool(&["mkdir", "proc", "sys", "dev"]))
        && passes_quietly(&mut tool(&["chmod", "755", "init"]))
        && passes_quietly(&mut tool(&["ln", "-s", "busybox", "bin/sh"]));
    let names = image.with_extension("txt");
    fs::write(&names, tool(&["find"]).output()?.stdout)?;
    let mut cpio = tool(&["cpio", "-o", "-H", "newc"]);
    let packed = cpio.stdin(fs::File::open(&names)?).stdout(fs::File::create(image)?).status()?.success();
    if made && packed { Ok(()) } else { Err(io::Error::other("busybox could not pack the image")) }
}
