// SPDX-License-Identifier: MPL-2.0

//! What a camera does to its pictures between the sensor and the encoder, and what shakes it.

mod blocks;
mod hunting;
mod lens;
mod noise_filter;
mod overlay;

use std::time::Duration;

use crate::{
    kinematics::Pose,
    picture::{Picture, Plane},
};

pub(crate) use hunting::{MEMORY, Sway};
pub(crate) use lens::Lens;
pub(crate) use noise_filter::NoiseFilter;

/// How the camera treats its pictures; the default does nothing to them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Imaging {
    /// By which part the lens draws in what is one focal length from the middle of the widest view: 0.05 to 0.15 in
    /// cameras. It falls with the square of the magnification.
    pub distortion: f64,
    /// How far the lens is ahead of the axes that the camera turns about, in metres.
    pub lens_offset_m: f64,
    /// Time from reading the first row of a picture to reading the last.
    pub rolling_shutter: Duration,
    /// Exponent of contrast: above 1 the dark becomes darker.
    pub gamma: Option<f64>,
    /// How strongly the noise filter flattens blocks of 8 x 8 pixels in which little but noise is seen, 0 to 1.
    pub blocks: f64,
    /// Whether exposure is set for a bright room once and for all, instead of by the camera itself as it goes. Recordings
    /// are as they were exposed.
    pub fixed_exposure: bool,
    /// How strongly exposure, white balance and focus swing while they find their way after a turn, 0 to 1.
    pub hunting: f64,
    /// How often it changes between day (colour) and night (grey); it begins with day.
    pub night: Option<Duration>,
    /// Whether a clock and a logo are burned into the picture.
    pub overlay: bool,
    /// By how many degrees the mast sways to either side.
    pub vibration_deg: f64,
    /// How much of the picture before stays in the picture where little changes, 0 to 0.95.
    pub noise_filter: f64,
}

impl Imaging {
    /// Where the camera really looks that is said to look along `pose`.
    pub(crate) fn shaken(&self, pose: Pose, time: Duration) -> Pose {
        // Resonances of a mast: a slow one of its whole length, quicker ones of its parts.
        let time = time.as_secs_f64() * std::f64::consts::TAU;
        let pan = 0.6 * (2.3 * time).sin() + 0.3 * (5.9 * time + 1.0).sin() + 0.1 * (9.7 * time).sin();
        let tilt = 0.5 * (3.1 * time + 0.5).sin() + 0.2 * (7.7 * time).sin();
        Pose {
            pan_deg: pose.pan_deg + self.vibration_deg * pan,
            tilt_deg: pose.tilt_deg + self.vibration_deg * tilt,
            ..pose
        }
    }

    /// Everything that the camera does to a picture whose exposure began at `time`. `sway` says how it turned before that.
    pub(crate) fn process(
        &self,
        picture: &mut Picture,
        time: Duration,
        sway: &Sway,
        filter: &mut NoiseFilter,
    ) {
        if self.hunting > 0.0 {
            sway.apply(self.hunting, picture);
        }
        if self.is_night(time) {
            night(picture);
        }
        if let Some(gamma) = self.gamma {
            contrast(gamma, picture);
        }
        if self.noise_filter > 0.0 {
            filter.apply(self.noise_filter, time, picture);
        }
        if self.blocks > 0.0 {
            blocks::flatten(self.blocks, &mut picture.planes[0]);
        }
        if self.overlay {
            overlay::burn_in(time, picture);
        }
    }

    /// Whether a picture is anything but a pinhole's.
    pub(crate) fn bends(&self) -> bool {
        self.distortion != 0.0 || !self.rolling_shutter.is_zero()
    }

    fn is_night(&self, time: Duration) -> bool {
        let period = self.night.map(|period| period.as_nanos().max(1));
        period.is_some_and(|period| time.as_nanos() / period % 2 == 1)
    }
}

/// Makes dark tones darker where the exponent is above 1, lighter below it.
fn contrast(exponent: f64, picture: &mut Picture) {
    let tone = |value: usize| {
        let part = ((value as f64 - 16.0) / 219.0).max(0.0);
        (16.0 + 219.0 * part.powf(exponent)).round().min(255.0) as u8
    };
    let table: [u8; 256] = std::array::from_fn(tone);
    picture.planes[0].data.iter_mut().for_each(|pixel| *pixel = table[usize::from(*pixel)]);
}

/// Grey, as without its infrared filter: cloth is brighter than to the eye, the more so the redder it is.
fn night(picture: &mut Picture) {
    let [luma, u, v] = &mut picture.planes;
    for (row, line) in luma.data.chunks_exact_mut(luma.width.max(1)).enumerate() {
        let red = &v.data[row / 2 * v.width..][..v.width];
        for (column, pixel) in line.iter_mut().enumerate() {
            let warm = i32::from(red[column / 2]) - 128;
            *pixel = (30 + i32::from(*pixel) * 7 / 8 + warm / 3).clamp(16, 235) as u8;
        }
    }
    for Plane { data, .. } in [u, v] {
        data.fill(128);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern() -> Picture {
        let mut picture = Picture::grey(64, 48, 90);
        picture.planes[0]
            .data
            .iter_mut()
            .enumerate()
            .for_each(|(i, pixel)| *pixel = 40 + (i * 7 % 120) as u8);
        picture.planes[2].data.fill(150);
        picture
    }

    #[test]
    fn the_default_leaves_pictures_and_directions_alone() {
        let mut picture = pattern();
        let imaging = Imaging::default();
        imaging.process(&mut picture, Duration::from_secs(3), &Sway::default(), &mut NoiseFilter::default());
        assert_eq!(picture, pattern());
        let pose = Pose { pan_deg: 12.0, ..Pose::default() };
        assert_eq!(imaging.shaken(pose, Duration::from_secs(3)), pose);
    }

    #[test]
    fn contrast_keeps_black_and_white_and_moves_what_is_between() {
        let mut picture = pattern();
        picture.planes[0].data[..3].copy_from_slice(&[16, 125, 235]);
        contrast(1.4, &mut picture);
        assert_eq!((picture.planes[0].data[0], picture.planes[0].data[2]), (16, 235));
        assert!((90..110).contains(&picture.planes[0].data[1]));
    }

    #[test]
    fn night_is_grey_and_every_other_period() {
        let imaging = Imaging { night: Some(Duration::from_secs(5)), ..Imaging::default() };
        let grey = |seconds| {
            let mut picture = pattern();
            let mut filter = NoiseFilter::default();
            imaging.process(&mut picture, Duration::from_secs(seconds), &Sway::default(), &mut filter);
            picture.planes[2].data.iter().all(|&value| value == 128)
        };
        assert_eq!([1, 4, 6, 9, 11].map(grey), [false, false, true, true, false]);
    }

    #[test]
    fn a_mast_sways_no_farther_than_it_is_said_to() {
        let imaging = Imaging { vibration_deg: 0.2, ..Imaging::default() };
        let pans: Vec<f64> = (0..500)
            .map(|step| imaging.shaken(Pose::default(), Duration::from_millis(7 * step)).pan_deg)
            .collect();
        assert!(pans.iter().all(|pan| pan.abs() <= 0.2));
        assert!(pans.iter().any(|pan| *pan > 0.1) && pans.iter().any(|pan| *pan < -0.1));
    }
}
