//! The Python wheel `hyst` grows here; it holds nothing yet.
