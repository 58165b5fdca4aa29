//! Compression filters that h5py writes and the HDF5 crate does not have, and messages about other filters.

use std::io::Read;

use hdf5_reader::FilterRegistry;
use hdf5_reader::error::Error;

/// `compression="lzf"` of h5py.
const LZF: u16 = 32_000;
/// `Zstd()` of hdf5plugin.
const ZSTANDARD: u16 = 32_015;

/// Returns the filters of the crate and these two. None returns more than `most` bytes.
pub(super) fn registry(most: usize) -> FilterRegistry {
    let mut registry = FilterRegistry::new();
    let lzf_of = move |data: &[u8], settings: &[u32]| {
        // The third setting is the size of the chunk.
        let size = settings.get(2).map_or(most, |size| most.min(*size as usize));
        lzf(data, size).ok_or_else(|| Error::InvalidData("damaged LZF data".to_owned()))
    };
    registry.register(LZF, Box::new(move |filter, data, _| lzf_of(data, &filter.client_data)));
    registry.register(
        ZSTANDARD,
        Box::new(move |_, data, _| {
            let mut own = Vec::new();
            zstd::stream::read::Decoder::new(data)?.take(most as u64).read_to_end(&mut own)?;
            Ok(own)
        }),
    );
    registry
}

/// Decodes LZF (Lehmann): runs of literal bytes, and copies of earlier bytes.
fn lzf(data: &[u8], most: usize) -> Option<Vec<u8>> {
    let mut own = Vec::with_capacity(most.min(data.len().saturating_mul(4)));
    let mut at = 0;
    while let Some(control) = data.get(at).map(|byte| usize::from(*byte)) {
        at += 1;
        if control < 32 {
            own.extend_from_slice(data.get(at..=at + control)?);
            at += control + 1;
        } else {
            let mut length = control >> 5;
            if length == 7 {
                length += usize::from(*data.get(at)?);
                at += 1;
            }
            let back = ((control & 31) << 8 | usize::from(*data.get(at)?)) + 1;
            at += 1;
            let from = own.len().checked_sub(back)?;
            for k in 0..length + 2 {
                own.push(own[from + k]);
            }
        }
        if own.len() > most {
            return None;
        }
    }
    Some(own)
}

/// Returns the message about an object that cannot be read.
pub(super) fn unreadable(path: &str, error: &Error) -> String {
    let reason = innermost(error);
    match reason {
        Error::UnsupportedFilter(_) => format!(
            "dataset {path} is compressed by a filter that is not supported ({reason}); rewrite the file with h5repack -f GZIP=4 in.h5 out.h5, \
             or in Python: import h5py, hdf5plugin; h5py.File('out.h5', 'w')['{}'] = h5py.File('in.h5')['{path}'][:]",
            path.trim_start_matches('/')
        ),
        _ => format!("{path} cannot be read ({reason}); the file is damaged or cut off: copy it again"),
    }
}

/// Returns the innermost error, without the paths around it.
pub(super) fn innermost(error: &Error) -> &Error {
    match error {
        Error::Context { source, .. } => innermost(source),
        error => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lzf_is_unpacked() {
        // Two literals, then a copy of five bytes from two bytes back.
        assert_eq!(lzf(&[1, b'a', b'b', 3 << 5, 1], 64).unwrap(), b"abababa");
        // A long copy has one more length byte.
        assert_eq!(lzf(&[0, b'x', 7 << 5, 3, 0], 64).unwrap(), [b'x'; 13]);
        assert_eq!(lzf(&[0, b'x', 7 << 5, 200, 0], 64), None);
        assert_eq!(lzf(&[5, b'a'], 64), None);
        assert_eq!(lzf(&[32, 0], 64), None);
    }

    #[test]
    fn the_message_about_an_unknown_filter_states_what_to_do() {
        let error = Error::UnsupportedFilter("filter id 32001".into()).with_context("x");
        let message = unreadable("/run/x", &error);
        assert!(message.contains("h5repack") && message.contains("/run/x") && message.contains("32001"), "{message}");
    }
}
