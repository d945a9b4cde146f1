// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use servo::{PanTilt, Time};

use super::control_queue::ControlQueue;
use super::operator::{CommandedMotion, OperatorDetector, Verdict};

/// Whether the camera is ours to move: an operator comes first, and so does whoever holds the control queue.
#[derive(Debug)]
pub struct Arbitration {
    watch: OperatorDetector,
    /// The camera's own queue.
    pub queue: ControlQueue,
    /// An operator moved the camera; until then it is his.
    operator_until: Option<Time>,
    /// Where the camera was first seen, while it may still be moving at a dead predecessor's word.
    found: Option<Found>,
    met: bool,
    told: Option<ControlOwner>,
}

#[derive(Debug)]
struct Found {
    position: PanTilt,
    zoom: Option<f64>,
    at: Time,
}

/// Who else moves the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControlOwner {
    /// Somebody who moved it.
    Operator,
    /// Whoever is before us in the control queue.
    Queue,
}

/// What a position says of others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finding {
    /// Nothing.
    Nothing,
    /// The camera moves since before we came.
    Orphan,
    /// An operator moves it.
    Operator,
}

impl Arbitration {
    /// For so long a camera just met is watched for a move that a predecessor left behind.
    const FIRST_LOOK: Duration = Duration::from_secs(10);

    /// More than the noise of a camera at rest, in so short a time.
    const DRIFT_DEG: f64 = 0.3;
    /// The same for the zoom, in parts of its travel.
    const DRIFT_ZOOM: f64 = 0.002;

    /// Of a camera just met, which may have a control queue or cannot.
    pub fn new(has_queue: bool) -> Self {
        Self {
            watch: OperatorDetector::default(),
            queue: if has_queue { ControlQueue::default() } else { ControlQueue::absent() },
            operator_until: None,
            found: None,
            met: false,
            told: None,
        }
    }

    /// Judges where the camera looks. An operator found keeps it for `give_way`; zero: none is looked for.
    pub fn positioned(
        &mut self,
        (position, zoom): (PanTilt, Option<f64>),
        (asked, answered): (Time, Time),
        commands: CommandedMotion,
        give_way: Duration,
    ) -> Finding {
        let verdict = self.watch.position((position, zoom), (asked, answered), commands);
        if self.is_orphan(position, zoom, answered) {
            return Finding::Orphan;
        }
        if verdict != Verdict::Foreign || give_way.is_zero() {
            return Finding::Nothing;
        }
        self.operator_until = Some(answered + give_way);
        Finding::Operator
    }

    fn is_orphan(&mut self, position: PanTilt, zoom: Option<f64>, now: Time) -> bool {
        if !self.met {
            self.met = true;
            self.found = Some(Found { position, zoom, at: now });
            return false;
        }
        let Some(found) = self.found.as_ref().filter(|found| now <= found.at + Self::FIRST_LOOK) else {
            return false;
        };
        let zoomed = found.zoom.zip(zoom).map_or(0.0, |(before, now)| (now - before).abs());
        let zooms = zoomed > Self::DRIFT_ZOOM;
        let moves = found.position.turn_to(position).largest() > Self::DRIFT_DEG;
        if moves || zooms {
            self.found = None;
        }
        moves || zooms
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        self.watch.check_invariants();
        self.queue.check_invariants();
        assert!(self.met || self.found.is_none(), "found where it was before it was met");
    }

    /// We moved the camera, or may have, in a way that nobody can foresee.
    pub fn excuse(&mut self, now: Time) {
        self.watch.excuse(now);
    }

    /// We command the camera: what it does now is no predecessor's.
    pub fn commanded(&mut self) {
        (self.met, self.found) = (true, None);
    }

    /// The camera is out of sight.
    pub fn forget(&mut self) {
        self.watch.forget();
        self.queue.forget();
    }

    /// Positions are told along other axes from here on.
    pub fn reorient(&mut self) {
        self.watch.forget();
    }

    /// The camera was asked where it looks, and did not say.
    pub fn undecided(&mut self) {
        self.watch.undecided();
    }

    /// Whether pan or tilt turned otherwise than commanded when last seen.
    pub fn turns_otherwise(&self) -> bool {
        self.watch.turns_otherwise()
    }

    /// Whether the camera is to be asked at once where it looks.
    pub fn asks(&self) -> bool {
        self.watch.suspects()
    }

    /// Who else moves the camera, if anybody.
    pub fn owner(&self, now: Time) -> Option<ControlOwner> {
        if self.queue.is_held() {
            return Some(ControlOwner::Queue);
        }
        self.operator_until.filter(|until| now < *until).map(|_| ControlOwner::Operator)
    }

    /// Whether we may move the camera now; not while that is still being found out.
    pub fn is_ours(&self, now: Time) -> bool {
        self.owner(now).is_none() && self.queue.lets_us() && !self.asks()
    }

