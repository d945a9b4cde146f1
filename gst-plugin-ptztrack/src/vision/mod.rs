//! Everything that computes on pictures: plain types, tested by themselves.

mod luma;

pub use luma::{Luma, LumaError};
