// SPDX-License-Identifier: MPL-2.0

//! What came of the hard tests, in one table: counts over seeds, with intervals.

use std::{collections::BTreeMap, fmt::Write};

use crate::{
    metrics::Metrics,
    record::{FrameRecord, Run, Suite, TargetState, TrackerName},
};

/// The end of a run that says whether the person is still followed, in seconds.
const END_S: f64 = 1.0;
/// Who is held for so long, in seconds, instead of the person has been gone over to.
const GONE_OVER_S: f64 = 0.5;

/// Of a count, where the true share lies in 95 of 100 cases: E. B. Wilson, "Probable inference, the law of succession, and
/// statistical inference", JASA 22 (1927). `None` of nothing.
pub fn wilson(count: usize, of: usize) -> Option<(f64, f64)> {
    const Z: f64 = 1.96;
    if of == 0 {
        return None;
    }
    let (n, share) = (of as f64, count as f64 / of as f64);
    let middle = (share + Z * Z / (2.0 * n)) / (1.0 + Z * Z / n);
    let half = Z / (1.0 + Z * Z / n) * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
    Some(((middle - half).max(0.0), (middle + half).min(1.0)))
}

/// Whether the tracker is on the person in at least half of the pictures of the last second.
pub fn is_held(run: &Run) -> bool {
    let Some(end) = run.frames.last() else { return false };
    let last: Vec<_> = run.frames.iter().filter(|frame| frame.time_s > end.time_s - END_S).collect();
    2 * last.iter().filter(|frame| is_on_target(frame)).count() >= last.len()
}

fn is_tracking(frame: &FrameRecord) -> bool {
    frame.estimate.as_ref().is_some_and(|estimate| estimate.state == TargetState::Tracking)
}

fn is_on_target(frame: &FrameRecord) -> bool {
    is_tracking(frame) && frame.on_target().is_some_and(|coverage| coverage.hit)
}

/// Whether the tracker says for half a second on end that it tracks, and is on somebody else alone.
pub fn goes_over(run: &Run) -> bool {
    let needed = (GONE_OVER_S * run.frame_rate).ceil() as usize;
    let is_over = |frame: &FrameRecord| {
        is_tracking(frame) && !is_on_target(frame) && frame.coverage.iter().any(|coverage| coverage.hit)
    };
    let mut on_end = 0;
    run.frames.iter().any(|frame| {
        on_end = if is_over(frame) { on_end + 1 } else { 0 };
        on_end >= needed.max(1)
    })
}

/// How often the tracker began to follow something.
pub fn pursuits(run: &Run) -> usize {
    let id = |frame: &FrameRecord| frame.estimate.as_ref().filter(|_| is_tracking(frame)).map(|one| one.id);
    let mut before = None;
    let begun = run.frames.iter().filter(|frame| {
        let now = id(frame);
        let begins = now.is_some() && now != before;
        before = now.or(before);
        begins
    });
    begun.count()
}

/// By how many degrees the camera turned, pan and tilt together.
pub fn turned_deg(run: &Run) -> f64 {
    run.frames
        .windows(2)
        .map(|pair| (pair[1].pan_deg - pair[0].pan_deg).abs() + (pair[1].tilt_deg - pair[0].tilt_deg).abs())
        .sum()
}

/// The table of the hard tests among `runs`, a tracker after the other; nothing where there are none.
pub fn summary(runs: &[Run]) -> String {
    let mut text = String::new();
    let hard = || runs.iter().filter(|run| run.suite == Suite::Hard && run.error.is_none());
    for tracker in TrackerName::ALL.iter().filter(|name| hard().any(|run| run.tracker == **name)) {
        let of_tracker: Vec<_> = hard().filter(|run| run.tracker == *tracker).collect();
        // Writing to a string cannot fail.
        let _ = write!(text, "{}", table(*tracker, &of_tracker));
    }
    text
}

fn table(tracker: TrackerName, runs: &[&Run]) -> String {
    let mut tests: BTreeMap<usize, (&str, Vec<&Run>)> = BTreeMap::new();
    for run in runs {
        let known = tests.iter().find(|(_, (title, _))| *title == run.title).map(|(place, _)| *place);
        let place = known.unwrap_or(tests.len());
        tests.entry(place).or_insert((&run.title, Vec::new())).1.push(run);
    }
    let mut text = format!(
        "\n| {tracker}: hard test | held at the end | 95 % | went over | P | pursuits | turned |\n|---|---|---|---|---|---|---|\n"
    );
    for (title, runs) in tests.values() {
        let _ = writeln!(text, "| {title} | {} |", row(runs).join(" | "));
    }
    text
}

