use opencv::core::{Point2f, Rect2f};
use ptztrack_contract::{Feature, Point, Rect, ReleaseReason, TargetChange, TargetState, Vector};

use super::ego_motion::EgoMotion;
use super::geometry::{Frame, around};
use super::patience::Limits;
use super::proof::MotionProof;
use super::selection::{Choice, Selection, Sighting};
use super::steps::Profile;
use super::target::{Sight, Target};
use crate::vision::Luma;

/// Shortest time between two frames, seconds: timestamps may repeat, velocities must stay finite.
const MIN_DT_S: f64 = 1e-3;
/// After a longer gap, seconds, a velocity says nothing about where the target is.
const MAX_DT_S: f64 = 2.0;
/// Width of a box made by a click, as a share of its height: a standing person.
const PERSON_ASPECT: f32 = 0.4;

/// How a [`Tracker`] works. Changes hold from the next target or frame on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config {
    /// Which steps are taken.
    pub profile: Profile,
    /// How the target is chosen.
    pub choice: Choice,
    /// Frames that a detection must be seen in before it is chosen.
    pub confirm_frames: u32,
    /// Seconds that a hidden target is coasted and looked for.
    pub coast_s: f64,
    /// Height, in frame heights, of the box that is made around a place selected by hand.
    pub manual_size: f64,
    /// Whether a detection that was chosen must soon be seen to move against the background, or is lost: right for
    /// a motion detector, wrong for one that finds people who stand.
    pub must_move: bool,
    /// How long a target is followed at most.
    pub limits: Limits,
}

/// Something that a detector saw, in frame sizes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Detection {
    /// Its box.
    pub bounds: Rect,
    /// Polygon around it; empty where only the box is known.
    pub contour: Vec<Point>,
}

/// What the tracker knows after one frame, in frame sizes (per second).
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// What it does.
    pub state: TargetState,
    /// What happened in this frame, in order.
    pub changes: Vec<TargetChange>,
    /// Why the target was released, where it was.
    pub released: Option<ReleaseReason>,
    /// Number of the target, from 1; 0 where there is none.
    pub id: u64,
    /// Box of the target; predicted while it is hidden.
    pub bounds: Rect,
    /// Its centre of mass (3.15).
    pub centroid: Point,
    /// Its motion in the picture, camera motion included.
    pub velocity: Vector,
    /// Motion of the background at its place, where that could be seen.
    pub ego_velocity: Option<Vector>,
    /// 0 to 1.
    pub confidence: f64,
    /// The feature points, kept and rejected.
    pub features: Vec<Feature>,
}

enum Phase {
    Searching,
    Tracking(Box<Target>),
    Occluded(Box<Target>, f64),
}

enum Command {
    Select(Point),
    Release,
}

/// Chooses a target and follows it. The same pictures always give the same answers.
pub struct Tracker {
    config: Config,
    phase: Phase,
    selection: Selection,
    command: Option<Command>,
    camera_rests: bool,
    /// Size of the last frame; `None` where nothing that was remembered holds for the next.
    size: Option<(usize, usize)>,
    last_id: u64,
}

impl Tracker {
    /// A tracker that searches.
    pub fn new(config: Config) -> Self {
        Self {
            config,
            phase: Phase::Searching,
            selection: Selection::default(),
            command: None,
            camera_rests: true,
            size: None,
            last_id: 0,
        }
    }

    /// Changes how it works from the next frame on.
    pub fn configure(&mut self, config: Config) {
        self.config = config;
    }

    /// What is known of the camera where the background cannot be seen; without any news it rests.
    pub fn set_camera_rests(&mut self, rests: bool) {
        self.camera_rests = rests;
    }

    /// With the next frame, follows what is at `place`: the detection there, or else a box of
    /// [`Config::manual_size`] around it.
    pub fn select(&mut self, place: Point) {
        self.command = Some(Command::Select(place));
    }

    /// With the next frame, lets the target go.
    pub fn release(&mut self) {
        self.command = Some(Command::Release);
    }

    /// The next frame does not continue the last one: what was followed is lost.
    pub fn interrupt(&mut self) {
        self.size = None;
    }

