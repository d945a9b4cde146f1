// SPDX-License-Identifier: MPL-2.0

//! A camera on its way to somebody whom another one sees.

use std::time::{Duration, Instant};

use handover::{Aim, Direction};

use super::View;
use super::link::{Link, Seen, direction};
use crate::camera::{Gaze, Origin, Person, Steering};
use crate::config::HandOver;
use ptztrack_contract::lock::lock;

/// It is given up after this: as long as a slow camera turns half round, and then sees nobody.
const LONGEST: Duration = Duration::from_secs(10);
/// Somebody is expected to go on as they do for so long: while a command, the camera and a picture are under way.
const LEAD: Duration = Duration::from_millis(500);
/// Between two orders to the camera.
const ORDER_EVERY: Duration = Duration::from_millis(400);
/// A place within so many standard deviations may be theirs.
const GATE: f64 = 3.0;
/// So many of them are to fit into the picture that the camera turns to: three to either side.
const IN_PICTURE: f64 = 6.0;

/// Somebody to turn to.
#[derive(Debug)]
pub struct Call {
    /// The camera that sees them.
    pub from: String,
    /// Their number there.
    pub id: u64,
    pub precedence: u32,
    begun: Instant,
    ordered: Option<(Instant, Gaze)>,
}

/// What becomes of it.
#[derive(Debug, PartialEq, Eq)]
pub enum Progress {
    Going,
    /// They are followed, under this number.
    TakenUp(u64),
    /// Somebody else wants something else of the camera.
    Overruled,
    /// They were not found.
    Failed,
}

impl Call {
    pub fn new(wish: &HandOver, id: u64) -> Self {
        let from = wish.from.clone();
        Self { from, id, precedence: wish.precedence, begun: Instant::now(), ordered: None }
    }

    /// Goes on with it.
    pub fn advance(&mut self, link: &Link, from: &Seen, called: &View) -> Progress {
        let steering = *lock(&called.known.steering);
        if self.ordered.is_some() && !matches!(steering, Steering::LookAt(..)) {
            return Progress::Overruled;
        }
        if let Some(person) = self.found(link, from, called) {
            if !person.is_target {
                called.known.select_track(person.id);
            }
            called.known.steer(Steering::Follow);
            let origin = Origin { target: person.id, id: self.id, camera: self.from.clone() };
            *lock(&called.known.origin) = Some(origin);
            return Progress::TakenUp(person.id);
        }
        if self.begun.elapsed() > LONGEST {
            called.known.steer(Steering::Follow);
            return Progress::Failed;
        }
        if let Some(gaze) = self.gaze(link, from, called).filter(|gaze| self.is_due(gaze, called)) {
            let now = Instant::now();
            self.ordered = Some((now, gaze));
            called.known.steer(Steering::LookAt(gaze, now));
        }
        Progress::Going
    }

    /// Whether the camera is to be told, as it was not yet, or was told a place that is off by an eighth of its picture by now.
    fn is_due(&self, gaze: &Gaze, called: &View) -> bool {
        let Some((at, before)) = self.ordered else { return true };
        let fov_deg = before.fov_deg.or_else(|| fov(called)).unwrap_or(0.0);
        at.elapsed() > ORDER_EVERY && of(gaze).angle_to_deg(of(&before)) > fov_deg / 8.0
    }

    /// Where the camera has to look; `None` where that is in too much doubt.
    pub fn gaze(&self, link: &Link, from: &Seen, called: &View) -> Option<Gaze> {
        let person = from.1.people.iter().find(|person| person.id == self.id)?;
        let aim = link.aim(&from.1, person, LEAD)?;
        let middle = aim.middle();
        let widest = called.widest_fov_deg?;
        let enough = IN_PICTURE * aim.doubt_deg;
        let fov_deg = called.target_height.and_then(|height| fills(&aim, height, called));
        let fov_deg = fov_deg.map(|fov_deg| fov_deg.max(enough).min(widest));
        let gaze = Gaze { pan_deg: middle.pan_deg, tilt_deg: middle.tilt_deg, fov_deg };
        // Whose place is known no better than that is not in the picture.
        (enough < 1.5 * fov_deg.or_else(|| fov(called))?).then_some(gaze)
    }

    fn found<'a>(&self, link: &Link, from: &Seen, called: &'a View) -> Option<&'a Person> {
        self.ordered?;
        let person = from.1.people.iter().find(|person| person.id == self.id)?;
        let aim = link.aim(&from.1, person, Duration::ZERO)?;
        nearest(&aim, called)
    }
}

/// Whether a camera follows whom this one sees.
pub fn follows(link: &Link, from: &Seen, person: &Person, called: &View) -> bool {
    let Some(aim) = link.aim(&from.1, person, Duration::ZERO) else { return false };
    nearest(&aim, called).is_some_and(|person| person.is_target)
}

/// Who of those whom a camera sees is where somebody has to be.
fn nearest<'a>(aim: &Aim, called: &'a View) -> Option<&'a Person> {
    let sight = &called.seen.1;
    let view = sight.pose_about(called.video)?.view()?;
    let off = |person: &Person| direction(&view, person.feet()).angle_to_deg(aim.feet);
    let seen = sight.people.iter().filter(|person| person.seen).map(|person| (person, off(person)));
    let (person, off) = seen.min_by(|one, other| one.1.total_cmp(&other.1))?;
    (off < GATE * aim.doubt_deg).then_some(person)
}

/// The field of view in which somebody fills the wanted part of the picture's height.
fn fills(aim: &Aim, height: f64, called: &View) -> Option<f64> {
    let pose = called.seen.1.poses.last()?;
    let half = |degrees: f64| (degrees / 2.0).to_radians().tan();
    let shape = half(pose.horizontal_fov_deg) / half(pose.vertical_fov_deg);
    let vertical = half((aim.height_deg? / height).min(170.0));
    Some(2.0 * (shape * vertical).atan().to_degrees())
}

fn fov(called: &View) -> Option<f64> {
    called.seen.1.poses.last().map(|pose| pose.horizontal_fov_deg)
}

fn of(gaze: &Gaze) -> Direction {
    Direction { pan_deg: gaze.pan_deg, tilt_deg: gaze.tilt_deg }
}
