// SPDX-License-Identifier: MPL-2.0

//! The state machine around one target.

use std::sync::Arc;

use opencv::core::{Point2f, Rect2f};
use ptztrack_contract::{Feature, ReleaseReason, TargetChange, TargetState};

use super::config::{Config, TargetRequest};
use super::dwell_time::DwellTime;
use super::ego_motion::EgoMotion;
use super::geometry::Frame;
use super::group::Group;
use super::policy::{ARM, Choice, Policy, tell_apart};
use super::report::{Detection, Tracked, reported};
use super::target::{Follow, Sight};
use super::tracks::{Region, Rules, Track, Tracks};
use crate::vision::Observation;
use crate::vision::stillness::Stillness;

/// Shortest time between two frames, seconds: timestamps may repeat, velocities must stay finite.
const MIN_DT_S: f64 = 1e-3;
/// After a longer gap, seconds, a velocity says nothing about where the target is.
const MAX_DT_S: f64 = 2.0;
/// After so long without anything that speaks for them, nobody is there, seconds; or after the time that a hidden target is coasted.
const DECAY_S: f64 = 3.0;
/// Who is followed because they move and is not seen for so long, seconds, may be given up for somebody who goes somewhere.
const MISSED_S: f64 = 0.2;
/// For how long somebody who is not seen is told of, seconds.
const TOLD_S: f64 = 0.5;

/// The track that is followed.
struct Target {
    /// Number of its track.
    id: u64,
    follow: Box<dyn Follow>,
    dwell: DwellTime,
    /// Its box when it was last seen, carried along with the background.
    seen_at: Rect2f,
}

enum Phase {
    /// And who was lost last, by number.
    Searching(Option<u64>),
    Tracking(Target),
    /// And for how many seconds.
    Occluded(Target, f64),
}

impl Phase {
    /// The number of the track that is followed.
    fn target(&self) -> Option<u64> {
        match self {
            Self::Searching(_) => None,
            Self::Tracking(target) | Self::Occluded(target, _) => Some(target.id),
        }
    }
}

/// Keeps account of everybody who is seen, chooses one of them and follows it. The same pictures always give the same answers.
pub struct Tracker {
    config: Config,
    phase: Phase,
    tracks: Tracks,
    policy: Policy,
    group: Group,
    stillness: Stillness,
    request: Option<TargetRequest>,
    camera_rests: bool,
    /// Size of the last frame; `None` where nothing that was remembered holds for the next.
    size: Option<(usize, usize)>,
    memory: Memory,
}

/// Memory for what is told of the next frame, and for what was seen in it.
#[derive(Default)]
struct Memory {
    features: Vec<Feature>,
    reported: Vec<ptztrack_contract::Track>,
    regions: Vec<Region>,
    people: Vec<Rect2f>,
    outlines: Vec<Vec<Point2f>>,
}

impl Tracker {
    /// A tracker that searches.
    pub fn new(config: Config) -> Self {
        Self {
            config,
            phase: Phase::Searching(None),
            tracks: Tracks::default(),
            policy: Policy::default(),
            group: Group::default(),
            stillness: Stillness::default(),
            request: None,
            camera_rests: true,
            size: None,
            memory: Memory::default(),
        }
    }

    /// Takes back what it reported, as memory for the next frame.
    pub fn recycle(&mut self, features: Vec<Feature>, tracks: Vec<ptztrack_contract::Track>) {
        (self.memory.features, self.memory.reported) = (features, tracks);
    }

    /// Changes how it works from the next frame on.
    pub fn configure(&mut self, config: Config) {
        self.config = config;
    }

    /// What is known of the camera where the background cannot be seen; without any news it rests.
    pub fn set_camera_rests(&mut self, rests: bool) {
        self.camera_rests = rests;
    }

    /// The tracks of these numbers become the target where they are asked for, and not by themselves.
    pub fn ignore(&mut self, ids: Arc<[u64]>) {
        self.policy.ignore(ids);
    }

    /// With the next frame, carries this out.
    pub fn request(&mut self, request: TargetRequest) {
        self.request = Some(request);
    }

    /// The next frame does not continue the last one: what was followed is lost.
    pub fn interrupt(&mut self) {
        self.size = None;
    }