    /// Looks at one frame, `dt_s` seconds after the last one.
    ///
    /// # Errors
    /// Where OpenCV fails, which no picture should make it do. The target is gone then.
    pub fn process(&mut self, luma: &Luma, dt_s: f64, detections: &[Detection]) -> opencv::Result<Report> {
        let dt_s = if dt_s.is_finite() { dt_s.max(MIN_DT_S) } else { f64::INFINITY };
        let frame = Frame { width: luma.width().max(1) as f32, height: luma.height().max(1) as f32 };
        let mut changes = Vec::new();
        let size = Some((luma.width(), luma.height()));
        let same_stream = std::mem::replace(&mut self.size, size) == size && dt_s <= MAX_DT_S;
        if !same_stream {
            // Another picture, or one from another time: nothing that was remembered holds.
            self.selection.clear();
            self.selection.given_up.clear();
        }
        self.selection.given_up.watch(luma, self.camera_rests)?;
        self.watch(detections, frame, dt_s);
        let command = self.command.take();
        let mut phase = std::mem::replace(&mut self.phase, Phase::Searching);
        let mut report = Report::default();
        if !same_stream {
            if let Phase::Tracking(target) | Phase::Occluded(target, _) = &phase {
                report = self.report(TargetState::Lost, Some(target), frame);
                changes.push(TargetChange::Lost);
                phase = Phase::Searching;
            }
        } else {
            phase = self.follow(phase, luma, dt_s, frame, &mut report, &mut changes)?;
        }
        phase = match command {
            Some(Command::Select(place)) => {
                self.take_over(phase, luma, place, frame, &mut report, &mut changes)?
            }
            Some(Command::Release) => {
                self.let_go(phase, ReleaseReason::Request, frame, &mut report, &mut changes)
            }
            None => phase,
        };
        if matches!(phase, Phase::Searching) && changes.is_empty() {
            phase = self.acquire_chosen(luma, frame, &mut report, &mut changes)?;
        }
        self.phase = phase;
        Ok(Report { changes, ..report })
    }

    /// Keeps account of the detections while no target is followed.
    fn watch(&mut self, detections: &[Detection], frame: Frame, dt_s: f64) {
        let sightings = detections.iter().map(|detection| Sighting {
            bounds: frame.rect_to_pixels(detection.bounds),
            contour: detection.contour.iter().map(|point| frame.point_to_pixels(*point)).collect(),
            velocity: Point2f::default(),
        });
        self.selection.update(sightings.collect(), frame, dt_s);
    }

    fn follow(
        &mut self,
        phase: Phase,
        luma: &Luma,
        dt_s: f64,
        frame: Frame,
        report: &mut Report,
        changes: &mut Vec<TargetChange>,
    ) -> opencv::Result<Phase> {
        let (mut target, hidden_s) = match phase {
            Phase::Searching => return Ok(Phase::Searching),
            Phase::Tracking(target) => (target, None),
            Phase::Occluded(target, hidden_s) => (target, Some(hidden_s + dt_s)),
        };
        let before = target.bounds;
        let coast_s = if self.config.profile == Profile::Robust { self.config.coast_s } else { 0.0 };
        let sight = match hidden_s {
            None => target.follow(luma, dt_s as f32)?,
            Some(_) => self.look_for(&mut target, luma, dt_s as f32)?,
        };
        let sight = if target.proof.failed() { Sight::Gone } else { sight };
        let (state, phase_of): (_, fn(Box<Target>, f64) -> Phase) = match sight {
            Sight::Seen => (TargetState::Tracking, |target, _| Phase::Tracking(target)),
            Sight::Hidden if hidden_s.unwrap_or(0.0) < coast_s => (TargetState::Occluded, Phase::Occluded),
            Sight::Hidden | Sight::Gone => (TargetState::Lost, |_, _| Phase::Searching),
        };
        match (state, hidden_s) {
            (TargetState::Tracking, Some(_)) => changes.push(TargetChange::Reacquired),
            (TargetState::Occluded, None) => changes.push(TargetChange::Occluded),
            (TargetState::Lost, _) => {
                changes.push(TargetChange::Lost);
                self.selection.clear();
            }
            _ => {}
        }
        if let (TargetState::Occluded, Some(hidden_s)) = (state, hidden_s) {
            target.confidence *= (1.0 - dt_s / (coast_s - hidden_s + 2.0 * dt_s)).max(0.0) as f32;
        }
        target.patience.pass(dt_s);
        if let (Sight::Seen, Some(ego)) = (sight, self.ego(&target)) {
            target.patience.watch(before, target.bounds, ego, dt_s);
        }
        let exhausted = target.patience.exhausted(self.config.limits);
        *report = self.report(state, Some(&target), frame);
        let bounds = target.bounds;
        let phase = phase_of(target, hidden_s.unwrap_or(0.0));
        match exhausted {
            Some(reason) if state != TargetState::Lost => {
                self.selection.given_up.add(luma, bounds)?;
                Ok(self.let_go(phase, reason, frame, report, changes))
            }
            _ => Ok(phase),
        }
    }

