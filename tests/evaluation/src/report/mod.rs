//! What runs are written down as.
