// SPDX-License-Identifier: MPL-2.0

//! Whom an operator or the application asked for.

use opencv::core::{Point2f, Rect2f};

use super::{Phase, Tracker};
use crate::vision::Observation;
use crate::vision::tracker::config::TargetRequest;
use crate::vision::tracker::geometry::{ASPECT, Frame, around};
use crate::vision::tracker::policy::clicked;
use crate::vision::tracker::tracks::Track;

impl Tracker {
    /// The numbers of the tracks that were asked for, by place or number, of which the first is meant that can be followed; at a place
    /// where nobody is seen, that of a new one.
    pub(super) fn requested(
        &mut self,
        request: TargetRequest,
        phase: &Phase,
        seen: &Observation,
        frame: Frame,
    ) -> Vec<u64> {
        let now = phase.target().unwrap_or(0);
        let numbers = || self.told_of(now).map(|track| track.id);
        match request {
            TargetRequest::Release => Vec::new(),
            TargetRequest::SelectTrack(id) => {
                let id = self.tracks.number_now(id);
                numbers().filter(|other| *other == id && id != now).collect()
            }
            TargetRequest::Next => {
                let mut others: Vec<_> = numbers().filter(|id| *id != now).collect();
                // After the last comes the first.
                others.sort_unstable_by_key(|id| (*id < now, *id));
                others
            }
            TargetRequest::Select(place) => {
                let place = frame.point_to_pixels(place);
                let shown = clicked(&self.tracks, place).map(Track::seen_bounds);
                let meant = shown.map(|shown| self.config.profile.body_at(place, shown));
                let bounds = meant.unwrap_or_else(|| self.box_at(place, frame));
                vec![self.tracks.number_at(seen, bounds, frame)]
            }
        }
    }

    fn box_at(&self, place: Point2f, frame: Frame) -> Rect2f {
        let height = self.config.manual_size as f32 * frame.height;
        around(place, ASPECT * height, height)
    }
}
