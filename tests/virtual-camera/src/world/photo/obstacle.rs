// SPDX-License-Identifier: MPL-2.0

//! Something that stands before the person: a board or a pillar, whose surface is a piece of the panorama itself.

use super::{
    settings::PhotoSettings,
    way::{HALF_WIDTH, HEIGHT, Way, turned},
};
use crate::world::Occlusion;

/// How far from the lens it stands, as a part of the person's distance.
const NEARNESS: f64 = 0.78;
/// Where the hiding begins, as a part of the way from one end to the other.
const BEGINS: f64 = 0.42;
/// Seconds for which all of the person is hidden, or their legs.
const HIDDEN: f64 = 1.0;
const LEGS_HIDDEN: f64 = 2.0;
/// What it may take of the angle that the way sweeps: the person is seen before and after.
const MOST: f64 = 0.5;
/// Height of what hides all of a person, in metres; and of the hip, as a part of the body.
const SCREEN: f64 = 2.1;
const HIP: f64 = 0.47;
/// How far beside it the floor is darkened, in degrees.
const SHADOW: f64 = 2.0;
/// From where its surface is taken: so far beside it, and from so far below to so far above the horizon, in degrees.
const BESIDE: f64 = 71.0;
const SURFACE: (f64, f64) = (-14.0, 16.0);

/// An upright board on the floor that faces the camera. Angles in degrees.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Obstacle {
    middle: f64,
    half: f64,
    /// To its middle, in metres.
    away: f64,
    /// Upper and lower edge over the lens, in metres.
    top: f64,
    bottom: f64,
}

/// What is seen in a direction of it.
pub(super) struct Seen {
    /// How much of the pixel it covers, 0 to 1.
    pub part: f64,
    /// Yaw and pitch in the panorama of what its surface shows.
    pub from: (f64, f64),
    /// How bright that is.
    pub light: f64,
    /// How bright what is beside it still is.
    pub shadow: f64,
}

impl Obstacle {
    /// What must stand in the way, if anything.
    pub fn of(settings: &PhotoSettings, way: &Way) -> Option<Self> {
        let hidden = match settings.occlusion {
            Occlusion::None => return None,
            Occlusion::Partial => LEGS_HIDDEN,
            Occlusion::Full => HIDDEN,
        };
        let full = settings.occlusion == Occlusion::Full;
        let begins = way.time_at(BEGINS);
        let yaws = |from: f64, to: f64| {
            let start = way.at(from);
            let moments = (0..=50).map(|step| way.at(from + (to - from) * f64::from(step) / 50.0));
            let ways = moments.map(|moment| turned(start.yaw_deg(), moment.yaw_deg()));
            let (low, high) = ways.fold((0.0f64, 0.0f64), |(low, high), way| (low.min(way), high.max(way)));
            (start.yaw_deg() + (low + high) / 2.0, (high - low) / 2.0)
        };
        let away = way.at(begins + hidden / 2.0).away();
        let body = if full { (HALF_WIDTH / away).atan().to_degrees() } else { 0.0 };
        let (middle, passed) = yaws(begins, begins + hidden);
        let (_, swept) = yaws(0.0, way.duration());
        let half = (passed + body).min((MOST * swept).max(1.1 * body));
        let eye = settings.place.eye_m;
        let over = |height: f64| NEARNESS * (height - eye);
        let top = if full { SCREEN - eye } else { over(HIP * HEIGHT) };
        Some(Self { middle, half, away: NEARNESS * away, top, bottom: -eye })
    }

    /// Upper and lower edge in a direction that it lies in.
    fn edges(&self, aside: f64) -> (f64, f64) {
        let away = self.away / aside.to_radians().cos().max(0.2);
        let pitch = |height: f64| (height / away).atan().to_degrees();
        (pitch(self.top), pitch(self.bottom))
    }

    /// How much of a pixel in that direction it covers, 0 to 1, with so many pixels a degree.
    pub fn part(&self, yaw: f64, pitch: f64, per_degree: f64) -> f64 {
        let aside = turned(self.middle, yaw);
        let (top, bottom) = self.edges(aside);
        let inside = (self.half - aside.abs()).min(top - pitch).min(pitch - bottom);
        (inside * per_degree + 0.5).clamp(0.0, 1.0)
    }

    /// Whether it changes anything in that direction.
    pub fn reaches(&self, yaw: f64) -> bool {
        turned(self.middle, yaw).abs() <= self.half + SHADOW
    }

    /// What is seen in a direction that it reaches; `None` where it changes nothing.
    pub fn seen(&self, yaw: f64, pitch: f64, per_degree: f64) -> Option<Seen> {
        let aside = turned(self.middle, yaw);
        let (top, bottom) = self.edges(aside);
        let part = self.part(yaw, pitch, per_degree);
        // Darkens the floor at its foot.
        let (across, down) = ((aside.abs() - self.half).max(0.0), (bottom - pitch).abs());
        let shadow = 1.0 - 0.45 * (-(across + down) / 0.7).exp();
        if part == 0.0 && shadow > 0.99 {
            return None;
        }
        let (share, up) = (aside / self.half, (pitch - bottom) / (top - bottom).max(0.1));
        let edge = ((self.half - aside.abs()).min(top - pitch) / 0.35).clamp(0.0, 1.0);
        let light = (1.0 - 0.22 * share * share) * (0.75 + 0.25 * edge) * (0.85 + 0.1 * up);
        let from = (self.middle + BESIDE + aside, SURFACE.0 + (SURFACE.1 - SURFACE.0) * up.clamp(0.0, 1.0));
        Some(Seen { part, from, light, shadow })
    }
}