    /// How the background moved, as seen or, where it cannot be, as the camera says.
    fn ego(&self, target: &Target) -> Option<EgoMotion> {
        target.ego().or(self.camera_rests.then(EgoMotion::default))
    }

    /// Looks for a hidden target where it should be and where a detector saw something.
    fn look_for(&self, target: &mut Target, luma: &Luma, dt_s: f32) -> opencv::Result<Sight> {
        let sight = target.coast(luma, dt_s)?;
        if sight != Sight::Hidden {
            return Ok(sight);
        }
        for sighting in self.selection.current() {
            if target.recognise(luma, sighting)? {
                return Ok(Sight::Seen);
            }
        }
        Ok(Sight::Hidden)
    }

    fn take_over(
        &mut self,
        old: Phase,
        luma: &Luma,
        place: Point,
        frame: Frame,
        report: &mut Report,
        changes: &mut Vec<TargetChange>,
    ) -> opencv::Result<Phase> {
        let pixels = frame.point_to_pixels(place);
        let sighting = self
            .selection
            .at(pixels)
            .cloned()
            .unwrap_or_else(|| Sighting { bounds: self.box_at(pixels, frame), ..Sighting::default() });
        let old = self.let_go(old, ReleaseReason::Request, frame, report, changes);
        match Target::acquire(luma, &sighting, self.config.profile.steps())? {
            Some(target) => Ok(self.begin(target, frame, report, changes)),
            None => Ok(old),
        }
    }

    fn box_at(&self, place: Point2f, frame: Frame) -> Rect2f {
        let height = self.config.manual_size as f32 * frame.height;
        around(place, PERSON_ASPECT * height, height)
    }

    fn let_go(
        &mut self,
        phase: Phase,
        reason: ReleaseReason,
        frame: Frame,
        report: &mut Report,
        changes: &mut Vec<TargetChange>,
    ) -> Phase {
        if let Phase::Tracking(target) | Phase::Occluded(target, _) = phase {
            if reason != ReleaseReason::Stationary {
                // It may move, and would be taken again at once.
                self.selection.release(target.bounds);
            }
            *report = self.report(TargetState::Searching, Some(&target), frame);
            report.features.clear();
            report.released = Some(reason);
            changes.push(TargetChange::Released);
        }
        Phase::Searching
    }

    fn acquire_chosen(
        &mut self,
        luma: &Luma,
        frame: Frame,
        report: &mut Report,
        changes: &mut Vec<TargetChange>,
    ) -> opencv::Result<Phase> {
        let chosen = self.selection.choose(self.config.choice, self.config.confirm_frames, frame);
        let Some(sighting) = chosen else { return Ok(Phase::Searching) };
        match Target::acquire(luma, sighting, self.config.profile.steps())? {
            Some(mut target) => {
                target.proof = MotionProof::new(self.config.must_move);
                Ok(self.begin(target, frame, report, changes))
            }
            None => Ok(Phase::Searching),
        }
    }

    fn begin(
        &mut self,
        target: Target,
        frame: Frame,
        report: &mut Report,
        changes: &mut Vec<TargetChange>,
    ) -> Phase {
        self.last_id += 1;
        self.selection.take(target.bounds);
        changes.push(TargetChange::Acquired);
        *report = self.report(TargetState::Tracking, Some(&target), frame);
        Phase::Tracking(Box::new(target))
    }

    fn report(&self, state: TargetState, target: Option<&Target>, frame: Frame) -> Report {
        let Some(target) = target else { return Report::default() };
        let feature = |kept: bool| move |position: Point2f| Feature { position: frame.point(position), kept };
        let kept = target.points.members().into_iter().map(feature(true));
        let rejected = target.points.rejected().iter().copied().map(feature(false));
        let ego = target.ego_velocity;
        Report {
            state,
            changes: Vec::new(),
            released: None,
            id: self.last_id,
            bounds: frame.rect(target.bounds),
            centroid: frame.point(target.centroid),
            velocity: frame.vector(target.own_velocity + ego.unwrap_or_default()),
            ego_velocity: ego.map(|ego| frame.vector(ego)),
            confidence: f64::from(target.confidence),
            features: kept.chain(rejected).collect(),
        }
    }
}

