//! What is put beside what.

use super::{
    column::{self, Column},
    judged::{Judged, Section},
    table::Table,
    thesis::{CONDITIONS, Condition, Row},
};
use crate::{metrics::Metrics, record::TrackerName};

/// What the thesis' own figures are called beside those of its profile, rerun.
pub const PRINTED: &str = "thesis, as printed";

/// Trackers × figures, over all tests that came to their end.
pub fn overview(section: &Section) -> Table {
    let tests = section.printed().len();
    let dropped = section.setup.real_time.then_some(&column::DROPPED);
    let columns: Vec<_> = column::OF_TESTS.iter().chain(dropped).collect();
    let line = |name: String, runs: Vec<&Metrics>| {
        let number = runs.len().to_string();
        let figures = columns.iter().map(|column| column.show(column.mean(runs.iter().copied())));
        [name, number].into_iter().chain(figures).collect()
    };
    let mut rows: Vec<_> = section
        .trackers()
        .map(|name| line(name.to_string(), tests_of(section, name).map(|one| &one.metrics).collect()))
        .collect();
    rows.push(line(PRINTED.into(), section.printed().iter().map(|row| &row.metrics).collect()));
    Table {
        caption: format!("Means over {tests} tests ({})", section.setup),
        headings: headings(&["tracker", "tests"], columns.iter().map(|column| column.heading.into())),
        rows,
    }
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
        .map(|name| line(name.to_string(), &|condition| column.mean(in_condition(section, name, condition))))
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
        let alone = [column::ACQUIRE, column::IDENTITY, column::COMMANDS];
        let alone = alone.iter().map(|column| column.show(column.of(&one.metrics)));
        Some(std::iter::once(printed.test.to_string()).chain(what).chain(beside).chain(alone).collect())
    };
    let what = ["test", "lighting", "occlusion", "speed", "direction", "subject"];
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
    Table {
        caption: format!("Recordings ({})", section.setup),
        headings: headings(&["recording", "tracker"], column::ALL.iter().map(|column| column.heading.into())),
        rows: section.runs.iter().filter(|one| one.run.test.is_none()).map(line).collect(),
    }
}

/// One figure against the whole delay: a row for every point, a column for every tracker.
pub fn against_delay(sweep: &[Section], column: &Column) -> Table {
    let trackers = swept(sweep);
    let line = |section: &Section| {
        let delays = section.setup.delays;
        let mean = |name: &TrackerName| column.mean(section.whole(*name).map(|one| &one.metrics));
        let cells = trackers.iter().map(|name| column.show(mean(name)));
        std::iter::once(delays.total().as_millis().to_string()).chain(cells).collect()
    };
    Table {
        caption: format!("{} against the delay of video and command together", column.heading),
        headings: headings(&["delay, ms"], trackers.iter().map(ToString::to_string)),
        rows: sweep.iter().map(line).collect(),
    }
}

/// Who took part in a sweep.
pub fn swept(sweep: &[Section]) -> Vec<TrackerName> {
    let takes_part = |name: &TrackerName| sweep.iter().any(|section| section.of(*name).next().is_some());
    TrackerName::ALL.iter().copied().filter(takes_part).collect()
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
) -> impl Iterator<Item = &'a Metrics> {
    let included = |one: &&Judged| one.printed().is_some_and(|row| (condition.includes)(&row.conditions));
    section.whole(tracker).filter(included).map(|one| &one.metrics)
}

/// The thesis' figures in tests of a condition.
pub fn printed_in<'a>(rows: &'a [&Row], condition: &Condition) -> impl Iterator<Item = &'a Metrics> {
    rows.iter().filter(|row| (condition.includes)(&row.conditions)).map(|row| &row.metrics)
}

fn tests_of<'a>(section: &Section<'a>, tracker: TrackerName) -> impl Iterator<Item = &'a Judged<'a>> {
    section.whole(tracker).filter(|one| one.run.test.is_some())
}

fn headings(first: &[&str], rest: impl IntoIterator<Item = String>) -> Vec<String> {
    first.iter().map(|heading| (*heading).to_owned()).chain(rest).collect()
}
