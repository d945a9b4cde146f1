// SPDX-License-Identifier: MPL-2.0

//! A new target is brought to the middle, by a camera that is not quite as it is assumed to be.

use std::{collections::VecDeque, time::Duration};

use ptztrack_contract::Vector;
use servo::{
    Access, Actuation, ActuatorStatus, Measurement, Mode, Motion, Servo, ServoSettings, SpeedMap, Time,
};

const FOV_DEG: f64 = 55.0;
const PICTURE_S: f64 = 0.04;
const COMMAND_S: f64 = 0.1;
const VIDEO_DELAY_S: f64 = 0.1;
const COMMAND_DELAY_S: f64 = 0.06;
const ACCELERATION_DEG_S2: f64 = 600.0;
/// How long the target is sought.
const SOUGHT_S: f64 = 1.6;
/// How far away somebody goes by, metres.
const AWAY_M: f64 = 5.5;

/// Somebody who goes by, straight ahead after so many seconds.
#[derive(Debug, Clone, Copy)]
struct Walker {
    first_deg: f64,
    speed_m_s: f64,
}

impl Walker {
    fn direction_deg(&self, time: f64) -> f64 {
        (self.first_deg.to_radians().tan() + self.speed_m_s * time / AWAY_M).atan().to_degrees()
    }
}

fn column(angle_deg: f64) -> f64 {
    0.5 + angle_deg.to_radians().tan() / (2.0 * (FOV_DEG / 2.0).to_radians().tan())
}

fn angle_deg(column: f64) -> f64 {
    ((column - 0.5) * 2.0 * (FOV_DEG / 2.0).to_radians().tan()).atan().to_degrees()
}

fn at(seconds: f64) -> Time {
    Duration::from_secs_f64(seconds).into()
}

/// Degrees off the middle times seconds; the camera's speeds are `factor` times those that are assumed.
fn off(walker: Walker, factor: f64, background_seen: bool) -> f64 {
    let settings = ServoSettings { fov_deg: Some(FOV_DEG), ..ServoSettings::default() };
    let speeds = settings.speed_map();
    let mut servo = Servo::new(settings);
    let actuator = ActuatorStatus {
        access: Access::Ours,
        mode: Mode::Velocity,
        may_move: true,
        in_doubt: false,
        interval: Duration::from_secs_f64(COMMAND_S),
    };
    let (mut pan, mut rate, mut told, mut under_way) = (0.0, 0.0f64, 0.0f64, VecDeque::new());
    let (mut pictures, mut shown, mut exposures) = (VecDeque::new(), None::<(f64, f64)>, 0);
    let (mut commanded, mut off) = (f64::NEG_INFINITY, 0.0);
    const STEP_S: f64 = 0.001;
    for step in 1..=(SOUGHT_S / STEP_S) as u32 {
        let time = f64::from(step) * STEP_S;
        while let Some((_, wanted)) = under_way.pop_front_if(|(acts, _): &mut (f64, f64)| *acts <= time) {
            told = wanted;
        }
        let change = ACCELERATION_DEG_S2 * STEP_S;
        rate += (told - rate).clamp(-change, change);
        pan += rate * STEP_S;
        let error = walker.direction_deg(time) - pan;
        off += error.abs() * STEP_S;
        if time >= f64::from(exposures) * PICTURE_S {
            exposures += 1;
            let place = column(error);
            let moved = shown.map(|(before, looked): (f64, f64)| {
                let background = column(angle_deg(before) - (pan - looked));
                ((place - before) / PICTURE_S, (background - before) / PICTURE_S)
            });
            shown = Some((place, pan));
            pictures.push_back((time + VIDEO_DELAY_S, place, moved));
        }
        let arrived =
            pictures.pop_front_if(|(arrives, ..): &mut (f64, f64, Option<(f64, f64)>)| *arrives <= time);
        let Some((_, place, moved)) = arrived else { continue };
        let along = |x: f64| Vector { x, y: 0.0 };
        let measurement = Measurement {
            velocity: moved.map_or_else(Vector::default, |(velocity, _)| along(velocity)),
            ego_velocity: moved.filter(|_| background_seen).map(|(_, background)| along(background)),
            ..Measurement::at(place, 0.5, at(time))
        };
        servo.measure(measurement, &actuator, at(time));
        if time - commanded < COMMAND_S - STEP_S / 2.0 {
            continue;
        }
        commanded = time;
        let actuation = servo.control(&actuator, at(time));
        let pan = if let Actuation::Move(Motion::Velocity { pan, .. }) = actuation { pan } else { 0.0 };
        let turn = Motion::Velocity { pan, tilt: 0.0, zoom: None };
        servo.accepted(&Actuation::Move(turn), at(time), at(time));
        under_way.push_back((time + COMMAND_DELAY_S, factor * speeds.deg_s(SpeedMap::level_of(pan))));
    }
    off
}

/// Told or not how the background moves, by a camera as late as it may be assumed to be.
#[test]
fn to_be_told_how_the_background_moves_costs_no_time() {
    for factor in [0.8, 0.9, 1.0, 1.1, 1.25] {
        for speed_m_s in [1.4, 0.0, -1.0, 4.0] {
            for first_deg in [-26.0, -15.0] {
                let walker = Walker { first_deg, speed_m_s };
                let [without, with] =
                    [false, true].map(|background_seen| off(walker, factor, background_seen));
                assert!(with < without + 0.05, "{walker:?}, speeds x {factor}: {without:.2}, {with:.2} told");
            }
        }
    }
}
