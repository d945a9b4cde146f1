// SPDX-License-Identifier: MPL-2.0

//! A camera that was called for somebody: it turns to where they have to be, takes them up, and follows them for as long as the
//! one that called says that it is they.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use handover::{Aim, Direction};

use super::exchange::Errand;
use super::link::Link;
use super::motion::Expected;
use super::view::View;
use crate::camera::{Gaze, Known, Origin, Person, Steering};
use crate::config::HandOver;
use ptztrack_contract::lock::lock;

/// It is given up after this: as long as a slow camera turns half round, and then sees nobody.
const LONGEST: Duration = Duration::from_secs(10);
/// Somebody is expected to go on as they do for so long: while a command, the camera and a picture are under way.
const LEAD_S: f64 = 0.5;
/// Between two orders to the camera.
const ORDER_EVERY: Duration = Duration::from_millis(400);
/// So many standard deviations of doubt are to fit into the picture that the camera turns to: three to either side.
const IN_PICTURE: f64 = 6.0;
/// Who is nearest to where they have to be in so many pictures is they.
const PICTURES: u32 = 3;
/// Somebody else is nearer than who is followed by so many standard deviations: two are rarely as near by chance.
const AHEAD: f64 = 1.0;
/// Who is followed elsewhere for so long is somebody else.
const ASTRAY: Duration = Duration::from_secs(1);

/// Somebody to turn to.
#[derive(Debug)]
pub struct Call {
    pub errand: Errand,
    begun: Instant,
    ordered: Option<(Instant, Gaze)>,
    /// Where the camera looked before it was told to turn.
    before: Option<Gaze>,
    /// How often the camera had refused to be sent anywhere before it was told to turn.
    refusals: u64,
    likely: Likely,
    /// Their number here, once they are followed.
    followed: Option<u64>,
    /// Nobody is followed where they have to be, since then.
    astray: Option<Instant>,
}

/// Who it may be: their number here, in how many pictures they were nearest, and when the last of these came.
#[derive(Debug, Default)]
struct Likely(Option<(u64, u32, Instant)>);

/// What becomes of it.
#[derive(Debug, PartialEq, Eq)]
pub enum Progress {
    Going,
    /// They are followed, under this number.
    TakenUp(u64),
    /// It was somebody else, or they were lost: they are looked for again.
    Again,
    /// Somebody else wants something else of the camera, or the other one sees them no more.
    Over,
    /// They were not found.
    Failed,
    /// The camera refuses to turn.
    Refused,
}

impl Call {
    pub fn new(wish: &HandOver, id: u64) -> Self {
        Self {
            errand: Errand { from: wish.from.clone(), id, precedence: wish.precedence },
            begun: Instant::now(),
            ordered: None,
            before: None,
            refusals: 0,
            likely: Likely::default(),
            followed: None,
            astray: None,
        }
    }

    /// Goes on with it.
    pub fn advance(&mut self, link: &Link, from: &View, called: &View) -> Progress {
        let person = from.person(self.errand.id).filter(|_| from.is_fresh());
        if self.is_overruled(called) || (self.followed.is_some() && person.is_none()) {
            return Progress::Over;
        }
        let seen = person.filter(|person| person.stands_in_picture());
        let expected = seen.and_then(|person| link.expect(from, person, called));
        let nearest = expected.as_ref().and_then(|expected| nearest(expected, called, self.followed));
        if self.likely.is_sure(nearest, called.seen.0) && (self.followed.is_some() || self.ordered.is_some())
        {
            return nearest.map_or(Progress::Going, |person| self.take_up(person, called));
        }
        match (self.followed, expected) {
            (Some(_), Some(expected)) if self.is_astray(&expected, called) => self.look_again(),
            (Some(_), _) => Progress::Going,
            (None, _) if self.begun.elapsed() > LONGEST => {
                self.cancel(&called.known);
                Progress::Failed
            }
            (None, _) if self.was_refused(called) => {
                self.end(&called.known, Steering::Follow);
                Progress::Refused
            }
            (None, _) if self.turn(link, from, called) => Progress::Going,
            (None, _) => Progress::Over,
        }
    }

    pub fn has_taken_up(&self) -> bool {
        self.followed.is_some()
    }

    /// Has the camera turn back, where it was sent somewhere: what it sees there may be a wall.
    pub fn cancel(&self, called: &Known) {
        let back = |before| Steering::TurnBack(before, Instant::now());
        self.end(called, self.before.map_or(Steering::Follow, back));
    }

