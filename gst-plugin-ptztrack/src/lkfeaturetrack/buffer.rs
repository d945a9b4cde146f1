// SPDX-License-Identifier: MPL-2.0

//! What is read from buffers and attached to them.

use gst_video::{VideoInfo, VideoRegionOfInterestMeta};
use ptztrack_contract::{
    BufferMeta, ContractError, MOTION_ROI, MotionMeta, Rect, TARGET_ROI, TargetChange, TargetMessage,
    TargetMeta, TargetState, Times, aspect,
};

use crate::region_of_interest::remove_regions_of_interest;
use crate::vision::{Detection, Report};

/// What a detector saw: the motion meta where it is asked for and there, or else the regions of interest
/// named `roi_type`.
pub(super) fn detections(
    buffer: &gst::BufferRef,
    info: &VideoInfo,
    roi_type: &str,
) -> Result<Vec<Detection>, ContractError> {
    let motion = (roi_type == MOTION_ROI).then(|| MotionMeta::of(buffer)).flatten();
    if let Some(motion) = motion {
        let MotionMeta { regions, outside } = motion?;
        let regions = regions.into_iter().map(|region| (region, false));
        return Ok(regions
            .chain(outside.into_iter().map(|region| (region, true)))
            .map(|(region, outside)| Detection {
                bounds: region.bounds,
                contour: region.contour,
                restless: region.track.map_or(0.0, |track| track.restless as f32),
                outside,
            })
            .collect());
    }
    Ok(buffer
        .iter_meta::<VideoRegionOfInterestMeta>()
        .filter(|region| region.roi_type() == roi_type)
        .map(|region| Detection {
            bounds: Rect::from_pixels(region.rect(), info.width(), info.height()),
            ..Detection::default()
        })
        .collect())
}

/// Attaches the target's own meta, and the standard one where there is a target.
pub(super) fn attach(
    buffer: &mut gst::BufferRef,
    info: &VideoInfo,
    report: Report,
    capture_time: Option<gst::ClockTime>,
) -> Result<(), glib::BoolError> {
    remove_regions_of_interest(buffer, TARGET_ROI);
    if matches!(report.state, TargetState::Tracking | TargetState::Occluded) {
        let pixels = report.bounds.to_pixels(info.width(), info.height());
        if pixels.2 > 0 && pixels.3 > 0 {
            VideoRegionOfInterestMeta::add(buffer, TARGET_ROI, pixels);
        }
    }
    let meta = TargetMeta {
        state: report.state,
        id: report.id,
        bounds: report.bounds,
        centroid: report.centroid,
        velocity: report.velocity,
        ego_velocity: report.ego_velocity,
        confidence: report.confidence,
        features: report.features,
        aspect: aspect((info.width(), info.height()), info.par().into()),
        capture_time,
    };
    meta.attach(buffer)
}

/// The message that says so.
pub(super) fn message(report: &Report, change: TargetChange, times: Times) -> TargetMessage {
    TargetMessage {
        change,
        reason: report.released.filter(|_| change == TargetChange::Released),
        times,
        state: report.state,
        id: report.id,
        bounds: report.bounds,
        centroid: report.centroid,
        velocity: report.velocity,
        confidence: report.confidence,
    }
}
