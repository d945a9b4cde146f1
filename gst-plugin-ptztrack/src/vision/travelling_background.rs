use std::time::Duration;

use opencv::core::{self, CV_8U, CV_32F, Mat, Scalar};
use opencv::imgproc;
use opencv::prelude::*;
use ptztrack_contract::CameraMotion;

use super::Luma;
use super::camera_motion::to_pixels;
use super::picture::Reduced;

/// The background, carried along with the camera.
#[derive(Debug, Default)]
pub struct TravellingBackground {
    mean: Mat,
    foreground: Vec<u8>,
    shown: Vec<u8>,
    width: usize,
}

impl TravellingBackground {
    /// How likely each pixel of the last picture is foreground: 0 to 255; `None` before the first one.
    pub fn foreground(&self) -> Option<Luma<'_>> {
        (!self.foreground.is_empty()).then(|| Luma::packed(&self.foreground, self.width))
    }

    /// Mean luma of the background where the last picture shows it.
    pub fn mean(&self) -> Option<Luma<'_>> {
        (!self.shown.is_empty()).then(|| Luma::packed(&self.shown, self.width))
    }

    /// Tells foreground from background in the next picture, to which the camera moved by `motion`, then learns
    /// from it.
    pub fn update(
        &mut self,
        picture: &Reduced,
        motion: Option<&CameraMotion>,
        _elapsed: Duration,
    ) -> opencv::Result<()> {
        let (width, height) = picture.size();
        self.width = width;
        let mut now = Mat::default();
        picture.luma().with_mat(|luma| luma.convert_to_def(&mut now, CV_32F))?;
        let Some(motion) = motion.filter(|_| !self.mean.empty()) else {
            self.mean = now;
            self.foreground = vec![0; width * height];
            self.shown = vec![0; width * height];
            return Ok(());
        };
        let map = to_pixels(&motion.homography, (width as f64, height as f64));
        let matrix = Mat::from_slice_2d(&map.0)?;
        let mut carried = now.clone();
        let size = core::Size::new(width as i32, height as i32);
        imgproc::warp_perspective(
            &self.mean,
            &mut carried,
            &matrix,
            size,
            imgproc::INTER_LINEAR,
            core::BORDER_TRANSPARENT,
            Scalar::all(0.0),
        )?;
        let (mut difference, mut likelihood) = (Mat::default(), Mat::default());
        core::absdiff(&now, &carried, &mut difference)?;
        difference.convert_to(&mut likelihood, CV_8U, 10.0, -100.0)?;
        self.foreground.copy_from_slice(likelihood.data_bytes()?);
        core::add_weighted_def(&carried, 0.95, &now, 0.05, 0.0, &mut self.mean)?;
        let mut shown = Mat::default();
        self.mean.convert_to_def(&mut shown, CV_8U)?;
        self.shown.copy_from_slice(shown.data_bytes()?);
        Ok(())
    }
}
