//! Debian packages for the machine with CAN; they are unpacked, not installed.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::command::{as_root, output, passes_quietly};

/// Package that depends on the newest kernel. The cloud kernel has no CAN.
const KERNEL: &str = "linux-image-amd64";
const OTHERS: &[&str] = &["busybox-static", "can-utils"];

/// Paths of the unpacked files.
pub(crate) struct Packages {
    pub(crate) kernel: PathBuf,
    /// Folder with the kernel's modules.
    pub(crate) modules: PathBuf,
    pub(crate) busybox: PathBuf,
    /// Folder with the programs of can-utils.
    pub(crate) utils: PathBuf,
}

impl Packages {
    /// Returns the packages of an earlier run, or downloads them.
    ///
    /// # Errors
    /// A message with the missing package and the command that installs it.
    pub(crate) fn get(folder: &Path) -> Result<Self, String> {
        let kept = folder.join("kernel.txt");
        if let Ok(kernel) = fs::read_to_string(&kept) {
            let packages = Self::of(folder, kernel.trim());
            if packages.whole() {
                return Ok(packages);
            }
        }
        let kernel = newest().or_else(|| if update() { newest() } else { None }).ok_or_else(|| {
            format!("Debian's package {KERNEL} was not found; this needs apt with package lists (`apt-get update`)")
        })?;
        let wanted = [&[kernel.as_str()], OTHERS].concat();
        let there = download(&wanted, folder) || update() && download(&wanted, folder);
        if !there {
            return Err(format!(
                "packages could not be downloaded; `apt-get download {}` prints the reason",
                wanted.join(" ")
            ));
        }
        let packages = Self::of(folder, &kernel);
        if !packages.whole() {
            return Err(format!("files are missing in the packages {}", wanted.join(", ")));
        }
        fs::write(&kept, &kernel).map_err(|error| format!("{}: {error}", kept.display()))?;
        Ok(packages)
    }

    fn of(folder: &Path, kernel: &str) -> Self {
        let root = folder.join("root");
        let version = kernel.trim_start_matches("linux-image-");
        Self {
            kernel: root.join(format!("boot/vmlinuz-{version}")),
            modules: root.join(format!("lib/modules/{version}/kernel")),
            busybox: root.join("bin/busybox"),
            utils: root.join("usr/bin"),
        }
    }

    fn whole(&self) -> bool {
        self.kernel.is_file() && self.modules.is_dir() && self.busybox.is_file() && self.utils.is_dir()
    }
}

/// Returns the package of the newest kernel.
fn newest() -> Option<String> {
    let text = output(Command::new("apt-cache").args(["depends", KERNEL]))?;
    let named = |line: &str| line.trim().strip_prefix("Depends: ").map(str::to_owned);
    text.lines().filter_map(named).find(|name| name.starts_with("linux-image-"))
}

fn update() -> bool {
    as_root() && passes_quietly(Command::new("apt-get").args(["-qq", "update"]))
}

/// Downloads packages and unpacks them below `folder`; returns whether that succeeded.
fn download(packages: &[&str], folder: &Path) -> bool {
    let (files, root) = (folder.join("packages"), folder.join("root"));
    for folder in [&files, &root] {
        // Files of an earlier attempt could belong to another kernel.
        let _ = fs::remove_dir_all(folder);
        if fs::create_dir_all(folder).is_err() {
            return false;
        }
    }
    eprintln!("apt-get download {}", packages.join(" "));
    // As root, apt cannot download into this folder as its sandbox user; this option avoids the warning.
    let mut apt = Command::new("apt-get");
    apt.args(["-qq", "-o", "APT::Sandbox::User=root", "download"]).args(packages).current_dir(&files);
    if !passes_quietly(&mut apt) {
        return false;
    }
    let archives = fs::read_dir(&files).into_iter().flatten().flatten();
    let unpacked = archives
        .map(|archive| passes_quietly(Command::new("dpkg-deb").arg("-x").arg(archive.path()).arg(&root)))
        .fold(0, |count, unpacked| count + usize::from(unpacked));
    // The archives are as large as their content and no longer needed.
    let _ = fs::remove_dir_all(&files);
    unpacked == packages.len()
}
