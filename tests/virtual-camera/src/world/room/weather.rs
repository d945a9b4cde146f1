// SPDX-License-Identifier: MPL-2.0

//! What comes and goes out of doors: shadows of clouds, headlights that sweep by, rain.

use super::{
    event::Event,
    settings::{Place, RoomSettings},
    view::{CAMERA, Canvas, Vector, View},
};
use crate::{picture::Plane, seeded::Seeded};

/// Light is computed at one pixel in so many across and down, even between them.
const MESH: usize = 8;
/// What is farther away than the houses lies on them, in metres.
const FARTHEST: f64 = 62.0;
/// What is higher is the sky, in metres.
const HOUSES: f64 = 10.0;
/// Part of the light that a cloud takes, and how fast clouds drift, in metres a second.
const CLOUD: f64 = 0.5;
const WIND: f64 = 4.5;
/// A car out of sight comes once in so many seconds; its headlights sweep over what they meet for so long.
const EVERY_S: f64 = 8.0;
const SWEEP_S: f64 = 4.5;
/// How far its headlights sweep to either side, how far ahead of the camera, and how much brighter they make what they meet.
const BEAM_REACH: f64 = 34.0;
const BEAM_AHEAD: f64 = 12.0;
const BEAM: f64 = 2.5;
/// Drops in a picture of 640 x 480; how far one falls while the shutter is open, in metres.
const DROPS: usize = 420;
const FALLS: f64 = 0.15;

/// The weather of a yard.
pub(super) struct Weather {
    seeded: Seeded,
    clouds: bool,
    headlights: bool,
    rain: bool,
    /// Whether the camera has taken its infrared filter out.
    infrared: bool,
}

impl Weather {
    pub fn new(room: &RoomSettings) -> Self {
        let has = |event| room.place != Place::Hall && room.events.contains(&event);
        Self {
            seeded: Seeded::new(room.seed).fork(0x3ea7),
            clouds: has(Event::Clouds),
            headlights: has(Event::Headlights),
            rain: has(Event::Rain),
            infrared: room.place == Place::InfraredYard,
        }
    }

    /// Changes a picture as the weather has it at a time in seconds.
    pub fn apply(&self, time: f64, view: &View, canvas: &mut Canvas) {
        if self.clouds {
            let phase = self.seeded.fork(1).unit() * 20.0;
            modulate(canvas, view, |point| 1.0 - CLOUD * cloud(point, phase, time));
        }
        if self.headlights {
            let passed = (time + EVERY_S * self.seeded.fork(2).unit()).rem_euclid(EVERY_S) / SWEEP_S;
            if passed < 1.0 {
                let beam = BEAM_REACH * (2.0 * passed - 1.0);
                modulate(canvas, view, |point| 1.0 + BEAM * lit(point, beam));
            }
        }
        if self.rain {
            rain(&mut self.seeded.fork(3).fork((time * 1000.0) as u64), view, &mut canvas.planes[0]);
        }
        if self.infrared {
            canvas.planes[1..].iter_mut().for_each(|plane| plane.data.fill(128));
        }
    }
}

/// How much of a cloud's shadow lies on a place, 0 to 1.
fn cloud([x, y, z]: Vector, phase: f64, time: f64) -> f64 {
    if y > HOUSES {
        return 0.0;
    }
    let along = x - WIND * time + phase;
    let wave = (0.11 * along + 0.9 * (0.09 * z + phase).sin()).sin() + 0.6 * (0.19 * z + 0.23 * along).sin();
    let share = ((wave + 0.15) / 0.5 + 0.5).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}

/// How much of a headlight's beam that is at `beam`, right of the camera, falls on a place, 0 to 1.
fn lit([x, y, z]: Vector, beam: f64) -> f64 {
    let bell = |off: f64, width: f64| (-(off / width) * (off / width)).exp();
    let on_ground = bell(x - beam, 4.5) * bell(z - BEAM_AHEAD, 3.0);
    // Farther away it is wider and sweeps faster.
    let on_houses = bell(x - beam * z / BEAM_AHEAD, 8.0) * bell(y - 1.5, 3.0);
    if z > 0.8 * FARTHEST { 0.5 * on_houses } else { on_ground }
}

/// What a pixel shows if nothing stands on the ground: a place there, or on the houses.
fn place(view: &View, x: f64, y: f64) -> Vector {
    let [right, up, ahead] = view.ray(x, y);
    let to_ground = if up < 0.0 { CAMERA[1] / -up } else { f64::INFINITY };
    let reach = to_ground.min(FARTHEST / right.hypot(ahead).max(1e-6));
    [right * reach, CAMERA[1] + up * reach, ahead * reach]
}

