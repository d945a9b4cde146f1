// SPDX-License-Identifier: MPL-2.0

//! The figures of the thesis, tables 5.2 and 5.3, to stand beside ours.

use std::sync::LazyLock;

use crate::{metrics::Metrics, record::TestId};

/// Table 5.3 with the conditions of table 5.2.
const TABLE: &str = include_str!("../../thesis.csv");

/// What is to be known of the printed figures.
pub const NOTE: &str = "The thesis' d_gc and d_gp are not measurements of their own: in 57 of its 72 rows the mean of d_gc \
                        is 0.8621 (1 - P) to 0.0002, and in 67 rows that of d_gp is 0.5887 times that of d_gc to 0.0001. \
                        What was measured there are P, DP and TF.";

/// One of the 72 tests.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Its number.
    pub test: TestId,
    /// What was varied.
    pub conditions: Conditions,
    /// What the thesis measured; the rest of the metrics it does not give.
    pub metrics: Metrics,
}

/// Table 5.2, in its own words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Conditions {
    /// `optimal` or `dim`.
    pub lighting: &'static str,
    /// `none`, `partial` or `full`.
    pub occlusion: &'static str,
    /// `fixed` or `variable`.
    pub speed: &'static str,
    /// `fixed` or `variable`.
    pub direction: &'static str,
    /// `a`, `b` or `c`.
    pub subject: &'static str,
}

/// A kind of test over which figures are averaged.
pub struct Condition {
    /// What it is called.
    pub heading: &'static str,
    /// Whether a test is one of them.
    pub includes: fn(&Conditions) -> bool,
}

/// The kinds of test that the tables have a column for.
pub const CONDITIONS: &[Condition] = &[
    Condition { heading: "all", includes: |_| true },
    Condition { heading: "optimal light", includes: |c| c.lighting == "optimal" },
    Condition { heading: "dim light", includes: |c| c.lighting == "dim" },
    Condition { heading: "no occlusion", includes: |c| c.occlusion == "none" },
    Condition { heading: "partial occlusion", includes: |c| c.occlusion == "partial" },
    Condition { heading: "full occlusion", includes: |c| c.occlusion == "full" },
    Condition { heading: "fixed speed", includes: |c| c.speed == "fixed" },
    Condition { heading: "variable speed", includes: |c| c.speed == "variable" },
    Condition { heading: "fixed direction", includes: |c| c.direction == "fixed" },
    Condition { heading: "variable direction", includes: |c| c.direction == "variable" },
    Condition { heading: "subject A", includes: |c| c.subject == "a" },
    Condition { heading: "subject B", includes: |c| c.subject == "b" },
    Condition { heading: "subject C", includes: |c| c.subject == "c" },
];

/// All rows, in order of their numbers.
pub fn rows() -> &'static [Row] {
    static ROWS: LazyLock<Vec<Row>> = LazyLock::new(|| TABLE.lines().skip(1).filter_map(row).collect());
    &ROWS
}

/// The row of a test.
pub fn row_of(test: TestId) -> Option<&'static Row> {
    rows().iter().find(|row| row.test == test)
}

fn row(line: &'static str) -> Option<Row> {
    let cells: Vec<&str> = line.split(',').collect();
    let [test, lighting, occlusion, speed, direction, subject, figures @ ..] = cells.as_slice() else {
        return None;
    };
    let figures: Vec<f64> = figures.iter().map(|cell| cell.parse().ok()).collect::<Option<_>>()?;
    let &[precision, detection_precision, fragmentation, mean_dgc, var_dgc, mean_dgp, var_dgp] =
        figures.as_slice()
    else {
        return None;
    };
    Some(Row {
        test: TestId(test.parse().ok()?),
        conditions: Conditions { lighting, occlusion, speed, direction, subject },
        metrics: Metrics {
            precision: Some(precision / 100.0),
            detection_precision: Some(detection_precision / 100.0),
            track_fragmentation: Some(fragmentation / 100.0),
            mean_dgc: Some(mean_dgc),
            var_dgc: Some(var_dgc),
            mean_dgp: Some(mean_dgp),
            var_dgp: Some(var_dgp),
            ..Metrics::default()
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_rows_are_read_in_order() {
        assert!(rows().iter().map(|row| row.test).eq(TestId::all()));
        let seven = row_of(TestId(7)).unwrap();
        assert_eq!((seven.conditions.occlusion, seven.conditions.subject), ("partial", "a"));
        assert_eq!(row_of(TestId(1)).unwrap().metrics.mean_dgp, Some(0.062754));
        assert_eq!(row_of(TestId(73)), None);
    }

    #[test]
    fn the_printed_distances_follow_from_the_printed_precision() {
        let count = |holds: &dyn Fn(f64, f64, f64) -> bool| {
            let figures = rows().iter().map(|row| &row.metrics);
            let of = |m: &Metrics| Some(holds(m.precision?, m.mean_dgc?, m.mean_dgp?));
            figures.filter(|metrics| of(metrics) == Some(true)).count()
        };
        assert_eq!(count(&|p, dgc, _| (dgc - 0.8621 * (1.0 - p)).abs() <= 0.0002), 57);
        assert_eq!(count(&|_, dgc, dgp| (dgp / dgc - 0.5887).abs() <= 0.0001), 67);
    }

    #[test]
    fn the_tests_are_a_full_factorial() {
        let sizes: Vec<_> = CONDITIONS
            .iter()
            .map(|condition| rows().iter().filter(|row| (condition.includes)(&row.conditions)).count())
            .collect();
        assert_eq!(sizes, [72, 36, 36, 24, 24, 24, 36, 36, 36, 36, 24, 24, 24]);
    }
}
