//! The CAN interfaces that Linux lists.

use std::fs;
use std::path::Path;

/// Folder in which Linux describes its network interfaces.
const INTERFACES_FOLDER: &str = "/sys/class/net";
/// Type of a CAN interface (`ARPHRD_CAN`).
const CAN_TYPE: &str = "280";
/// MTU of an interface with CAN FD: bytes of a frame with its header. It is 16 without CAN FD.
const FD_MTU: u32 = 72;

/// A CAN interface of this machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Interface {
    /// Name of the interface in the operating system.
    pub name: String,
    /// Whether the interface is up.
    pub up: bool,
    /// Whether the interface carries CAN FD frames.
    pub fd: bool,
}

/// Returns the CAN interfaces of this machine, sorted by name; none on other systems than Linux.
pub fn interfaces() -> Vec<Interface> {
    interfaces_in(Path::new(INTERFACES_FOLDER))
}

fn interfaces_in(folder: &Path) -> Vec<Interface> {
    let mut found: Vec<Interface> = fs::read_dir(folder).into_iter().flatten().flatten().filter_map(read).collect();
    found.sort_by(|a, b| a.name.cmp(&b.name));
    found
}

/// Reads the folder of an interface; `None` if it is not a CAN interface.
fn read(entry: fs::DirEntry) -> Option<Interface> {
    let text = |name: &str| fs::read_to_string(entry.path().join(name)).ok().map(|text| text.trim().to_owned());
    if text("type")? != CAN_TYPE {
        return None;
    }
    let flags = text("flags").and_then(|flags| u32::from_str_radix(flags.trim_start_matches("0x"), 16).ok());
    let bytes = text("mtu").and_then(|bytes| bytes.parse().ok());
    Some(Interface {
        name: entry.file_name().into_string().ok()?,
        up: flags.is_some_and(|flags| flags & 1 == 1),
        fd: bytes.is_some_and(|bytes: u32| bytes >= FD_MTU),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interfaces_of_other_kinds_are_left_out() {
        let folder = std::env::temp_dir().join(format!("hyst-hw-interfaces-{}", std::process::id()));
        for (name, kind, flags, mtu) in
            [("can1", "280", "0x40080", "16"), ("can0", "280", "0x400c1", "72"), ("lo", "772", "0x9", "65536")]
        {
            let folder = folder.join(name);
            fs::create_dir_all(&folder).unwrap();
            for (file, text) in [("type", kind), ("flags", flags), ("mtu", mtu)] {
                fs::write(folder.join(file), format!("{text}\n")).unwrap();
            }
        }
        // A file, not an interface.
        fs::write(folder.join("bonding_masters"), "").unwrap();
        let found = interfaces_in(&folder);
        fs::remove_dir_all(&folder).unwrap();
        let interface = |name: &str, up, fd| Interface { name: name.to_owned(), up, fd };
        assert_eq!(found, [interface("can0", true, true), interface("can1", false, false)]);
        assert_eq!(interfaces_in(&folder), []);
    }
}
