// SPDX-License-Identifier: MPL-2.0

//! What goes into a tracker and what comes out of it, in frame sizes.

use std::time::Duration;

use opencv::core::Point2f;
use ptztrack_contract::{
    Feature, Point, Rect, ReleaseReason, TargetChange, TargetState, TrackChange, TrackState, Vector,
};

use super::ego_motion::EgoMotion;
use super::geometry::{Frame, centre};
use super::group::GroupEstimate;
use super::target::Follow;
use super::tracks::Track;

/// Something that a detector saw, in frame sizes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Detection {
    /// Its box.
    pub bounds: Rect,
    /// Polygon around it; empty where only the box is known.
    pub contour: Vec<Point>,
    /// Whether it lies outside of the detector's zones: nobody is chosen there.
    pub outside: bool,
}

/// What the tracker knows after one frame, in frame sizes (per second).
#[derive(Debug, Clone, PartialEq)]
pub struct Tracked {
    /// What it does.
    pub state: TargetState,
    /// What happened in this frame, in order.
    pub changes: Vec<TargetChange>,
    /// Who was released, where somebody was: another may be the target in the same picture.
    pub released: Option<Released>,
    /// Number of whom an operator asked for and who cannot be followed, as no corner is seen of them.
    pub without_corners: Option<u64>,
    /// Number of the target, from 1; 0 where there is none.
    pub id: u64,
    /// Box of the target; predicted while it is hidden.
    pub bounds: Rect,
    /// Whether that holds several people who are followed.
    pub is_group: bool,
    /// Its centre of mass (3.15).
    pub centroid: Point,
    /// Its motion in the picture, camera motion included.
    pub velocity: Vector,
    /// Motion of the background at its place, where that could be seen.
    pub ego_velocity: Option<Vector>,
    /// The logarithm of the background's magnification, per second, where that could be seen.
    pub ego_zoom: Option<f64>,
    /// For how long the picture has shown the same, where that was seen.
    pub unchanged_for: Option<Duration>,
    /// 0 to 1.
    pub confidence: f64,
    /// The feature points, kept and rejected.
    pub features: Vec<Feature>,
    /// Everybody who is seen.
    pub tracks: Vec<ptztrack_contract::Track>,
    /// Who came and went in this frame, by number; who merged, with the number that they go on under.
    pub track_changes: Vec<(TrackChange, u64, Option<u64>)>,
}

/// A target that was let go, as it was last seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Released {
    /// Why.
    pub reason: ReleaseReason,
    /// Its number.
    pub id: u64,
    /// Its box.
    pub bounds: Rect,
    /// Its centre of mass.
    pub centroid: Point,
    /// In the picture, the camera's own motion included.
    pub velocity: Vector,
    /// 0 to 1.
    pub confidence: f64,
}

impl Tracked {
    /// Tells of a target of that number; who came and went stays.
    pub(super) fn tell_of(&mut self, state: TargetState, id: u64, target: &dyn Follow, frame: Frame) {
        let feature = |kept: bool| move |position: Point2f| Feature { position: frame.point(position), kept };
        let points = target.points();
        let kept = points.members().map(feature(true));
        let rejected = points.rejected().iter().copied().map(feature(false));
        self.features.clear();
        self.features.extend(kept.chain(rejected));
        let estimate = target.estimate();
        let ego = estimate.ego_velocity;
        (self.state, self.id) = (state, id);
        self.bounds = frame.rect(estimate.bounds);
        self.centroid = frame.point(estimate.centroid);
        self.velocity = frame.vector(estimate.own_velocity + ego.unwrap_or_default());
        self.ego_velocity = ego.map(|ego| frame.vector(ego));
        self.confidence = f64::from(estimate.confidence);
    }

    /// Whom it tells of is let go.
    pub(super) fn release(&mut self, reason: ReleaseReason) {
        let Self { id, bounds, centroid, velocity, confidence, .. } = *self;
        self.released = Some(Released { reason, id, bounds, centroid, velocity, confidence });
        self.changes.push(TargetChange::Released);
    }

    /// Tells how the background moves, `dt_s` after the last picture: without a target in the middle of the picture.
    pub(super) fn tell_of_background(&mut self, ego: EgoMotion, dt_s: f64, frame: Frame) {
        let middle = centre(frame.bounds());
        self.ego_velocity.get_or_insert_with(|| frame.vector(ego.at(middle) / dt_s as f32));
        self.ego_zoom =
            Some(f64::from(ego.magnification(middle)).ln() / dt_s).filter(|zoom| zoom.is_finite());
    }

    /// Tells of a group in place of the target in it.
    pub(super) fn become_group(&mut self, group: &GroupEstimate, frame: Frame) {
        let (own, ego) = (frame.vector(group.own_velocity), self.ego_velocity.unwrap_or_default());
        self.bounds = frame.rect(group.bounds);
        self.is_group = group.people > 1;
        self.centroid = frame.point(centre(group.bounds));
        self.velocity = Vector { x: own.x + ego.x, y: own.y + ego.y };
    }
}

/// What is told of a track.
pub(super) fn reported(track: &Track, target: u64, frame: Frame) -> ptztrack_contract::Track {
    ptztrack_contract::Track {
        id: track.id,
        bounds: frame.rect(track.bounds()),
        velocity: frame.vector(track.velocity()),
        state: if track.is_alone() {
            TrackState::Seen
        } else if track.is_shared() {
            TrackState::Shared
        } else {
            TrackState::Hidden
        },
        confidence: f64::from(track.confidence()),
        is_target: track.id == target,
    }
}

impl Default for Tracked {
    /// There is no target.
    fn default() -> Self {
        Self {
            state: TargetState::Searching,
            changes: Vec::new(),
            released: None,
            without_corners: None,
            id: 0,
            bounds: Rect::default(),
            is_group: false,
            centroid: Point::default(),
            velocity: Vector::default(),
            ego_velocity: None,
            ego_zoom: None,
            unchanged_for: None,
            confidence: 0.0,
            features: Vec::new(),
            tracks: Vec::new(),
            track_changes: Vec::new(),
        }
    }
}
