// SPDX-License-Identifier: MPL-2.0

//! Who was here: whoever comes back within the time of memory has their old number.

use opencv::core::Rect2f;

use super::looks::Views;
use super::track::Track;
use crate::vision::tracker::ego_motion::EgoMotion;
use crate::vision::tracker::geometry::{centre, length};

/// How alike by colours somebody must be to be taken for who they were: most people in dark clothes are alike by four fifths.
const SAME: f32 = 0.85;
/// How far they may have come, in heights: at once, and in every second.
const REACH: (f32, f32) = (1.0, 1.5);
/// By how much, as a factor, their height may have changed.
const RESIZED: f32 = 1.8;
/// Most who are remembered.
const MAX_REMEMBERED: usize = 32;

#[derive(Debug)]
struct Remembered {
    id: u64,
    views: Views,
    bounds: Rect2f,
    ago_s: f64,
}

/// Who was seen and is no more.
#[derive(Debug, Default)]
pub(super) struct Memory(Vec<Remembered>);

impl Memory {
    /// So much time passes, in which the background moves as `ego`; who was seen before `memory_s` is forgotten.
    pub fn pass(&mut self, ego: Option<EgoMotion>, dt_s: f64, memory_s: f64) {
        for one in &mut self.0 {
            one.ago_s += dt_s;
            one.bounds = ego.map_or(one.bounds, |ego| ego.apply_to(one.bounds));
        }
        self.0.retain(|one| one.ago_s <= memory_s);
    }

    pub fn remember(&mut self, track: &Track) {
        if self.0.len() == MAX_REMEMBERED {
            self.0.remove(0);
        }
        self.0.push(Remembered {
            id: track.id,
            views: track.views.clone(),
            bounds: track.bounds(),
            ago_s: track.journey.unseen_s,
        });
    }

    /// The number of who is most like a new track and may have come there, and is then no longer among those who are gone.
    pub fn recall(&mut self, track: &Track) -> Option<u64> {
        let bounds = track.bounds();
        let likely = |one: &Remembered| {
            let ratio = bounds.height / one.bounds.height.max(1.0);
            let off = length(centre(bounds) - centre(one.bounds)) / one.bounds.height.max(1.0);
            let reach = REACH.0 + REACH.1 * one.ago_s as f32;
            (off <= reach && (1.0 / RESIZED..=RESIZED).contains(&ratio))
                .then(|| one.views.resemblance(&track.views))?
        };
        let alike = self.0.iter().enumerate().filter_map(|(index, one)| Some((index, likely(one)?)));
        let (index, _) = alike.filter(|(_, alike)| *alike >= SAME).max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(self.0.remove(index).id)
    }

    pub fn clear(&mut self) {
        self.0.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::tracker::geometry::Frame;
    use crate::vision::tracker::tracks::looks::Looks;
    use crate::vision::tracker::tracks::region::Region;

    /// Somebody in dark clothes, of which that share is white.
    fn somebody(x: f32, white: f32) -> Track {
        let mut region = Region::new(Rect2f::new(x, 100.0, 40.0, 100.0), Vec::new(), false);
        region.looks = Looks::of_greys(&[(40, 1.0 - white), (200, white)]);
        Track::new(0, &region, Frame { width: 640.0, height: 480.0 })
    }

    /// The number of who is seen `after_s` later at `x`, where number 5 went away in dark clothes in the middle.
    fn recalled(x: f32, white: f32, after_s: f64) -> Option<u64> {
        let mut memory = Memory::default();
        let mut gone = somebody(300.0, 0.0);
        gone.id = 5;
        memory.remember(&gone);
        memory.pass(None, after_s, 60.0);
        let number = memory.recall(&somebody(x, white));
        assert!(number.is_none() || memory.recall(&somebody(x, white)).is_none(), "given twice");
        number
    }

    #[test]
    fn whoever_comes_back_has_their_old_number() {
        assert_eq!(recalled(350.0, 0.1, 2.0), Some(5));
        assert_eq!(recalled(600.0, 0.0, 2.0), Some(5), "three heights in two seconds");
        assert_eq!(recalled(350.0, 0.0, 70.0), None, "forgotten");
    }

    #[test]
    fn who_comes_after_them_is_somebody_else() {
        assert_eq!(recalled(350.0, 0.3, 2.0), None, "a third of what they wear is white");
        assert_eq!(recalled(600.0, 0.0, 0.5), None, "nobody runs so fast");
    }
}
