// SPDX-License-Identifier: MPL-2.0

//! What is put beside what.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    column::{self, Column},
    judged::{Judged, Section},
    table::Table,
    thesis::{CONDITIONS, Condition, Row},
};
use crate::{
    metrics::{Cause, Metrics, mean},
    record::TrackerName,
};

/// What the thesis' own figures are called beside those of its profile, rerun.
pub const PRINTED: &str = "thesis, as printed";

/// Whom the figures of the others are set against.
const REFERENCE: TrackerName = TrackerName::Oracle;

/// Trackers × figures, over all that was shown to every one of them, with intervals.
pub fn overview(section: &Section) -> Table {
    let shared = section.shared();
    let among = |one: &&Judged| shared.contains(&one.shown());
    let mut rows: Vec<_> = section
        .trackers()
        .map(|name| {
            figures(section, name.to_string(), &section.whole(name).filter(among).collect::<Vec<_>>())
        })
        .collect();
    if !section.printed().is_empty() {
        rows.push(printed_line(section));
    }
    let seeds: BTreeSet<_> = shared.iter().map(|(_, seed)| *seed).collect();
    Table {
        caption: format!(
            "Means over {} runs of each tracker, in brackets 95 % intervals or the distance to the oracle's, seed {} ({})",
            shared.len(),
            seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(", "),
            section.setup
        ),
        headings: summary_headings(),
        rows,
    }
}

fn summary_headings() -> Vec<String> {
    headings(&["tracker", "runs"], column::OF_SUMMARY.iter().map(|column| column.heading.into()))
}

fn figures(section: &Section, name: String, runs: &[&Judged]) -> Vec<String> {
    let cell = |column: &Column| match column.key {
        key if column::WITH_INTERVAL.iter().any(|other| other.key == key) => column.show_with_interval(runs),
        key if [column::CENTRED, column::DGC_CENTRED].iter().any(|other| other.key == key) => {
            against_reference(section, column, runs)
        }
        _ => column.show(column.mean(runs.iter().map(|one| &one.metrics))),
    };
    [name, runs.len().to_string()].into_iter().chain(column::OF_SUMMARY.iter().map(cell)).collect()
}

fn printed_line(section: &Section) -> Vec<String> {
    let rows = section.printed();
    let cells = column::OF_SUMMARY.iter().map(|column| {
        let known = column::OF_THESIS.iter().any(|other| other.key == column.key);
        column.show(column.mean(rows.iter().map(|row| &row.metrics)).filter(|_| known))
    });
    [PRINTED.to_owned(), rows.len().to_string()].into_iter().chain(cells).collect()
}

/// The mean, and how much more that is than the oracle's mean over the same runs.
fn against_reference(section: &Section, column: &Column, runs: &[&Judged]) -> String {
    let reference: BTreeMap<_, _> =
        section.whole(REFERENCE).filter_map(|one| Some((one.shown(), column.of(&one.metrics)?))).collect();
    let differences: Vec<_> =
        runs.iter().filter_map(|one| Some(column.of(&one.metrics)? - reference.get(&one.shown())?)).collect();
    let all = column.show(column.mean(runs.iter().map(|one| &one.metrics)));
    match mean(&differences).filter(|_| runs.iter().any(|one| one.run.tracker != REFERENCE)) {
        Some(difference) => format!("{all} ({difference:+.*})", column.decimals),
        None => all,
    }
}

/// Causes of losses × trackers, in how many runs out of how many anything was lost.
pub fn causes(section: &Section) -> Table {
    let trackers: Vec<_> = section.trackers().collect();
    let losses = |name: TrackerName, cause: Cause| {
        section.whole(name).flat_map(|one| &one.losses).filter(|loss| loss.cause == cause).count()
    };
    let mut rows: Vec<Vec<String>> = Cause::ALL
        .iter()
        .map(|cause| {
            let counts = trackers.iter().map(|name| losses(*name, *cause).to_string());
            std::iter::once(cause.to_string()).chain(counts).collect()
        })
        .collect();
    let lossy = trackers.iter().map(|name| {
        let lost = section.whole(*name).filter(|one| !one.losses.is_empty()).count();
        format!("{lost} of {}", section.whole(*name).count())
    });
    rows.push(std::iter::once("runs with a loss".to_owned()).chain(lossy).collect());
    Table {
        caption: format!("Losses by cause ({})", section.setup),
        headings: headings(&["cause"], trackers.iter().map(ToString::to_string)),
        rows,
    }
}

