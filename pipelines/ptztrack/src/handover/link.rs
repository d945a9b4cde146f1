// SPDX-License-Identifier: MPL-2.0

//! From one camera to another: what is learned while both see the same person.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use handover::{Aim, Direction, Learned, Map, Pair, Place};

use crate::camera::{Person, Pose, Sight};

/// A picture of each that come within so long show the same moment: no longer than one is under way.
const SAME_MOMENT: Duration = Duration::from_millis(150);
/// Between two pairs: somebody who walks has come a foot further.
const EVERY: Duration = Duration::from_millis(200);
/// A camera that turns tells where it looks at least as often.
const LONGEST_WAIT: Duration = Duration::from_secs(3);

/// A person whom both see, until it is known where the camera looked.
#[derive(Debug)]
struct Moment {
    at: Instant,
    place: Place,
    person: Person,
}

/// From a camera that calls to one that is called.
#[derive(Debug)]
pub struct Link {
    pub map: Map,
    /// Something was learned since it was last kept.
    pub changed: bool,
    waiting: VecDeque<Moment>,
    last: Option<Instant>,
}

/// What a camera saw when.
pub type Seen = (Instant, Sight);

impl Link {
    pub fn new(map: Map) -> Self {
        Self { map, changed: false, waiting: VecDeque::new(), last: None }
    }

    /// Takes what both see. `video`: how late pictures of the one that turns are. Returns whether one of them was moved.
    pub fn see(&mut self, from: &Seen, to: &Seen, video: Duration) -> bool {
        self.notice(from, to, video);
        let mut moved = false;
        while let Some(moment) = self.waiting.front() {
            let age = to.0.saturating_duration_since(moment.at);
            if age > LONGEST_WAIT {
                self.waiting.pop_front();
                continue;
            }
            let Some(pose) = to.1.pose_at(age) else { break };
            let pair = pose.view().map(|view| pair(moment, &view));
            self.waiting.pop_front();
            match pair.map(|pair| self.map.learn(pair)) {
                Some(Learned::Taken) => self.changed = true,
                Some(Learned::Moved) => (self.changed, moved) = (true, true),
                Some(Learned::Contradicts) | None => {}
            }
        }
        moved
    }

    /// Keeps who is seen by both, if there is no doubt who that is.
    fn notice(&mut self, from: &Seen, to: &Seen, video: Duration) {
        let apart = if from.0 > to.0 { from.0 - to.0 } else { to.0 - from.0 };
        if apart > SAME_MOMENT || self.last.is_some_and(|last| to.0 < last + EVERY) {
            return;
        }
        let whole: Vec<&Person> = from.1.people.iter().filter(|person| person.is_whole()).collect();
        // Several may be told apart by what is known already; here they are left alone.
        let ([seen], Some(person)) = (whole.as_slice(), to.1.target()) else { return };
        let Some(at) = to.0.checked_sub(video) else { return };
        self.last = Some(to.0);
        self.waiting.push_back(Moment { at, place: place(&from.1, seen), person: person.clone() });
    }

    /// The camera that is called looks at this place, as somebody says. Returns whether that can be so.
    pub fn point(&mut self, x: f64, y: f64, pose: &Pose) -> bool {
        let direction = Direction { pan_deg: pose.pan_deg, tilt_deg: pose.tilt_deg };
        let pair = Pair { place: Place::in_picture(x, y), direction, height_deg: None, person: 0 };
        let learned = self.map.learn(pair) == Learned::Taken;
        self.changed |= learned;
        learned
    }

    /// Where to look for somebody whom the camera that calls sees there.
    pub fn aim(&self, sight: &Sight, person: &Person, lead: Duration) -> Option<Aim> {
        let ahead = lead.as_secs_f64();
        let [x, y, width, height] = person.bounds;
        let [right, down] = person.velocity;
        let bounds = [x + right * ahead, y + down * ahead, width, height];
        self.map.aim(place(sight, &Person { bounds, ..person.clone() }))
    }
}

/// Somebody's feet as a camera sees them: in its picture, or where it turns, in a direction.
fn place(_sight: &Sight, person: &Person) -> Place {
    let feet = person.feet();
    Place::in_picture(feet.x, feet.y)
}

fn pair(moment: &Moment, view: &ptztrack_contract::View) -> Pair {
    let [feet, head] = [moment.person.feet(), moment.person.head()].map(|point| direction(view, point));
    Pair {
        place: moment.place,
        direction: feet,
        height_deg: Some(head.tilt_deg - feet.tilt_deg).filter(|height| *height > 0.0),
        person: moment.person.id,
    }
}

/// In which direction a camera sees a point.
pub fn direction(view: &ptztrack_contract::View, point: ptztrack_contract::Point) -> Direction {
    let (pan_deg, tilt_deg) = view.angles_of(point);
    Direction { pan_deg, tilt_deg }
}
