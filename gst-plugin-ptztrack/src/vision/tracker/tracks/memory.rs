// SPDX-License-Identifier: MPL-2.0

//! Who was here: whoever comes back within the time of memory has their old number.

use opencv::core::Rect2f;

use super::looks::Views;
use super::track::Track;
use crate::vision::tracker::ego_motion::EgoMotion;
use crate::vision::tracker::geometry::{centre, length};

/// How alike by colours somebody must be to be taken for who they were.
const SAME: f32 = 0.8;
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
