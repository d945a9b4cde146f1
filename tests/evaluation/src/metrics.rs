//! The metrics of thesis 5.2.
