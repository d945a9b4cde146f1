//! The two bounds: both know the truth of the picture at hand, and one of them never moves.

use std::sync::Mutex;

use ptztrack_contract::{Point, TargetMeta, TargetState, Vector};

use super::{Cue, CurrentCue, Phase, attach_targets, normalised, rate};
use crate::{
    metrics::SPECK,
    pipeline::{Elements, PipelineError, lock},
    record::GroundTruth,
};

pub(super) fn attach(pipeline: &gst::Pipeline, cue: &CurrentCue) -> Result<(), PipelineError> {
    let last = Mutex::default();
    attach_targets(&pipeline.pad("tracker", "src")?, cue, move |cue, buffer| {
        tell(cue, buffer.pts(), &mut lock(&last))
    });
    Ok(())
}

/// What was told last, and when.
type Last = Option<(TargetMeta, Option<gst::ClockTime>)>;

fn tell(cue: &Cue, time: Option<gst::ClockTime>, last: &mut Last) -> TargetMeta {
    let truth = cue.truth.as_ref().filter(|_| cue.phase != Phase::Before);
    let target = match truth {
        Some(truth) if truth.visible >= SPECK => see(truth, cue.size, time, last),
        Some(_) | None => match last.take() {
            Some((before, _)) => TargetMeta { state: TargetState::Occluded, ..before },
            None => TargetMeta::default(),
        },
    };
    *last = (target.id > 0).then(|| (target.clone(), time));
    target
}

fn see(truth: &GroundTruth, size: (u32, u32), time: Option<gst::ClockTime>, last: &Last) -> TargetMeta {
    let centroid = Point { x: truth.centroid.0 / f64::from(size.0), y: truth.centroid.1 / f64::from(size.1) };
    let velocity = last.as_ref().map_or_else(Vector::default, |(before, then)| {
        // What happened while it was hidden is no velocity.
        let seen_before = before.state == TargetState::Tracking;
        let rate = rate((before.centroid, *then), (centroid, time)).filter(|_| seen_before);
        rate.unwrap_or(before.velocity)
    });
    TargetMeta {
        state: TargetState::Tracking,
        id: 1,
        bounds: normalised(truth.bounds, size),
        centroid,
        velocity,
        confidence: 1.0,
        ..TargetMeta::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Bounds;

    fn cue(phase: Phase, x: f64, visible: f64) -> Cue {
        let truth = GroundTruth {
            id: 0,
            bounds: Bounds { left: x - 10.0, top: 20.0, width: 20.0, height: 60.0 },
            centroid: (x, 45.0),
            visible,
            unhidden: visible,
            in_view: 1.0,
            position_m: None,
            direction_deg: None,
        };
        Cue { phase, truth: Some(truth), size: (200, 100) }
    }

    #[test]
    fn the_truth_is_told_from_the_first_box_on() {
        let (mut last, ms) = (None, |n| Some(gst::ClockTime::from_mseconds(n)));
        assert_eq!(tell(&cue(Phase::Before, 90.0, 1.0), ms(0), &mut last), TargetMeta::default());
        let first = tell(&cue(Phase::FirstBox, 100.0, 1.0), ms(40), &mut last);
        assert_eq!((first.state, first.velocity), (TargetState::Tracking, Vector::default()));
        assert_eq!(first.centroid, Point { x: 0.5, y: 0.45 });
        let second = tell(&cue(Phase::After, 104.0, 0.2), ms(80), &mut last);
        assert!((second.velocity.x - 0.5).abs() < 1e-9, "{second:?}");
        let hidden = tell(&cue(Phase::After, 112.0, 0.0), ms(120), &mut last);
        assert_eq!((hidden.state, hidden.velocity), (TargetState::Occluded, second.velocity));
        assert_eq!(hidden.centroid, second.centroid);
        let again = tell(&cue(Phase::After, 160.0, 1.0), ms(160), &mut last);
        assert_eq!((again.state, again.velocity), (TargetState::Tracking, second.velocity));
    }
}
