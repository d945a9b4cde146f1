// SPDX-License-Identifier: MPL-2.0

//! Everybody who is tracked, and what detectors of others see, as GStreamer's analytics library has it (1.24 on): boxes of a class,
//! each related to the number of its track.

use std::collections::BTreeMap;

use gst_analytics::prelude::*;
use gst_analytics::{AnalyticsODMtd, AnalyticsRelationMeta, RelTypes};
use gst_video::VideoInfo;
use ptztrack_contract::{MOTION_ROI, Rect, Track, TrackState};

/// The class of whatever our own detector finds, which does not tell people from vehicles.
const OBJECT: &str = "object";

/// The boxes of this class that a detector has left.
pub fn boxes(buffer: &gst::BufferRef, info: &VideoInfo, class: &str) -> Vec<Rect> {
    let (width, height) = (f64::from(info.width().max(1)), f64::from(info.height().max(1)));
    let mut boxes = Vec::new();
    // Some attach one for each object.
    for meta in buffer.iter_meta::<AnalyticsRelationMeta>() {
        let objects = meta.iter::<AnalyticsODMtd>();
        let of_class = objects.filter(|object| object.obj_type().is_some_and(|kind| kind.as_str() == class));
        let places = of_class.filter_map(|object| object.location().ok());
        boxes.extend(places.filter(|place| place.w > 0 && place.h > 0).map(|place| Rect {
            x: f64::from(place.x) / width,
            y: f64::from(place.y) / height,
            width: f64::from(place.w) / width,
            height: f64::from(place.h) / height,
        }));
    }
    boxes
}

/// Tells of everybody, picture after picture.
#[derive(Debug, Default)]
pub struct Analytics {
    /// When each of those who are tracked was seen first, by number.
    first_seen: BTreeMap<u64, gst::ClockTime>,
}

impl Analytics {
    /// Attaches a box for each track that is seen, of the class that the detector's boxes have, and its number.
    ///
    /// # Errors
    /// Where GStreamer has no room for them.
    pub fn attach(
        &mut self,
        buffer: &mut gst::BufferRef,
        info: &VideoInfo,
        roi_type: &str,
        tracks: &[Track],
        now: Option<gst::ClockTime>,
    ) -> Result<(), glib::BoolError> {
        self.first_seen.retain(|id, _| tracks.iter().any(|track| track.id == *id));
        let mut seen = tracks.iter().filter(|track| track.state != TrackState::Hidden).peekable();
        if seen.peek().is_none() {
            return Ok(());
        }
        let class = glib::Quark::from_str(if roi_type == MOTION_ROI { OBJECT } else { roi_type });
        // A detector may have left its own there.
        let mut meta = if buffer.meta::<AnalyticsRelationMeta>().is_some() {
            buffer.meta_mut::<AnalyticsRelationMeta>().ok_or_else(|| glib::bool_error!("no relation meta"))?
        } else {
            AnalyticsRelationMeta::add(buffer)
        };
        for track in seen {
            let first = *self.first_seen.entry(track.id).or_insert(now.unwrap_or_default());
            let [x, y, width, height] = pixels(&track.bounds, info);
            let object = meta.add_od_mtd(class, x, y, width, height, track.confidence as f32)?.id();
            let number = meta.add_tracking_mtd(track.id, first)?.id();
            meta.set_relation(RelTypes::RELATE_TO, object, number)?;
            meta.set_relation(RelTypes::RELATE_TO, number, object)?;
        }
        Ok(())
    }
}

/// Where it reaches beyond the picture, too.
fn pixels(bounds: &Rect, info: &VideoInfo) -> [i32; 4] {
    let (width, height) = (f64::from(info.width()), f64::from(info.height()));
    [bounds.x * width, bounds.y * height, bounds.width * width, bounds.height * height]
        .map(|side| side.round() as i32)
}
