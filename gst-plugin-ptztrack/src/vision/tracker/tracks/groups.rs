// SPDX-License-Identifier: MPL-2.0

//! People who are seen in one region: whose its sides are, and who is who when they part.

use opencv::core::Rect2f;

use super::region::Region;
use super::track::{Evidence, Track};
use crate::vision::tracker::geometry::centre;

/// A region that is so many times as wide as the widest of them shows them side by side; in a narrower one the nearest hides the
/// others.
const WIDER: f32 = 1.3;
/// Seconds for which it is weighed who is who after they parted.
const WEIGHED_S: f64 = 1.0;
/// Sum of likenesses over that time from which they are taken for exchanged, seconds.
const EXCHANGED: f64 = 0.08;
/// And from which, either way, no more time is needed.
const CLEAR: f64 = 0.25;

/// Which of its `members` the sides of a region (left, top, right, bottom) belong to.
pub(super) fn owners_of_sides(tracks: &[Track], members: &[usize], bounds: Rect2f) -> [Option<usize>; 4] {
    let by = |value: fn(Rect2f) -> f32| {
        let of = move |index: &&usize| value(tracks[**index].bounds());
        members.iter().max_by(|a, b| of(a).total_cmp(&of(b))).copied()
    };
    let nearest = by(|bounds| bounds.br().y);
    let widest = members.iter().map(|&index| tracks[index].bounds().width).fold(0.0, f32::max);
    if bounds.width < WIDER * widest {
        return [nearest; 4];
    }
    let leftmost = by(|bounds| -centre(bounds).x);
    let rightmost = by(|bounds| centre(bounds).x);
    let topmost = by(|bounds| -bounds.y);
    [leftmost, topmost, rightmost, nearest]
}

/// Two who parted, and how much likelier it is that they are not exchanged.
#[derive(Debug)]
struct Parting {
    ids: (u64, u64),
    kept: f64,
    age_s: f64,
}

/// Who parted lately. Until it is decided who is who, nothing is learned of their looks.
#[derive(Debug, Default)]
pub(super) struct Partings(Vec<Parting>);

impl Partings {
    /// Takes note of who is seen alone again, weighs who is who by what was known before they met, and exchanges the numbers and
    /// looks of those who were taken for each other.
    pub fn update(&mut self, tracks: &mut [Track], regions: &[Region], dt_s: f64) {
        for index in 0..tracks.len() {
            let mut companions = std::mem::take(&mut tracks[index].companions);
            companions.retain(|id| tracks.iter().any(|track| track.id == *id && !track.is_gone()));
            tracks[index].companions = companions;
        }
        self.begin(tracks);
        self.0.retain_mut(|parting| {
            let place = |id: u64| tracks.iter().position(|track| track.id == id);
            let (Some(one), Some(other)) = (place(parting.ids.0), place(parting.ids.1)) else { return false };
            parting.age_s += dt_s;
            if let Some(kept) = likelier_kept(&tracks[one], &tracks[other], regions) {
                parting.kept += f64::from(kept) * dt_s;
            }
            let decided = parting.age_s >= WEIGHED_S || parting.kept.abs() >= CLEAR;
            if decided {
                if parting.kept <= -EXCHANGED {
                    exchange(tracks, one, other);
                }
                let (one_id, other_id) = parting.ids;
                tracks[one].companions.retain(|id| *id != one_id && *id != other_id);
                tracks[other].companions.retain(|id| *id != one_id && *id != other_id);
            }
            !decided
        });
    }

    fn begin(&mut self, tracks: &[Track]) {
        for one in tracks.iter().filter(|track| matches!(track.evidence, Evidence::Alone(_))) {
            for other in tracks.iter().filter(|other| {
                one.id < other.id
                    && matches!(other.evidence, Evidence::Alone(_))
                    && (one.companions.contains(&other.id) || other.companions.contains(&one.id))
            }) {
                let ids = (one.id, other.id);
                if !self.0.iter().any(|parting| parting.ids == ids) {
                    self.0.push(Parting { ids, kept: 0.0, age_s: 0.0 });
                }
            }
        }
    }

    pub fn clear(&mut self) {
        self.0.clear();
    }
}

/// Sum of the likenesses as they are, less that were they exchanged.
fn likelier_kept(one: &Track, other: &Track, regions: &[Region]) -> Option<f32> {
    let (Evidence::Alone(of_one), Evidence::Alone(of_other)) = (one.evidence, other.evidence) else {
        return None;
    };
    let alike = |track: &Track, region: usize| track.views.likeness(&regions.get(region)?.looks);
    Some(alike(one, of_one)? + alike(other, of_other)? - alike(one, of_other)? - alike(other, of_one)?)
}

fn exchange(tracks: &mut [Track], one: usize, other: usize) {
    let [one, other] = match tracks.get_disjoint_mut([one, other]) {
        Ok(both) => both,
        Err(_) => return,
    };
    std::mem::swap(&mut one.id, &mut other.id);
    std::mem::swap(&mut one.views, &mut other.views);
    std::mem::swap(&mut one.companions, &mut other.companions);
    std::mem::swap(&mut one.beside_target_s, &mut other.beside_target_s);
}