    fn end(&self, called: &Known, steering: Steering) {
        if self.followed.is_none() {
            called.steer_if(|now| matches!(now, Steering::LookAt(..)), steering);
        }
    }

    /// Whether somebody else has the camera, or has chosen whom it follows.
    fn is_overruled(&self, called: &View) -> bool {
        match self.followed {
            Some(_) => {
                let is_ours =
                    |origin: &Origin| origin.camera == self.errand.from && origin.id == self.errand.id;
                !called.follows() || !lock(&called.known.origin).as_ref().is_some_and(is_ours)
            }
            None => !self.may_turn(&called.known, *lock(&called.known.steering)),
        }
    }

    /// Whether this call may have the camera: it turns for it already; or it was not told to yet, it follows or turns for another
    /// call, and no operator moves it.
    fn may_turn(&self, called: &Known, steering: Steering) -> bool {
        match steering {
            Steering::LookAt(..) if self.ordered.is_some() => true,
            Steering::LookAt(..) | Steering::Follow => {
                self.ordered.is_none() && !called.operator.load(Ordering::Relaxed)
            }
            _ => false,
        }
    }

    fn take_up(&mut self, person: &Person, called: &View) -> Progress {
        let is_ours = |now| matches!(now, Steering::LookAt(..));
        if self.followed.is_none() && !called.known.steer_if(is_ours, Steering::Follow) {
            return Progress::Over;
        }
        self.astray = None;
        if !person.is_target {
            called.known.select_track(person.id);
        }
        let before = self.followed.replace(person.id);
        if before == Some(person.id) {
            return Progress::Going;
        }
        let origin = Origin { target: person.id, id: self.errand.id, camera: self.errand.from.clone() };
        *lock(&called.known.origin) = Some(origin);
        Progress::TakenUp(person.id)
    }

    /// Whether nobody has been followed for a while where they have to be.
    fn is_astray(&mut self, expected: &Expected, called: &View) -> bool {
        let target = called.target();
        // Whose feet are not seen may be anywhere.
        let is_there =
            target.is_some_and(|(person, motion)| !person.is_whole() || expected.is_place_of(&motion));
        if is_there {
            self.astray = None;
            return false;
        }
        let came = called.seen.0;
        came.saturating_duration_since(*self.astray.get_or_insert(came)) > ASTRAY
    }

    fn look_again(&mut self) -> Progress {
        (self.begun, self.ordered, self.followed, self.astray) = (Instant::now(), None, None, None);
        self.likely = Likely::default();
        Progress::Again
    }

    /// Tells the camera where to look, if there is something to tell; `false`: somebody else has it.
    fn turn(&mut self, link: &Link, from: &View, called: &View) -> bool {
        let gaze = self.gaze(link, from, called).filter(|gaze| self.is_due(gaze, called));
        let Some(gaze) = gaze else { return true };
        let (known, now) = (&called.known, Instant::now());
        let refusals = lock(&known.state).refused_moves;
        if !known.steer_if(|steering| self.may_turn(known, steering), Steering::LookAt(gaze, now)) {
            return false;
        }
        if self.ordered.replace((now, gaze)).is_none() {
            self.refusals = refusals;
            self.before = self.before.or(called.gaze());
        }
        true
    }

    /// Whether the camera has refused to turn, as one does that takes no move to a position.
    fn was_refused(&self, called: &View) -> bool {
        self.ordered.is_some() && lock(&called.known.state).refused_moves > self.refusals
    }

    /// Whether the camera is to be told, as it was not yet, or was told a place that is off by an eighth of its picture by now.
    fn is_due(&self, gaze: &Gaze, called: &View) -> bool {
        let Some((at, before)) = self.ordered else { return true };
        let fov_deg = before.fov_deg.or_else(|| called.fov_deg()).unwrap_or(0.0);
        at.elapsed() > ORDER_EVERY && of(gaze).angle_to_deg(of(&before)) > fov_deg / 8.0
    }

    /// Where the camera has to look; `None` where that is in too much doubt.
    pub fn gaze(&self, link: &Link, from: &View, called: &View) -> Option<Gaze> {
        let aim = link.aim(from, from.person(self.errand.id)?, LEAD_S)?;
        let middle = aim.middle();
        let widest = called.widest_fov_deg?;
        let enough = IN_PICTURE * aim.doubt_deg;
        let fov_deg = called.target_height.and_then(|height| fills(&aim, height, called));
        let fov_deg = fov_deg.map(|fov_deg| fov_deg.max(enough).min(widest));
        let gaze = Gaze { pan_deg: middle.pan_deg, tilt_deg: middle.tilt_deg, fov_deg };
        // Whose place is known no better than that is not in the picture.
        (enough < 1.5 * fov_deg.or_else(|| called.fov_deg())?).then_some(gaze)
    }
}

