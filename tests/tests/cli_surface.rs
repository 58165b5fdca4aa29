//! The command line itself: help, version, completions, exit codes.

use std::process::Stdio;

use hyst_tests::Lab;

#[test]
fn help_and_version_exit_with_zero() {
    let lab = Lab::new();
    assert!(lab.ok("--version").stdout.starts_with("hystctl "));
    let help = lab.ok("--help").stdout;
    for part in ["fit", "simulate", "diagnose", "compensate", "excite", "run", "Examples", "Exit codes"] {
        assert!(help.contains(part), "\"{part}\" is missing in: {help}");
    }
    for command in ["fit", "simulate", "diagnose", "compensate", "excite", "run"] {
        let help = lab.ok(&format!("{command} --help")).stdout;
        assert!(help.contains("Example") && help.contains("hystctl "), "{help}");
    }
}

#[test]
fn bad_arguments_exit_with_two() {
    let lab = Lab::new();
    for line in ["", "frobnicate", "fit", "fit a.csv", "fit a.csv --model pi", "fit --model pi -o m.json", "--nonsense"]
    {
        let ran = lab.run(line);
        assert_eq!((ran.code, ran.stdout.as_str()), (2, ""), "{line}: {}", ran.stderr);
        assert!(!ran.stderr.is_empty(), "{line}");
    }
}

#[test]
fn completions_exist_for_every_shell() {
    let lab = Lab::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(lab.ok(&format!("completions {shell}")).stdout.contains("compensate"), "{shell}");
    }
}

#[test]
fn a_closed_pipe_is_not_an_error() {
    let lab = Lab::new();
    let mut child = lab
        .command("excite identification --high 100 -o -")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let ran = hyst_tests::Ran::from(child.wait_with_output().unwrap());
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(!ran.stderr.contains("error"), "{}", ran.stderr);
}

#[cfg(unix)]
#[test]
#[cfg_attr(not(full_device), ignore = "there is no /dev/full")]
fn a_full_disk_is_an_error_and_leaves_no_file() {
    let lab = Lab::with_model();
    let message = lab.fails("simulate --model model.json train.csv -o /dev/full", 1);
    assert!(message.contains("/dev/full: cannot be written"), "{message}");
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let ran =
        hyst_tests::Ran::from(lab.command("simulate --model model.json train.csv").stdout(full).output().unwrap());
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("error: "), "{}", ran.stderr);
}

#[cfg(unix)]
#[test]
#[cfg_attr(not(file_permissions), ignore = "file permissions do not apply to root")]
fn a_read_only_folder_is_an_error() {
    use std::os::unix::fs::PermissionsExt;
    let lab = Lab::with_train("");
    std::fs::create_dir(lab.path("locked")).unwrap();
    let lock = |mode| std::fs::set_permissions(lab.path("locked"), std::fs::Permissions::from_mode(mode)).unwrap();
    lock(0o555);
    let message = lab.fails("fit train.csv --model pi -o locked/model.json", 1);
    assert!(message.contains("locked/model.json: cannot be written"), "{message}");
    lock(0o755);
}