    /// When an operator's time is over, where one is there.
    pub fn operator_until(&self, now: Time) -> Option<Time> {
        self.operator_until.filter(|until| now < *until)
    }

    /// Who holds the camera, if that is another than the last time this was asked.
    pub fn change(&mut self, now: Time) -> Option<Option<ControlOwner>> {
        let owner = self.owner(now);
        (std::mem::replace(&mut self.told, owner) != owner).then_some(owner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{QueuePlace, QueueRequest};
    use servo::CommandHistory;

    const GIVE_WAY: Duration = Duration::from_secs(10);

    fn s<T: From<Duration>>(s: u64) -> T {
        Duration::from_secs(s).into()
    }

    fn tell_place(
        arbitration: &mut Arbitration,
        place: (PanTilt, Option<f64>),
        at: Time,
        give_way: Duration,
    ) -> Finding {
        let nothing = CommandHistory::default();
        arbitration.positioned(place, (at, at), CommandedMotion { pan_tilt: &nothing, zoom: None }, give_way)
    }

    fn tell(arbitration: &mut Arbitration, pan: f64, at: Time) -> Finding {
        tell_place(arbitration, (PanTilt::new(pan, 0.0), Some(0.0)), at, GIVE_WAY)
    }

    fn met() -> Arbitration {
        let mut arbitration = Arbitration::new(true);
        for second in 1..30 {
            assert_eq!(tell(&mut arbitration, 0.0, s(second)), Finding::Nothing);
        }
        assert_eq!(arbitration.change(s(30)), None);
        arbitration
    }

    #[test]
    fn an_operator_has_the_camera_until_he_lets_it_rest() {
        let mut arbitration = met();
        assert_eq!(tell(&mut arbitration, 9.0, s(30)), Finding::Nothing);
        assert!(arbitration.asks() && !arbitration.is_ours(s(30)));
        assert_eq!(tell(&mut arbitration, 9.0, s(30)), Finding::Operator);
        assert_eq!(arbitration.change(s(30)), Some(Some(ControlOwner::Operator)));
        assert_eq!(arbitration.change(s(31)), None);
        tell(&mut arbitration, 20.0, s(35));
        assert_eq!(tell(&mut arbitration, 20.0, s(35)), Finding::Operator);
        assert!(!arbitration.is_ours(s(44)));
        assert_eq!(arbitration.operator_until(s(44)), Some(s(45)));
        assert!(arbitration.is_ours(s(45)));
        assert_eq!(arbitration.change(s(45)), Some(None));
    }

    #[test]
    fn nobody_is_given_way_where_that_is_not_wanted() {
        let mut arbitration = met();
        for pan in [9.0, 9.0, 30.0, 30.0] {
            let place = (PanTilt::new(pan, 0.0), None);
            assert_eq!(tell_place(&mut arbitration, place, s(30), Duration::ZERO), Finding::Nothing);
        }
    }

    #[test]
    fn a_camera_found_moving_is_an_orphan_once() {
        let mut arbitration = Arbitration::new(true);
        assert_eq!(tell(&mut arbitration, 0.0, s(1)), Finding::Nothing);
        assert_eq!(tell(&mut arbitration, 0.5, s(2)), Finding::Orphan);
        assert_eq!(tell(&mut arbitration, 1.0, s(3)), Finding::Nothing);
        let mut arbitration = Arbitration::new(true);
        tell(&mut arbitration, 0.0, s(1));
        let zoomed = (PanTilt::default(), Some(0.01));
        assert_eq!(tell_place(&mut arbitration, zoomed, s(2), GIVE_WAY), Finding::Orphan);
    }

    #[test]
    fn a_camera_at_the_seam_is_no_orphan() {
        let mut arbitration = Arbitration::new(true);
        tell(&mut arbitration, 179.99, s(1));
        assert_eq!(tell(&mut arbitration, -179.99, s(2)), Finding::Nothing);
    }

    #[test]
    fn what_we_command_is_no_orphan() {
        let mut arbitration = Arbitration::new(true);
        tell(&mut arbitration, 0.0, s(1));
        arbitration.commanded();
        assert_eq!(tell(&mut arbitration, 1.0, s(2)), Finding::Nothing);
    }

    #[test]
    fn whoever_is_before_us_in_the_queue_has_the_camera() {
        let mut arbitration = met();
        arbitration.queue.told(Some(true));
        assert!(!arbitration.is_ours(s(30)));
        let place = |position| Some(QueuePlace { position, poll_every: s(20) });
        arbitration.queue.answered(QueueRequest::Request, place(2), s(30));
        assert_eq!(arbitration.change(s(30)), Some(Some(ControlOwner::Queue)));
        arbitration.queue.answered(QueueRequest::Query, place(1), s(31));
        assert!(arbitration.is_ours(s(31)));
        assert_eq!(arbitration.change(s(31)), Some(None));
    }
}
