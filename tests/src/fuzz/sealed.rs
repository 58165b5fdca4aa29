//! Controllers and parameter blocks with changed content and valid checksums.

use std::sync::OnceLock;

use super::random::Random;
use crate::controller::controller;

/// Checksum of frames, of the head of a controller and of a parameter block.
pub(super) const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Returns the bytes of a controller with a valid checksum of its head.
fn with_check_sum(head: &[u8], block: &[u8]) -> Vec<u8> {
    [head, &CRC.checksum(head).to_le_bytes(), block].concat()
}

/// Returns a controller that a device can run, and the offset of its model's block.
pub(super) fn recipe() -> (&'static [u8], usize) {
    static RECIPE: OnceLock<(Vec<u8>, usize)> = OnceLock::new();
    let (bytes, block) = RECIPE.get_or_init(|| {
        let parts = controller(0.1, 8, [0.0, 100.0]);
        (parts.concat(), parts[0].len())
    });
    (bytes, *block)
}

/// Offset of the numbers of a controller: after `HYCT`, version and flags.
const NUMBERS: usize = 4 + 2;

/// Changes the content of a controller and corrects its checksums.
pub(super) fn reseal_recipe(random: &mut Random, recipe: &mut Vec<u8>) {
    let offset = self::recipe().1;
    // The checksum of the head is directly before the block.
    let (mut head, mut block) = (recipe[..offset - 4].to_vec(), recipe[offset..].to_vec());
    if random.once_in(2) {
        odd_number(random, &mut head[NUMBERS..]);
    }
    if !random.once_in(3) {
        reseal_block(random, &mut block);
    }
    *recipe = with_check_sum(&head, &block);
}

/// Replaces one of the numbers of eight bytes by an implausible one.
fn odd_number(random: &mut Random, bytes: &mut [u8]) {
    let odd = [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e308, -1e308, 1e-320, 1e9, 65.0, -0.0];
    let places = bytes.len() / 8;
    if places > 0 {
        let at = 8 * random.below(places);
        bytes[at..at + 8].copy_from_slice(&random.of(&odd).to_le_bytes());
    }
}

/// Damages the parameters of a block and corrects its length and checksum.
pub(super) fn reseal_block(random: &mut Random, bytes: &mut Vec<u8>) {
    let mut payload = bytes[9..bytes.len() - 4].to_vec();
    if random.once_in(2) && payload.len() > 16 {
        // The numbers are not aligned to eight bytes.
        let from = random.below(8);
        odd_number(random, &mut payload[from..]);
    } else {
        random.damage(&mut payload);
    }
    bytes.truncate(5);
    bytes.extend((payload.len() as u32).to_le_bytes());
    bytes.extend(payload);
    let sum = CRC.checksum(bytes).to_le_bytes();
    bytes.extend(sum);
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyst_hw::wire::read_recipe;

    #[test]
    fn an_unchanged_controller_gets_its_own_check_sum() {
        let (bytes, block) = recipe();
        assert_eq!(with_check_sum(&bytes[..block - 4], &bytes[block..]), bytes);
        assert!(read_recipe(bytes).is_ok());
    }
}
