//! Tables for machines: RFC 4180, fixed formatting, missing values empty.

use super::{
    column,
    judged::{Judged, Section, Setup},
    tables::{PRINTED, conditions, in_condition, printed_in},
};
use crate::{
    metrics::{Metrics, d_gc, d_gp, is_true_positive},
    record::{FrameRecord, GroundTruth},
};

/// Digits after the point; as many as the thesis gives.
const DECIMALS: usize = 6;

const SETUP: [&str; 9] = [
    "seed",
    "codec",
    "width",
    "height",
    "first_box",
    "video_delay_ms",
    "command_delay_ms",
    "sweep",
    "real_time",
];
/// What every line on a run begins with.
const RUN: [&str; 3] = ["title", "test", "tracker"];

/// One line a run.
pub fn results(judged: &[Judged]) -> String {
    let figures = column::ALL.iter().map(|column| column.key);
    let mut csv = line(
        RUN.into_iter()
            .chain(SETUP)
            .chain(["frames", "frames_with_target"])
            .chain(figures)
            .chain(["dropped", "error"]),
    );
    for one in judged {
        let run = one.run;
        let test = run.test.map(|test| test.to_string()).unwrap_or_default();
        let mut cells = vec![run.title.clone(), test, run.tracker.to_string()];
        cells.extend(setup(&one.setup));
        cells.extend([one.metrics.frames, one.metrics.frames_with_target].map(|number| number.to_string()));
        cells.extend(column::ALL.iter().map(|column| number(column.of(&one.metrics))));
        cells.push(run.dropped.map(|dropped| dropped.to_string()).unwrap_or_default());
        cells.push(run.error.clone().unwrap_or_default());
        csv += &line(cells);
    }
    csv
}

/// Whether a text is what [`results`] once wrote.
pub fn is_results(text: &str) -> bool {
    text.starts_with(&RUN.join(","))
}

/// One line a tracker and condition, and the thesis' own means of the same tests.
pub fn by_condition(sections: &[Section]) -> String {
    let figures = column::OF_TESTS.iter().map(|column| column.key);
    let mut csv = line(["tracker", "condition", "runs"].into_iter().chain(SETUP).chain(figures));
    for section in sections {
        let printed = section.printed();
        for condition in conditions(section) {
            let ours = section.trackers().map(|tracker| {
                (tracker.to_string(), in_condition(section, tracker, condition).collect::<Vec<_>>())
            });
            let theirs = (PRINTED.to_owned(), printed_in(&printed, condition).collect());
            for (name, metrics) in ours.chain([theirs]) {
                let mut cells = vec![name, condition.name.to_owned(), metrics.len().to_string()];
                cells.extend(setup(&section.setup));
                cells.extend(means(&metrics));
                csv += &line(cells);
            }
        }
    }
    csv
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

fn setup(setup: &Setup) -> [String; 9] {
    let (video, command) = (setup.delays.video.as_millis(), setup.delays.command.as_millis());
    [
        setup.seed.to_string(),
        setup.codec.to_string(),
        setup.size.0.to_string(),
        setup.size.1.to_string(),
        setup.first_box.to_string(),
        video.to_string(),
        command.to_string(),
        setup.sweep.to_string(),
        setup.real_time.to_string(),
    ]
}

fn means(runs: &[&Metrics]) -> impl Iterator<Item = String> {
    column::OF_TESTS.iter().map(|column| number(column.mean(runs.iter().copied())))
}

fn number(value: Option<f64>) -> String {
    // Adding zero turns -0 into 0.
    value.map(|value| format!("{:.DECIMALS$}", value + 0.0)).unwrap_or_default()
}

fn line(cells: impl IntoIterator<Item = impl AsRef<str>>) -> String {
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
