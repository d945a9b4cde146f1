// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use gst_video::prelude::*;
use gst_video::{VideoConverter, VideoInfo};
use ptztrack_contract::{MotionChange, MotionMeta, Plane, Rect, Region, SceneMeta, View};

use super::Output;
use super::settings::Settings;
use crate::frame;
use crate::luma_source::{LumaSource, LumaSourceError};
use crate::unseen::Unseen;
use crate::vision::{
    Cadence, CameraMoves, CarriedZones, Detector, DetectorError, Luma, Presence, SceneModel,
};

/// Distance of pictures whose timestamps and caps tell none.
const NOMINAL_DISTANCE: Duration = Duration::from_millis(40);

/// A frame that could not be looked at or drawn.
#[derive(Debug, thiserror::Error)]
pub(super) enum StreamError {
    #[error("the buffer does not hold a frame of the negotiated caps")]
    Buffer,
    #[error("the luma cannot be read: {0}")]
    Luma(#[from] LumaSourceError),
    #[error("detection failed: {0}")]
    Detector(#[from] DetectorError),
    #[error("the scene cannot be told apart: {0}")]
    Scene(opencv::Error),
    #[error("the output cannot be drawn: {0}")]
    Drawing(#[from] opencv::Error),
    #[error("the output cannot be converted: {0}")]
    Conversion(#[from] glib::BoolError),
}

/// A copy of a plane whose rows are packed, as all of a [`crate::vision::SceneView`] are.
fn plane(luma: Luma) -> Plane {
    let (width, height) = (luma.width(), luma.height());
    let pixels = glib::Bytes::from(&luma.bytes()[..width * height]);
    Plane { width: width as u32, height: height as u32, pixels }
}

/// What tracker and servo last said.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Heard {
    /// Where the tracker sees its target: nothing becomes background there.
    pub target: Option<Rect>,
    /// Where the camera looks, where it rests and that is known.
    pub view: Option<View>,
    /// How it moves.
    pub camera: CameraMoves,
}

/// One stream of frames of the same caps.
pub(super) struct Stream {
    pub in_info: VideoInfo,
    out_info: VideoInfo,
    source: LumaSource,
    detector: Detector,
    scene: SceneModel,
    zones: CarriedZones,
    /// Timestamp of the last picture that the scene was seen in.
    scene_pts: Option<gst::ClockTime>,
    presence: Presence,
    converter: Option<VideoConverter>,
    last_pts: Option<gst::ClockTime>,
    cadence: Cadence,
    /// Something is missing before the next picture.
    interrupted: bool,
    pub unseen: Unseen,
    /// Whether a fault of this stream was already reported, so that one fault is not a flood.
    pub warned: bool,
}

impl Stream {
    fn new(in_info: VideoInfo, out_info: VideoInfo) -> Self {
        Self {
            in_info,
            out_info,
            source: LumaSource::default(),
            detector: Detector::default(),
            scene: SceneModel::default(),
            zones: CarriedZones::default(),
            scene_pts: None,
            presence: Presence::default(),
            converter: None,
            last_pts: None,
            cadence: Cadence::default(),
            interrupted: false,
            unseen: Unseen::default(),
            warned: false,
        }
    }

    /// The stream after negotiation. Where only the output changed, what was learned still holds; other
    /// frames are learned anew, which neither ends the motion reported so far nor says that the camera looks elsewhere.
    pub fn negotiated(before: Option<Self>, in_info: VideoInfo, out_info: VideoInfo) -> Self {
        match before {
            Some(before) if before.in_info == in_info => Self { out_info, converter: None, ..before },
            Some(before) => {
                Self { presence: before.presence, zones: before.zones, ..Self::new(in_info, out_info) }
            }
            None => Self::new(in_info, out_info),
        }
    }

    /// The next picture has nothing to do with those before.
    pub fn flush(&mut self) {
        self.forget();
        self.last_pts = None;
        self.cadence = Cadence::default();
        self.interrupted = false;
    }

    /// Pictures are missing before the next one.
    pub fn interrupt(&mut self) {
        self.interrupted = true;
    }

    /// Time since the last picture. Forgets the background where too much of it passed unseen.
    pub fn advance(&mut self, pts: Option<gst::ClockTime>, max_gap: Duration) -> Duration {
        let since = self.last_pts.zip(pts).map(|(last, pts)| pts.checked_sub(last).map(Duration::from));
        let interrupted = std::mem::take(&mut self.interrupted);
        // Into the past it is another stream, unless timestamps are in no order. Where there are none nobody can tell how much is
        // missing, and a leaky queue may mark every other frame: learning anew each time, nothing would ever be found.
        let is_another =
            |since: Option<Duration>| since.map_or(!self.cadence.is_disordered(), |since| since > max_gap);
        if interrupted && since.is_some_and(is_another) {
            self.forget();
        }
        self.last_pts = pts;
        since.and_then(|since| self.cadence.elapsed(since)).unwrap_or_else(|| self.nominal_distance())
    }

    fn nominal_distance(&self) -> Duration {
        let fps = self.in_info.fps();
        if fps.numer() <= 0 || fps.denom() <= 0 {
            return NOMINAL_DISTANCE;
        }
        Duration::from_secs_f64(f64::from(fps.denom()) / f64::from(fps.numer()))
    }

    fn forget(&mut self) {
        self.detector.relearn();
        self.scene.restart();
    }

    /// Lets a picture pass unseen; the background will have changed when it looks again.
    pub fn skip(&mut self) {
        self.detector.relearn();
    }

    /// The moving regions of a frame as the thesis finds them; `None` while it learns.
    pub fn look(
        &mut self,
        buffer: &gst::BufferRef,
        settings: &Settings,
    ) -> Result<Option<Vec<Region>>, StreamError> {
        let frame = frame::readable(buffer, &self.in_info).ok_or(StreamError::Buffer)?;
        let luma = self.source.luma(&frame)?;
        Ok(self.detector.process(&luma, &settings.detector())?)
    }

    /// The moving regions of a frame, the camera at rest or not (`None` while it learns), and what everybody can
    /// use of it: camera motion, foreground, background.
    pub fn look_at_scene(
        &mut self,
        buffer: &gst::BufferRef,
        elapsed: Duration,
        settings: &Settings,
        heard: &Heard,
    ) -> Result<(Option<MotionMeta>, SceneMeta), StreamError> {
        let frame = frame::readable(buffer, &self.in_info).ok_or(StreamError::Buffer)?;
        let picture = self.source.picture(&frame)?;
        let from_pts = std::mem::replace(&mut self.scene_pts, buffer.pts());
        let config = settings.detector();
        self.scene.protect(heard.target);
        let expected = heard.camera.expected_motion(elapsed);
        let seen = self
            .scene
            .update(&picture, config.analysis_width, elapsed, expected)
            .map_err(StreamError::Scene)?;
        self.zones.set(&config.zones, &config.exclude_zones);
        let motion = seen.camera_motion.map(|motion| motion.homography);
        self.zones.carry(motion, seen.coasted_motion, elapsed, heard.view);
        let size = (frame.width() as usize, frame.height() as usize);
        let motion = self.detector.process_likelihood(&seen, size, &config, &self.zones)?;
        let scene = SceneMeta {
            from_pts,
            camera_motion: seen.camera_motion,
            coasted_motion: seen.coasted_motion,
            luma: plane(seen.luma),
            chroma: seen.chroma.map(|chroma| chroma.map(plane)),
            foreground: plane(seen.foreground),
            background: plane(seen.background),
        };
        if let Some(motion) = &motion {
            self.scene.relight(self.detector.light().iter()).map_err(StreamError::Scene)?;
            let regions = motion.regions.iter().chain(&motion.outside);
            self.scene.forget_ghosts(regions).map_err(StreamError::Scene)?;
        }
        Ok((motion, scene))
    }

    /// Takes back what was told of a picture, as memory for the next.
    pub fn recycle(&mut self, motion: Option<MotionMeta>) {
        motion.into_iter().for_each(|motion| self.detector.recycle(motion));
    }

    /// Whether motion starts or ends with these regions.
    pub fn change(
        &mut self,
        regions: &[Region],
        elapsed: Duration,
        settings: &Settings,
    ) -> Option<MotionChange> {
        let end_delay = Duration::from_nanos(settings.end_delay_ns);
        self.presence.update(!regions.is_empty(), elapsed, end_delay)
    }

    /// Whether motion ends as the stream does, and the timestamp of its last picture.
    pub fn finish(&mut self) -> (Option<MotionChange>, Option<gst::ClockTime>) {
        (self.presence.finish(), self.last_pts)
    }

    /// Draws what `output` asks for of the frame in `inbuf`, in which `regions` were found, into `outbuf`.
    pub fn draw(
        &mut self,
        inbuf: &gst::BufferRef,
        outbuf: &mut gst::BufferRef,
        regions: &[Region],
        output: Output,
    ) -> Result<(), StreamError> {
        let mut out = frame::writable(outbuf, &self.out_info).ok_or(StreamError::Buffer)?;
        let stride = out.plane_stride().first().copied().unwrap_or(0).unsigned_abs() as usize;
        if output != Output::Foreground {
            self.detector.draw_mask(out.plane_data_mut(0)?, stride, 1)?;
            return Ok(());
        }
        let frame = frame::readable(inbuf, &self.in_info).ok_or(StreamError::Buffer)?;
        let converter = match self.converter.take() {
            Some(converter) => converter,
            None => VideoConverter::new(&self.in_info, &self.out_info, None)?,
        };
        converter.frame_ref(&frame, &mut out);
        self.converter = Some(converter);
        let alpha = out.plane_data_mut(0)?.get_mut(3..).unwrap_or_default();
        Ok(self.detector.draw_regions(regions, alpha, stride, 4)?)
    }
}
