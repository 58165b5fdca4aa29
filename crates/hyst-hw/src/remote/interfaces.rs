//! CAN interfaces, as Linux lists them.

use std::fs;
use std::path::Path;

/// Where the system describes its network interfaces.
const NETWORK: &str = "/sys/class/net";
/// What it says of those that are CAN.
const CAN: &str = "280";
/// Bytes of a frame of CAN FD with its head; of a classic one 16.
const FD: u32 = 72;

/// A CAN interface of this machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Interface {
    /// What the system calls it.
    pub name: String,
    /// Whether it carries frames now.
    pub up: bool,
    /// Whether these may be of CAN FD.
    pub fd: bool,
}

/// The CAN interfaces of this machine, by name; none on other systems than Linux.
pub fn interfaces() -> Vec<Interface> {
    under(Path::new(NETWORK))
}

fn under(folder: &Path) -> Vec<Interface> {
    let mut found: Vec<Interface> = fs::read_dir(folder).into_iter().flatten().flatten().filter_map(read).collect();
    found.sort_by(|a, b| a.name.cmp(&b.name));
    found
}

/// The interface that a folder describes, if it is of CAN.
fn read(entry: fs::DirEntry) -> Option<Interface> {
    let text = |name: &str| fs::read_to_string(entry.path().join(name)).ok().map(|text| text.trim().to_owned());
    if text("type")? != CAN {
        return None;
    }
    let flags = text("flags").and_then(|flags| u32::from_str_radix(flags.trim_start_matches("0x"), 16).ok());
    let bytes = text("mtu").and_then(|bytes| bytes.parse().ok());
    Some(Interface {
        name: entry.file_name().into_string().ok()?,
        up: flags.is_some_and(|flags| flags & 1 == 1),
        fd: bytes.is_some_and(|bytes: u32| bytes >= FD),
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
        // Not an interface at all.
        fs::write(folder.join("bonding_masters"), "").unwrap();
        let found = under(&folder);
        fs::remove_dir_all(&folder).unwrap();
        let interface = |name: &str, up, fd| Interface { name: name.to_owned(), up, fd };
        assert_eq!(found, [interface("can0", true, true), interface("can1", false, false)]);
        assert_eq!(under(&folder), []);
    }
}
