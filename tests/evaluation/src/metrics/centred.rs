// SPDX-License-Identifier: MPL-2.0

//! How soon the camera has the person in the middle, and how well it keeps them there.

use super::{counted_dgc, d_gc, is_out, mean};
use crate::record::FrameRecord;

/// A person is in the middle where d_gc is below this ...
const MIDDLE: f64 = 0.1;
/// ... and stays so for as long as this, seconds.
const STAYS_S: f64 = 0.5;

/// From the first counted picture to the first of half a second of pictures in all of which d_gc < 0.1.
pub fn centred_after_s(frames: &[FrameRecord]) -> Option<f64> {
    Some(frames.get(begin(frames)?)?.time_s - frames.first()?.time_s)
}

/// Mean of d_gc from then on, over the pictures in which the middle of the person is inside.
pub fn mean_dgc_centred(frames: &[FrameRecord]) -> Option<f64> {
    mean(&counted_dgc(&frames[begin(frames)?..]).collect::<Vec<_>>())
}

fn begin(frames: &[FrameRecord]) -> Option<usize> {
    let central =
        |frame: &FrameRecord| !is_out(frame) && d_gc(frame).is_some_and(|distance| distance < MIDDLE);
    let mut begin = 0;
    for stretch in frames.chunk_by(|a, b| central(a) == central(b)) {
        let spans = stretch.last().map_or(0.0, |last| last.time_s - stretch[0].time_s);
        if central(&stretch[0]) && spans >= STAYS_S {
            return Some(begin);
        }
        begin += stretch.len();
    }
    None
}
