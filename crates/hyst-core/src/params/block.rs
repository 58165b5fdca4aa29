//! The parameters of a chain as a block of bytes that firmware loads without a heap.
//!
//! | bytes | content |
//! |---|---|
//! | 4 | `HYST` |
//! | 1 | version of the format |
//! | 4 | length of the payload, little endian |
//! | n | [`ChainParams`], [postcard](https://postcard.jamesmunns.com) |
//! | 4 | CRC-32 (ISO-HDLC) of all bytes before, little endian |

use core::fmt;

use super::ChainParams;

/// Version of the blocks that this version of the library writes and reads.
///
/// 1: first version. 2: `volt_seconds` after `seconds` in the parameters of viscous plays. 3: the rate stage after the
/// lag, the settling part after the rate of a drift, harmonics after the phase of a tone. 4: the side of a curve. 5:
/// `falls` before `zero`. 6: the widening after the rate stage. 7: `direct` before `seconds` of a temperature, the gain of a
/// load. 8: the side of a saturation.
pub const BLOCK_VERSION: u8 = 8;

/// A list of at most `N` numbers without a heap.
pub type List<const N: usize> = heapless::Vec<f64, N>;

const MAGIC: [u8; 4] = *b"HYST";
const HEAD: usize = MAGIC.len() + 1 + 4;
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
const TAIL: usize = 4;

/// The reason why a block cannot be read or written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BlockError {
    /// The bytes do not start with `HYST`.
    NotABlock,
    /// The block has another version of the format.
    Version {
        /// Version of the block.
        version: u8,
    },
    /// There are fewer bytes than the head specifies.
    Truncated {
        /// Number of bytes that are needed.
        needed: usize,
        /// Number of bytes that were found.
        found: usize,
    },
    /// The checksum does not match: the bytes were changed.
    Corrupt {
        /// Checksum in the block.
        stated: u32,
        /// Checksum of the bytes.
        computed: u32,
    },
    /// A list is longer than the [`List`] into which it is read, or an option (kind of model, order, curve) is unknown
    /// to this build. The block is not damaged.
    TooLong,
    /// The payload is not a set of parameters.
    Malformed,
    /// The buffer is too small for the block.
    NoRoom,
}

impl fmt::Display for BlockError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotABlock => f.write_str("not a parameter block: it does not start with HYST"),
            Self::Version { version } => {
                write!(
                    f,
                    "block version {version}, this build reads {BLOCK_VERSION}: export the model again, or update it"
                )
            }
            Self::Truncated { needed, found } => write!(f, "block truncated: {found} of {needed} bytes"),
            Self::Corrupt { stated, computed } => {
                write!(f, "block damaged: checksum {computed:08x}, stated {stated:08x}")
            }
            Self::TooLong => f.write_str(
                "a list of the block is longer than the capacity of this build: raise N of the List<N> of read_block \
                 (or the block has a kind of model that is newer than this build)",
            ),
            Self::Malformed => f.write_str("the parameters of the block cannot be read: export the model again"),
            Self::NoRoom => f.write_str("the buffer is too small for the block"),
        }
    }
}

impl core::error::Error for BlockError {}

fn number(bytes: Option<&[u8]>) -> Option<u32> {
    Some(u32::from_le_bytes(bytes?.try_into().ok()?))
}

/// Writes a block into `buffer` and returns the bytes written.
///
/// # Errors
/// [`BlockError::NoRoom`].
pub fn write_block<'a, L: serde::Serialize, E: serde::Serialize>(
    chain: &ChainParams<L, E>,
    buffer: &'a mut [u8],
) -> Result<&'a [u8], BlockError> {
    let room = buffer.get_mut(HEAD..).ok_or(BlockError::NoRoom)?;
    let length = postcard::to_slice(chain, room).map_err(|_| BlockError::NoRoom)?.len();
    let announced = u32::try_from(length).map_err(|_| BlockError::NoRoom)?;
    let end = HEAD + length;
    let head = MAGIC.into_iter().chain([BLOCK_VERSION]).chain(announced.to_le_bytes());
    for (slot, byte) in buffer.iter_mut().zip(head) {
        *slot = byte;
    }
    let sum = CRC.checksum(buffer.get(..end).ok_or(BlockError::NoRoom)?).to_le_bytes();
    buffer.get_mut(end..end + TAIL).ok_or(BlockError::NoRoom)?.copy_from_slice(&sum);
    buffer.get(..end + TAIL).ok_or(BlockError::NoRoom)
}

