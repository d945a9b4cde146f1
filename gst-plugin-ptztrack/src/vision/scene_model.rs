// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use ptztrack_contract::{CameraMotion, Homography, Rect, Region};

use super::Luma;
use super::camera_motion::CameraMotionEstimator;
use super::ghosts::Ghosts;
use super::picture::{Picture, Reduced};
use super::reduce::divisor;
use super::travelling::{TravellingBackground, Way};

/// What one picture shows: all planes are of one size, the whole picture reduced.
#[derive(Debug, Clone, Copy)]
pub struct SceneView<'a> {
    /// How the camera moved since the picture before; `None` where that is not known.
    pub camera_motion: Option<CameraMotion>,
    /// How it is taken to have moved since, where that was not seen for a moment; the motion of the next picture starts from there.
    pub coasted_motion: Option<Homography>,
    /// The picture's luma.
    pub luma: Luma<'a>,
    /// Its U and V, where it has colour.
    pub chroma: Option<[Luma<'a>; 2]>,
    /// How likely each pixel is foreground: 0 to 255.
    pub foreground: Luma<'a>,
    /// Mean luma of the background behind it.
    pub background: Luma<'a>,
}

#[cfg(test)]
impl<'a> SceneView<'a> {
    /// Of a picture without colour, where nobody knows how the camera moved.
    pub fn of_greys(luma: Luma<'a>, background: Luma<'a>, foreground: Luma<'a>) -> Self {
        Self { camera_motion: None, coasted_motion: None, luma, chroma: None, foreground, background }
    }
}

/// Reduces pictures, measures the motion of the camera and carries the background along: all that looks at
/// whole pictures, in the order in which one needs the other.
#[derive(Debug, Default)]
pub struct SceneModel {
    picture: Reduced,
    motion: CameraMotionEstimator,
    background: TravellingBackground,
    camera_motion: Option<CameraMotion>,
    ghosts: Ghosts,
}

impl SceneModel {
    /// Forgets the pictures before.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// Looks at the next picture, `elapsed` after the one before, reduced to at most `width` pixels a row (0: not
    /// reduced). `expected` (normalised) says where the picture may have gone; it is only a guess.
    pub fn update(
        &mut self,
        picture: &Picture,
        width: usize,
        elapsed: Duration,
        expected: Option<Homography>,
    ) -> opencv::Result<SceneView<'_>> {
        let divisor = divisor(picture.luma.width(), width);
        let size = ((picture.luma.width() / divisor).max(1), (picture.luma.height() / divisor).max(1));
        if size != self.picture.size() {
            self.restart();
        }
        self.picture.fill(picture, size);
        let foreground = self.background.foreground();
        self.camera_motion =
            self.motion.update(&self.picture.luma(), foreground.as_ref(), expected, elapsed)?;
        let motion = self.camera_motion.map(|motion| motion.homography).or_else(|| self.motion.coasted());
        self.background.update(&self.picture, motion.as_ref(), self.way(), elapsed)?;
        Ok(self.view())
    }

    /// What is known of how the last picture came to where it is.
    fn way(&self) -> Way {
        match self.camera_motion {
            _ if !self.motion.may_be_elsewhere() => Way::Known,
            Some(_) => Way::Lost,
            None => Way::Unknown,
        }
    }

    /// What lies in `bounds` (normalised, of the last picture) does not become background: see
    /// [`TravellingBackground::protect`].
    pub fn protect(&mut self, bounds: Option<Rect>) {
        self.background.protect(bounds);
    }

    /// Where nobody is, of the regions that were found in the last picture, what stays the same is background at once.
    pub fn forget_ghosts<'a>(&mut self, regions: impl Iterator<Item = &'a Region>) -> opencv::Result<()> {
        let mut ghosts = std::mem::take(&mut self.ghosts);
        for region in regions {
            if ghosts.is_nobody(&self.view(), region) {
                self.background.adopt(&region.contour)?;
            }
        }
        self.ghosts = ghosts;
        Ok(())
    }

    /// Light has changed in these regions, which were found in the last picture: the background has changed with it.
    pub fn relight<'a>(&mut self, regions: impl Iterator<Item = &'a Region>) -> opencv::Result<()> {
        for region in regions {
            self.background.relight(&region.contour)?;
        }
        Ok(())
    }

    /// What the last picture showed.
    pub fn view(&self) -> SceneView<'_> {
        let luma = self.picture.luma();
        SceneView {
            camera_motion: self.camera_motion,
            coasted_motion: self.motion.coasted(),
            luma,
            chroma: self.picture.chroma(),
            foreground: self.background.foreground().unwrap_or(luma),
            background: self.background.mean().unwrap_or(luma),
        }
    }
}