/// Makes every pixel so many times as bright as the place has it that it shows.
fn modulate(canvas: &mut Canvas, view: &View, brightness: impl Fn(Vector) -> f64) {
    let (columns, rows) = (view.size.0 / MESH + 2, view.size.1 / MESH + 2);
    let at = |index: usize| {
        let (x, y) = ((index % columns * MESH) as f64, (index / columns * MESH) as f64);
        (256.0 * brightness(place(view, x, y))) as i32
    };
    let mesh: Vec<i32> = (0..columns * rows).map(at).collect();
    let [luma, u, v] = &mut canvas.planes;
    spread(luma, 16, MESH, columns, &mesh);
    [u, v].into_iter().for_each(|plane| spread(plane, 128, MESH / 2, columns, &mesh));
}

/// Multiplies what is above `zero` by what the mesh, of so many `columns`, says in 256ths every `step` pixels.
fn spread(plane: &mut Plane, zero: i32, step: usize, columns: usize, mesh: &[i32]) {
    let step_i = step as i32;
    for (row, line) in plane.data.chunks_exact_mut(plane.width.max(1)).enumerate() {
        let (upper, down) = (row / step * columns, (row % step) as i32);
        let down_to = |column: usize| {
            let (above, below) = (mesh[upper + column], mesh[upper + columns + column]);
            above + (below - above) * down / step_i
        };
        for (column, pixels) in line.chunks_mut(step).enumerate() {
            let (left, right) = (down_to(column), down_to(column + 1));
            for (index, pixel) in (0..).zip(pixels) {
                let factor = left + (right - left) * index / step_i;
                *pixel = (zero + (((i32::from(*pixel) - zero) * factor) >> 8)).clamp(0, 255) as u8;
            }
        }
    }
}

/// Streaks of drops at all distances, and the haze of those that are too far to be seen.
fn rain(chance: &mut Seeded, view: &View, luma: &mut Plane) {
    let (width, height) = (luma.width, luma.height);
    for pixel in &mut luma.data {
        *pixel = (u32::from(*pixel) * 15 / 16 + 7) as u8;
    }
    let drops = DROPS * width * height / (640 * 480);
    for _ in 0..drops {
        let away = 1.0 + 7.0 * chance.unit().powi(2);
        let length = (view.pinhole.focal * FALLS / away).clamp(2.0, height as f64 / 2.0) as usize;
        let broad = (view.pinhole.focal * 0.004 / away).clamp(1.0, 6.0) as usize;
        let (x, y) = (chance.below(width.max(1)), chance.below(height.max(1)));
        // Near ones are blurred: broad and faint.
        let strength = (90.0 / broad as f64) as i32;
        for step in 0..length {
            let (column, row) = (x + step / 9, y + step);
            if row >= height || column >= width {
                break;
            }
            let end = (column + broad).min(width);
            for pixel in &mut luma.data[row * width + column..row * width + end] {
                let value = i32::from(*pixel);
                *pixel = (value + (215 - value).max(0) * strength / 256) as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{geometry::Pinhole, kinematics::Pose, world::room::Action};

    const SIZE: (u32, u32) = (160, 120);

    fn weather(event: Event) -> Weather {
        let room = RoomSettings {
            place: Place::Yard,
            action: Action::Nobody,
            events: vec![event],
            ..RoomSettings::default()
        };
        Weather::new(&room)
    }

    fn view() -> View {
        let pose = Pose { tilt_deg: -10.0, ..Pose::default() };
        View::new(&pose, Pinhole::new(SIZE.0, SIZE.1, 55.0), SIZE)
    }

    fn luma(event: Event, time: f64) -> Vec<u8> {
        let mut canvas = Canvas::grey(SIZE.0, SIZE.1, 120);
        weather(event).apply(time, &view(), &mut canvas);
        canvas.planes[0].data.clone()
    }

    #[test]
    fn clouds_darken_a_part_of_the_ground_and_drift() {
        let darkest = |time| luma(Event::Clouds, time).into_iter().min().unwrap();
        let times: Vec<u8> = (0..40).map(|step| darkest(f64::from(step))).collect();
        assert!(times.iter().any(|darkest| *darkest < 75), "{times:?}");
        assert!((0..40).all(|step| luma(Event::Clouds, f64::from(step)).iter().all(|pixel| *pixel <= 120)));
        assert_ne!(luma(Event::Clouds, 3.0), luma(Event::Clouds, 4.0));
    }

    #[test]
    fn headlights_sweep_by_now_and_then() {
        let bright = |step: u32| luma(Event::Headlights, 0.25 * f64::from(step)).into_iter().max().unwrap();
        let lit: Vec<u8> = (0..64).map(bright).collect();
        assert!(lit.iter().any(|bright| *bright > 200) && lit.contains(&120), "{lit:?}");
    }

    #[test]
    fn rain_falls_elsewhere_in_every_picture_and_the_same_rain_always() {
        let streaks = |time| luma(Event::Rain, time).iter().filter(|pixel| **pixel > 125).count();
        assert!((100..6000).contains(&streaks(1.0)), "{}", streaks(1.0));
        assert_ne!(luma(Event::Rain, 1.0), luma(Event::Rain, 1.04));
        assert_eq!(luma(Event::Rain, 1.0), luma(Event::Rain, 1.0));
    }
}
