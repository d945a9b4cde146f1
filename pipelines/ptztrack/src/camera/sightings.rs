// SPDX-License-Identifier: MPL-2.0

//! Who is followed, with the best picture: a branch of the camera's pipeline, which gets what is left for it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use events::{Collector, Crop, Ended, Sighting, Target, sharpness};
use gst_video::prelude::*;
use ptztrack_contract::{BufferMeta, Rect, TargetMeta, TargetState};

use super::known::Known;
use super::recording::{Segments, now_ms};
use super::sight::Person;
use crate::config::{CameraSettings, Kept};
use crate::log::Log;

/// Where a pipeline ends from which it is seen who is followed.
pub const SINK: &str = "appsink name=sightings sync=false async=false max-buffers=1 drop=true";

/// Between two looks whether a picture is better than those before.
const LOOK: Duration = Duration::from_millis(200);

/// No picture that is kept is higher, in pixels.
const MOST_HEIGHT: u32 = 480;

/// Sees to it that those are kept whom this pipeline follows.
pub fn watch(
    sink: &gst_app::AppSink,
    known: &Arc<Known>,
    camera: &CameraSettings,
    segments: Option<Arc<Segments>>,
    log: Arc<Log>,
) {
    let Some(kept) = camera.kept else { return };
    let mut witness = Witness::new(known.clone(), kept, segments, log);
    let see = move |sink: &gst_app::AppSink| {
        let sample = sink.pull_sample().map_err(|_| gst::FlowError::Eos)?;
        witness.see(&sample);
        Ok(gst::FlowSuccess::Ok)
    };
    sink.set_callbacks(gst_app::AppSinkCallbacks::builder().new_sample(see).build());
}

struct Witness {
    kept: Kept,
    log: Arc<Log>,
    /// What is recorded of the camera, where it is.
    segments: Option<Arc<Segments>>,
    began: Instant,
    collector: Collector,
    known: Arc<Known>,
    looked: Option<Instant>,
}

impl Witness {
    fn new(known: Arc<Known>, kept: Kept, segments: Option<Arc<Segments>>, log: Arc<Log>) -> Self {
        let collector = Collector::new(&known.name, now_ms());
        Self { kept, log, segments, began: Instant::now(), collector, known, looked: None }
    }

    fn see(&mut self, sample: &gst::Sample) {
        let Some(meta) = sample.buffer().and_then(TargetMeta::of).and_then(Result::ok) else { return };
        let followed = matches!(meta.state, TargetState::Tracking | TargetState::Occluded);
        let target = followed.then(|| self.target(&meta));
        let ended = self.collector.see(self.began.elapsed(), now_ms(), target.as_ref());
        ended.into_iter().for_each(|ended| self.keep(ended));
        if let Some(target) = target.filter(|_| meta.state == TargetState::Tracking && self.is_to_look()) {
            self.look(sample, &target, meta.bounds);
        }
    }

    fn target(&self, meta: &TargetMeta) -> Target {
        let ego = meta.ego_velocity.unwrap_or_default();
        let (x, y) = (meta.velocity.x - ego.x, meta.velocity.y - ego.y);
        let speed = x.hypot(y);
        Target {
            track: meta.id,
            height: meta.bounds.height,
            // Whoever comes closer to a camera above their head goes down in its picture.
            towards: if speed > 0.0 { y / speed } else { 0.0 },
            direction: self.direction(meta),
        }
    }

    /// Pan and tilt, of the place of the target in the last picture that the tracker has seen, and where the camera looked when that
    /// was taken. This one may have waited.
    fn direction(&self, meta: &TargetMeta) -> Option<(f64, f64)> {
        let seen = self.known.sight.borrow().clone();
        let (_, sight) = &*seen;
        let place = sight.people.iter().find(|person| person.id == meta.id).map(Person::centre);
        let view = sight.pose_about(self.known.video_delay())?.view()?;
        Some(view.angles_of(place.unwrap_or_else(|| meta.bounds.centre())))
    }

    fn is_to_look(&mut self) -> bool {
        let is_due = self.kept.pictures && self.looked.is_none_or(|looked| looked.elapsed() >= LOOK);
        if is_due {
            self.looked = Some(Instant::now());
        }
        is_due
    }

