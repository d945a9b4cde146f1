// SPDX-License-Identifier: MPL-2.0

//! Tables for machines: RFC 4180, fixed formatting, missing values empty.

use super::{
    column,
    judged::{Judged, Setup},
};
use crate::{
    metrics::{d_gc, d_gp, is_true_positive},
    record::{FrameRecord, GroundTruth, Provenance},
};

/// Digits after the point; as many as the thesis gives.
const DECIMALS: usize = 6;

const SETUP: [&str; 6] = ["codec", "width", "height", "first_box", "video_delay_ms", "command_delay_ms"];
/// What every line on a run begins with.
const RUN: [&str; 3] = ["title", "test", "tracker"];

/// One line a run.
pub fn results(judged: &[Judged]) -> String {
    let figures = column::ALL.iter().map(|column| column.key);
    let mut csv = line(
        RUN.into_iter()
            .chain(["seed"])
            .chain(SETUP)
            .chain(["frames", "frames_with_target"])
            .chain(figures)
            .chain(["suite", "path", "tracker_made_of", "servo", "laboratory", "error"]),
    );
    for one in judged {
        let run = one.run;
        let test = run.test.map(|test| test.to_string()).unwrap_or_default();
        let mut cells = vec![run.title.clone(), test, run.tracker.to_string(), run.seed.to_string()];
        cells.extend(setup(&one.setup));
        cells.extend([one.metrics.frames, one.metrics.frames_with_target].map(|number| number.to_string()));
        cells.extend(column::ALL.iter().map(|column| number(column.of(&one.metrics))));
        let Provenance { tracker, servo, laboratory } = run.provenance.clone();
        cells.extend([run.suite.to_string(), run.path.clone(), tracker, servo, laboratory]);
        cells.push(run.error.clone().unwrap_or_default());
        csv += &line(cells);
    }
    csv
}

/// One line a loss.
pub fn losses(judged: &[Judged]) -> String {
    let mut csv =
        line(["suite", "title", "tracker", "seed", "first_box", "cause", "begin_s", "duration_s", "frame"]);
    for (one, loss) in judged.iter().flat_map(|one| one.losses.iter().map(move |loss| (one, loss))) {
        let run = one.run;
        csv += &line([
            run.suite.to_string(),
            run.title.clone(),
            run.tracker.to_string(),
            run.seed.to_string(),
            run.first_box.to_string(),
            loss.cause.to_string(),
            number(Some(loss.begin_s)),
            number(Some(loss.duration_s)),
            loss.frame.to_string(),
        ]);
    }
    csv
}

/// Whether a text is what [`results`] once wrote.
pub fn is_results(text: &str) -> bool {
    text.starts_with(&RUN.join(","))
}

/// One line a picture of one run.
pub fn frames(frames: &[FrameRecord]) -> String {
    let mut csv = line([
        "time_s",
        "visible",
        "unhidden",
        "in_view",
        "true_x",
        "true_y",
        "true_left",
        "true_top",
        "true_width",
        "true_height",
        "state",
        "x",
        "y",
        "left",
        "top",
        "width",
        "height",
        "target",
        "features",
        "d_gc",
        "d_gp",
        "right",
        "pan_deg",
        "tilt_deg",
        "zoom",
        "commands",
    ]);
    for frame in frames {
        let truth = |value: fn(&GroundTruth) -> f64| number(frame.truth.as_ref().map(value));
        let mut cells = vec![number(Some(frame.time_s))];
        cells.extend([
            truth(|t| t.visible),
            truth(|t| t.unhidden),
            truth(|t| t.in_view),
            truth(|t| t.centroid.0),
            truth(|t| t.centroid.1),
            truth(|t| t.bounds.left),
            truth(|t| t.bounds.top),
            truth(|t| t.bounds.width),
            truth(|t| t.bounds.height),
        ]);
        cells.extend(estimate(frame));
        cells.extend([
            number(d_gc(frame)),
            number(d_gp(frame)),
            u8::from(is_true_positive(frame)).to_string(),
        ]);
        cells.extend([frame.pan_deg, frame.tilt_deg, frame.zoom].map(|value| number(Some(value))));
        cells.push(frame.commands.to_string());
        csv += &line(cells);
    }
    csv
}

fn estimate(frame: &FrameRecord) -> [String; 9] {
    let Some(estimate) = &frame.estimate else { return Default::default() };
    let (x, y) = estimate.centroid;
    let bounds = estimate.bounds;
    let [x, y, left, top, width, height] =
        [x, y, bounds.left, bounds.top, bounds.width, bounds.height].map(|value| number(Some(value)));
    let state = estimate.state.name().to_owned();
    [state, x, y, left, top, width, height, estimate.id.to_string(), estimate.features.to_string()]
}

fn setup(setup: &Setup) -> [String; 6] {
    let (video, command) = (setup.delays.video.as_millis(), setup.delays.command.as_millis());
    [
        setup.codec.to_string(),
        setup.size.0.to_string(),
        setup.size.1.to_string(),
        setup.first_box.to_string(),
        video.to_string(),
        command.to_string(),
    ]
}

/// Of fixed digits; nothing where there is none.
pub fn number(value: Option<f64>) -> String {
    // Adding zero turns -0 into 0.
    value.map(|value| format!("{:.DECIMALS$}", value + 0.0)).unwrap_or_default()
}

/// One line of cells.
pub fn line(cells: impl IntoIterator<Item = impl AsRef<str>>) -> String {
    let cells: Vec<_> = cells.into_iter().map(|cell| quoted(cell.as_ref())).collect();
    cells.join(",") + "\n"
}

fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.into()
    }
}

/// Lines of cells, as [`line`] writes them.
pub fn parse(text: &str) -> Vec<Vec<String>> {
    let (mut lines, mut cells, mut cell, mut in_quotes) = (Vec::new(), Vec::new(), String::new(), false);
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            '"' if in_quotes && chars.next_if_eq(&'"').is_some() => cell.push('"'),
            '"' => in_quotes = !in_quotes,
            ',' if !in_quotes => cells.push(std::mem::take(&mut cell)),
            '\n' if !in_quotes => {
                cells.push(std::mem::take(&mut cell));
                lines.push(std::mem::take(&mut cells));
            }
            c => cell.push(c),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        let cells = ["plain", "", "a, b", "\"quoted\"", "two\nlines", "\"", "end"];
        let text = line(cells) + &line(["x"]);
        assert_eq!(parse(&text), [cells.map(str::to_owned).to_vec(), vec!["x".to_owned()]]);
        assert_eq!(parse(""), Vec::<Vec<String>>::new());
    }
}
