// SPDX-License-Identifier: MPL-2.0

//! Exposure, white balance and focus that overshoot and come back after the camera has turned.

use std::{f64::consts::TAU, time::Duration};

use crate::{
    kinematics::Pose,
    picture::{Picture, Plane},
};

/// For how long a turn is felt.
pub(crate) const MEMORY: Duration = Duration::from_millis(2500);
/// Between two looks at where the camera pointed.
const STEP: Duration = Duration::from_millis(100);
/// A turn of so many fields of view a second is felt fully.
const FULL_FIELDS_S: f64 = 0.5;
/// At full strength: part by which the brightness swings, chroma steps, and passes of softening.
const BRIGHTNESS: f64 = 0.45;
const TINT: f64 = 14.0;
const SOFTNESS: f64 = 4.0;

/// How far the three loops are from where they belong, about -1 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Sway {
    exposure: f64,
    white_balance: f64,
    focus: f64,
}

impl Sway {
    /// Of a picture at `time`, by where the camera looked before: each loop is a damped oscillation that turns set off.
    pub fn new(time: Duration, fov_deg: f64, pose_at: impl Fn(Duration) -> Pose) -> Self {
        let mut sway = Self::default();
        let mut after = pose_at(time);
        let mut ago = Duration::ZERO;
        while ago < MEMORY && ago + STEP <= time {
            let before = pose_at(time - ago - STEP);
            let turned = (after.pan_deg - before.pan_deg).hypot(after.tilt_deg - before.tilt_deg);
            let felt = (turned / STEP.as_secs_f64() / fov_deg / FULL_FIELDS_S).min(1.0);
            let share = felt * STEP.as_secs_f64();
            let ago_s = ago.as_secs_f64();
            let ringing = |hertz: f64, decay_s: f64| (TAU * hertz * ago_s).sin() * (-ago_s / decay_s).exp();
            sway.exposure += 4.0 * share * ringing(0.8, 0.8);
            sway.white_balance += 3.0 * share * ringing(0.35, 1.2);
            sway.focus += 4.0 * share * ringing(1.1, 0.6);
            (after, ago) = (before, ago + STEP);
        }
        sway
    }

    /// Lets a picture be as bright, tinted and sharp as the loops have it, `strength` being 0 to 1.
    pub fn apply(&self, strength: f64, picture: &mut Picture) {
        let gain = (256.0 * (1.0 + strength * BRIGHTNESS * self.exposure.clamp(-1.0, 1.0))) as i32;
        let tint = (strength * TINT * self.white_balance.clamp(-1.0, 1.0)).round() as i32;
        let [luma, u, v] = &mut picture.planes;
        for pixel in &mut luma.data {
            *pixel = (16 + (((i32::from(*pixel) - 16) * gain) >> 8)).clamp(0, 255) as u8;
        }
        for (plane, shift) in [(&mut *u, -tint), (&mut *v, tint)] {
            plane.data.iter_mut().for_each(|value| *value = (i32::from(*value) + shift).clamp(16, 240) as u8);
        }
        let passes = (strength * SOFTNESS * self.focus.abs()).round() as usize;
        for pass in 0..passes.min(6) {
            soften(luma, 1 << (pass / 2));
        }
    }
}

/// Every pixel is the mean of its neighbours so far away, to the four sides.
fn soften(plane: &mut Plane, reach: usize) {
    let (width, height) = (plane.width, plane.height);
    let before = plane.data.clone();
    for (row, line) in plane.data.chunks_exact_mut(width.max(1)).enumerate() {
        let (above, below) = (row.saturating_sub(reach) * width, (row + reach).min(height - 1) * width);
        for (column, pixel) in line.iter_mut().enumerate() {
            let (left, right) = (column.saturating_sub(reach), (column + reach).min(width - 1));
            let sum: u32 = [above + column, below + column, row * width + left, row * width + right]
                .iter()
                .map(|&at| u32::from(before[at]))
                .sum();
            *pixel = ((sum + 2) / 4) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera that turns by 30 °/s from 1 s to 2 s.
    fn pose(time: Duration) -> Pose {
        Pose { pan_deg: 30.0 * (time.as_secs_f64() - 1.0).clamp(0.0, 1.0), ..Pose::default() }
    }

    #[test]
    fn a_turn_sets_it_off_and_rest_calms_it() {
        let at = |ms: u64| Sway::new(Duration::from_millis(ms), 55.0, pose);
        assert_eq!(at(900), Sway::default());
        let swing = (2000..3000).step_by(40).map(|ms| at(ms).exposure.abs()).fold(0.0, f64::max);
        assert!(swing > 0.3, "{swing}");
        assert_eq!(at(4600), Sway::default());
    }

    #[test]
    fn pictures_grow_brighter_tinted_and_soft() {
        let mut picture = Picture::grey(32, 24, 100);
        picture.planes[0].data[12 * 32 + 16] = 200;
        Sway { exposure: 0.5, white_balance: 1.0, focus: 0.5 }.apply(1.0, &mut picture);
        let luma = &picture.planes[0].data;
        assert!(luma[0] > 110 && luma[12 * 32 + 16] < 200, "{} {}", luma[0], luma[12 * 32 + 16]);
        assert!(picture.planes[1].data[0] < 128 && picture.planes[2].data[0] > 128);
    }
}