    /// Looks at one frame, `dt_s` seconds after the last one.
    ///
    /// # Errors
    /// Where OpenCV fails, which no picture should make it do. The target is gone then.
    pub fn process(
        &mut self,
        seen: &Observation,
        dt_s: f64,
        detections: &[Detection],
    ) -> opencv::Result<Tracked> {
        let dt_s = if dt_s.is_finite() { dt_s.max(MIN_DT_S) } else { f64::INFINITY };
        let size = (seen.luma.width(), seen.luma.height());
        let frame = Frame { width: size.0.max(1) as f32, height: size.1.max(1) as f32 };
        let same_stream = self.size.replace(size) == Some(size) && dt_s <= MAX_DT_S;
        if !same_stream {
            self.forget();
        }
        self.watch(seen, detections, frame, if same_stream { dt_s } else { MIN_DT_S });
        let mut tracked = self.blank();
        let phase = std::mem::replace(&mut self.phase, Phase::Searching(None));
        let phase = if same_stream {
            self.follow(phase, seen, dt_s, frame, &mut tracked)?
        } else {
            lose(&phase, frame, &mut tracked);
            Phase::Searching(None)
        };
        let mut phase = self.obey(phase, seen, frame, &mut tracked)?;
        if let Phase::Searching(lost) = phase
            && tracked.changes.is_empty()
        {
            phase = self.acquire_chosen(seen, lost, frame, &mut tracked)?;
        }
        self.follow_group(phase.target(), seen, dt_s, frame, &mut tracked);
        self.tell_of_everybody(phase.target().unwrap_or(0), frame, &mut tracked);
        self.phase = phase;
        if let Some(ego) = EgoMotion::of(seen).filter(|_| same_stream) {
            tracked.tell_of_background(ego, dt_s, frame);
        }
        let scene = seen.scene.as_ref();
        tracked.unchanged_for = scene.map(|scene| self.stillness.see(&scene.luma, dt_s));
        Ok(tracked)
    }

    /// Another picture, or one from another time: nothing that was remembered holds.
    fn forget(&mut self) {
        self.tracks.restart();
        self.policy.restart();
        self.group.disband();
        self.stillness = Stillness::default();
    }

    /// Tells of nobody.
    fn blank(&mut self) -> Tracked {
        let Memory { features, reported, .. } = &mut self.memory;
        features.clear();
        reported.clear();
        let (features, tracks) = (std::mem::take(features), std::mem::take(reported));
        Tracked { features, tracks, ..Tracked::default() }
    }

    /// Who is seen, or was a moment ago; and the target.
    fn told_of(&self, target: u64) -> impl Iterator<Item = &Track> {
        self.tracks.iter().filter(move |track| track.journey.unseen_s <= TOLD_S || track.id == target)
    }

    fn tell_of_everybody(&self, target: u64, frame: Frame, tracked: &mut Tracked) {
        tracked.tracks.extend(self.told_of(target).map(|track| reported(track, target, frame)));
        tracked.track_changes.extend(self.tracks.events().iter().copied());
    }

    /// How the background moved, by what is seen of it, by how it moved before, or by what is known of the camera.
    fn ego_motion(&self, seen: &Observation) -> Option<EgoMotion> {
        EgoMotion::seen_or_coasted(seen).or(self.camera_rests.then(EgoMotion::default))
    }

    /// Keeps account of everybody, whether a target is followed or not.
    fn watch(&mut self, seen: &Observation, detections: &[Detection], frame: Frame, dt_s: f64) {
        let Memory { regions, people, outlines, .. } = &mut self.memory;
        regions.clear();
        self.tracks.give_back(outlines);
        for detection in detections {
            self.config.profile.read(detection, frame, (people, outlines), regions);
        }
        let Config { confirm_frames, coast_s, memory_s, detector_pause_s, .. } = self.config;
        let coast_s = coast_s.max(DECAY_S);
        let rules = Rules { confirm_pictures: confirm_frames, coast_s, memory_s, detector_pause_s };
        let ego = self.ego_motion(seen);
        self.tracks.update(seen, self.memory.regions.drain(..), ego, dt_s, rules);
        self.policy.pass(&self.tracks, ego, dt_s);
    }

