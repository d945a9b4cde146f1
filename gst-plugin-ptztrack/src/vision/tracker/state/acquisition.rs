// SPDX-License-Identifier: MPL-2.0

//! How a track becomes the target, and how the target is let go.

use ptztrack_contract::{ReleaseReason, TargetChange, TargetState};

use super::{Phase, Target, Tracker};
use crate::vision::Observation;
use crate::vision::tracker::config::{Config, TargetRequest};
use crate::vision::tracker::dwell_time::DwellTime;
use crate::vision::tracker::geometry::Frame;
use crate::vision::tracker::report::Tracked;

/// Of those who may be followed so many are tried in one picture: to look for corners takes time.
const TRIES: usize = 4;

impl Tracker {
    /// Carries out what was asked for.
    pub(super) fn obey(
        &mut self,
        phase: Phase,
        seen: &Observation,
        frame: Frame,
        tracked: &mut Tracked,
    ) -> opencv::Result<Phase> {
        let Some(request) = self.request.take() else { return Ok(phase) };
        if let TargetRequest::Release = request {
            self.group.members().for_each(|id| self.policy.release(id));
            self.group.disband();
            return Ok(self.let_go(phase, ReleaseReason::Request, frame, tracked));
        }
        let requested = self.requested(request, &phase, seen, frame);
        for &id in &requested {
            if let Some(target) = self.acquire(seen, id)? {
                self.let_go(phase, ReleaseReason::Request, frame, tracked);
                return Ok(self.begin(target, frame, tracked));
            }
        }
        tracked.without_corners = requested.first().copied();
        Ok(phase)
    }

    /// Lets the target go, where there is one.
    pub(super) fn let_go(
        &mut self,
        phase: Phase,
        reason: ReleaseReason,
        frame: Frame,
        tracked: &mut Tracked,
    ) -> Phase {
        let target = match phase {
            Phase::Tracking(target) | Phase::Occluded(target, _) => target,
            Phase::Searching(lost) => {
                // Nobody is to go after them any more.
                if let Some(lost) = lost {
                    (tracked.state, tracked.id) = (TargetState::Searching, lost);
                }
                return Phase::Searching(None);
            }
        };
        if reason != ReleaseReason::Stationary {
            // It may move, and would be taken again at once.
            self.policy.release(target.id);
        }
        tracked.tell_of(TargetState::Searching, target.id, &*target.follow, frame);
        tracked.features.clear();
        tracked.release(reason);
        Phase::Searching(None)
    }

    /// Takes up whom the policy chooses, who was `lost` before all others.
    pub(super) fn acquire_chosen(
        &mut self,
        seen: &Observation,
        lost: Option<u64>,
        frame: Frame,
        tracked: &mut Tracked,
    ) -> opencv::Result<Phase> {
        let Config { choice, must_travel, .. } = self.config;
        let choices = self.policy.choices(&self.tracks, choice, lost, must_travel, frame);
        let ids: Vec<u64> = choices.iter().map(|track| track.id).take(TRIES).collect();
        for id in ids {
            let Some(mut target) = self.acquire(seen, id)? else { continue };
            if must_travel {
                target.dwell = DwellTime::on_trial();
            }
            return Ok(self.begin(target, frame, tracked));
        }
        Ok(Phase::Searching(lost))
    }

    /// Takes up the track of that number; `None` where it cannot be followed.
    fn acquire(&mut self, seen: &Observation, id: u64) -> opencv::Result<Option<Target>> {
        let Some(track) = self.tracks.get(id) else { return Ok(None) };
        let seen_at = track.seen_bounds();
        let follow = self.config.profile.acquire(seen, track, self.tracks.region(track))?;
        let Some(follow) = follow else { return Ok(None) };
        self.tracks.target(id);
        Ok(Some(Target { id, follow, dwell: DwellTime::default(), seen_at }))
    }

    fn begin(&mut self, target: Target, frame: Frame, tracked: &mut Tracked) -> Phase {
        self.policy.take(target.id);
        tracked.changes.push(TargetChange::Acquired);
        tracked.tell_of(TargetState::Tracking, target.id, &*target.follow, frame);
        Phase::Tracking(target)
    }
}
