// SPDX-License-Identifier: MPL-2.0

//! Where much changes and nobody comes of it: a screen, a curtain or a lamp changes much and stays in its place.

use opencv::core::Rect2f;

use super::track::Track;
use crate::vision::tracker::ego_motion::EgoMotion;
use crate::vision::tracker::geometry::share_inside;

/// Time constants of how restless a place is believed to be, seconds: while something changes there, and after.
const RISE_S: f64 = 0.4;
const DECAY_S: f64 = 120.0;
/// Most places that are remembered, and belief below which one is forgotten.
const MAX_PLACES: usize = 64;
const LEAST: f64 = 0.01;

/// Places of the background, and how restless each is: 0 to 1.
#[derive(Debug, Default)]
pub(super) struct RestlessPlaces(Vec<(Rect2f, f64)>);

impl RestlessPlaces {
    /// Carries them into the next picture. Where nobody knows how the camera moved, nobody knows any more where they are.
    pub fn carry(&mut self, ego: Option<EgoMotion>, dt_s: f64) {
        let Some(ego) = ego else { return self.0.clear() };
        for (place, belief) in &mut self.0 {
            *place = ego.apply_to(*place);
            *belief *= (-dt_s / DECAY_S).exp();
        }
        self.0.retain(|(_, belief)| *belief > LEAST);
    }

    /// Takes note of who is seen and goes nowhere.
    pub fn watch<'a>(&mut self, tracks: impl Iterator<Item = &'a Track>, dt_s: f64) {
        let rise = 1.0 - (-dt_s / RISE_S).exp();
        for stays in tracks.filter(|track| track.goes_nowhere()).map(Track::bounds) {
            let most = |place: &Rect2f| (*place & stays).area();
            match self.0.iter_mut().max_by(|a, b| most(&a.0).total_cmp(&most(&b.0))) {
                Some((place, belief)) if share_inside(stays, *place) > 0.5 => {
                    *belief += rise * (1.0 - *belief)
                }
                _ => self.0.push((stays, rise)),
            }
        }
        let surplus = self.0.len().saturating_sub(MAX_PLACES);
        self.0.drain(..surplus);
    }

    /// How restless the place of `bounds` is, 0 to 1.
    pub fn at(&self, bounds: Rect2f) -> f32 {
        let beliefs = self.0.iter().map(|(place, belief)| *belief as f32 * share_inside(bounds, *place));
        beliefs.fold(0.0, f32::max).min(1.0)
    }

    pub fn clear(&mut self) {
        self.0.clear();
    }
}
