// SPDX-License-Identifier: MPL-2.0

//! Pictures of a run's telling moments, chosen while it goes on.

use std::collections::BTreeMap;

use virtual_camera::Picture;

use crate::{
    codec, metrics,
    pipeline::{LastBytes, Pipeline, PipelineError, SINK, SOURCE},
    record::{FrameRecord, Moment, Snapshot, TargetState},
};

/// The first box is at the edge of the picture: how long the camera may take to bring it to the middle, seconds.
const APPROACH_S: f64 = 2.0;

#[derive(Clone)]
struct Page {
    frame: usize,
    picture: Picture,
}

/// A picture in which the person is not held any more: it will show the beginning of a loss if that lasts.
struct Doubt {
    begin_s: f64,
    page: Page,
}

/// What is kept so far: one picture for a moment.
#[derive(Default)]
pub(crate) struct Album {
    pages: BTreeMap<Moment, Page>,
    /// The first picture with somebody to follow, as long as they were never found.
    unseen: Option<Page>,
    /// Beginnings of losses.
    losses: Vec<Page>,
    doubt: Option<Doubt>,
    /// d_gc of the worst one.
    worst: f64,
    /// Whether the tracker ever was.
    was_right: bool,
}

impl Album {
    /// Keeps `picture`, number `frame` of those that count, if it tells something.
    pub fn look(&mut self, frame: usize, record: &FrameRecord, picture: Picture) {
        self.doubt(frame, record, &picture);
        let first = self.tells(record).filter(|moment| !self.pages.contains_key(moment));
        self.was_right |= metrics::is_true_positive(record);
        let is_worst = |distance: &f64| {
            let counts = !metrics::is_out(record) && record.time_s >= APPROACH_S;
            counts && first.is_none() && *distance > self.worst
        };
        let distance = metrics::d_gc(record).filter(is_worst);
        self.worst = distance.unwrap_or(self.worst);
        if let Some(moment) = first.or(distance.map(|_| Moment::Worst)) {
            self.pages.insert(moment, Page { frame, picture });
        }
    }

    /// Keeps the picture in which a loss begins, once it is one: see [`metrics::losses`].
    fn doubt(&mut self, frame: usize, record: &FrameRecord, picture: &Picture) {
        if !self.was_right && self.unseen.is_none() && record.truth.is_some() {
            self.unseen = Some(Page { frame, picture: picture.clone() });
        }
        if metrics::holds(record) || !self.was_right {
            self.doubt = None;
            return;
        }
        let begin = || Doubt { begin_s: record.time_s, page: Page { frame, picture: picture.clone() } };
        let doubt = self.doubt.get_or_insert_with(begin);
        let kept = self.losses.last().is_some_and(|page| page.frame == doubt.page.frame);
        // The loss ends with the next picture at the earliest.
        if !kept && record.time_s - doubt.begin_s >= metrics::LASTING_S {
            self.losses.push(doubt.page.clone());
        }
    }

    /// What the picture would be the first of.
    fn tells(&self, record: &FrameRecord) -> Option<Moment> {
        match record.estimate.as_ref().map(|estimate| estimate.state) {
            Some(TargetState::Occluded) => Some(Moment::Occluded),
            Some(TargetState::Tracking) => Some(Moment::Acquired),
            Some(TargetState::Lost | TargetState::Searching) | None => None,
        }
    }

    /// The pictures, as a camera would send them, in order of time.
    pub fn develop(self, info: &gst_video::VideoInfo) -> Result<Vec<Snapshot>, PipelineError> {
        let encoder = Encoder::new(info)?;
        let mut snapshots = Vec::new();
        let never = self.unseen.filter(|_| !self.was_right);
        let losses = self.losses.into_iter().chain(never).map(|page| (Moment::Lost, page));
        for (moment, Page { frame, picture }) in self.pages.into_iter().chain(losses) {
            snapshots.push(Snapshot { moment, frame, jpeg: encoder.encode(&picture, info, frame)? });
        }
        snapshots.sort_by_key(|snapshot| (snapshot.frame, snapshot.moment));
        Ok(snapshots)
    }
}

/// Makes JPEGs.
struct Encoder {
    pipeline: Pipeline,
    jpeg: LastBytes,
}

impl Encoder {
    fn new(info: &gst_video::VideoInfo) -> Result<Self, PipelineError> {
        let description = format!(
            "appsrc name={SOURCE} ! {} ! fakesink name={SINK} sync=false async=false",
            codec::jpeg_encoder()
        );
        let pipeline = Pipeline::new(&description, info)?;
        let jpeg = pipeline.last_bytes()?;
        pipeline.start()?;
        Ok(Self { pipeline, jpeg })
    }