impl Likely {
    /// Takes who is nearest in the picture that came then; whether it is they.
    fn is_sure(&mut self, nearest: Option<&Person>, came: Instant) -> bool {
        self.0 = match (nearest, self.0) {
            (None, _) => None,
            (Some(person), Some((id, pictures, last))) if person.id == id => {
                Some((id, pictures + u32::from(came > last), came))
            }
            (Some(person), _) => Some((person.id, 1, came)),
        };
        self.0.is_some_and(|(_, pictures, _)| pictures >= PICTURES)
    }
}

/// Whether a camera follows whom this one sees.
pub fn follows(link: &Link, from: &View, person: &Person, called: &View) -> bool {
    let Some(expected) = link.expect(from, person, called) else { return false };
    nearest(&expected, called, None).is_some_and(|person| person.is_target)
}

/// Who of those whom a camera sees is where somebody has to be, and goes where they go; who is followed already before others.
pub fn nearest<'a>(expected: &Expected, called: &'a View, followed: Option<u64>) -> Option<&'a Person> {
    let distance = |person: &Person, motion: &_| {
        let ahead = if followed == Some(person.id) { AHEAD } else { 0.0 };
        Some(expected.distance(motion)? - ahead)
    };
    let near = called.motions().filter_map(|(person, motion)| Some((person, distance(person, &motion)?)));
    near.min_by(|one, other| one.1.total_cmp(&other.1)).map(|(person, _)| person)
}

/// The field of view in which somebody fills the wanted part of the picture's height.
fn fills(aim: &Aim, height: f64, called: &View) -> Option<f64> {
    let pose = called.seen.1.poses.last()?;
    let half = |degrees: f64| (degrees / 2.0).to_radians().tan();
    let shape = half(pose.horizontal_fov_deg) / half(pose.vertical_fov_deg);
    let vertical = half((aim.height_deg? / height).min(170.0));
    Some(2.0 * (shape * vertical).atan().to_degrees())
}