/// Everything said of one test; a dash where there is nothing to say.
fn row(runs: &[&Run]) -> [String; 6] {
    let dash = || "-".to_owned();
    let somebody: Vec<_> = runs.iter().filter(|run| run.frames.iter().any(|f| f.truth.is_some())).collect();
    if somebody.is_empty() {
        let (begun, turned) = (
            runs.iter().map(|run| pursuits(run)).sum::<usize>(),
            runs.iter().map(|run| turned_deg(run)).sum::<f64>(),
        );
        return [dash(), dash(), dash(), dash(), begun.to_string(), format!("{turned:.0}°")];
    }
    let count = |holds: fn(&Run) -> bool| somebody.iter().filter(|run| holds(run)).count();
    let held = count(is_held);
    let interval = wilson(held, somebody.len())
        .map_or_else(dash, |(low, high)| format!("{:.0} to {:.0} %", 100.0 * low, 100.0 * high));
    let others = somebody.iter().any(|run| run.frames.iter().any(|frame| !frame.others.is_empty()));
    let over = if others { format!("{}/{}", count(goes_over), somebody.len()) } else { dash() };
    let precision: Vec<f64> = somebody.iter().filter_map(|run| Metrics::of(run).precision).collect();
    let mean = crate::metrics::mean(&precision).map_or_else(dash, |mean| format!("{:.1} %", 100.0 * mean));
    [format!("{held}/{}", somebody.len()), interval, over, mean, dash(), dash()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        record::{Bounds, Coverage, Estimate, GroundTruth},
        report::made_up,
    };

    #[test]
    fn wilson_is_as_published() {
        // Of 10 of 10, and of 5 of 10.
        let (low, high) = wilson(10, 10).unwrap();
        assert!((low - 0.7225).abs() < 1e-3 && (high - 1.0).abs() < 1e-9, "{low} {high}");
        let (low, high) = wilson(5, 10).unwrap();
        assert!((low - 0.2366).abs() < 1e-3 && (high - 0.7634).abs() < 1e-3, "{low} {high}");
        assert_eq!(wilson(0, 0), None);
    }

    /// A run whose tracker is on these people (0 is nothing) picture by picture.
    fn run(on: &[u32]) -> Run {
        let like = made_up::frame((80, 60));
        let truth = |id| GroundTruth {
            id,
            bounds: Bounds { left: 10.0, top: 10.0, width: 10.0, height: 30.0 },
            centroid: (15.0, 25.0),
            visible: 1.0,
            unhidden: 1.0,
            in_view: 1.0,
            position_m: None,
            direction_deg: None,
        };
        let estimate = Estimate {
            state: TargetState::Tracking,
            centroid: (15.0, 25.0),
            bounds: truth(1).bounds,
            id: 7,
            features: 0,
        };
        let frames = on.iter().enumerate().map(|(number, on)| FrameRecord {
            time_s: number as f64 * 0.04,
            truth: Some(truth(1)),
            others: vec![truth(2)],
            estimate: (*on > 0).then(|| estimate.clone()),
            coverage: (*on > 0)
                .then_some(Coverage { id: *on, hit: true, covered: 1.0 })
                .into_iter()
                .collect(),
            pan_deg: number as f64,
            tilt_deg: 0.0,
            ..like.clone()
        });
        let run = made_up::run(frames.collect());
        Run { suite: Suite::Hard, title: "two".into(), frame_rate: 25.0, ..run }
    }

    #[test]
    fn going_over_and_holding_are_told_apart() {
        let kept = run(&[[1; 30], [1; 30]].concat());
        assert!(is_held(&kept) && !goes_over(&kept));
        let over = run(&[[1; 30], [2; 30]].concat());
        assert!(!is_held(&over) && goes_over(&over));
        let briefly = run(&[vec![1; 30], vec![2; 12], vec![1; 30]].concat());
        assert!(is_held(&briefly) && !goes_over(&briefly));
        let text = summary(&[kept, over]);
        assert!(text.contains("| two | 1/2 | 9 to 91 % | 1/2 |"), "{text}");
    }

    #[test]
    fn pursuits_and_turning_are_counted() {
        let twice = run(&[0, 1, 1, 0, 0, 2, 2, 0]);
        // The same number: it was never lost for the tracker.
        assert_eq!(pursuits(&twice), 1);
        assert_eq!(turned_deg(&twice), 7.0);
        assert_eq!(pursuits(&run(&[0, 0])), 0);
        let mut empty = twice;
        empty.frames.iter_mut().for_each(|frame| frame.truth = None);
        assert!(summary(&[empty]).contains("| two | - | - | - | - | 1 | 7° |"));
    }
}