    fn encode(
        &self,
        picture: &Picture,
        info: &gst_video::VideoInfo,
        number: usize,
    ) -> Result<Vec<u8>, PipelineError> {
        let mut buffer = picture.to_buffer(info).ok_or(PipelineError::NoElement(SOURCE))?;
        if let Some(buffer) = buffer.get_mut() {
            buffer.set_pts(gst::ClockTime::from_mseconds(number as u64));
        }
        self.pipeline.finish(buffer)?;
        Ok(self.jpeg.take())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        record::{Bounds, Estimate, GroundTruth},
        report::made_up,
    };

    const SIZE: (u32, u32) = (64, 48);

    fn record(time_s: f64, x: f64, state: TargetState) -> FrameRecord {
        let bounds = Bounds { left: x - 4.0, top: 10.0, width: 8.0, height: 28.0 };
        let truth = GroundTruth {
            id: 1,
            bounds,
            centroid: bounds.centre(),
            visible: 1.0,
            unhidden: 1.0,
            in_view: 1.0,
            position_m: None,
            direction_deg: None,
        };
        made_up::judged_by_boxes(FrameRecord {
            time_s,
            truth: Some(truth),
            estimate: Some(Estimate { state, centroid: bounds.centre(), bounds, id: 1, features: 9 }),
            ..made_up::frame(SIZE)
        })
    }

    fn look(album: &mut Album, frame: usize, record: &FrameRecord) {
        album.look(frame, record, Picture::grey(SIZE.0, SIZE.1, 20 * frame as u8));
    }

    fn developed(album: Album) -> (Vec<(Moment, usize)>, Vec<Snapshot>) {
        let info = gst_video::VideoInfo::builder(gst_video::VideoFormat::I420, SIZE.0, SIZE.1).build();
        let snapshots = album.develop(&info.unwrap()).unwrap();
        (snapshots.iter().map(|snapshot| (snapshot.moment, snapshot.frame)).collect(), snapshots)
    }

    /// As a tracker that stays behind while the person goes on.
    fn wrong(mut record: FrameRecord) -> FrameRecord {
        let estimate = record.estimate.as_mut().unwrap();
        estimate.bounds.left += 20.0;
        estimate.centroid = estimate.bounds.centre();
        made_up::judged_by_boxes(record)
    }

    #[test]
    fn a_loss_that_lasts_is_shown_from_its_beginning() {
        gst::init().unwrap();
        use TargetState::{Occluded, Tracking};
        let mut hidden = wrong(record(1.0, 30.0, Tracking));
        hidden.truth.as_mut().unwrap().visible = 0.0;
        let run = [
            wrong(record(0.0, 30.0, Tracking)),
            record(0.5, 30.0, Tracking),
            hidden,
            wrong(record(1.5, 30.0, Occluded)),
            wrong(record(1.6, 30.0, Tracking)),
        ];
        let mut album = Album::default();
        for (frame, record) in run.iter().enumerate() {
            look(&mut album, frame, record);
        }
        let expected = [(Moment::Acquired, 0), (Moment::Lost, 2), (Moment::Occluded, 3)];
        assert_eq!(developed(album).0, expected);
    }

    #[test]
    fn the_worst_is_still_in_the_picture() {
        gst::init().unwrap();
        let mut album = Album::default();
        for (frame, x) in [32.0, 50.0, 45.0, 70.0].into_iter().enumerate() {
            look(&mut album, frame, &record(2.0 + frame as f64, x, TargetState::Tracking));
        }
        assert_eq!(developed(album).0, [(Moment::Acquired, 0), (Moment::Worst, 1)]);
    }

    #[test]
    fn keeps_firsts_and_the_worst_after_the_approach() {
        gst::init().unwrap();
        use TargetState::{Lost, Occluded, Searching, Tracking};
        let run = [
            (0.0, 4.0, Tracking),
            (2.5, 40.0, Tracking),
            (3.0, 33.0, Occluded),
            (3.5, 33.0, Lost),
            (4.0, 50.0, Searching),
            (4.5, 33.0, Tracking),
            (5.0, 45.0, Lost),
        ];
        let mut album = Album::default();
        for (frame, (time_s, x, state)) in run.into_iter().enumerate() {
            look(&mut album, frame, &record(time_s, x, state));
        }
        let (moments, snapshots) = developed(album);
        let expected = [(Moment::Acquired, 0), (Moment::Occluded, 2), (Moment::Lost, 3), (Moment::Worst, 4)];
        assert_eq!(moments, expected);
        assert!(snapshots.iter().all(|snapshot| snapshot.jpeg.starts_with(&[0xff, 0xd8])));
    }
}
