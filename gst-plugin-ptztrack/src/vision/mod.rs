//! Everything that computes on pictures: plain types, tested by themselves.

mod draw;
mod luma;
mod scene;
mod trail;

pub use draw::{Colour, Patch, Shape, draw, text_width};
pub use luma::{Luma, LumaError};
pub use scene::{FrameSize, Parts, Seen, Spot, scene};
pub use trail::Trail;
