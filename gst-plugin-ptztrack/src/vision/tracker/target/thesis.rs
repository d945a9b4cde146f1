// SPDX-License-Identifier: MPL-2.0

//! Thesis 3.5 as written: corners in the contour, Lucas-Kanade in a patch, the mean of the points, mean-shift.

use opencv::core::{Point2f, Rect2f};

use super::{Estimate, Follow, MAX_POINTS, Sight, is_gone, spacing, window_for};
use crate::vision::lucas_kanade::Precision;
use crate::vision::tracker::corners::{self, CornerFinder, Search};
use crate::vision::tracker::flow::{Flow, Followed};
use crate::vision::tracker::geometry::{around, centre, mean};
use crate::vision::tracker::grey_histogram::{GreyHistogram, near_the_middle};
use crate::vision::tracker::patch::{Patch, cut_around};
use crate::vision::tracker::points::Points;
use crate::vision::tracker::tracks::{Track, Tracks};
use crate::vision::{Luma, Observation};

/// Standard deviations that a first corner may lie from the mean of all: "a 20% range from the standard deviation".
const DEVIATION_RANGE: f32 = 1.2;
/// Grey levels of mean absolute difference from which a point is lost.
const MAX_RESIDUAL: f32 = 20.0;
/// Nobody says where a target goes while the camera turns: it is looked for far off, and to the end.
const HALVINGS: usize = 4;
const PRECISION: Precision = Precision { steps: 20, step: 0.03 };
/// How far the centre of mass may lie from the middle of the box, as a share of its sides.
const CENTROID_REACH: f32 = 0.5;
/// Time constant of the velocity that says where to look next, seconds.
const VELOCITY_TIME_S: f32 = 0.35;

/// A target followed by its points alone.
pub(in super::super) struct Thesis {
    estimate: Estimate,
    points: Points,
    patch: Patch,
    greys: Option<GreyHistogram>,
    followed: Followed,
}

impl Thesis {
    /// Takes up a track, whose `contour` may be empty; `None` where it has no corner.
    pub fn acquire(luma: &Luma, track: &Track, contour: &[Point2f]) -> opencv::Result<Option<Self>> {
        let bounds = track.seen_bounds();
        let patch = Patch::cut(luma, cut_around(luma, bounds), HALVINGS);
        if patch.is_empty() {
            return Ok(None);
        }
        let ellipse = corners::ellipse(bounds);
        let contour = if contour.len() >= 3 { contour } else { &ellipse[..] };
        let search = Search { contour, taken: &[], count: MAX_POINTS, distance: spacing(bounds) };
        let mut corners = Vec::new();
        CornerFinder::default().find(&patch, &search, &mut corners)?;
        let found = corners::reject_outliers(corners, DEVIATION_RANGE);
        if found.kept.is_empty() {
            return Ok(None);
        }
        let greys = GreyHistogram::new(&patch, &found.kept);
        let mut points = Points::on_target(found.kept);
        points.reject(found.rejected);
        let estimate = Estimate::begun(bounds, track.velocity());
        let mut target = Self { estimate, points, patch, greys, followed: Followed::default() };
        target.estimate.centroid = target.centre_of_mass()?;
        Ok(Some(target))
    }

    fn centre_of_mass(&self) -> opencv::Result<Point2f> {
        let bounds: Rect2f = self.estimate.bounds;
        let Some(greys) = &self.greys else { return Ok(centre(bounds)) };
        let mass = greys.centre_of_mass(&self.patch, bounds)?.unwrap_or_else(|| centre(bounds));
        Ok(near_the_middle(mass, bounds, CENTROID_REACH))
    }
}

impl Follow for Thesis {
    fn follow(&mut self, seen: &Observation, dt_s: f32, _: &mut Tracks, _: u64) -> opencv::Result<Sight> {
        let luma = &seen.luma;
        let expected = self.estimate.own_velocity * dt_s;
        let start = centre(self.estimate.bounds);
        let next = Patch::cut(luma, self.patch.as_cut().moved(luma, expected), HALVINGS);
        self.followed.begin(self.points.positions().map(|start| (start, start + expected)));
        let flow = Flow {
            window: window_for(self.estimate.bounds, self.patch.step()),
            halvings: HALVINGS,
            precision: PRECISION,
            max_residual: MAX_RESIDUAL,
            max_return_error: None,
        };
        flow.follow(&self.patch, &next, &mut self.followed);
        let consensus = self.points.average(&self.followed.found);
        self.patch = next;
        if let Some(consensus) = consensus {
            self.estimate.bounds += consensus.motion;
            self.estimate.confidence = consensus.share;
        }
        let bounds = self.estimate.bounds;
        if is_gone(bounds, luma) {
            return Ok(Sight::Gone);
        }
        if consensus.is_none() {
            // The thesis loses what it does not see.
            return Ok(Sight::Gone);
        }
        let own = (centre(bounds) - start) / dt_s;
        self.estimate.own_velocity += (own - self.estimate.own_velocity) * (dt_s / (dt_s + VELOCITY_TIME_S));
        if let Some(middle) = mean(self.points.positions()) {
            self.estimate.bounds = around(middle, bounds.width, bounds.height);
        }
        let wanted = cut_around(luma, self.estimate.bounds);
        if self.patch.as_cut() != wanted {
            self.patch.fill(luma, wanted, HALVINGS);
        }
        self.estimate.centroid = self.centre_of_mass()?;
        Ok(Sight::Seen)
    }

    fn estimate(&self) -> &Estimate {
        &self.estimate
    }

    fn points(&self) -> &Points {
        &self.points
    }
}
