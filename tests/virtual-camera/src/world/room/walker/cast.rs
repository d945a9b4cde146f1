// SPDX-License-Identifier: MPL-2.0

//! Who is in the room, and the ways they take where the room does not play a test of the thesis.

use std::f64::consts::PI;

use super::{
    super::{
        action::Action,
        settings::{RoomSettings, Subject},
    },
    SUBJECTS,
    route::{self, Leg, Leg::*, Way},
    walk::{ENTRY_DEG, TO_THE_EDGE},
};
use crate::{seeded::Seeded, truth::Kind};

/// Metres per second of ordinary walking, of somebody slow, of somebody in a hurry, and of running.
const SPEED: f64 = 1.4;
const SLOW: f64 = 1.0;
const FAST: f64 = 1.9;
const RUN: f64 = 4.0;
/// When those who walk set off, in seconds: as in the tests.
const DEPARTURE: f64 = 0.8;
/// How long somebody wanders, in seconds, and each of those who take turns.
const WANDERING: f64 = 180.0;
const RELAY: f64 = 60.0;
/// So far to the side a camera that turns no farther than it has to sees nobody any more, in metres.
const GONE: f64 = 12.0;
/// The part of the floor in which they walk: from side to side and ahead of the camera, in metres.
const FLOOR: ((f64, f64), (f64, f64)) = ((-4.2, 4.2), (4.9, 6.9));

/// Who reaches into the view stands so far outside of it, in metres: hands and forearms are in it.
const HANDS_IN: f64 = 0.4;

/// Those in a group walk so far apart, in metres, and so fast.
const APART: f64 = 0.62;
const GROUP_SPEED: f64 = 1.25;
/// Where others walk about before and behind the person's way, ahead of the camera and from side to side.
const BEFORE: (f64, f64) = (3.7, 4.5);
const BEHIND: (f64, f64) = (6.4, 7.2);
const WIDTH: (f64, f64) = (-5.5, 5.5);
/// Where vehicles drive to the right and to the left, ahead of the camera, and from how far to either side, in metres.
const LANES: (f64, f64) = (10.6, 13.6);
const STREET: f64 = 32.0;
/// Their stream of chance.
const OTHERS: u64 = 0x07e5;

/// Somebody in the room.
#[derive(Debug, Clone)]
pub(super) struct Role {
    pub subject: Subject,
    /// Whose clothes they wear: their number, from 0. The first three are the subjects' own.
    pub clothes: usize,
    pub kind: Kind,
    pub way: Way,
}

/// Everybody of an action that is not a test, the one to be followed first.
pub(super) fn cast(settings: &RoomSettings) -> Vec<Role> {
    let mut chance = Seeded::new(settings.seed).fork(0xca57).fork(settings.action.way());
    let stage = Stage::new(&mut chance);
    let alone = |way| vec![(way, 0)];
    let ways = match settings.action {
        Action::Test | Action::Nobody => Vec::new(),
        Action::Cross => stage.cross(&mut chance, 1),
        Action::CrossAlike => stage.cross(&mut chance, 0),
        Action::Part => stage.part(&mut chance),
        Action::Overtake => stage.overtake(&mut chance),
        Action::StopAndGo => alone(stage.stop_and_go(&mut chance)),
        Action::Sit => alone(stage.sit(&mut chance)),
        Action::Approach => alone(stage.approach(&mut chance)),
        Action::Run => alone(stage.run()),
        Action::Wander => alone(stage.wander(&mut chance)),
        Action::Group => stage.group(&mut chance, settings.others),
        Action::Near => alone(stage.near(&mut chance)),
        Action::Far => alone(stage.far(&mut chance)),
        Action::Drive => alone(stage.drive(&mut chance)),
        Action::Reach => alone(stage.reach(&mut chance)),
        Action::Relay => stage.relay(&mut chance),
        Action::Join => stage.join(&mut chance),
    };
    let first = if settings.action == Action::Drive { Kind::Vehicle } else { Kind::Person };
    let others = [Subject::A, Subject::B, Subject::C].into_iter().filter(|other| *other != settings.subject);
    let subjects: Vec<_> = std::iter::once(settings.subject).chain(others).collect();
    let role =
        |(way, clothes): (Way, usize)| Role { subject: subjects[clothes % 3], clothes, kind: first, way };
    ways.into_iter().map(role).collect()
}

