//! A virtual machine with CAN: QEMU runs the tests `can` of `hyst-hw` and `cli_can` in it.
//!
//! They create virtual interfaces and test against the kernel.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use super::image;
use super::packages::Packages;
use super::programs::{PASSED, TESTS};
use crate::command::{self, Outcome, cargo, install, output, target, wait, which};

const EMULATOR: &str = "qemu-system-x86_64";
const EMULATOR_PACKAGE: &str = "qemu-system-x86";
/// Time limit; the machine is emulated and has one processor.
const LIMIT: Duration = Duration::from_secs(600);

/// Runs the tests in the machine.
pub(crate) fn check() -> Outcome {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        return skipped("this needs Linux on x86-64");
    }
    if which(EMULATOR).is_none() && !install(&[EMULATOR_PACKAGE]) {
        return skipped(&format!("{EMULATOR} is missing (Debian: `apt-get install {EMULATOR_PACKAGE}`)"));
    }
    let folder = target().join("can");
    let packages = match Packages::get(&folder) {
        Ok(packages) => packages,
        Err(why) => return skipped(&why),
    };
    match run(&packages, &folder) {
        Ok(()) => Outcome::Passed,
        Err(why) => {
            eprintln!("error: {why}");
            Outcome::Failed
        }
    }
}

fn skipped(why: &str) -> Outcome {
    Outcome::Skipped(format!("SocketCAN was not tested: {why}"))
}

fn run(packages: &Packages, folder: &Path) -> Result<(), String> {
    let mut programs = Vec::new();
    for (package, test) in TESTS {
        programs.push((*test, built(package, test)?));
    }
    let hystctl = hystctl()?;
    let image = image::build(packages, &programs, &hystctl, folder)?;
    let printed = folder.join("printed.txt");
    let log = fs::File::create(&printed).map_err(|error| format!("{}: {error}", printed.display()))?;
    let mut machine = Command::new(EMULATOR);
    machine
        .args(["-accel", "tcg", "-machine", "q35", "-cpu", "max", "-m", "1024", "-nodefaults", "-no-reboot"])
        .args(["-display", "none", "-serial", "stdio", "-append", "console=ttyS0 quiet panic=-1", "-kernel"])
        .arg(&packages.kernel)
        .arg("-initrd")
        .arg(&image)
        .stdin(Stdio::null())
        .stdout(log);
    let child = machine.spawn().map_err(|error| format!("{EMULATOR} could not be started: {error}"))?;
    let ended = wait(child, LIMIT);
    // The exit code of QEMU is not that of the tests; only the output has the results.
    let bytes = fs::read(&printed).map_err(|error| format!("{}: {error}", printed.display()))?;
    let text = String::from_utf8_lossy(&bytes).replace('\r', "");
    eprintln!("{}", text.trim());
    if ended.is_none() {
        return Err(format!("the machine did not end within {} s", LIMIT.as_secs()));
    }
    judge(&text)
}

/// Checks in the output of the machine that all tests ran and passed.
fn judge(text: &str) -> Result<(), String> {
    for (_, test) in TESTS {
        let ran = |line: &str| line.starts_with("test result: ok.") && !line.contains(" 0 passed");
        let mut lines = text.lines().skip_while(|line| *line != format!("hyst-can: starts {test}"));
        let ok = lines.any(ran) && lines.any(|line| line.strip_prefix(PASSED) == Some(test));
        if !ok {
            return Err(format!("the tests {test} did not pass in the machine"));
        }
    }
    Ok(())
}

/// Builds an integration test of a package and returns the path of its program.
fn built(package: &str, test: &str) -> Result<PathBuf, String> {
    let arguments = ["test", "--no-run", "--message-format=json-render-diagnostics", "--workspace"];
    let text = output(cargo().args(arguments).args(["--test", test]).stderr(Stdio::inherit()));
    let text = text.ok_or_else(|| format!("the tests {test} of {package} do not build"))?;
    let named = format!(r#""name":"{test}""#);
    let line = text.lines().filter(|line| line.contains(&named)).find_map(|line| line.split_once(r#""executable":""#));
    let program = line.and_then(|(_, rest)| rest.split_once('"')).map(|(program, _)| PathBuf::from(program));
    program.ok_or_else(|| format!("cargo printed no path for the tests {test} of {package}"))
}

/// Builds `hystctl` and returns its path.
fn hystctl() -> Result<PathBuf, String> {
    match command::build() {
        Outcome::Passed => Ok(command::program()),
        _ => Err("hystctl does not build".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "\
hyst-can: starts can
test result: ok. 14 passed; 0 failed
hyst-can: passed can
hyst-can: starts cli_can
test result: ok. 2 passed; 0 failed
hyst-can: passed cli_can
";

    #[test]
    fn only_tests_that_ran_and_passed_are_accepted() {
        assert_eq!(judge(GOOD), Ok(()));
        for (from, to) in [
            ("14 passed", "0 passed"),
            ("ok. 2", "FAILED. 2"),
            ("hyst-can: passed can\n", ""),
            ("hyst-can: passed cli_can\n", ""),
            ("test result: ok. 14 passed; 0 failed\n", ""),
        ] {
            assert!(GOOD.contains(from), "{from}");
            judge(&GOOD.replace(from, to)).unwrap_err();
        }
        judge("").unwrap_err();
    }
}
