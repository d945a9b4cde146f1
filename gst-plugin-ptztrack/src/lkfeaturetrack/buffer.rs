// SPDX-License-Identifier: MPL-2.0

//! What is read from buffers and attached to them.

use gst_video::{VideoInfo, VideoRegionOfInterestMeta};
use ptztrack_contract::{
    BufferMeta, ContractError, Feature, MOTION_ROI, MotionMeta, Rect, TARGET_ROI, TargetChange,
    TargetMessage, TargetMeta, TargetState, Times, Track, TracksMeta, aspect,
};

use crate::region_of_interest::remove_regions_of_interest;
use crate::vision::{Detection, Released, Tracked};

/// What a detector saw in one frame; kept as memory for the next.
#[derive(Default)]
pub(super) struct Detections {
    list: Vec<Detection>,
    motion: MotionMeta,
}

impl Detections {
    /// Reads the motion meta where it is asked for and there, or else the regions of interest named `roi_type`.
    pub fn read(
        &mut self,
        buffer: &gst::BufferRef,
        info: &VideoInfo,
        roi_type: &str,
    ) -> Result<&[Detection], ContractError> {
        let motion = (roi_type == MOTION_ROI).then(|| self.motion.refill(buffer)).flatten();
        match motion.transpose() {
            Ok(Some(())) => self.take_motion(),
            Ok(None) => {
                let regions = buffer.iter_meta::<VideoRegionOfInterestMeta>();
                let bounds =
                    regions.filter(|region| region.roi_type() == roi_type).map(|region| region.rect());
                self.list.clear();
                self.list.extend(bounds.map(|bounds| Detection {
                    bounds: Rect::from_pixels(bounds, info.width(), info.height()),
                    ..Detection::default()
                }));
                #[cfg(feature = "analytics")]
                self.list.extend(
                    crate::analytics::boxes(buffer, info, roi_type)
                        .into_iter()
                        .map(|bounds| Detection { bounds, ..Detection::default() }),
                );
            }
            Err(error) => {
                self.list.clear();
                return Err(error);
            }
        }
        Ok(&self.list)
    }

    fn take_motion(&mut self) {
        let MotionMeta { regions, outside } = &mut self.motion;
        self.list.resize_with(regions.len() + outside.len(), Detection::default);
        let outside = outside.iter_mut().map(|region| (region, true));
        let regions = regions.iter_mut().map(|region| (region, false)).chain(outside);
        for (detection, (region, outside)) in self.list.iter_mut().zip(regions) {
            // Each gets memory of the other.
            std::mem::swap(&mut detection.contour, &mut region.contour);
            detection.bounds = region.bounds;
            detection.outside = outside;
        }
    }
}

/// Attaches the target's own meta, and the standard one where there is a target, and everybody's. Gives points and tracks
/// back, as memory.
pub(super) fn attach(
    buffer: &mut gst::BufferRef,
    info: &VideoInfo,
    tracked: Tracked,
    capture_time: Option<gst::ClockTime>,
) -> Result<(Vec<Feature>, Vec<Track>), glib::BoolError> {
    remove_regions_of_interest(buffer, TARGET_ROI);
    if matches!(tracked.state, TargetState::Tracking | TargetState::Occluded) {
        let pixels = tracked.bounds.to_pixels(info.width(), info.height());
        if pixels.2 > 0 && pixels.3 > 0 {
            VideoRegionOfInterestMeta::add(buffer, TARGET_ROI, pixels);
        }
    }
    let everybody = TracksMeta { tracks: tracked.tracks };
    everybody.attach(buffer)?;
    let meta = TargetMeta {
        state: tracked.state,
        id: tracked.id,
        bounds: tracked.bounds,
        is_group: tracked.is_group,
        centroid: tracked.centroid,
        velocity: tracked.velocity,
        ego_velocity: tracked.ego_velocity,
        ego_zoom: tracked.ego_zoom,
        unchanged_for: tracked.unchanged_for.and_then(|time| time.try_into().ok()),
        confidence: tracked.confidence,
        features: tracked.features,
        aspect: aspect((info.width(), info.height()), info.par().into()),
        capture_time,
    };
    meta.attach(buffer)?;
    Ok((meta.features, everybody.tracks))
}

/// The message that says so.
pub(super) fn message(tracked: &Tracked, change: TargetChange, times: Times) -> TargetMessage {
    let message = TargetMessage {
        change,
        reason: None,
        times,
        state: tracked.state,
        id: tracked.id,
        bounds: tracked.bounds,
        centroid: tracked.centroid,
        velocity: tracked.velocity,
        confidence: tracked.confidence,
    };
    match tracked.released {
        Some(Released { reason, id, bounds, centroid, velocity, confidence })
            if change == TargetChange::Released =>
        {
            let (reason, state) = (Some(reason), TargetState::Searching);
            TargetMessage { reason, state, id, bounds, centroid, velocity, confidence, ..message }
        }
        _ => message,
    }
}