impl Default for Report {
    /// There is no target.
    fn default() -> Self {
        Self {
            state: TargetState::Searching,
            changes: Vec::new(),
            released: None,
            id: 0,
            bounds: Rect::default(),
            centroid: Point::default(),
            velocity: Vector::default(),
            ego_velocity: None,
            confidence: 0.0,
            features: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{Picture, Scene};
    use super::*;

    const SIZE: (usize, usize) = (480, 320);
    const PERSON: (f32, f32) = (40.0, 90.0);
    const DT: f64 = 0.1;

    fn config() -> Config {
        Config {
            profile: Profile::Robust,
            choice: Choice::Largest,
            confirm_frames: 1,
            coast_s: 1.5,
            manual_size: 0.3,
            must_move: false,
            limits: Limits { stationary_s: f64::INFINITY, tracked_s: f64::INFINITY },
        }
    }

    /// The street moved by `pan` with people of their own textures at these places.
    fn street(pan: (f32, f32), people: &[(f32, f32, u32)]) -> Picture {
        let mut picture = Scene::new(SIZE.0, SIZE.1).background(pan);
        for (x, y, texture) in people {
            picture.paint(Rect2f::new(*x, *y, PERSON.0, PERSON.1), *texture);
        }
        picture
    }

    fn following(profile: Profile, picture: &Picture, x: f32, y: f32) -> Tracker {
        following_with(Config { profile, ..config() }, picture, x, y)
    }

    fn following_with(config: Config, picture: &Picture, x: f32, y: f32) -> Tracker {
        let mut tracker = Tracker::new(config);
        let (width, height) = (SIZE.0 as f64, SIZE.1 as f64);
        let bounds = Rect {
            x: f64::from(x) / width,
            y: f64::from(y) / height,
            width: f64::from(PERSON.0) / width,
            height: f64::from(PERSON.1) / height,
        };
        let report = tracker
            .process(&picture.luma(), DT, &[Detection { bounds, contour: Vec::new() }])
            .expect("acquire");
        assert_eq!(report.changes, [TargetChange::Acquired]);
        tracker
    }

    fn step(tracker: &mut Tracker, picture: &Picture) -> Report {
        tracker.process(&picture.luma(), DT, &[]).expect("follow")
    }

    #[track_caller]
    fn assert_at(report: &Report, x: f32, y: f32) {
        assert_near(report, x, y, 8.0);
    }

    #[track_caller]
    fn assert_near(report: &Report, x: f32, y: f32, tolerance: f32) {
        assert_eq!((report.state, report.id), (TargetState::Tracking, 1), "{:?}", report.bounds);
        let off =
            ((report.bounds.x * SIZE.0 as f64) as f32 - x, (report.bounds.y * SIZE.1 as f64) as f32 - y);
        assert!(off.0.abs().max(off.1.abs()) < tolerance, "{off:?} pixels off");
    }

    #[test]
    fn a_walker_is_followed() {
        let mut tracker = following(Profile::Robust, &street((0.0, 0.0), &[(80.0, 100.0, 7)]), 80.0, 100.0);
        for n in 1..30 {
            let x = 80.0 + 8.5 * n as f32;
            assert_at(&step(&mut tracker, &street((0.0, 0.0), &[(x, 100.0, 7)])), x, 100.0);
        }
    }

    #[test]
    fn a_detection_that_never_moves_is_lost_and_a_chosen_one_is_not() {
        let picture = street((0.0, 0.0), &[(200.0, 100.0, 7)]);
        let lost_within = |chosen: bool| {
            let must_move = Config { must_move: true, ..config() };
            let mut tracker = following_with(must_move, &picture, 200.0, 100.0);
            if chosen {
                tracker.select(Point { x: 220.0 / SIZE.0 as f64, y: 145.0 / SIZE.1 as f64 });
            }
            (1..40).find(|_| step(&mut tracker, &picture).state == TargetState::Lost)
        };
        assert_eq!(lost_within(true), None);
        assert!((14..20).contains(&lost_within(false).expect("lost")));
    }

    #[test]
    fn the_thesis_follows_a_walker_before_an_even_wall() {
        let wall = |x| {
            let mut picture = Scene::new(SIZE.0, SIZE.1).flat(240);
            picture.paint(Rect2f::new(x, 100.0, PERSON.0, PERSON.1), 7);
            picture
        };
        let mut tracker = following(Profile::Thesis, &wall(80.0), 80.0, 100.0);
        for n in 1..30 {
            let x = 80.0 + 8.5 * n as f32;
            assert_near(&step(&mut tracker, &wall(x)), x, 100.0, 12.0);
        }
    }

    #[test]
    fn the_panning_camera_does_not_drag_the_walker() {
        let mut tracker = following(Profile::Robust, &street((0.0, 0.0), &[(200.0, 100.0, 7)]), 200.0, 100.0);
        for n in 1..30 {
            // The camera keeps the walker in the middle: only the street moves.
            let (pan, x) = (-9.0 * n as f32, 200.0 + (n % 3) as f32);
            let report = step(&mut tracker, &street((pan, 0.0), &[(x, 100.0, 7)]));
            assert_at(&report, x, 100.0);
            let ego = report.ego_velocity.expect("textured").x * SIZE.0 as f64 * DT;
            assert!((ego + 9.0).abs() < 0.5, "{ego}");
        }
    }

    #[test]
    fn somebody_standing_is_kept_under_a_camera_that_starts_to_pan() {
        let mut tracker = following(Profile::Robust, &street((0.0, 0.0), &[(200.0, 100.0, 7)]), 200.0, 100.0);
        let mut pan = 0.0;
        for n in 1..30 {
            pan -= if n > 10 { 7.0 } else { 0.0 };
            let report = step(&mut tracker, &street((pan, 0.0), &[(200.0 + pan, 100.0, 7)]));
            assert_at(&report, 200.0 + pan, 100.0);
        }
    }

    #[test]
    fn a_large_motion_of_the_whole_picture_is_followed() {
        let mut tracker = following(Profile::Robust, &street((0.0, 0.0), &[(60.0, 100.0, 7)]), 60.0, 100.0);
        let mut x = 60.0;
        for speed in [12.0, 28.0, 44.0, 60.0, 60.0] {
            x += speed;
            let report = step(&mut tracker, &street((x - 60.0, 0.0), &[(x, 100.0, 7)]));
            assert_at(&report, x, 100.0);
        }
    }

    #[test]
    fn two_who_cross_are_not_confused() {
        let mut tracker = following(
            Profile::Robust,
            &street((0.0, 0.0), &[(60.0, 100.0, 7), (360.0, 104.0, 99)]),
            60.0,
            100.0,
        );
        let mut last = Report::default();
        for n in 1..34 {
            let (x, other) = (60.0 + 9.0 * n as f32, 360.0 - 9.0 * n as f32);
            // The other passes in front.
            last = step(&mut tracker, &street((0.0, 0.0), &[(x, 100.0, 7), (other, 104.0, 99)]));
        }
        assert_at(&last, 60.0 + 9.0 * 33.0, 100.0);
    }

    #[test]
    fn hidden_for_a_second_and_found_again() {
        let mut tracker = following(Profile::Robust, &street((0.0, 0.0), &[(40.0, 100.0, 7)]), 40.0, 100.0);
        let mut changes = Vec::new();
        let mut last = Report::default();
        for n in 1..40 {
            let mut picture = street((0.0, 0.0), &[(40.0 + 8.0 * n as f32, 100.0, 7)]);
            picture.paint(Rect2f::new(150.0, 0.0, 110.0, 320.0), 4321);
            last = step(&mut tracker, &picture);
            changes.extend(last.changes.iter().copied());
        }
        assert_eq!(changes, [TargetChange::Occluded, TargetChange::Reacquired]);
        assert_at(&last, 40.0 + 8.0 * 39.0, 100.0);
    }

    #[test]
    fn the_same_pictures_give_the_same_answers() {
        let run = || {
            let mut tracker =
                following(Profile::Robust, &street((0.0, 0.0), &[(80.0, 100.0, 7)]), 80.0, 100.0);
            (1..8)
                .map(|n| step(&mut tracker, &street((0.0, 0.0), &[(80.0 + 7.0 * n as f32, 100.0, 7)])))
                .collect::<Vec<_>>()
        };
        assert_eq!(run(), run());
    }

    #[test]
    fn a_long_gap_is_a_loss() {
        let picture = street((0.0, 0.0), &[(80.0, 100.0, 7)]);
        for gap in [3.0, f64::NAN, f64::INFINITY] {
            let mut tracker = following(Profile::Robust, &picture, 80.0, 100.0);
            let report = tracker.process(&picture.luma(), gap, &[]).expect("follow");
            assert_eq!(report.changes, [TargetChange::Lost], "{gap}");
        }
    }
}