/// Those who move about besides, people first, `before` of the action itself being numbered before them.
pub(super) fn others(settings: &RoomSettings, before: usize) -> Vec<Role> {
    let seeded = Seeded::new(settings.seed).fork(0xca57).fork(OTHERS);
    let person = |number: usize| {
        let mut chance = seeded.fork(number as u64);
        let subject = chance.pick(&[Subject::B, Subject::C]);
        // Two behind the person's way for each before it, where they may hide them.
        let band = if number % 3 == 2 { BEFORE } else { BEHIND };
        let way = about(band, &mut chance);
        // Nobody wears what one of the subjects wears, who may be the person to be followed.
        Role { subject, clothes: SUBJECTS + before + number, kind: Kind::Person, way }
    };
    let vehicle = |number: usize| {
        let mut chance = seeded.fork(100 + number as u64);
        let way = passing(number, &mut chance);
        Role { subject: Subject::A, clothes: 0, kind: Kind::Vehicle, way }
    };
    let people = if settings.action == Action::Group { 0 } else { settings.others };
    (0..people).map(person).chain((0..settings.vehicles).map(vehicle)).collect()
}

/// A vehicle that drives along the street, one after the other and by turns on either side of it.
fn passing(number: usize, chance: &mut Seeded) -> Way {
    let side = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
    let lane = if side > 0.0 { LANES.0 } else { LANES.1 };
    let (start, end) = ((-side * STREET, lane), (side * STREET, lane));
    Way {
        start,
        heading: side * PI / 2.0,
        departure: chance.range(0.0, 3.0) + 3.0 * number as f64,
        above_deg: 0.0,
        legs: vec![Past(end, chance.range(6.0, 11.0))],
    }
}

/// Somebody who is there from the beginning and walks about in a part of the floor, so far ahead of the camera.
fn about((near, far): (f64, f64), chance: &mut Seeded) -> Way {
    let place = |chance: &mut Seeded| (chance.range(WIDTH.0, WIDTH.1), chance.range(near, far));
    let start = place(chance);
    Way {
        start,
        heading: chance.range(-PI, PI),
        departure: chance.range(0.0, 2.0),
        above_deg: 0.0,
        legs: strolling(start, WANDERING, chance, place),
    }
}

/// From place to place for so many seconds, with stops, at changing speeds.
fn strolling(
    mut place: (f64, f64),
    lasting: f64,
    chance: &mut Seeded,
    somewhere: impl Fn(&mut Seeded) -> (f64, f64),
) -> Vec<Leg> {
    let (mut legs, mut seconds) = (Vec::new(), 3.0);
    while seconds < lasting {
        let next = somewhere(chance);
        let (length, speed) = ((next.0 - place.0).hypot(next.1 - place.1), chance.range(0.7, 1.7));
        if length < 1.2 {
            continue;
        }
        let pause = chance.range(0.5, 4.0);
        if chance.unit() < 0.3 {
            legs.extend([To(next, speed), Stand(pause)]);
            seconds += pause + 1.0;
        } else {
            legs.push(Past(next, speed));
        }
        seconds += length / speed + 0.4;
        place = next;
    }
    legs
}

/// Where the sofa stands that somebody sits down on, (x, z) of the sitter's feet before it.
pub(super) fn seat(settings: &RoomSettings) -> Option<(f64, f64)> {
    let mut chance = Seeded::new(settings.seed).fork(0xca57).fork(settings.action.way());
    let stage = Stage::new(&mut chance);
    (settings.action == Action::Sit).then(|| stage.seat())
}

/// From which side to which the way leads, and how far ahead of the camera.
struct Stage {
    /// 1 from left to right, -1 the other way.
    side: f64,
    /// Metres ahead of the camera.
    lane: f64,
    /// How far above the middle of the first view somebody comes in, in degrees.
    above_deg: f64,
}

impl Stage {
    fn new(chance: &mut Seeded) -> Self {
        Self {
            side: chance.pick(&[-1.0, 1.0]),
            lane: chance.range(5.3, 6.0),
            above_deg: chance.range(-ENTRY_DEG, ENTRY_DEG),
        }
    }

    /// Where somebody starts out of sight on a lane, and where they leave the room.
    fn start(&self, lane: f64) -> (f64, f64) {
        (-self.side * lane * 51f64.to_radians().tan(), lane)
    }

    fn end(&self, lane: f64) -> (f64, f64) {
        (self.side * lane * 47f64.to_radians().tan(), lane)
    }

    /// A place so far from the middle of the lane, along the way.
    fn at(&self, along: f64, lane: f64) -> (f64, f64) {
        (self.side * along, lane)
    }

    fn way(&self, start: (f64, f64), departure: f64, legs: Vec<Leg>) -> Way {
        let heading = match legs.first() {
            Some(Past(to, _) | To(to, _)) => (to.0 - start.0).atan2(to.1 - start.1),
            _ => self.side * PI / 2.0,
        };
        Way { start, heading, departure, above_deg: self.above_deg, legs }
    }

