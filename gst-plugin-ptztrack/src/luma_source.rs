//! Reads the luma of any supported video frame.