fn of(gaze: &Gaze) -> Direction {
    Direction { pan_deg: gaze.pan_deg, tilt_deg: gaze.tilt_deg }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::handover::stage::{FEET, RATE, link, person, target, view, wish};

    const PICTURE: Duration = Duration::from_millis(80);

    /// A call of `yard` for target 3, and what `door` sees from picture to picture.
    struct Bench {
        call: Call,
        link: Link,
        door: Arc<Known>,
        came: Instant,
    }

    impl Bench {
        fn new() -> Self {
            let call = Call::new(&wish(&["door"]), 3);
            Self {
                call,
                link: link(),
                door: view("door", true, Instant::now(), Vec::new()).known,
                came: Instant::now(),
            }
        }

        fn see(&mut self, people: &[Person]) -> Progress {
            self.came += PICTURE;
            let yard = view("yard", false, self.came, vec![person(3, FEET, RATE)]);
            let door = View { known: self.door.clone(), ..view("door", true, self.came, people.to_vec()) };
            self.call.advance(&self.link, &yard, &door)
        }

        fn take_up(&mut self) {
            (0..2).for_each(|_| assert_eq!(self.see(&[person(7, FEET, RATE)]), Progress::Going));
            assert_eq!(self.see(&[person(7, FEET, RATE)]), Progress::TakenUp(7));
        }
    }

    #[test]
    fn who_walks_as_they_do_is_taken_up_and_what_stays_where_they_pass_is_not() {
        let mut bench = Bench::new();
        assert_eq!(bench.see(&[]), Progress::Going);
        assert!(matches!(*lock(&bench.door.steering), Steering::LookAt(..)));
        let ghost = person(6, FEET, 0.0);
        let walker = person(7, [FEET[0] + 0.01, FEET[1]], RATE);
        assert_eq!(bench.see(&[ghost.clone(), walker.clone()]), Progress::Going);
        assert_eq!(bench.see(&[ghost.clone(), walker.clone()]), Progress::Going);
        assert_eq!(bench.see(&[ghost, walker]), Progress::TakenUp(7));
        assert_eq!(*lock(&bench.door.steering), Steering::Follow);
        let origin = Origin { target: 7, id: 3, camera: "yard".to_owned() };
        assert_eq!(*lock(&bench.door.origin), Some(origin));
    }

    #[test]
    fn who_is_followed_elsewhere_is_somebody_else_and_they_are_looked_for_again() {
        let mut bench = Bench::new();
        bench.take_up();
        let here = target(person(7, FEET, RATE));
        (0..20).for_each(|_| assert_eq!(bench.see(std::slice::from_ref(&here)), Progress::Going));
        let elsewhere = target(person(7, [0.9, 0.7], 0.0));
        let ends = (0..20).find(|_| bench.see(std::slice::from_ref(&elsewhere)) == Progress::Again);
        assert_eq!(ends, Some(13), "a second later");
        assert_eq!(bench.see(&[elsewhere]), Progress::Going);
        assert!(matches!(*lock(&bench.door.steering), Steering::LookAt(..)));
    }

    #[test]
    fn a_new_number_of_theirs_is_taken_up_at_once() {
        let mut bench = Bench::new();
        bench.take_up();
        let other = [target(person(7, [0.9, 0.7], 0.0)), person(8, FEET, RATE)];
        assert_eq!(bench.see(&other), Progress::Going);
        assert_eq!(bench.see(&other), Progress::Going);
        assert_eq!(bench.see(&other), Progress::TakenUp(8));
    }

    #[test]
    fn a_camera_that_refuses_to_turn_follows_again() {
        let mut bench = Bench::new();
        lock(&bench.door.state).refused_moves = 2;
        assert_eq!(bench.see(&[]), Progress::Going);
        assert_eq!(bench.see(&[]), Progress::Going, "it refused others");
        lock(&bench.door.state).refused_moves = 3;
        assert_eq!(bench.see(&[]), Progress::Refused);
        assert_eq!(*lock(&bench.door.steering), Steering::Follow);
    }

    #[test]
    fn a_camera_that_finds_nobody_there_turns_back() {
        let mut bench = Bench::new();
        assert_eq!(bench.see(&[]), Progress::Going);
        bench.call.begun -= LONGEST + Duration::from_secs(1);
        assert_eq!(bench.see(&[]), Progress::Failed);
        let before = Gaze { pan_deg: 0.0, tilt_deg: -10.0, fov_deg: Some(60.0) };
        let steering = *lock(&bench.door.steering);
        assert!(matches!(steering, Steering::TurnBack(gaze, _) if gaze == before), "{steering:?}");
    }

    /// It was not told yet, as nobody knew where they are, or they are looked for again.
    #[test]
    fn a_camera_that_somebody_takes_before_it_was_told_to_turn_is_left_to_them() {
        let gaze = Gaze { pan_deg: 5.0, tilt_deg: 0.0, fov_deg: None };
        let now = Instant::now();
        for taken in [Steering::HandedOver, Steering::Turned(gaze, now), Steering::GoHome(now)] {
            let mut bench = Bench::new();
            bench.door.steer(taken);
            assert_eq!(bench.see(&[]), Progress::Over);
            assert_eq!(*lock(&bench.door.steering), taken);

            let mut bench = Bench::new();
            bench.take_up();
            bench.call.look_again();
            bench.door.steer(taken);
            assert_eq!(bench.see(&[]), Progress::Over, "they were to be looked for again");
            assert_eq!(*lock(&bench.door.steering), taken);
        }
        let mut bench = Bench::new();
        bench.door.operator.store(true, Ordering::Relaxed);
        assert_eq!(bench.see(&[]), Progress::Over, "an operator moves it");
        assert_eq!(*lock(&bench.door.steering), Steering::Follow);
    }

    /// Between the look at who has it and the order.
    #[test]
    fn a_camera_that_somebody_takes_as_it_is_told_to_turn_is_left_to_them() {
        let mut bench = Bench::new();
        let yard = view("yard", false, bench.came, vec![person(3, FEET, RATE)]);
        let door = View { known: bench.door.clone(), ..view("door", true, bench.came, Vec::new()) };
        bench.door.steer(Steering::HandedOver);
        assert!(!bench.call.turn(&bench.link, &yard, &door));
        assert_eq!(*lock(&bench.door.steering), Steering::HandedOver);
        bench.call.cancel(&bench.door);
        assert_eq!(*lock(&bench.door.steering), Steering::HandedOver);
    }

    #[test]
    fn whom_somebody_chooses_by_hand_is_followed() {
        let mut bench = Bench::new();
        bench.take_up();
        bench.door.select(0.5, 0.5);
        assert_eq!(bench.see(&[target(person(7, FEET, RATE))]), Progress::Over);
    }
}
