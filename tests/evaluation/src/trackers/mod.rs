// SPDX-License-Identifier: MPL-2.0

//! What follows the person: each a few elements between decoder and servo, and the same first box for all.

use std::{
    sync::{Arc, Mutex},
    time::Duration,
};

use gst::prelude::*;
use ptztrack_contract::{BufferMeta, Point, Rect, TargetMeta, Vector};

use virtual_camera::{Matrix, Sighting, VirtualCamera};

use crate::{
    experiment::Protocol,
    pipeline::{PipelineError, SINK, lock},
    record::{Bounds, FirstBox, GroundTruth, TrackerName},
};

mod bounds;
mod followers;
mod ours;
mod stock;

use followers::Follower;

/// Where a picture stands in its run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Phase {
    /// Nobody is to be followed yet.
    Before,
    /// The picture of the first box.
    FirstBox,
    /// Any picture after it.
    After,
}

impl Phase {
    /// Of a picture that is `counted` or not; `begun` says whether one before it was.
    pub fn of(counted: bool, begun: bool) -> Self {
        match (counted, begun) {
            (false, _) => Self::Before,
            (true, false) => Self::FirstBox,
            (true, true) => Self::After,
        }
    }
}

/// What is known of the picture that comes next. The bounds see the truth; everybody else sees it once, in the
/// picture of the first box.
#[derive(Debug, Clone)]
pub(crate) struct Cue {
    pub phase: Phase,
    pub truth: Option<GroundTruth>,
    /// In the picture of the first box, where its shape is known: a place, in pixels, at which the person is seen, and nobody before them.
    pub seen_at: Option<(f64, f64)>,
    /// How the background moved since the picture before: from its pixels to those of this one.
    pub motion: Option<Matrix>,
    pub size: (u32, u32),
}

/// The cue of the picture that is under way.
pub(crate) type CurrentCue = Arc<Mutex<Cue>>;

impl Cue {
    pub fn new(size: (u32, u32)) -> Self {
        Self { phase: Phase::Before, truth: None, seen_at: None, motion: None, size }
    }

    /// With where the person is seen, of the `people` in the picture.
    pub fn with_a_click_among(self, people: &[Sighting]) -> Self {
        let id = self.truth.as_ref().map(|truth| truth.id);
        let person = people.iter().find(|one| Some(one.truth.id) == id);
        let seen_at = person.filter(|_| self.phase == Phase::FirstBox).and_then(pointed_at);
        Self { seen_at, ..self }
    }

    /// Where an operator clicks who means the person, in frame sizes: where only their box is known, into its middle.
    fn click(&self) -> Option<Point> {
        let (x, y) = self.seen_at.or(self.given().map(|bounds| bounds.centre()))?;
        Some(Point { x: x / f64::from(self.size.0), y: y / f64::from(self.size.1) })
    }

    /// The box that trackers are given with this picture.
    fn given(&self) -> Option<Bounds> {
        self.truth.as_ref().filter(|_| self.phase == Phase::FirstBox).map(|truth| truth.bounds)
    }
}

/// What tells where the person is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Perception {
    /// Our elements.
    Ours,
    /// GStreamer's `cvtracker`.
    Stock,
    /// The truth, or nothing that anybody hears.
    Truth,
}

fn perception(name: TrackerName) -> Perception {
    match name {
        TrackerName::Ptztrack | TrackerName::Thesis => Perception::Ours,
        TrackerName::Csrt
        | TrackerName::Kcf
        | TrackerName::Mosse
        | TrackerName::MedianFlow
        | TrackerName::KcfPredicted => Perception::Stock,
        TrackerName::RelativeMoves
        | TrackerName::BoxPid
        | TrackerName::Oracle
        | TrackerName::OracleEgo
        | TrackerName::OracleXray
        | TrackerName::Still => Perception::Truth,
    }
}