    fn follow(
        &mut self,
        phase: Phase,
        seen: &Observation,
        dt_s: f64,
        frame: Frame,
        tracked: &mut Tracked,
    ) -> opencv::Result<Phase> {
        let (mut target, hidden_s) = match phase {
            Phase::Searching(_) => return Ok(phase),
            Phase::Tracking(target) => (target, None),
            Phase::Occluded(target, hidden_s) => (target, Some(hidden_s + dt_s)),
        };
        target.id = self.tracks.number_now(target.id);
        let coast_s = self.config.coast_s;
        let sight = target.follow.follow(seen, dt_s as f32, &mut self.tracks, target.id)?;
        if !target.follow.estimate().is_borne_out {
            self.tracks.find_again(target.id, self.config.must_travel);
            target.id = self.tracks.number_now(target.id);
        }
        let state = match sight {
            Sight::Seen => TargetState::Tracking,
            Sight::Hidden if hidden_s.unwrap_or(0.0) < coast_s => TargetState::Occluded,
            Sight::Hidden | Sight::Gone => TargetState::Lost,
        };
        match (state, hidden_s) {
            (TargetState::Tracking, Some(_)) => tracked.changes.push(TargetChange::Reacquired),
            (TargetState::Occluded, None) => tracked.changes.push(TargetChange::Occluded),
            (TargetState::Lost, _) => tracked.changes.push(TargetChange::Lost),
            _ => {}
        }
        target.dwell.pass(dt_s);
        let is_sure = target.follow.estimate().is_sure();
        if sight == Sight::Seen && is_sure && !target.dwell.is_on_trial() {
            tell_apart(&mut self.tracks, target.id, target.follow.estimate().bounds, dt_s);
        }
        let ego = self.ego_motion(seen);
        let bounds = target.follow.estimate().bounds;
        if let (Sight::Seen, Some(ego)) = (sight, ego) {
            target.dwell.watch(target.seen_at, bounds, ego, dt_s);
        }
        target.seen_at = match (sight, ego) {
            (Sight::Seen, _) => bounds,
            (_, Some(ego)) => ego.apply_to(target.seen_at),
            _ => target.seen_at,
        };
        tracked.tell_of(state, target.id, &*target.follow, frame);
        let exhausted = target.dwell.exhausted(self.config.limits).filter(|_| state != TargetState::Lost);
        if let Some(reason) = exhausted {
            self.policy.park(target.id, target.follow.estimate().bounds);
            return Ok(self.let_go(Phase::Tracking(target), reason, frame, tracked));
        }
        if self.is_outdone(&target, frame) {
            self.policy.park(target.id, target.seen_at);
            return Ok(self.let_go(Phase::Tracking(target), ReleaseReason::Stationary, frame, tracked));
        }
        Ok(match state {
            TargetState::Tracking => Phase::Tracking(target),
            TargetState::Occluded => {
                let left = (1.0 - hidden_s.unwrap_or(0.0) / coast_s.max(dt_s)).max(0.0);
                tracked.confidence *= left;
                Phase::Occluded(target, hidden_s.unwrap_or(0.0))
            }
            _ => Phase::Searching(Some(target.id)),
        })
    }

    /// Where everybody is followed, tells of the box that holds all of them in place of the `target`'s.
    fn follow_group(
        &mut self,
        target: Option<u64>,
        seen: &Observation,
        dt_s: f64,
        frame: Frame,
        tracked: &mut Tracked,
    ) {
        let Config { choice, must_travel, .. } = self.config;
        if choice != Choice::Group {
            return self.group.disband();
        }
        let ready = self.policy.ready(&self.tracks, must_travel, frame);
        self.group.gather(&self.tracks, ready, target, |track| self.policy.is_unwanted(track));
        let group = self.group.follow(&self.tracks, self.ego_motion(seen), dt_s as f32);
        if let (Some(group), Some(_)) = (group, target) {
            tracked.become_group(&group, frame);
        }
    }

    /// Whether a target that was chosen because it moves stays where it is, while somebody else goes somewhere: at first anybody whom
    /// the policy would choose, and later who has gone as far as they are tall, where the target never went farther than an arm
    /// reaches: what a screen shows goes to and fro for ever. Who is missed for a moment is judged by their way so far.
    fn is_outdone(&self, target: &Target, frame: Frame) -> bool {
        let Config { choice, must_travel, .. } = self.config;
        let track = self.tracks.get(target.id);
        let seen = track.filter(|track| track.journey.unseen_s <= MISSED_S);
        if target.dwell.is_on_trial() && seen.is_none_or(Track::goes_nowhere) {
            let choices = self.policy.choices(&self.tracks, choice, None, must_travel, frame);
            return choices.first().is_some_and(|track| track.id != target.id);
        }
        let farthest = track.map_or(0.0, |track| track.journey.farthest);
        let height = target.follow.estimate().bounds.height;
        let goes_farther = |other: &Track| {
            other.id != target.id
                && other.has_gone_as_far_as(height)
                && farthest < ARM * height.max(other.height())
        };
        choice != Choice::Manual
            && target.dwell.is_of_motion()
            && seen.is_none_or(|track| !track.travels())
            && self.policy.ready(&self.tracks, must_travel, frame).any(goes_farther)
    }
}

/// Tells that the target, where there was one, is lost.
fn lose(phase: &Phase, frame: Frame, tracked: &mut Tracked) {
    if let Phase::Tracking(target) | Phase::Occluded(target, _) = phase {
        tracked.tell_of(TargetState::Lost, target.id, &*target.follow, frame);
        tracked.changes.push(TargetChange::Lost);
    }
}

mod acquisition;
mod requests;
#[cfg(test)]
mod tests;
