//! Kind and length at the beginning of each record.

/// Size of kind and length at the beginning of a record \[bytes\].
pub(super) const HEAD: usize = 9;

/// Splits off the first record of `bytes`; returns its kind, its body and the rest, or `None` if it is not complete.
pub(super) fn split(bytes: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (head, rest) = bytes.split_at_checked(HEAD)?;
    let (kind, length) = head.split_first()?;
    let length = usize::try_from(u64::from_le_bytes(length.try_into().ok()?)).ok()?;
    let (body, rest) = rest.split_at_checked(length)?;
    Some((*kind, body, rest))
}
