// SPDX-License-Identifier: MPL-2.0

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use handover::{Direction, Place};
use ptztrack_contract::Point;
use ptztrack_contract::lock::lock;

use super::exchange::Errand;
use super::motion::Motion;
use crate::camera::{Gaze, Known, Person, Pose, Sight, Steering};

/// What was seen longer ago says nothing of where somebody is.
const FRESH: Duration = Duration::from_millis(500);
/// Over so long it is measured how fast somebody goes.
const STEP: Duration = Duration::from_millis(200);

/// One camera as it is seen in one moment.
pub struct View {
    /// This process runs it.
    pub is_here: bool,
    pub known: Arc<Known>,
    /// What it saw last, and when.
    pub seen: Arc<(Instant, Sight)>,
    /// It tells where it looks.
    pub turns: bool,
    /// Nothing is known that speaks against it.
    pub can_be_called: bool,
    /// How late its pictures are.
    pub video: Duration,
    /// Horizontal, zoomed out, as far as that was seen.
    pub widest_fov_deg: Option<f64>,
    /// How tall whom it follows is to be, where it zooms.
    pub target_height: Option<f64>,
    /// For whom it was called, while it is on its way.
    pub errand: Option<Errand>,
}

impl View {
    /// Nobody else moves it, it has a picture, and nothing else is wanted of it.
    pub fn follows(&self) -> bool {
        *lock(&self.known.steering) == Steering::Follow
            && !self.known.operator.load(Ordering::Relaxed)
            && lock(&self.known.state).picture
    }

    pub fn is_fresh(&self) -> bool {
        self.seen.0.elapsed() < FRESH
    }

    /// Whether it was called for this track of another camera: it is on its way, or follows them as its target.
    pub fn is_called_for(&self, camera: &str, id: u64) -> bool {
        let target = lock(&self.known.state).target_id;
        let origin = lock(&self.known.origin);
        self.errand.as_ref().is_some_and(|errand| errand.from == camera && errand.id == id)
            || origin.as_ref().is_some_and(|origin| {
                origin.camera == camera && origin.id == id && target == Some(origin.target)
            })
    }

    pub fn people(&self) -> &[Person] {
        &self.seen.1.people
    }

    pub fn person(&self, id: u64) -> Option<&Person> {
        self.people().iter().find(|person| person.id == id)
    }

    /// What it saw where when its last picture was taken.
    fn last(&self) -> Option<ptztrack_contract::View> {
        self.seen.1.pose_about(self.video)?.view()
    }

    /// Where it looked when the picture that came then was taken; `None` where that is not known yet.
    pub fn pose_when(&self, came: Instant) -> Option<Pose> {
        self.seen.1.pose_at(self.seen.0.saturating_duration_since(came) + self.video)
    }

    /// Horizontal, now.
    pub fn fov_deg(&self) -> Option<f64> {
        self.seen.1.poses.last().map(|pose| pose.horizontal_fov_deg)
    }

    /// Where it looks now.
    pub fn gaze(&self) -> Option<Gaze> {
        let pose = self.seen.1.poses.last()?;
        Some(Gaze { pan_deg: pose.pan_deg, tilt_deg: pose.tilt_deg, fov_deg: Some(pose.horizontal_fov_deg) })
    }

    /// In which direction that is which its last picture shows there; `None` where it is not known where it looked.
    pub fn direction_of(&self, point: Point) -> Option<Direction> {
        Some(direction(&self.pose_when(self.seen.0)?.view()?, point))
    }

    /// The same as a place, of a camera that does not turn, too.
    pub fn place_of(&self, point: Point) -> Option<Place> {
        if self.turns {
            self.direction_of(point).map(Place::towards)
        } else {
            Some(Place::in_picture(point.x, point.y))
        }
    }

    /// Where it sees the feet of somebody, so many seconds after its last picture.
    pub fn place(&self, person: &Person, ahead_s: f64) -> Option<Place> {
        let feet = person.ahead(ahead_s).feet();
        if self.turns {
            Some(Place::towards(direction(&self.last()?, feet)))
        } else {
            Some(Place::in_picture(feet.x, feet.y))
        }
    }

    /// As far beside their feet as they are wide to either side.
    pub fn beside(&self, person: &Person) -> Option<Place> {
        let [x, y, width, height] = person.bounds;
        self.place(&Person { bounds: [x + width / 2.0, y, width, height], ..person.clone() }, 0.0)
    }

    /// Where it saw the feet of somebody in the picture that came then; `None` where it is not known yet where it looked.
    pub fn place_when(&self, person: &Person, came: Instant) -> Option<Place> {
        if self.turns {
            let view = self.pose_when(came)?.view()?;
            Some(Place::towards(direction(&view, person.feet())))
        } else {
            self.place(person, 0.0)
        }
    }

    /// Whom it follows, and how they go.
    pub fn target(&self) -> Option<(&Person, Motion)> {
        self.motions().find(|(person, _)| person.is_target)
    }

    /// Where the feet of those are whom it sees, by its last picture, and how fast they go.
    pub fn motions(&self) -> impl Iterator<Item = (&Person, Motion)> {
        let view = self.last();
        let seen = self.people().iter().filter(|person| person.seen);
        seen.filter_map(move |person| Some((person, motion(view.as_ref()?, person))))
    }
}

fn motion(view: &ptztrack_contract::View, person: &Person) -> Motion {
    let feet = |seconds: f64| direction(view, person.ahead(seconds).feet());
    Motion::between(feet(0.0), feet(STEP.as_secs_f64()), STEP.as_secs_f64())
}

/// In which direction a camera sees a point.
pub fn direction(view: &ptztrack_contract::View, point: Point) -> Direction {
    let (pan_deg, tilt_deg) = view.angles_of(point);
    Direction { pan_deg, tilt_deg }
}