    fn look(&mut self, sample: &gst::Sample, target: &Target, bounds: Rect) {
        let Some(info) = sample.caps().and_then(|caps| gst_video::VideoInfo::from_caps(caps).ok()) else {
            return;
        };
        let Some(frame) = sample
            .buffer()
            .and_then(|buffer| gst_video::VideoFrameRef::from_buffer_ref_readable(buffer, &info).ok())
        else {
            return;
        };
        let (x, y, width, height) = bounds.to_pixels(info.width(), info.height());
        let grey = convert(&frame, [x, y, width, height], (width, height), gst_video::VideoFormat::Gray8);
        let Some(grey) = grey else { return };
        self.collector.offer(target, sharpness(&grey, width as usize), || crop(&frame, bounds));
    }

    fn keep(&self, ended: Ended) {
        let Ended { sighting, best } = ended;
        let picture = best.and_then(|(quality, crop)| crop.into_picture(quality, self.kept.pixelate));
        let recording = self.segments.as_ref().and_then(|segments| segments.at(sighting.from_ms));
        self.log.keep(Sighting { picture, recording, ..sighting });
    }
}

/// The pipeline is over.
impl Drop for Witness {
    fn drop(&mut self) {
        let ended = self.collector.end();
        ended.into_iter().for_each(|ended| self.keep(ended));
    }
}

type Frame<'a> = gst_video::VideoFrameRef<&'a gst::BufferRef>;

/// Somebody, with half of the box around them.
fn crop(frame: &Frame, bounds: Rect) -> Option<Crop> {
    let around = Rect {
        x: bounds.x - bounds.width / 2.0,
        y: bounds.y - bounds.height / 4.0,
        width: 2.0 * bounds.width,
        height: 1.5 * bounds.height,
    };
    let (left, top, width, height) = around.to_pixels(frame.width(), frame.height());
    let (x, y, person_width, person_height) = bounds.to_pixels(frame.width(), frame.height());
    let scale = (f64::from(MOST_HEIGHT) / f64::from(height.max(1))).min(1.0);
    let scaled = |length: u32| (f64::from(length) * scale).round() as u32;
    let size = (scaled(width).max(1), scaled(height).max(1));
    let rgb = convert(frame, [left, top, width, height], size, gst_video::VideoFormat::Rgb)?;
    let person = [x.saturating_sub(left), y.saturating_sub(top), person_width, person_height].map(scaled);
    Some(Crop { width: size.0, height: size.1, rgb, person })
}