    fn across(&self, lane: f64, speed: f64) -> Way {
        self.way(self.start(lane), DEPARTURE, vec![Past(self.end(lane), speed)])
    }

    /// The other comes nearer the camera or farther away.
    fn cross(&self, chance: &mut Seeded, clothes: usize) -> Vec<(Way, usize)> {
        let other = self.lane + chance.pick(&[-0.55, 0.65]);
        let back = Self { side: -self.side, lane: other, ..*self };
        let meets = back.way(
            back.start(other),
            DEPARTURE + chance.range(0.0, 0.8),
            vec![Past(back.end(other), SPEED)],
        );
        vec![(self.across(self.lane, SPEED), 0), (meets, clothes)]
    }

    /// Side by side, the other half a step ahead; then one of the two turns off and goes back behind them.
    fn part(&self, chance: &mut Seeded) -> Vec<(Way, usize)> {
        let (lane, other) = (self.lane, self.lane + chance.pick(&[-0.6, 0.6]));
        let begin = self.start(other);
        let beside = (begin.0 + self.side * 0.35, other);
        let parting = chance.range(-0.8, 0.8);
        let leaves = if other > lane { 7.2 } else { 4.8 };
        let straight = |start, lane| self.way(start, DEPARTURE, vec![Past(self.end(lane), SPEED)]);
        let off = |start, lane: f64, away: f64| {
            let legs = vec![
                Past(self.at(parting, lane), SPEED),
                Past(self.at(parting + 0.6, (lane + away) / 2.0), SPEED),
                Past(self.at(parting, away), SPEED),
                Past((begin.0, away), SPEED),
            ];
            self.way(start, DEPARTURE, legs)
        };
        // Who turns off goes to the side that the other is not on.
        if chance.unit() < 0.5 {
            let away = if other > lane { 4.8 } else { 7.2 };
            vec![(off(self.start(lane), lane, away), 0), (straight(beside, other), 1)]
        } else {
            vec![(straight(self.start(lane), lane), 0), (off(beside, other, leaves), 1)]
        }
    }

    fn overtake(&self, chance: &mut Seeded) -> Vec<(Way, usize)> {
        let other = self.lane + chance.pick(&[-0.55, 0.6]);
        let length = self.end(self.lane).0 - self.start(self.lane).0;
        // They are level half-way: the slow one has gone for so long.
        let level = length.abs() / 2.0 / SLOW - length.abs() / 2.0 / FAST;
        let faster = self.way(self.start(other), DEPARTURE + level, vec![Past(self.end(other), FAST)]);
        vec![(self.across(self.lane, SLOW), 0), (faster, 1)]
    }

    fn stop_and_go(&self, chance: &mut Seeded) -> Way {
        let mut legs = Vec::new();
        for along in [-2.6, -0.1, 2.4] {
            legs.push(To(self.at(along + chance.range(-0.4, 0.4), self.lane), SPEED));
            legs.push(Stand(chance.range(1.5, 5.0)));
        }
        legs.push(Past(self.end(self.lane), SPEED));
        self.way(self.start(self.lane), DEPARTURE, legs)
    }

    fn seat(&self) -> (f64, f64) {
        self.at(0.3, self.lane)
    }

    fn sit(&self, chance: &mut Seeded) -> Way {
        let seat = self.seat();
        // Looks at the camera, more or less.
        let facing = seat.0.atan2(seat.1) + PI + chance.range(-0.1, 0.1);
        let legs = vec![
            To(seat, SPEED),
            Face(facing),
            Sit(chance.range(4.0, 7.0)),
            Past(self.end(self.lane), SPEED),
        ];
        self.way(self.start(self.lane), DEPARTURE, legs)
    }

    fn approach(&self, chance: &mut Seeded) -> Way {
        let along = chance.range(-0.6, 0.6);
        // Both on one line of sight.
        let far = self.at(along, 6.9);
        let near = (far.0 * 3.0 / 6.9, 3.0);
        let legs = vec![
            Past(self.at(along - 1.2, 6.7), SPEED),
            Past((far.0 * 0.95, 6.5), SPEED),
            To(near, SPEED),
            Stand(chance.range(0.3, 1.5)),
            To(far, SPEED),
            Past(self.end(6.4), SPEED),
        ];
        self.way(self.start(6.4), DEPARTURE, legs)
    }

    fn run(&self) -> Way {
        let legs = vec![
            Past(self.at(-5.0, self.lane), 2.0),
            Past(self.at(4.6, self.lane), RUN),
            Past(self.at(5.0, self.lane + 0.7), SPEED),
            Past(self.at(4.0, self.lane + 0.9), SPEED),
            Past(self.at(-4.6, self.lane + 0.7), RUN),
        ];
        self.way(self.start(self.lane), DEPARTURE, legs)
    }