/// The conditions in which ours does worst, the worst first: three values of the thesis' conditions.
pub fn worst(section: &Section) -> Option<String> {
    let dp = |condition: &Condition| {
        let runs: Vec<_> = in_condition(section, TrackerName::Ptztrack, condition).collect();
        let (mean, lost) = (column::DP.mean(runs.iter().map(|one| &one.metrics))?, runs.iter());
        let lost = lost.filter(|one| !one.losses.is_empty()).count();
        Some((
            mean,
            format!(
                "{} (DP {mean:.1} %, the person lost in {lost} of {} runs)",
                condition.heading,
                runs.len()
            ),
        ))
    };
    // A condition that every run has is no worse than the rest.
    let whole = section.whole(TrackerName::Ptztrack).count();
    let telling = |one: &&Condition| in_condition(section, TrackerName::Ptztrack, one).count() < whole;
    let mut all: Vec<_> = conditions(section).filter(telling).filter_map(dp).collect();
    all.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let worst: Vec<_> = all.into_iter().take(3).map(|(_, words)| words).collect();
    (!worst.is_empty()).then(|| format!("Ours is worst in: {}.\n", worst.join("; ")))
}

/// Trackers × conditions, one figure.
pub fn by_condition(section: &Section, column: &Column) -> Table {
    let conditions: Vec<_> = conditions(section).collect();
    let line = |name: String, mean: &dyn Fn(&Condition) -> Option<f64>| {
        let cells = conditions.iter().map(|condition| column.show(mean(condition)));
        std::iter::once(name).chain(cells).collect()
    };
    let mut rows: Vec<_> = section
        .trackers()
        .map(|name| {
            line(name.to_string(), &|condition| {
                column.mean(in_condition(section, name, condition).map(|one| &one.metrics))
            })
        })
        .collect();
    rows.push(line(PRINTED.into(), &|condition| column.mean(printed_in(&section.printed(), condition))));
    Table {
        caption: format!("{} by condition", column.heading),
        headings: headings(&["tracker"], conditions.iter().map(|condition| condition.heading.into())),
        rows,
    }
}

/// Every test of one tracker, the thesis' figures in brackets.
pub fn per_test(section: &Section, tracker: TrackerName) -> Table {
    let line = |one: &Judged| {
        let printed = one.printed()?;
        let c = &printed.conditions;
        let what = [c.lighting, c.occlusion, c.speed, c.direction, c.subject].map(String::from);
        let beside = column::OF_THESIS.iter().map(|column| {
            format!("{} ({})", column.show(column.of(&one.metrics)), column.show(column.of(&printed.metrics)))
        });
        let alone = column::OF_TESTS.iter().skip(column::OF_THESIS.len());
        let alone = alone.map(|column| column.show(column.of(&one.metrics)));
        let first = [printed.test.to_string(), one.run.seed.to_string()];
        Some(first.into_iter().chain(what).chain(beside).chain(alone).collect())
    };
    let what = ["test", "seed", "lighting", "occlusion", "speed", "direction", "subject"];
    Table {
        caption: format!("{tracker}, every test (in brackets: {PRINTED})"),
        headings: headings(&what, column::OF_TESTS.iter().map(|column| column.heading.into())),
        rows: section.of(tracker).filter_map(line).collect(),
    }
}

/// Recordings × trackers.
pub fn recordings(section: &Section) -> Table {
    let line = |one: &Judged| {
        let figures = column::ALL.iter().map(|column| column.show(column.of(&one.metrics)));
        let names = [one.run.title.clone(), one.run.tracker.to_string()];
        names.into_iter().chain(figures).collect()
    };
    let shown = section.runs.iter().filter(|one| one.run.test.is_none());
    let mut rows: Vec<_> = shown.clone().map(line).collect();
    if shown.map(Judged::shown).collect::<BTreeSet<_>>().len() > 1 {
        rows.extend(section.trackers().map(|name| {
            let runs: Vec<_> = section.whole(name).filter(|one| one.run.test.is_none()).collect();
            let means = column::ALL
                .iter()
                .map(|column| column.show(column.mean(runs.iter().map(|one| &one.metrics))));
            [format!("mean of {}", runs.len()), name.to_string()].into_iter().chain(means).collect()
        }));
    }
    Table {
        caption: format!("Recordings ({})", section.setup),
        headings: headings(&["recording", "tracker"], column::ALL.iter().map(|column| column.heading.into())),
        rows,
    }
}

/// Conditions of which a test was run.
pub fn conditions(section: &Section) -> impl Iterator<Item = &'static Condition> {
    let printed = section.printed();
    CONDITIONS.iter().filter(move |condition| printed.iter().any(|row| (condition.includes)(&row.conditions)))
}

/// The figures of one tracker in tests of a condition.
pub fn in_condition<'a>(
    section: &Section<'a>,
    tracker: TrackerName,
    condition: &Condition,
) -> impl Iterator<Item = &'a Judged<'a>> {
    let included = |one: &&Judged| one.printed().is_some_and(|row| (condition.includes)(&row.conditions));
    section.whole(tracker).filter(included)
}

/// The thesis' figures in tests of a condition.
pub fn printed_in<'a>(rows: &'a [&Row], condition: &Condition) -> impl Iterator<Item = &'a Metrics> {
    rows.iter().filter(|row| (condition.includes)(&row.conditions)).map(|row| &row.metrics)
}

fn headings(first: &[&str], rest: impl IntoIterator<Item = String>) -> Vec<String> {
    first.iter().map(|heading| (*heading).to_owned()).chain(rest).collect()
}
