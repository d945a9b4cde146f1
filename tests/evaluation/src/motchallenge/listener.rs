// SPDX-License-Identifier: MPL-2.0

//! What the elements say of everybody, picture by picture.

use std::sync::{Arc, Mutex};

use gst::prelude::*;
use ptztrack_contract::{BufferMeta, MotionMeta, Rect, TargetMeta, TargetState, TracksMeta};

use crate::{
    metrics::overlap_with,
    pipeline::{Elements, Pipeline, PipelineError, SINK, lock},
    record::Bounds,
};

/// Boxes of one picture, in frame sizes.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Said {
    /// The moving regions of the detector, where there is one.
    pub regions: Option<Vec<Rect>>,
    /// Number and box of each track.
    pub tracks: Vec<(u64, Rect)>,
}

/// Hears what reaches the sink of a pipeline.
pub(crate) struct Listener(Arc<Mutex<Said>>);

impl Listener {
    /// To be called before the pipeline starts.
    pub fn attach(pipeline: &Pipeline) -> Result<Self, PipelineError> {
        let said = Arc::<Mutex<Said>>::default();
        let heard = said.clone();
        pipeline.bin().pad(SINK, "sink")?.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
            if let Some(buffer) = info.buffer() {
                *lock(&heard) = Said::of(buffer);
            }
            gst::PadProbeReturn::Ok
        });
        Ok(Self(said))
    }

    /// What was said of the last picture; can be had once.
    pub fn take(&self) -> Said {
        std::mem::take(&mut *lock(&self.0))
    }
}

impl Said {
    fn of(buffer: &gst::BufferRef) -> Self {
        let motion = MotionMeta::of(buffer).and_then(Result::ok);
        let tracks = TracksMeta::of(buffer).and_then(Result::ok);
        Self {
            regions: motion.map(|motion| motion.regions.iter().map(|region| region.bounds).collect()),
            tracks: match tracks {
                Some(tracks) => tracks.tracks.iter().map(|track| (track.id, track.bounds)).collect(),
                None => Self::target(buffer).into_iter().collect(),
            },
        }
    }

    /// How well the best region fits a box in a picture of that size, pixels: intersection over union, 0 where there
    /// is none; `None` where there is no detector.
    pub fn best_region(&self, bounds: &Bounds, size: (u32, u32)) -> Option<f64> {
        let (width, height) = (f64::from(size.0), f64::from(size.1));
        let fits = self.regions.as_ref()?.iter().map(|region| {
            let region = Bounds {
                left: region.x * width,
                top: region.y * height,
                width: region.width * width,
                height: region.height * height,
            };
            overlap_with(&region, bounds)
        });
        Some(fits.fold(0.0, f64::max))
    }

    /// Of a tracker that tells of its target alone.
    fn target(buffer: &gst::BufferRef) -> Option<(u64, Rect)> {
        let target = TargetMeta::of(buffer)?.ok()?;
        let placed = matches!(target.state, TargetState::Tracking | TargetState::Occluded);
        placed.then_some((target.id, target.bounds))
    }
}

#[cfg(test)]
mod tests {
    use ptztrack_contract::{Region, Track, TrackState, Vector};

    use super::*;

    #[test]
    fn regions_and_a_target_that_has_a_place_are_heard() {
        gst::init().unwrap();
        let rect = |x| Rect { x, y: 0.2, width: 0.1, height: 0.4 };
        let said = |state| {
            let mut buffer = gst::Buffer::new();
            let buffer = buffer.get_mut().unwrap();
            let region = Region { bounds: rect(0.1), ..Region::default() };
            MotionMeta { regions: vec![region], ..MotionMeta::default() }.attach(buffer).unwrap();
            TargetMeta { state, id: 3, bounds: rect(0.5), ..TargetMeta::default() }.attach(buffer).unwrap();
            Said::of(buffer)
        };
        let tracks = vec![(3, rect(0.5))];
        for state in [TargetState::Tracking, TargetState::Occluded] {
            assert_eq!(said(state), Said { regions: Some(vec![rect(0.1)]), tracks: tracks.clone() });
        }
        for state in [TargetState::Searching, TargetState::Lost] {
            assert_eq!(said(state).tracks, []);
        }
        assert_eq!(Said::of(gst::Buffer::new().as_ref()), Said::default());
    }

    #[test]
    fn a_region_fits_by_what_it_shares_with_a_box() {
        let region = |x| Rect { x, y: 0.2, width: 0.1, height: 0.4 };
        let said = Said { regions: Some(vec![region(0.6), region(0.1)]), tracks: vec![] };
        let bounds = Bounds { left: 10.0, top: 10.0, width: 10.0, height: 40.0 };
        // They have 30 of 50 rows in common.
        assert!((said.best_region(&bounds, (100, 100)).unwrap() - 0.6).abs() < 1e-9);
        assert_eq!(Said::default().best_region(&bounds, (100, 100)), None);
    }

    #[test]
    fn everybody_is_heard_of_whom_the_tracker_tells() {
        gst::init().unwrap();
        let track = |id, state| Track {
            id,
            bounds: Rect { x: 0.1, y: 0.2, width: 0.1, height: 0.4 },
            velocity: Vector::default(),
            state,
            confidence: 1.0,
            is_target: id == 2,
        };
        let tracks = vec![track(2, TrackState::Seen), track(5, TrackState::Hidden)];
        let mut buffer = gst::Buffer::new();
        let writable = buffer.get_mut().unwrap();
        TracksMeta { tracks }.attach(writable).unwrap();
        TargetMeta { state: TargetState::Tracking, id: 2, ..TargetMeta::default() }.attach(writable).unwrap();
        let numbers: Vec<_> = Said::of(&buffer).tracks.iter().map(|(id, _)| *id).collect();
        assert_eq!(numbers, [2, 5]);
    }
}
