// SPDX-License-Identifier: MPL-2.0

//! From a buffer to a measurement, or to a warning why there is none.

use std::time::Duration;

use gst::prelude::*;
use gst::subclass::prelude::*;
use ptztrack_contract::lock::lock;
use ptztrack_contract::{BufferMeta, TargetMeta, TargetState};
use servo::{Measurement, Visibility};

use crate::plumbing::{Plumbing, PtzSink};
use crate::settings::Steering;
use crate::stream::Fault;

/// From buffers to measurements.
pub trait Measuring: PtzSink {
    /// Leaves a measurement of the target that a buffer brings for the camera task.
    fn measure(&self, buffer: &gst::BufferRef) {
        let flags = buffer.flags();
        if flags.contains(gst::BufferFlags::GAP) {
            // The picture before, shown again by an element that fills in where none comes.
            return;
        }
        self.miss_pictures();
        let target = TargetMeta::of(buffer);
        // The tracker lets corrupted ones pass.
        if target.is_some() || !flags.contains(gst::BufferFlags::CORRUPTED) {
            self.miss_meta(target.is_some());
        }
        match target {
            Some(Ok(target)) => self.see(&target, buffer),
            Some(Err(err)) => self.warn(Fault::UnreadableMeta, || {
                format!(
                    "a target meta cannot be read ({err}); check that all plugins are of the same version"
                )
            }),
            None => {}
        }
    }

    fn see(&self, target: &TargetMeta, buffer: &gst::BufferRef) {
        let Some(picture) = lock(&self.core().stream).picture() else { return };
        if !picture.shows(target) || buffer.meta::<gst_video::VideoCropMeta>().is_some() {
            return self.warn(Fault::OtherPicture, || {
                format!("the picture has been cropped, or its shape changed, since the target was found in it: the camera cannot be steered by it. Put `{}` in front of the element that does that, or have it done before the tracker", Self::PARTICULARS.name)
            });
        }
        let shown = self.running_time(buffer.pts());
        let captured = target.capture_time.or(shown);
        let age = self.age(captured, shown);
        let (stale_timeout, steering) = {
            let settings = lock(&self.core().settings);
            (settings.servo.stale_timeout, settings.steering)
        };
        if self.is_from_before_pause(captured, stale_timeout) {
            return;
        }
        if age > stale_timeout {
            return self.warn(Fault::OldPictures, || {
                format!("pictures arrive {age:.1?} late, which is more than `stale-timeout` ({stale_timeout:?}): the camera is not steered by them. If the network is slow, lower the stream's bit rate, or reduce other traffic; if an element of the pipeline is, put a leaky queue (`queue leaky=downstream max-size-buffers=1`) in front of it")
            });
        }
        // Who is lost as the picture has become another one has not gone out of view.
        let is_gone = matches!(target.state, TargetState::Lost | TargetState::Searching);
        let is_cut_off = lock(&self.core().stream).is_other_picture() && is_gone;
        let visibility = match steering {
            Steering::Follow if is_released(target) || is_cut_off => Visibility::Released,
            Steering::Follow => target.state.into(),
            // On the way there it does not matter who is there.
            Steering::Home | Steering::LookAt => Visibility::Released,
            Steering::Off => return,
        };
        self.with_task(|task| {
            let mailbox = task.mailbox();
            mailbox.see(Measurement {
                visibility,
                id: target.id,
                centroid: target.centroid,
                bounds: target.bounds,
                velocity: target.velocity,
                ego_velocity: target.ego_velocity,
                ego_zoom: target.ego_zoom,
                unchanged_for: target.unchanged_for.map(Duration::from),
                size: picture.size,
                aspect: picture.aspect,
                taken_at: mailbox.now() - age,
            });
        });
    }

    /// How long ago the picture was taken, as far as its timestamp tells.
    fn age(&self, captured: Option<gst::ClockTime>, shown: Option<gst::ClockTime>) -> Duration {
        if lock(&self.core().stream).lockstep {
            return Duration::ZERO;
        }
        let Some((now, captured)) = self.obj().current_running_time().zip(captured) else {
            return Duration::ZERO;
        };
        let arrived = self.time();
        let (captured, shown, now) = (nanoseconds(captured), shown.map(nanoseconds), nanoseconds(now));
        lock(&self.core().stream).age.of(captured, shown, now, arrived)
    }

    /// Whether the picture was on its way when the pipeline was paused. For a while only, as a source may begin anew with its timestamps.
    fn is_from_before_pause(&self, captured: Option<gst::ClockTime>, stale_timeout: Duration) -> bool {
        let now = self.time();
        captured.is_some_and(|time| {
            lock(&self.core().stream).was_paused_after(nanoseconds(time), now, stale_timeout)
        })
    }

    /// Tells where no picture came for so long that nobody was followed. That may have been all; but where a network fills a
    /// queue, what comes then is as late, and pictures without timestamps of their own do not tell. No warning: where the camera
    /// does not answer either, there is one already.
    fn miss_pictures(&self) {
        let stale_timeout = lock(&self.core().settings).servo.stale_timeout;
        let now = self.time();
        let missed = {
            let mut stream = lock(&self.core().stream);
            let pause = stream.pause(now).filter(|pause| *pause > stale_timeout);
            pause.filter(|_| stream.is_news(Fault::NoPicture))
        };
        if let Some(pause) = missed {
            gst::element_imp_info!(
                self,
                gst::StreamError::Failed,
                ("no picture came for {pause:.1?}, which is more than `stale-timeout` ({stale_timeout:?}): nobody was followed meanwhile. If the network held them back, later ones may be just as late, and following suffers: lower the stream's bit rate, or reduce other traffic")
            );
        }
    }

    /// Warns where no buffer has had a target meta for long.
    fn miss_meta(&self, has_meta: bool) {
        let now = self.time();
        if lock(&self.core().stream).lacks_meta(has_meta, now) {
            self.warn(Fault::NoMeta, || {
                "no buffer has had a PtzTargetMeta for a second: there is no target to follow. Put `lkfeaturetrack` in front, with no element in between that drops metas".to_owned()
            });
        }
    }

    /// Warns once a stream.
    fn warn(&self, fault: Fault, text: impl FnOnce() -> String) {
        if lock(&self.core().stream).is_news(fault) {
            gst::element_imp_warning!(self, gst::StreamError::Format, ("{}", text()));
        }
    }
}

impl<S: PtzSink> Measuring for S {}

/// In a number that can be subtracted from.
pub fn nanoseconds(time: gst::ClockTime) -> i64 {
    i64::try_from(time.nseconds()).unwrap_or(i64::MAX)
}

/// Whether somebody was let go on purpose in this picture: who is lost is called so.
fn is_released(target: &TargetMeta) -> bool {
    target.state == TargetState::Searching && target.id != 0
}
