//! Everything that computes on pictures: plain types, tested by themselves.

mod draw;
mod luma;
mod scene;
mod tracker;
mod trail;

pub use draw::{Colour, Patch, Shape, draw, text_width};
pub use luma::{Luma, LumaError};
pub use scene::{FrameSize, Parts, Seen, Spot, scene};
pub use tracker::{Choice, Config, Detection, Profile, Report, Tracker};
pub use trail::Trail;
