// SPDX-License-Identifier: MPL-2.0

//! What changed from one report to another, test by test, with the interval of the difference.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs, io,
    path::{Path, PathBuf},
};

use super::{
    RESULTS,
    bootstrap::{Interval, interval},
    column::{self, Column},
    csv,
    table::Table,
};
use crate::metrics::mean;

/// Why nothing can be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// There is no report, or none to read.
    #[error("cannot read {}: {source}; a report is a folder once given as --out", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// It is something else, or of an earlier version.
    #[error("{} has no column `{column}`: it is no report of this version", path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// What is missing.
        column: &'static str,
    },
    /// Figures of another laboratory are other figures.
    #[error("the laboratories differ (`{0}` and `{1}`): run both with the same")]
    Laboratory(String, String),
    /// They have no run in common.
    #[error("the reports have no run in common")]
    Nothing,
}

/// What is set against each other.
const COLUMNS: [Column; 7] = [
    column::P,
    column::DP,
    column::TF,
    column::SUCCESS,
    column::MEAN_DGC,
    column::DGC_CENTRED,
    column::LOSSES,
];

/// By what runs are found again: all that makes them comparable.
const KEY: [&str; 12] = [
    "tracker",
    "suite",
    "first_box",
    "codec",
    "width",
    "height",
    "video_delay_ms",
    "command_delay_ms",
    "sweep",
    "test",
    "title",
    "seed",
];

/// One run of a report: its cells by the names of their columns.
type Row = BTreeMap<String, String>;

/// Tables of what changed from the report in folder `a` to that in folder `b`, tracker after tracker. Tests in which nothing
/// changed have no line.
///
/// # Errors
/// Where a report cannot be read, or they are not comparable.
pub fn compare(a: &Path, b: &Path) -> Result<String, CompareError> {
    let (before, after) = (read(a)?, read(b)?);
    let pairs: Vec<_> = before.iter().filter_map(|(key, before)| Some((before, after.get(key)?))).collect();
    let (first, second) = pairs.first().ok_or(CompareError::Nothing)?;
    if let Some((one, other)) = pairs.iter().find(|(one, other)| one["laboratory"] != other["laboratory"]) {
        return Err(CompareError::Laboratory(one["laboratory"].clone(), other["laboratory"].clone()));
    }
    let servo = if first["servo"] == second["servo"] { "" } else { "\nThe servo differs too.\n" };
    let trackers: BTreeSet<_> = pairs.iter().map(|(one, _)| one["tracker"].as_str()).collect();
    let tables = trackers.into_iter().map(|tracker| {
        let of: Vec<_> = pairs.iter().filter(|(one, _)| one["tracker"] == tracker).copied().collect();
        table(tracker, &of).markdown()
    });
    Ok(tables.collect::<Vec<_>>().join("\n") + servo)
}

fn table(tracker: &str, pairs: &[(&Row, &Row)]) -> Table {
    let mut tests = BTreeMap::<(u32, &str), Vec<(&Row, &Row)>>::new();
    for pair in pairs {
        let number = pair.0["test"].parse().unwrap_or(u32::MAX);
        tests.entry((number, &pair.0["title"])).or_default().push(*pair);
    }
    let changed = tests.iter().filter(|(_, pairs)| {
        pairs.iter().any(|(a, b)| COLUMNS.iter().any(|column| a.get(column.key) != b.get(column.key)))
    });
    let mut rows: Vec<_> = changed.map(|((_, title), pairs)| line(title, pairs)).collect();
    rows.push(line("all", pairs));
    let headings = COLUMNS.iter().map(|column| column.heading.to_owned());
    Table {
        caption: format!(
            "{tracker}: difference of the second to the first, in brackets the 95 % interval, * where that excludes nothing \
             ({} of {} tests changed)",
            rows.len() - 1,
            tests.len()
        ),
        headings: ["test".to_owned(), "runs".to_owned()].into_iter().chain(headings).collect(),
        rows,
    }
}

fn line(title: &str, pairs: &[(&Row, &Row)]) -> Vec<String> {
    let cells = COLUMNS.iter().map(|column| cell(column, pairs));
    [title.to_owned(), pairs.len().to_string()].into_iter().chain(cells).collect()
}

fn cell(column: &Column, pairs: &[(&Row, &Row)]) -> String {
    let value = |row: &Row| row.get(column.key)?.parse::<f64>().ok();
    let differences: Vec<_> = pairs
        .iter()
        .filter_map(|(a, b)| {
            let group = (a["seed"].parse().unwrap_or(0), a["path"].as_str());
            Some((group, value(b)? - value(a)?))
        })
        .collect();
    let values: Vec<_> = differences.iter().map(|(_, difference)| *difference).collect();
    let Some(mean) = mean(&values) else { return column.show(None) };
    let show = |value: f64| format!("{:+.*}", column.decimals, value + 0.0);
    match interval(differences) {
        Some(sure @ Interval { low, high }) => {
            let star = if sure.excludes_zero() { "*" } else { "" };
            format!("{} ({} {}){star}", show(mean), show(low), show(high))
        }
        None => show(mean),
    }
}

/// The runs of a report that came to their end.
fn read(folder: &Path) -> Result<BTreeMap<Vec<String>, Row>, CompareError> {
    let path = folder.join(RESULTS);
    let text = fs::read_to_string(&path)
        .map_err(|source| CompareError::Unreadable { path: path.clone(), source })?;
    let mut lines = csv::parse(&text).into_iter();
    let names = lines.next().unwrap_or_default();
    let needed = KEY.into_iter().chain(["servo", "laboratory", "path", "error"]);
    if let Some(column) = needed.into_iter().find(|column| !names.iter().any(|name| name == column)) {
        return Err(CompareError::Column { path, column });
    }
    let rows = lines.filter(|cells| cells.len() == names.len());
    let rows = rows.map(|cells| names.iter().cloned().zip(cells).collect::<Row>());
    Ok(rows
        .filter(|row| row["error"].is_empty())
        .map(|row| (KEY.map(|name| row[name].clone()).to_vec(), row))
        .collect())
}
