//! Random numbers from a seed, and random damage to bytes.

/// Random number generator SplitMix64 (Steele, Lea and Flood 2014).
#[derive(Clone, Debug)]
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Returns the next number.
    pub(super) fn number(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a number below `n`, which must not be zero.
    pub(super) fn below(&mut self, n: usize) -> usize {
        (self.number() % n as u64) as usize
    }

    /// Returns true with probability 1/n; never if `n` is zero.
    pub(super) fn once_in(&mut self, n: usize) -> bool {
        n > 0 && self.below(n) == 0
    }

    /// Returns a number from `low` to `high`.
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.number() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns a random element.
    pub(super) fn of<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len())]
    }

    /// Returns at most `max` random bytes.
    pub(super) fn bytes(&mut self, max: usize) -> Vec<u8> {
        (0..self.below(max + 1)).map(|_| self.number() as u8).collect()
    }

    /// Changes, removes, repeats or moves some of the bytes.
    pub(super) fn damage(&mut self, bytes: &mut Vec<u8>) {
        for _ in 0..=self.below(3) {
            if bytes.is_empty() {
                return;
            }
            let (at, other) = (self.below(bytes.len()), self.below(bytes.len()));
            let (low, high) = (at.min(other), at.max(other));
            match self.below(9) {
                0 => bytes[at] ^= 1 << self.below(8),
                1 => bytes[at] = *self.of(&[0, 1, 0x7f, 0x80, 0xff, b'0', b'-', b'9', b'"', b'{', b'\n', b',', b'e']),
                2 => bytes.truncate(at),
                3 => drop(bytes.remove(at)),
                4 => bytes.insert(at, self.number() as u8),
                5 => bytes.swap(at, other),
                6 => drop(bytes.drain(low..high)),
                7 => {
                    let again = bytes[low..high.min(low + 64)].to_vec();
                    bytes.splice(low..low, again);
                }
                // The smallest or the largest length or count.
                _ => bytes[low..high.min(low + 8)].fill(*self.of(&[0, 0xff])),
            }
        }
    }
}
