//! Compiler, linker and emulator for the Cortex-M4F.
//!
//! The usual compiler is rustup's, with an additional target. If the target cannot be downloaded, Debian's packages
//! contain a compiler and the sources of `core`, which is then also built.

use crate::command::{install, output, wait, which};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;
use std::{env, fs};

/// Cortex-M4F without an operating system, and so without a standard library.
pub(crate) const TARGET: &str = "thumbv7em-none-eabihf";

const EMULATOR: &str = "qemu-system-arm";
const LINKER: &str = "arm-none-eabi-ld";
const PACKAGES: &[&str] = &["rustc-web", "cargo-web", "rust-web-src", "binutils-arm-none-eabi", EMULATOR];

/// Minor version of the oldest accepted compiler, 1.x.
const MINOR: u32 = 88;

/// The programs that build and link firmware.
pub(crate) struct Toolchain {
    /// `rustc 1.95.0 (59807616e 2026-04-14)`
    pub(crate) version: String,
    cargo: OsString,
    arguments: &'static [&'static str],
    environment: Vec<(&'static str, OsString)>,
    linker: Vec<OsString>,
    /// Whether the toolchain has clippy.
    pub(crate) lints: bool,
}

impl Toolchain {
    /// Returns rustup's toolchain or else Debian's, and installs missing parts if possible.
    ///
    /// `HYST_FIRMWARE_TOOLCHAIN` (`rustup` or `debian`) selects one.
    ///
    /// # Errors
    /// The commands that install a toolchain.
    pub(crate) fn find() -> Result<Self, String> {
        let wanted = env::var("HYST_FIRMWARE_TOOLCHAIN").unwrap_or_default();
        let rustup = || if wanted == "debian" { None } else { Self::rustup() };
        let debian = || if wanted == "rustup" { None } else { Self::debian() };
        rustup()
            .or_else(debian)
            .or_else(|| if wanted != "rustup" && install(PACKAGES) { Self::debian() } else { None })
            .ok_or_else(|| {
                format!("`rustup target add {TARGET}`, or on Debian as root `apt-get install {}`", PACKAGES.join(" "))
            })
    }

    fn rustup() -> Option<Self> {
        let rustc = || Command::new(env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()));
        let installed = || {
            let folder = output(rustc().args(["--print", "target-libdir", "--target", TARGET]));
            folder.is_some_and(|folder| Path::new(&folder).is_dir())
        };
        if !installed() {
            let mut add = Command::new("rustup");
            add.args(["target", "add", TARGET]).stdin(Stdio::null()).env_remove("RUST_BACKTRACE");
            let added = add.spawn().ok().and_then(|child| wait(child, Duration::from_secs(180)));
            if !added.is_some_and(|status| status.success()) || !installed() {
                return None;
            }
        }
        let sysroot = output(rustc().args(["--print", "sysroot"]))?;
        let verbose = output(rustc().arg("-vV"))?;
        let host = verbose.lines().find_map(|line| line.strip_prefix("host: "))?;
        let lld = PathBuf::from(sysroot).join("lib/rustlib").join(host).join("bin/rust-lld");
        let linker =
            if lld.is_file() { vec![lld.into(), "-flavor".into(), "gnu".into()] } else { vec![which(LINKER)?.into()] };
        Some(Self {
            version: verbose.lines().next()?.to_owned(),
            cargo: env::var_os("CARGO").unwrap_or_else(|| "cargo".into()),
            arguments: &[],
            environment: Vec::new(),
            linker,
            lints: true,
        })
    }

    fn debian() -> Option<Self> {
        let (rustc, cargo) = ("/usr/bin/rustc", "/usr/bin/cargo");
        let version = output(Command::new(rustc).arg("--version").env_remove("LD_LIBRARY_PATH"))?;
        let minor: u32 = version.split(['.', ' ']).nth(2)?.parse().ok()?;
        let sources = Path::new("/usr/lib/rustlib/src/rust/library/core/Cargo.toml").is_file();
        if minor < MINOR || !sources || !Path::new(cargo).is_file() {
            return None;
        }
        let linker = which(LINKER)?;
        Some(Self {
            version,
            cargo: cargo.into(),
            arguments: &["-Zbuild-std=core", "-Zbuild-std-features=compiler-builtins-mem"],
            environment: vec![
                // Otherwise cargo uses rustup's compiler, if there is one.
                ("RUSTC", rustc.into()),
                // Building `core` is not a stable feature yet.
                ("RUSTC_BOOTSTRAP", "1".into()),
                ("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER", linker.clone().into()),
            ],
            linker: vec![linker.into()],
            lints: false,
        })
    }

    /// Returns a cargo command (`build`, `clippy`) for the target, with the target folder `target`.
    pub(crate) fn cargo(&self, what: &str, target: &Path) -> Command {
        let mut command = Command::new(&self.cargo);
        command.args([what, "--target", TARGET, "--target-dir"]).arg(target).args(self.arguments);
        // These variables are for the host, not for the target.
        for name in ["RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS", "CARGO_BUILD_TARGET", "LD_LIBRARY_PATH"] {
            command.env_remove(name);
        }
        command.envs(self.environment.iter().map(|(k, v)| (k, v)));
        command
    }

    /// Returns the command of the linker.
    pub(crate) fn linker(&self) -> Command {
        let mut parts = self.linker.iter();
        let mut command = Command::new(parts.next().cloned().unwrap_or_default());
        command.args(parts);
        command
    }
}

/// Reason why [`emulate`] failed.
pub(crate) enum NotRun {
    /// There is no emulator; contains its name and the command that installs it.
    Missing(String),
    /// The firmware failed and has printed the reason.
    Failed,
}

/// Runs the image on QEMU's mps2-an386 and writes its output to the file `printed`.
pub(crate) fn emulate(image: &Path, printed: &Path) -> Result<(), NotRun> {
    if which(EMULATOR).is_none() && !install(&[EMULATOR]) {
        return Err(NotRun::Missing(format!("{EMULATOR} (Debian: `apt-get install {EMULATOR}`)")));
    }
    let file = fs::File::create(printed).map_err(|error| {
        eprintln!("error: {}: {error}", printed.display());
        NotRun::Failed
    })?;
    let child = Command::new(EMULATOR)
        // One instruction takes 2⁶ ns of the machine's time, independent of the load of the host.
        .args(["-machine", "mps2-an386", "-icount", "shift=6"])
        .args(["-nographic", "-monitor", "none", "-serial", "none", "-semihosting-config", "enable=on,target=native"])
        .arg("-kernel")
        .arg(image)
        .stdin(Stdio::null())
        .stdout(file)
        .spawn();
    match child.map(|child| wait(child, Duration::from_secs(300))) {
        Ok(Some(status)) if status.success() => Ok(()),
        Ok(ended) => {
            let text = fs::read_to_string(printed).unwrap_or_default();
            let last: Vec<&str> = text.lines().filter(|line| !line.starts_with("bits ")).collect();
            eprintln!("{}", last[last.len().saturating_sub(5)..].join("\n"));
            eprintln!("error: the firmware {}", if ended.is_some() { "failed" } else { "did not end within 300 s" });
            Err(NotRun::Failed)
        }
        Err(error) => {
            eprintln!("error: {EMULATOR} could not be started: {error}");
            Err(NotRun::Failed)
        }
    }
}