/// Where somebody is pointed at, in pixels: in the middle of their box, or where they are not seen there, the place at which they are
/// that is nearest to the middle of all that is seen of them. `None` where nothing is.
fn pointed_at(person: &Sighting) -> Option<(f64, f64)> {
    let Bounds { left, top, width, height } = person.truth.bounds;
    let middle = person.truth.bounds.centre();
    if person.silhouette.shows(middle) {
        return Some(middle);
    }
    let places = (0..height.ceil() as u32).flat_map(|row| {
        (0..width.ceil() as u32)
            .map(move |column| (left + f64::from(column) + 0.5, top + f64::from(row) + 0.5))
    });
    let seen: Vec<_> = places.filter(|place| person.silhouette.shows(*place)).collect();
    let sum = seen.iter().fold((0.0, 0.0), |sum, place| (sum.0 + place.0, sum.1 + place.1));
    let middle = (sum.0 / seen.len() as f64, sum.1 / seen.len() as f64);
    let away = |place: &(f64, f64)| (place.0 - middle.0).hypot(place.1 - middle.1);
    seen.into_iter().min_by(|a, b| away(a).total_cmp(&away(b)))
}

/// A tracker's part in one pipeline.
pub(crate) struct Tracker {
    name: TrackerName,
    first_box: FirstBox,
    cue: CurrentCue,
    /// What commands the camera, where that is not our servo.
    follower: Option<Mutex<Follower>>,
}

impl Tracker {
    pub fn new(name: TrackerName, first_box: FirstBox, size: (u32, u32)) -> Self {
        let follower = Follower::of(name, size).map(Mutex::new);
        Self { name, first_box, cue: Arc::new(Mutex::new(Cue::new(size))), follower }
    }

    /// What it is told of the picture that is under way.
    pub fn cue(&self) -> &CurrentCue {
        &self.cue
    }

    /// Its elements, from decoded pictures to pictures with or without a target meta.
    pub fn description(&self) -> String {
        match (perception(self.name), self.name) {
            (Perception::Ours, TrackerName::Thesis) => ours::THESIS.to_owned(),
            (Perception::Ours, _) => ours::DEFAULTS.to_owned(),
            (Perception::Stock, name) => stock::description(name),
            (Perception::Truth, _) => "identity name=tracker".to_owned(),
        }
    }

    /// The element that moves the camera at `location`, with `settings` that are the same for all; one that moves nothing
    /// where the tracker is not to, or commands it by [`Self::steer`].
    pub fn sink(&self, protocol: Protocol, location: &str, settings: &str) -> String {
        let sink = format!("{} name={SINK} location={location} {settings}", protocol.sink());
        match self.name {
            name if name == TrackerName::Still || self.follower.is_some() => {
                format!("fakesink name={SINK} sync=false async=false")
            }
            // The thesis knows its camera from the start.
            TrackerName::Thesis => format!("{sink} prediction=average learn=false search-time=0"),
            _ => sink,
        }
    }

    /// Puts up its probes.
    pub fn attach(&self, pipeline: &gst::Pipeline) -> Result<(), PipelineError> {
        match perception(self.name) {
            Perception::Ours => ours::attach(pipeline, self.first_box),
            Perception::Stock => stock::attach(pipeline, &self.cue),
            Perception::Truth => bounds::attach(pipeline, self.name, &self.cue),
        }
    }

    /// To be called before each picture.
    pub fn next(&self, pipeline: &gst::Pipeline, cue: Cue) -> Result<(), PipelineError> {
        *lock(&self.cue) = cue.clone();
        match perception(self.name) {
            Perception::Ours => ours::next(pipeline, self.first_box, &cue),
            Perception::Stock => stock::next(pipeline, &cue),
            Perception::Truth => Ok(()),
        }
    }

    /// To be called when the picture of that `exposure` has gone all the way, with what was said of it: commands `camera`, where
    /// no element does.
    pub fn steer(
        &self,
        camera: &VirtualCamera,
        exposure: Duration,
        target: Option<&TargetMeta>,
    ) -> Result<(), PipelineError> {
        let Some(follower) = &self.follower else { return Ok(()) };
        Ok(lock(follower).steer(camera, exposure, target)?)
    }
}