    fn wander(&self, chance: &mut Seeded) -> Way {
        self.wander_for(WANDERING, DEPARTURE, chance)
    }

    fn wander_for(&self, seconds: f64, departure: f64, chance: &mut Seeded) -> Way {
        let first = self.at(-3.5, self.lane);
        let ((left, right), (near, far)) = FLOOR;
        let somewhere = |chance: &mut Seeded| (chance.range(left, right), chance.range(near, far));
        let mut legs = vec![Past(first, SPEED)];
        legs.extend(strolling(first, seconds, chance, somewhere));
        self.way(self.start(self.lane), departure, legs)
    }

    /// One after the other: the second comes in where the first one came in, some seconds after that one has left on the other
    /// side.
    fn relay(&self, chance: &mut Seeded) -> Vec<(Way, usize)> {
        let mut first = self.wander_for(RELAY, DEPARTURE, chance);
        first.legs.push(Past(self.at(GONE, self.lane), SPEED));
        let (_, left) = route::follow(&first);
        let second = self.wander_for(RELAY, left + chance.range(3.0, 6.0), chance);
        vec![(first, 0), (second, 1)]
    }

    /// The second comes in where the first one came in, a minute and some seconds later.
    fn join(&self, chance: &mut Seeded) -> Vec<(Way, usize)> {
        let first = self.wander(chance);
        let second = self.wander_for(RELAY, RELAY + chance.range(3.0, 6.0), chance);
        vec![(first, 0), (second, 1)]
    }

    /// In rows of up to three, at about the same speed; the person is anywhere in the first row.
    fn group(&self, chance: &mut Seeded, others: usize) -> Vec<(Way, usize)> {
        let abreast = others.min(2) + 1;
        let own = chance.below(abreast);
        let mut places: Vec<usize> = (0..=others).filter(|place| *place != own).collect();
        places.insert(0, own);
        let mut member = |(clothes, place): (usize, usize)| {
            let (row, file) = (place / abreast, place % abreast);
            let lane =
                self.lane + APART * (file as f64 - (abreast - 1) as f64 / 2.0) + chance.range(-0.1, 0.1);
            let (start, behind) = (self.start(lane), 0.9 * row as f64 + chance.range(-0.15, 0.15));
            let start = (start.0 - self.side * behind, lane);
            let speed = GROUP_SPEED * chance.range(0.97, 1.03);
            (self.way(start, DEPARTURE, vec![Past(self.end(lane), speed)]), clothes)
        };
        places.into_iter().enumerate().map(&mut member).collect()
    }

    /// From far to the one side over a place just ahead of the camera to the other side.
    fn near(&self, chance: &mut Seeded) -> Way {
        let lane = chance.range(1.9, 2.3);
        let legs = vec![
            Past(self.at(-1.6, lane), SPEED),
            Past(self.at(1.6, lane), SPEED),
            Past(self.at(5.0, 4.4), SPEED),
        ];
        self.way(self.at(-5.6, 4.4), DEPARTURE, legs)
    }

    /// To and fro where people are 20 to 40 pixels high in a picture of 640 x 480.
    fn far(&self, chance: &mut Seeded) -> Way {
        let (lane, back) = (chance.range(29.0, 46.0), chance.range(-3.0, 3.0));
        let reach = 0.28 * lane;
        let legs = vec![
            Past(self.at(reach, lane), SPEED),
            Past(self.at(reach, lane + back), SPEED),
            Past(self.at(-reach, lane + back), SPEED),
        ];
        self.way(self.at(-reach, lane), DEPARTURE, legs)
    }

    /// Stands beside the first view for a while and reaches into it; then walks in.
    fn reach(&self, chance: &mut Seeded) -> Way {
        let start = self.start(self.lane);
        let stop = (start.0 + self.side * (TO_THE_EDGE - HANDS_IN), self.lane);
        let legs = vec![To(stop, SPEED), Reach(chance.range(0.8, 2.5)), Past(self.end(self.lane), SPEED)];
        self.way(start, DEPARTURE, legs)
    }

    /// Along the street, with a stop on the way.
    fn drive(&self, chance: &mut Seeded) -> Way {
        let lane = if self.side > 0.0 { LANES.0 } else { LANES.1 };
        let speed = chance.range(3.0, 6.0);
        let legs = vec![
            To(self.at(chance.range(-1.0, 3.0), lane), speed),
            Stand(chance.range(0.5, 2.0)),
            Past(self.at(STREET, lane), speed),
        ];
        self.way(self.at(-13.0, lane), DEPARTURE, legs)
    }
}
