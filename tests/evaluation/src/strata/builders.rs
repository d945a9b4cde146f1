// SPDX-License-Identifier: MPL-2.0

//! What each stratum is about: a small change to a person who walks across a room.

use std::time::Duration;

use virtual_camera::{Action, Event, Lighting, Occlusion, Place, Pose, Seeded, Subject};

use super::draft::Draft;
use crate::{experiment::Target, record::FirstBox};

pub(super) fn alone(draft: &mut Draft, chance: &mut Seeded) {
    draft.room.occlusion = Occlusion::None;
    draft.room.lighting = Lighting::Optimal;
    draft.room.action = chance.pick(&[Action::Test, Action::Test, Action::StopAndGo, Action::Run]);
}

pub(super) fn hidden(draft: &mut Draft, chance: &mut Seeded) {
    draft.room.occlusion = chance.pick(&[Occlusion::Partial, Occlusion::Full, Occlusion::Full]);
    draft.room.lighting = Lighting::Optimal;
}

/// Whom to follow is told by a click: anybody else would be as good a choice.
fn among_others(draft: &mut Draft, action: Action) {
    draft.room.action = action;
    draft.room.occlusion = Occlusion::None;
    draft.room.lighting = Lighting::Optimal;
    draft.first_box = FirstBox::Given;
}

pub(super) fn crossing(draft: &mut Draft, chance: &mut Seeded) {
    among_others(draft, chance.pick(&[Action::Cross, Action::CrossAlike, Action::Overtake]));
}

pub(super) fn parting(draft: &mut Draft, _chance: &mut Seeded) {
    among_others(draft, Action::Part);
}

pub(super) fn parting_alike(draft: &mut Draft, chance: &mut Seeded) {
    parting(draft, chance);
    draft.room.alike = true;
}

pub(super) fn crowd(draft: &mut Draft, _chance: &mut Seeded) {
    among_others(draft, Action::Test);
    draft.room.others = 6;
}

pub(super) fn crowd_alike(draft: &mut Draft, chance: &mut Seeded) {
    crowd(draft, chance);
    draft.room.alike = true;
}

pub(super) fn groups(draft: &mut Draft, chance: &mut Seeded) {
    among_others(draft, chance.pick(&[Action::Group, Action::Test]));
    draft.room.others = 2 + chance.below(6);
}

pub(super) fn reflecting(draft: &mut Draft, _chance: &mut Seeded) {
    draft.room.occlusion = Occlusion::None;
    draft.room.lighting = Lighting::Optimal;
    draft.room.reflections = true;
}

pub(super) fn dark(draft: &mut Draft, chance: &mut Seeded) {
    draft.room.occlusion = Occlusion::None;
    draft.room.lighting = chance.pick(&[Lighting::Dim, Lighting::Dim, Lighting::Dark]);
    // Clothed nearly in the colour of the wall.
    draft.room.subject = Subject::A;
    draft.camera.imaging.noise_filter = chance.pick(&[0.0, 0.5, 0.8]);
}

pub(super) fn nobody(draft: &mut Draft, chance: &mut Seeded) {
    draft.room.action = Action::Nobody;
    draft.target = Target::Nobody;
    let happens = |chance: &mut Seeded| chance.unit() < 0.6;
    draft.room.events = Event::ALL.into_iter().map(|(event, _)| event).filter(|_| happens(chance)).collect();
    // Nothing happens in the first minute and a half of some of them.
    draft.begin = Duration::from_secs_f64(chance.range(90.0, 300.0));
}

fn in_yard(draft: &mut Draft, place: Place, action: Action) {
    draft.room.place = place;
    draft.room.action = action;
    draft.room.occlusion = Occlusion::None;
    draft.room.lighting = Lighting::Optimal;
}

pub(super) fn far(draft: &mut Draft, chance: &mut Seeded) {
    in_yard(draft, Place::Yard, Action::Far);
    draft.room.events = weather(&[Event::Draught, Event::Clouds], chance);
}

pub(super) fn outdoors(draft: &mut Draft, chance: &mut Seeded) {
    let place = chance.pick(&[Place::Yard, Place::Yard, Place::NightYard, Place::InfraredYard]);
    in_yard(draft, place, Action::Test);
    let light = if place == Place::Yard { Event::Clouds } else { Event::Headlights };
    draft.room.events = weather(&[Event::Draught, Event::Rain, light], chance);
}

fn weather(events: &[Event], chance: &mut Seeded) -> Vec<Event> {
    events.iter().copied().filter(|_| chance.unit() < 0.6).collect()
}

pub(super) fn vehicles(draft: &mut Draft, chance: &mut Seeded) {
    if chance.unit() < 0.5 {
        in_yard(draft, Place::Yard, Action::Drive);
    } else {
        in_yard(draft, Place::Yard, Action::Test);
        draft.room.vehicles = 1 + chance.below(3);
        draft.first_box = FirstBox::Given;
    }
}

pub(super) fn near(draft: &mut Draft, chance: &mut Seeded) {
    draft.room.action = Action::Near;
    draft.room.occlusion = Occlusion::None;
    // Magnified 1.6 to 2 times: from above, as here, nobody fills the widest view, however close they come.
    let zoom_step = chance.range(350.0, 600.0);
    draft.camera.home = Some(Pose { zoom_step, ..draft.room.home() });
    // They show from about 4 s on.
    draft.begin = Duration::from_secs(2);
}

pub(super) fn turning(draft: &mut Draft, chance: &mut Seeded) {
    draft.room.occlusion = Occlusion::None;
    draft.room.lighting = Lighting::Optimal;
    draft.begin = Duration::from_secs_f64(chance.range(4.0, 5.0));
    draft.lead = Duration::from_millis(1500);
}

pub(super) fn faint(draft: &mut Draft, chance: &mut Seeded) {
    hardly_seen(draft, chance.range(3.0, 5.0));
}

pub(super) fn pale(draft: &mut Draft, chance: &mut Seeded) {
    hardly_seen(draft, chance.range(6.0, 12.0));
}

/// Somebody so many grey levels from the wall, in little light.
fn hardly_seen(draft: &mut Draft, levels: f64) {
    draft.room.occlusion = Occlusion::None;
    draft.room.lighting = Lighting::Dim;
    draft.room.faint = Some(levels);
}

pub(super) fn reaching(draft: &mut Draft, chance: &mut Seeded) {
    draft.room.action = Action::Reach;
    draft.room.occlusion = Occlusion::None;
    draft.room.lighting = Lighting::Optimal;
    draft.room.events = vec![Event::Film];
    draft.room.events.extend(Some(Event::Draught).filter(|_| chance.unit() < 0.5));
    // Hands show from about 2 s on.
    draft.begin = Duration::from_millis(1000);
}