/// Why `name` cannot run here: `None` where it can.
pub fn missing(name: TrackerName) -> Option<String> {
    let stock = perception(name) == Perception::Stock;
    (stock && gst::ElementFactory::find("cvtracker").is_none())
        .then(|| format!("{name} is skipped: GStreamer has no `cvtracker`; install gstreamer1.0-opencv"))
}

/// A box in frame sizes.
pub(crate) fn normalised(bounds: Bounds, size: (u32, u32)) -> Rect {
    let (width, height) = (f64::from(size.0), f64::from(size.1));
    Rect {
        x: bounds.left / width,
        y: bounds.top / height,
        width: bounds.width / width,
        height: bounds.height / height,
    }
}

/// A place in a picture, in frame sizes, and the picture's time.
type Place = (Point, Option<gst::ClockTime>);

/// Motion from one place to another, in frame sizes a second; `None` where no time passed.
fn rate(from: Place, to: Place) -> Option<Vector> {
    let step_s = to.1.zip(from.1).and_then(|(now, then)| now.checked_sub(then))?.seconds_f64();
    (step_s > 0.0).then(|| Vector { x: (to.0.x - from.0.x) / step_s, y: (to.0.y - from.0.y) / step_s })
}

/// Lets `say` put a target meta onto every picture that passes `pad`.
fn attach_targets(
    pad: &gst::Pad,
    cue: &CurrentCue,
    say: impl Fn(&Cue, &mut gst::BufferRef) -> TargetMeta + Send + Sync + 'static,
) {
    let cue = cue.clone();
    pad.add_probe(gst::PadProbeType::BUFFER, move |_, info| {
        if let Some(buffer) = info.buffer_mut().map(gst::Buffer::make_mut) {
            let target = say(&lock(&cue), buffer);
            if let Err(error) = target.attach(buffer) {
                gst::error!(gst::CAT_DEFAULT, "no target meta: {error}");
            }
        }
        gst::PadProbeReturn::Ok
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pole, or somebody nearer, stands before the middle of them.
    #[test]
    fn a_click_is_where_the_person_is_seen() {
        let bounds = Bounds { left: 100.0, top: 20.0, width: 30.0, height: 10.0 };
        let truth = GroundTruth {
            id: 3,
            bounds,
            centroid: bounds.centre(),
            visible: 0.6,
            unhidden: 0.6,
            in_view: 1.0,
            position_m: None,
            direction_deg: None,
        };
        let mut person = Sighting::of_box(truth.clone(), (200, 100));
        person.silhouette = serde_json::from_value(serde_json::json!({
            "origin": [100.0, 20.0], "pixel": [10.0, 10.0],
            "whole": { "width": 3, "height": 1, "lengths": [0, 3] },
            "visible": { "width": 3, "height": 1, "lengths": [0, 1, 1, 1] },
        }))
        .expect("a silhouette");
        let cue = |phase| Cue { phase, truth: Some(truth.clone()), ..Cue::new((200, 100)) };
        let clicked =
            |cue: Cue| cue.click().map(|place| ((200.0 * place.x).round(), (100.0 * place.y).round()));
        assert_eq!(clicked(cue(Phase::FirstBox)), Some((115.0, 25.0)), "only the box is known");
        let clicks = [Phase::Before, Phase::FirstBox, Phase::After]
            .map(|phase| clicked(cue(phase).with_a_click_among(std::slice::from_ref(&person))));
        let [None, Some((x, y)), None] = clicks else { panic!("{clicks:?}") };
        assert!(!(111.0..120.0).contains(&x) && (24.0..=26.0).contains(&y), "{x}, {y}");
        assert!((x - 115.0).abs() < 6.0, "{x}: as near to the middle as they are seen");
    }
}
