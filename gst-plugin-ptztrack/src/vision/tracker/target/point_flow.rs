// SPDX-License-Identifier: MPL-2.0

//! How a target moves from one picture to the next, by the points on its figure.

use opencv::core::{Point2f, Rect2f};

use super::{MAX_POINTS, spacing, window_for};
use crate::vision::Luma;
use crate::vision::lucas_kanade::Precision;
use crate::vision::tracker::corners::{self, CornerFinder, Search};
use crate::vision::tracker::ego_motion::EgoMotion;
use crate::vision::tracker::figure::FigureMap;
use crate::vision::tracker::flow::{Flow, Followed};
use crate::vision::tracker::geometry::{centre, in_ellipse, length, scaled};
use crate::vision::tracker::patch::{Patch, cut_around};
use crate::vision::tracker::points::Points;

/// Grey levels of mean absolute difference from which a point is lost, and pixels it may be off going forth and back.
const MAX_RESIDUAL: f32 = 25.0;
const MAX_RETURN_ERROR: f32 = 0.8;
/// The target is within twice the window of where it is expected, and what is left after so small a step is far below `NOISE`.
const HALVINGS: usize = 2;
const PRECISION: Precision = Precision { steps: 10, step: 0.03 };
/// Share of the points that must agree for them to be believed alone.
const BELIEVED_SHARE: f32 = 0.5;
/// New points are looked for when fewer than this share of them is left, every so many seconds.
const REPLENISH_SHARE: f32 = 0.7;
const REPLENISH_S: f32 = 0.16;
/// With fewer points the target starts with new ones.
const MIN_MEMBERS: usize = 4;
/// How likely a corner must lie on the figure to be followed.
const ON_FIGURE: f32 = 0.6;
/// Nobody changes their velocity faster than this, in heights of them per second squared: about 7 m/s².
const ACCELERATION: f32 = 4.0;
/// Deviation of the motion of what the points may lie on, pixels and shares of the height, as limbs swing; and of their mean.
const LIMB_NOISE: (f32, f32) = (1.0, 0.015);
const NOISE: (f32, f32) = (0.5, 0.005);

/// How the points of a target moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motion {
    /// Against the background, pixels.
    pub own: Point2f,
    /// Its deviation, pixels.
    pub deviation: f32,
    /// How far it is to be believed, 0 to 1.
    pub trust: f32,
}

/// The points of a target, and the pixels that they were found in.
pub(super) struct PointFlow {
    points: Points,
    patch: Patch,
    replenished_s: f32,
    /// Memory for the next picture.
    next: Patch,
    followed: Followed,
    finder: CornerFinder,
    taken: Vec<Point2f>,
    corners: Vec<Point2f>,
}

impl PointFlow {
    /// Of a target in `bounds`; `None` where it has no corner on its figure.
    pub fn new(luma: &Luma, bounds: Rect2f, figure: &FigureMap) -> opencv::Result<Option<Self>> {
        let patch = Patch::cut(luma, cut_around(luma, bounds), HALVINGS);
        if patch.is_empty() {
            return Ok(None);
        }
        let mut flow = Self {
            points: Points::default(),
            patch,
            next: Patch::default(),
            replenished_s: 0.0,
            followed: Followed::default(),
            finder: CornerFinder::default(),
            taken: Vec::new(),
            corners: Vec::new(),
        };
        flow.find_corners(bounds, figure)?;
        let found = corners::reject_outliers(std::mem::take(&mut flow.corners), 2.0);
        flow.points = Points::on_target(found.kept);
        flow.points.reject(found.rejected);
        Ok((flow.points.len() > 0).then_some(flow))
    }

    pub fn points(&self) -> &Points {
        &self.points
    }

    /// Follows the points of a target that was in `bounds`, and is expected to move by `expected` against the background, which moves
    /// as `ego`. `None` where too few are left.
    pub fn follow(
        &mut self,
        luma: &Luma,
        bounds: Rect2f,
        (ego, expected): (EgoMotion, Point2f),
        figure: &FigureMap,
        dt_s: f32,
    ) -> opencv::Result<Option<Motion>> {
        let carried = ego.at(centre(bounds));
        let moved = self.patch.as_cut().moved(luma, carried + expected);
        self.next.fill(luma, moved, HALVINGS);
        self.followed.begin(self.points.positions().map(|start| (start, ego.apply(start) + expected)));
        let flow = Flow {
            window: window_for(bounds, self.patch.step()),
            halvings: HALVINGS,
            precision: PRECISION,
            max_residual: MAX_RESIDUAL,
            max_return_error: Some(MAX_RETURN_ERROR),
        };
        flow.follow(&self.patch, &self.next, &mut self.followed);
        std::mem::swap(&mut self.patch, &mut self.next);
        let on_figure = |point| figure.at(point);
        let consensus = self.points.advance(&self.followed.found, ego, expected, bounds.height, on_figure);
        self.replenished_s += dt_s;
        Ok(consensus.map(|consensus| {
            let own = consensus.motion - carried;
            let of = |(pixels, share): (f32, f32)| pixels + share * bounds.height;
            // Points on whoever passes in front agree too; but no person turns so quickly.
            let turn = of(LIMB_NOISE) + ACCELERATION * bounds.height * dt_s * dt_s;
            let innovation = length(own - expected) / turn;
            let trust =
                (consensus.share / BELIEVED_SHARE).min(1.0) * (-0.125 * innovation * innovation).exp();
            Motion { own, deviation: of(NOISE), trust }
        }))
    }

    /// The target is in `bounds`; where that is `sure`, points that were lost are made up for. Otherwise what is there may be whoever
    /// passes in front.
    pub fn settle(
        &mut self,
        luma: &Luma,
        bounds: Rect2f,
        figure: &FigureMap,
        sure: bool,
    ) -> opencv::Result<()> {
        let wanted = cut_around(luma, bounds);
        if !self.patch.as_cut().serves(&wanted) {
            self.patch.fill(luma, wanted, HALVINGS);
        }
        let body = scaled(bounds, 1.2, 1.1);
        self.points.retain(|point| in_ellipse(body, point));
        if !sure {
            return Ok(());
        }
        if self.points.members().count() < MIN_MEMBERS {
            self.points = Points::default();
            self.find_corners(bounds, figure)?;
            self.points = Points::on_target(self.corners.drain(..));
        } else if (self.points.len() as f32) < REPLENISH_SHARE * MAX_POINTS as f32
            && self.replenished_s >= REPLENISH_S
        {
            self.replenished_s = 0.0;
            self.find_corners(bounds, figure)?;
            self.points.propose(self.corners.drain(..));
        }
        Ok(())
    }

    /// Finds corners on the figure.
    fn find_corners(&mut self, bounds: Rect2f, figure: &FigureMap) -> opencv::Result<()> {
        let body = corners::ellipse(scaled(bounds, 0.95, 1.0));
        let Self { points, patch, finder, taken, corners, .. } = self;
        taken.clear();
        taken.extend(points.positions());
        let count = MAX_POINTS.saturating_sub(taken.len());
        let search = Search { contour: &body, taken, count, distance: spacing(bounds) };
        finder.find(patch, &search, corners)?;
        corners.retain(|corner| figure.at(*corner) >= ON_FIGURE);
        Ok(())
    }
}
