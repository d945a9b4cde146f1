// SPDX-License-Identifier: MPL-2.0

//! What the whole picture shows: as the detector in front saw it, or else looked at here.

use std::time::Duration;

use ptztrack_contract::{BufferMeta, CameraMotion, ContractError, Homography, Plane, SceneMeta};

use crate::vision::{CameraMotionEstimator, Luma, Picture, SceneModel, SceneView};

/// Width at most of the pictures that are looked at here, pixels.
const WIDTH: usize = 320;

/// Where the scene of each picture comes from.
#[derive(Default)]
pub(super) struct SceneSource {
    /// The last picture's, where a detector had seen it, and that picture's timestamp.
    last: Option<(SceneMeta, Option<gst::ClockTime>)>,
    /// Works where there is no detector of ours in front.
    model: SceneModel,
}

impl SceneSource {
    /// Forgets the pictures before.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// What `picture`, which came in `buffer` and `elapsed` after the one before, shows. `expected` (normalised) is a first
    /// guess of how the picture moved.
    ///
    /// # Errors
    /// Where OpenCV fails; a meta that cannot be read counts as none.
    pub fn look(
        &mut self,
        buffer: &gst::BufferRef,
        picture: &Picture,
        elapsed: Duration,
        expected: Option<Homography>,
    ) -> opencv::Result<Result<SceneView<'_>, ContractError>> {
        match SceneMeta::of(buffer) {
            Some(Ok(meta)) => self.heed(meta, buffer.pts(), expected).map(Ok),
            Some(Err(error)) => Ok(Err(error)),
            None => {
                self.last = None;
                self.model.update(picture, WIDTH, elapsed, expected).map(Ok)
            }
        }
    }

    /// Takes the detector's word. Where pictures were dropped between it and here, its camera motion starts from a
    /// picture that never came: then it is measured again, from the last that did.
    fn heed(
        &mut self,
        mut meta: SceneMeta,
        pts: Option<gst::ClockTime>,
        expected: Option<Homography>,
    ) -> opencv::Result<SceneView<'_>> {
        let before = self.last.take();
        if let Some((last, last_pts)) = &before
            && meta.from_pts != *last_pts
        {
            meta.camera_motion = between(&last.luma, &meta.luma, expected)?;
            // At least so far it is taken to have moved, from the last picture that was dropped.
            meta.coasted_motion = meta.coasted_motion.filter(|_| meta.camera_motion.is_none());
        }
        if before.is_none() {
            (meta.camera_motion, meta.coasted_motion) = (None, None);
        }
        let (meta, _) = self.last.insert((meta, pts));
        Ok(view(meta))
    }
}

fn between(from: &Plane, to: &Plane, expected: Option<Homography>) -> opencv::Result<Option<CameraMotion>> {
    let mut estimator = CameraMotionEstimator::default();
    estimator.update(&luma(from), None, None, Duration::ZERO)?;
    estimator.update(&luma(to), None, expected, Duration::ZERO)
}

fn luma(plane: &Plane) -> Luma<'_> {
    Luma::packed(&plane.pixels, plane.width as usize)
}

fn view(meta: &SceneMeta) -> SceneView<'_> {
    SceneView {
        camera_motion: meta.camera_motion,
        coasted_motion: meta.coasted_motion,
        luma: luma(&meta.luma),
        chroma: meta.chroma.as_ref().map(|[u, v]| [luma(u), luma(v)]),
        foreground: luma(&meta.foreground),
        background: luma(&meta.background),
    }
}
