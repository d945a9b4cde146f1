// SPDX-License-Identifier: MPL-2.0

//! What goes on in the room besides people: lights and things that change by themselves.

use std::f64::consts::TAU;

use crate::seeded::Seeded;

/// Something that happens without anybody.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// A door opens and falls shut.
    Door,
    /// A screen shows films.
    Film,
    /// Patches of sun come and go on the floor, cut into stripes by a blind.
    Sun,
    /// The light is switched off and on.
    Switch,
    /// A plant moves in the draught; out of doors all trees in the wind.
    Draught,
    /// Clouds' shadows drift over the ground, out of doors.
    Clouds,
    /// Headlights of a car out of sight sweep by, out of doors.
    Headlights,
    /// It rains, out of doors.
    Rain,
}

impl Event {
    /// Every one, with its name for command lines.
    pub const ALL: [(Self, &'static str); 8] = [
        (Self::Door, "door"),
        (Self::Film, "film"),
        (Self::Sun, "sun"),
        (Self::Switch, "switch"),
        (Self::Draught, "draught"),
        (Self::Clouds, "clouds"),
        (Self::Headlights, "headlights"),
        (Self::Rain, "rain"),
    ];
}

/// Something that is 0 but for some time now and then, as chance has it: rises and falls within `ramp` seconds.
#[derive(Debug, Clone)]
pub(super) struct Now {
    seeded: Seeded,
    /// Seconds in which it happens once.
    pub every: f64,
    /// Seconds for which it lasts, at least and at most.
    pub lasts: (f64, f64),
    pub ramp: f64,
}

impl Now {
    pub fn new(seeded: Seeded, every: f64, lasts: (f64, f64), ramp: f64) -> Self {
        Self { seeded, every, lasts, ramp }
    }

    /// How far it is at a time in seconds: 0 not at all, 1 wholly. The first time is not before `every`.
    pub fn at(&self, time: f64) -> f64 {
        let number = (time / self.every).floor();
        if number < 1.0 {
            return 0.0;
        }
        let mut chance = self.seeded.fork(number as u64);
        let lasts = chance.range(self.lasts.0, self.lasts.1);
        let begins = chance.range(0.0, (self.every - lasts - 2.0 * self.ramp).max(0.0));
        let since = time - number * self.every - begins;
        let share = (since.min(lasts + 2.0 * self.ramp - since) / self.ramp.max(1e-9)).clamp(0.0, 1.0);
        share * share * (3.0 - 2.0 * share)
    }
}

/// The light of all lamps together at a time in seconds, 1 unless they are switched off: once in 90 s, for 5 to 30 s.
/// Fluorescent tubes blink before they burn.
pub(super) fn lamps(seeded: &Seeded, time: f64) -> f64 {
    let off = Now::new(seeded.fork(0x5317), 90.0, (5.0, 30.0), 0.04);
    let dark = off.at(time);
    let just_lit = off.at(time - 0.9);
    let blinks = just_lit > 0.5 && dark < 0.5 && (time * 9.0 * TAU).sin() > 0.2;
    if blinks { 0.45 } else { 1.0 - 0.72 * dark }
}

/// How strongly the sun shines through the blind at a time in seconds, 0 to 1: clouds pass.
pub(super) fn sun(seeded: &Seeded, time: f64) -> f64 {
    let place = time / 11.0;
    let at = |index: f64| seeded.fork(0x5c10).fork(index as u64).unit();
    let share = place.fract();
    let eased = share * share * (3.0 - 2.0 * share);
    let clouds = at(place.floor()) + (at(place.floor() + 1.0) - at(place.floor())) * eased;
    ((clouds - 0.3) * 2.2).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lamps_are_off_now_and_then_and_on_most_of_the_time() {
        let light: Vec<f64> = (0..6000).map(|step| lamps(&Seeded::new(3), f64::from(step) * 0.1)).collect();
        let dark = light.iter().filter(|light| **light < 0.4).count();
        assert!((250..2500).contains(&dark), "{dark}");
        assert!(light[..800].iter().all(|light| *light == 1.0));
    }

    #[test]
    fn the_sun_comes_and_goes_slowly() {
        let sun: Vec<f64> = (0..6000).map(|step| sun(&Seeded::new(3), f64::from(step) * 0.1)).collect();
        assert!(sun.contains(&0.0) && sun.contains(&1.0));
        assert!(sun.windows(2).all(|pair| (pair[0] - pair[1]).abs() < 0.04));
    }
}