/// Reads a block. Bytes after it are ignored, so a whole flash page may be passed.
///
/// Only the form of the parameters is checked; `build` checks their values. They are returned by value. With lists of
/// 300 numbers (a Preisach triangle of 24 × 24) and of 8 they take 8 KB (dpm has three such lists), without the memory
/// for building (`docs/firmware.md`).
///
/// The first list must hold the longest list of the operator (`fit --model pi` makes 20 plays by default, and 64 at
/// most; a triangle of n cells along an edge has n (n + 1) / 2). The second must hold the creep bank and the dead
/// zones. If a list is too short, the error is [`BlockError::TooLong`].
///
/// ```
/// use hyst_core::{Build, Chain, List, OperatorParams, Pi, Sampling, read_block};
///
/// /// Room for 64 plays, 32 samples of dead time and 8 creep elements.
/// type Actuator = Chain<f32, Pi<f32, 64>, 32, 8>;
///
/// fn load(flash: &[u8]) -> Result<Actuator, &'static str> {
///     let chain = read_block::<List<64>, List<8>>(flash).map_err(|_| "bad block")?;
///     let OperatorParams::Pi(pi) = &chain.operator else { return Err("this firmware runs pi only") };
///     let pi: Pi<f32, 64> = pi.build(&()).map_err(|_| "bad parameters")?;
///     chain.around(pi, &Sampling { period: 1e-3 }).map_err(|_| "bad parameters")
/// }
///
/// # use hyst_core::{ChainParams, EffectParams, PiParams, write_block};
/// # let thresholds: Vec<f64> = (1..=20).map(f64::from).collect();
/// # let operator = OperatorParams::Pi(PiParams { gain: 0.1, weights: thresholds.clone(), thresholds });
/// # let fitted: ChainParams<Vec<f64>> = ChainParams {
/// #     operator, effects: EffectParams::default(), falls: false, zero: 0.0, input: [0.0, 120.0],
/// # };
/// # let mut buffer = [0; 512];
/// # let flash = write_block(&fitted, &mut buffer).unwrap();
/// assert!(load(flash).is_ok());
/// assert!(load(b"HYST").is_err());
/// ```
///
/// # Errors
/// See [`BlockError`].
pub fn read_block<'a, L, E>(bytes: &'a [u8]) -> Result<ChainParams<L, E>, BlockError>
where
    L: serde::Deserialize<'a>,
    E: serde::Deserialize<'a>,
{
    let found = bytes.len();
    if bytes.get(..MAGIC.len()) != Some(&MAGIC[..]) {
        return Err(BlockError::NotABlock);
    }
    let short = |needed| BlockError::Truncated { needed, found };
    let version = *bytes.get(MAGIC.len()).ok_or(short(HEAD))?;
    // The payload has no names, so another version would be misread.
    if version != BLOCK_VERSION {
        return Err(BlockError::Version { version });
    }
    let length = number(bytes.get(MAGIC.len() + 1..HEAD)).ok_or(short(HEAD))? as usize;
    let end = HEAD.saturating_add(length);
    let needed = end.saturating_add(TAIL);
    let stated = number(bytes.get(end..needed)).ok_or(short(needed))?;
    let computed = CRC.checksum(bytes.get(..end).ok_or(short(needed))?);
    if stated != computed {
        return Err(BlockError::Corrupt { stated, computed });
    }
    let payload = bytes.get(HEAD..end).ok_or(short(needed))?;
    match postcard::take_from_bytes(payload) {
        Ok((chain, [])) => Ok(chain),
        // The types reject the value. Malformed bytes give other errors.
        Err(postcard::Error::SerdeDeCustom) => Err(BlockError::TooLong),
        _ => Err(BlockError::Malformed),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CreepParams, EffectParams, LagParams, OperatorParams, PiParams, ResonanceParams};
    use proptest::prelude::*;
    use std::vec::Vec;

    fn chain(plays: usize) -> ChainParams<Vec<f64>> {
        ChainParams {
            operator: OperatorParams::Pi(PiParams {
                gain: 0.1,
                thresholds: (1..=plays).map(|i| i as f64).collect(),
                weights: (1..=plays).map(|i| 0.1 / i as f64).collect(),
            }),
            effects: EffectParams {
                lag: Some(LagParams { seconds: 0.002 }),
                creep: Some(CreepParams { seconds: std::vec![0.1, 1.0], shares: std::vec![0.01, 0.02] }),
                resonances: [Some(ResonanceParams { hz: 90.0, damping: 0.03, gain: 1.0 }), None],
                ..EffectParams::default()
            },
            falls: false,
            zero: -1.5,
            input: [0.0, 120.0],
        }
    }

    #[test]
    fn firmware_reads_the_block_of_a_host() {
        let mut buffer = [0; 512];
        let host = chain(10);
        let bytes = write_block(&host, &mut buffer).unwrap();
        // 20 numbers of the operator, 4 of the creep bank, 7 others, of 8 bytes each; few other bytes.
        assert!(bytes.len() < 8 * 31 + 41, "{}", bytes.len());
        let firmware: ChainParams<List<16>, List<8>> = read_block(bytes).unwrap();
        let OperatorParams::Pi(pi) = &firmware.operator else { panic!("{firmware:?}") };
        assert_eq!(pi.weights.as_slice(), (1..=10).map(|i| 0.1 / f64::from(i)).collect::<Vec<_>>());
        assert_eq!(firmware.effects.creep.unwrap().shares.as_slice(), [0.01, 0.02]);
        let again: ChainParams<Vec<f64>> = read_block(bytes).unwrap();
        assert_eq!(again, host);
    }

    /// The documentation states this size for a triangle of 24 × 24.
    #[test]
    fn parameters_with_a_triangle_take_8_kb() {
        let bytes = size_of::<ChainParams<List<300>, List<8>>>();
        assert!(bytes <= 8_250, "{bytes}");
    }

    /// Returns a block with this payload and a valid checksum.
    fn block_of(payload: &[u8]) -> Vec<u8> {
        let length = (payload.len() as u32).to_le_bytes();
        let mut bytes: Vec<u8> =
            MAGIC.into_iter().chain([BLOCK_VERSION]).chain(length).chain(payload.iter().copied()).collect();
        bytes.extend(CRC.checksum(&bytes).to_le_bytes());
        bytes
    }

    #[test]
    fn a_list_that_is_too_long_is_distinguished_from_damage() {
        let mut buffer = [0; 512];
        let bytes = write_block(&chain(10), &mut buffer).unwrap();
        assert_eq!(read_block::<List<8>, List<8>>(bytes), Err(BlockError::TooLong));
        assert_eq!(read_block::<List<16>, List<1>>(bytes), Err(BlockError::TooLong));
        let payload = bytes[HEAD..bytes.len() - TAIL].to_vec();
        // Too few bytes, too many, and an invalid tag of an option (the last byte before the sign, the sensor zero and
        // the range of the input is the tag of the absent interference).
        let mut option = payload.clone();
        option[payload.len() - 26] = 7;
        for broken in [payload[..payload.len() - 1].to_vec(), [&payload[..], &[0]].concat(), option] {
            assert_eq!(read_block::<List<16>, List<8>>(&block_of(&broken)), Err(BlockError::Malformed));
        }
        read_block::<List<16>, List<8>>(&block_of(&payload)).unwrap();
    }

    #[test]
    fn every_flipped_bit_and_every_truncation_is_detected() {
        let mut buffer = [0; 512];
        let bytes = write_block(&chain(3), &mut buffer).unwrap().to_vec();
        for i in 0..bytes.len() {
            assert!(read_block::<List<16>, List<8>>(&bytes[..i]).is_err());
            for bit in 0..8 {
                let mut broken = bytes.clone();
                broken[i] ^= 1 << bit;
                assert!(read_block::<List<16>, List<8>>(&broken).is_err(), "byte {i}, bit {bit}");
            }
        }
        assert_eq!(write_block(&chain(3), &mut [0; 60]), Err(BlockError::NoRoom));
    }

    proptest! {
        #[test]
        fn no_bytes_cause_a_panic(body in prop::collection::vec(any::<u8>(), 0..300), whole: bool) {
            let bytes = block_of(&body);
            let _ = read_block::<List<16>, List<8>>(&bytes[..bytes.len() - if whole { 0 } else { TAIL }]);
        }
    }
}
