// SPDX-License-Identifier: MPL-2.0

//! Pictures of the telling moments, the boxes drawn over them.

use std::fmt::Write;

use super::{judged::Judged, table::escape};
use crate::{
    metrics::{Loss, d_gc, d_gp, is_true_positive},
    record::{Bounds, FrameRecord, Moment, Snapshot, TargetState},
};

/// The moments of one run side by side; nothing where none were kept.
pub fn html(one: &Judged) -> String {
    let figures: String = one
        .run
        .snapshots
        .iter()
        .filter(|snapshot| snapshot.moment != Moment::Lost)
        .filter_map(|snapshot| Some(figure(snapshot, one.run.frames.get(snapshot.frame)?)))
        .collect();
    if figures.is_empty() {
        return String::new();
    }
    format!("<h4>{}</h4>\n<div class=\"strip\">\n{figures}</div>\n", one.run.tracker)
}

/// The pictures in which losses of one run began, each with its cause.
pub fn losses(one: &Judged) -> String {
    let figure = |loss: &Loss| {
        let shown = |snapshot: &&Snapshot| snapshot.moment == Moment::Lost && snapshot.frame == loss.frame;
        let picture = figure(one.run.snapshots.iter().find(shown)?, one.run.frames.get(loss.frame)?);
        let run = one.run;
        Some(format!(
            "<div><p><b>{}</b><br>{}, {}, seed {}, at {:.1} s for {:.1} s</p>\n{picture}</div>\n",
            loss.cause,
            run.tracker,
            escape(&run.title),
            run.seed,
            loss.begin_s,
            loss.duration_s
        ))
    };
    one.losses.iter().filter_map(figure).collect()
}

fn figure(snapshot: &Snapshot, frame: &FrameRecord) -> String {
    let (width, height) = frame.size;
    let moment = snapshot.moment;
    let image = glib::base64_encode(&snapshot.jpeg);
    let mut svg = format!(
        "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{moment}\">\
         <image width=\"{width}\" height=\"{height}\" href=\"data:image/jpeg;base64,{image}\"/>"
    );
    if let Some(truth) = &frame.truth {
        svg += &outline(&truth.bounds, "truth");
    }
    if let Some(estimate) = frame.estimate.as_ref().filter(|estimate| estimate.has_place()) {
        let class = match estimate.state {
            TargetState::Occluded => "predicted",
            _ if is_true_positive(frame) => "right",
            _ => "wrong",
        };
        svg += &outline(&estimate.bounds, class);
        let (x, y) = estimate.centroid;
        let _ = write!(
            svg,
            "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{:.1}\"/>",
            f64::from(width) / 100.0
        );
    }
    format!(
        "<figure>{svg}</svg><figcaption><b>{moment}</b> {}</figcaption></figure>\n",
        escape(&words(frame))
    )
}

fn outline(bounds: &Bounds, class: &str) -> String {
    let Bounds { left, top, width, height } = bounds;
    format!(
        "<rect class=\"{class}\" x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
    )
}

fn words(frame: &FrameRecord) -> String {
    let mut words = format!("{:.2} s", frame.time_s);
    if let Some(estimate) = &frame.estimate {
        words += &format!(", {}", estimate.state.name());
        if estimate.features > 0 {
            words += &format!(", {} features", estimate.features);
        }
    }
    for (name, value) in [("d_gc", d_gc(frame)), ("d_gp", d_gp(frame))] {
        if let Some(value) = value {
            words += &format!(", {name} {value:.2}");
        }
    }
    if let Some(truth) = frame.truth.as_ref().filter(|truth| truth.unhidden < 0.995) {
        words += &format!(", {:.0} % hidden", 100.0 * (1.0 - truth.unhidden));
    }
    words
}