/// A part of a picture in another format, scaled to a size: its pixels row by row, without a gap.
fn convert(
    frame: &Frame,
    part: [u32; 4],
    (width, height): (u32, u32),
    format: gst_video::VideoFormat,
) -> Option<Vec<u8>> {
    let whole = part.map(|side| i32::try_from(side).ok());
    let [Some(x), Some(y), Some(part_width @ 1..), Some(part_height @ 1..)] = whole else { return None };
    // Neither is converted.
    let (rate, interlacing) = (frame.info().fps(), frame.info().interlace_mode());
    let info = gst_video::VideoInfo::builder(format, width, height).fps(rate).interlace_mode(interlacing);
    let info = info.build().ok()?;
    let mut config = gst_video::VideoConverterConfig::new();
    config.set_src_x(x);
    config.set_src_y(y);
    config.set_src_width(Some(part_width));
    config.set_src_height(Some(part_height));
    let converter = gst_video::VideoConverter::new(frame.info(), &info, Some(config)).ok()?;
    let buffer = gst::Buffer::with_size(info.size()).ok()?;
    let mut converted = gst_video::VideoFrame::from_buffer_writable(buffer, &info).ok()?;
    converter.frame_ref(frame, &mut converted.as_mut_video_frame_ref());
    let stride = usize::try_from(info.stride()[0]).ok()?;
    let row = width as usize * info.format_info().pixel_stride()[0] as usize;
    let plane = converted.plane_data(0).ok()?;
    Some(
        plane
            .chunks(stride)
            .take(height as usize)
            .flat_map(|line| &line[..row.min(line.len())])
            .copied()
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use ptztrack_contract::Point;
    use ptztrack_contract::lock::lock;

    use super::*;
    use crate::camera::running::Running;
    use crate::camera::servo_stats::ServoStats;
    use crate::camera::{Abilities, Pose, Sight, Steering, Turn};

    /// The camera has turned on by the time at which the picture is here.
    #[test]
    fn a_late_picture_tells_where_they_were() {
        let known = Arc::new(Known::new("door"));
        let pose = |ms: u64, pan_deg: f64| Pose {
            age: Duration::from_millis(ms),
            pan_deg,
            tilt_deg: 0.0,
            horizontal_fov_deg: 60.0,
            vertical_fov_deg: 40.0,
        };
        let person = Person {
            id: 7,
            bounds: [0.45, 0.3, 0.1, 0.4],
            velocity: [0.0; 2],
            seen: true,
            confidence: 1.0,
            is_target: true,
        };
        let poses = vec![pose(1000, 0.0), pose(0, 20.0)];
        let sight = Sight { people: vec![person], poses, moving: true, ..Sight::default() };
        known.sight.send_replace(Arc::new((Instant::now(), sight)));
        *lock(&known.running) = Some(Arc::new(Late(400)));
        let kept = Kept { pictures: false, pixelate: false };
        let witness = Witness::new(known, kept, None, Arc::new(Log::unwritten()));
        // Of a picture before, in which they were further to the right.
        let meta = TargetMeta {
            state: TargetState::Tracking,
            id: 7,
            bounds: Rect { x: 0.6, y: 0.3, width: 0.1, height: 0.4 },
            centroid: Point { x: 0.65, y: 0.5 },
            confidence: 1.0,
            ..TargetMeta::default()
        };
        let (pan_deg, tilt_deg) = witness.target(&meta).direction.unwrap();
        assert!((pan_deg - 16.0).abs() < 1e-6 && tilt_deg.abs() < 1e-6, "{pan_deg}, {tilt_deg}");
    }

    /// What runs with so many milliseconds between a command and a picture that shows it.
    #[derive(Debug)]
    struct Late(u64);

    impl Running for Late {
        fn look(&self, _: bool) {}
        fn select(&self, _: f64, _: f64) {}
        fn select_track(&self, _: u64) {}
        fn ignore(&self, _: &BTreeSet<u64>) {}
        fn release(&self) {}
        fn steer(&self, _: Steering) {}
        fn turn(&self, _: &Known, _: Turn) -> bool {
            false
        }
        fn abilities(&self, _: &Known) -> Abilities {
            Abilities::default()
        }
        fn servo_stats(&self) -> Option<ServoStats> {
            Some(ServoStats {
                numbers: [("latency".to_owned(), self.0 * 1_000_000)].into(),
                ..ServoStats::default()
            })
        }
    }

    /// A grey picture whose pixels tell their places, at an odd width, of a stream that says its rate, as those by RTSP do.
    #[test]
    fn a_crop_has_somebody_where_it_says() {
        gst::init().unwrap();
        let (width, height) = (81, 60);
        let info = gst_video::VideoInfo::builder(gst_video::VideoFormat::Gray8, width, height)
            .fps(gst::Fraction::new(25, 1));
        let info = info.build().unwrap();
        let mut pixels = vec![16; info.size()];
        let stride = info.stride()[0] as usize;
        for row in 20..40 {
            pixels[row * stride + 30..row * stride + 40].fill(235);
        }
        let buffer = gst::Buffer::from_slice(pixels);
        let frame = gst_video::VideoFrameRef::from_buffer_ref_readable(&buffer, &info).unwrap();
        let crop = crop(&frame, Rect::from_pixels((30, 20, 10, 20), width, height)).unwrap();
        assert_eq!((crop.width, crop.height, crop.person), (20, 30, [5, 5, 10, 20]));
        let bright = |x: usize, y: usize| crop.rgb[(y * 20 + x) * 3] > 200;
        assert!(
            bright(5, 5)
                && bright(14, 24)
                && !bright(4, 5)
                && !bright(15, 5)
                && !bright(5, 4)
                && !bright(5, 25)
        );
        assert!(convert(&frame, [0, 0, 0, 10], (1, 1), gst_video::VideoFormat::Rgb).is_none());
    }
}
