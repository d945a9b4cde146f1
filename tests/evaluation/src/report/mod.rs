// SPDX-License-Identifier: MPL-2.0

//! What runs are written down as: CSV for machines, Markdown and one page for people, plots and pictures.
//!
//! | file | what is in it |
//! |---|---|
//! | `results.csv` | one line a run |
//! | `frames/…/….csv` | one line a picture of a run |
//! | `losses.csv` | one line a loss, with its cause |
//! | `summary.md` | the worst conditions, trackers × figures, causes of losses: for a screen, and for the README |
//! | `tests.md` | every test of every tracker beside the thesis' figures |
//! | `plots/….png` | d_gc and d_gp over time |
//! | `index.html` | all of it in one file |
//!
//! The same runs give the same bytes, in whichever order they come.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use judged::{Judged, Section};
pub(crate) use judged::{place, slug};
use plot::Plot;
use table::Table;

use crate::record::{Run, TestId};

mod bootstrap;
mod column;
pub(crate) mod csv;
mod definitions;
mod judged;
mod page;
mod plot;
mod strip;
mod table;
mod tables;
mod thesis;

#[cfg(test)]
pub(crate) mod made_up;
#[cfg(test)]
mod tests;

/// By it a folder is known to hold a report.
const RESULTS: &str = "results.csv";

/// The tests of the thesis' figures 5.10 to 5.13, and the first with a full occlusion.
const SHOWN: [TestId; 5] = [TestId(1), TestId(7), TestId(13), TestId(19), TestId(37)];

/// What there is to say when all is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Report {
    /// Tables for a terminal, which are Markdown too.
    pub summary: String,
    /// What could not be done, and what to do about it.
    pub notes: Vec<String>,
}

/// Why nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The system does not let us.
    #[error("cannot write {}: {source}; is there room, and may you write there?", path.display())]
    Write {
        /// Where.
        path: PathBuf,
        /// What it says.
        source: io::Error,
    },
    /// They were made with different things.
    #[error(
        "{one} and {other} were run with another servo or laboratory and do not belong into one table; run them anew (--fresh)"
    )]
    Mixed {
        /// A run.
        one: String,
        /// Another one.
        other: String,
    },
}

/// Makes the folder `out` where it is missing, and tries to write into it: better now than after hours of work.
///
/// # Errors
/// Where nothing can be written there.
pub fn make_room(out: &Path) -> Result<(), ReportError> {
    let probe = out.join(format!(".probe-{}", std::process::id()));
    fs::create_dir_all(out)
        .and_then(|()| fs::write(&probe, ""))
        .and_then(|()| fs::remove_file(&probe))
        .map_err(|source| ReportError::Write { path: out.into(), source })
}

/// Writes everything about `runs` into the folder `out`, which is made where it is missing; `left_out` says which trackers
/// were not run and why. What an earlier report left there is gone.
///
/// # Errors
/// Where a file cannot be written, or runs are not comparable. A missing gnuplot is no error but a note.
pub fn write(runs: &[Run], left_out: &[String], out: &Path) -> Result<Report, ReportError> {
    comparable(runs)?;
    let judged = Judged::all(runs);
    let content = Content::of(&judged, left_out);
    clear(out)?;
    save(&out.join(RESULTS), csv::results(&judged))?;
    save(&out.join("losses.csv"), csv::losses(&judged))?;
    for one in &judged {
        save(&out.join(format!("frames/{}.csv", place(one.run))), csv::frames(&one.run.frames))?;
    }
    let plots = out.join("plots");
    fs::create_dir_all(&plots).map_err(|source| ReportError::Write { path: plots.clone(), source })?;
    let failures = content.failures().map(|(what, why)| format!("{what} failed: {why}"));
    let mut notes: Vec<_> = left_out.iter().cloned().chain(failures).collect();
    notes.extend(content.draw(&plots));
    let summary = content.summary();
    save(&out.join("summary.md"), with_notes(&summary, &notes))?;
    save(&out.join("tests.md"), content.test_by_test())?;
    save(&out.join("index.html"), page::html(&content, &plots))?;
    Ok(Report { summary, notes })
}

fn comparable(runs: &[Run]) -> Result<(), ReportError> {
    let name = |run: &Run| format!("{} on {}, seed {}", run.tracker, run.title, run.seed);
    let odd = runs.windows(2).find(|pair| !pair[0].provenance.is_comparable(&pair[1].provenance));
    odd.map_or(Ok(()), |pair| Err(ReportError::Mixed { one: name(&pair[0]), other: name(&pair[1]) }))
}

/// Removes the folders of an earlier report: nothing of it shall stand beside the new tables. Where there is none, folders of
/// these names are somebody else's.
fn clear(out: &Path) -> Result<(), ReportError> {
    if !fs::read_to_string(out.join(RESULTS)).is_ok_and(|text| csv::is_results(&text)) {
        return Ok(());
    }
    for path in ["frames", "plots"].map(|folder| out.join(folder)) {
        match fs::remove_dir_all(&path) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => {
                return Err(ReportError::Write { path, source });
            }
            _ => {}
        }
    }
    Ok(())
}

fn with_notes(summary: &str, notes: &[String]) -> String {
    let list: String = notes.iter().map(|note| format!("- {note}\n")).collect();
    if list.is_empty() { summary.into() } else { format!("{summary}\nNotes\n\n{list}") }
}

pub(crate) fn save(path: &Path, content: impl AsRef<[u8]>) -> Result<(), ReportError> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(path, content))
        .map_err(|source| ReportError::Write { path: path.into(), source })
}

/// What tables, plots and page are made from.
struct Content<'a> {
    /// Comparable runs.
    sections: Vec<Section<'a>>,
    /// Why trackers were not run.
    left_out: &'a [String],
}

impl<'a> Content<'a> {
    fn of(judged: &'a [Judged<'a>], left_out: &'a [String]) -> Self {
        Self { sections: Section::all(judged), left_out }
    }

    /// What is looked at closely: the thesis' figures, or else the first there is.
    fn shown(&self, section: &Section<'a>) -> Vec<&'a str> {
        let titles = section.titles();
        let chosen = titles.iter().filter(|(test, _)| test.is_none_or(|test| SHOWN.contains(&test)));
        let chosen: Vec<_> = chosen.map(|(_, title)| *title).collect();
        if chosen.is_empty() { titles.first().map(|(_, title)| *title).into_iter().collect() } else { chosen }
    }

    /// Draws all plots; says what went wrong, once.
    fn draw(&self, folder: &Path) -> Option<String> {
        let over_time = self.sections.iter().flat_map(|section| {
            self.shown(section).into_iter().map(|title| Plot::over_time(section, title)).collect::<Vec<_>>()
        });
        let failed: Vec<_> = over_time.filter_map(|plot| plot.draw(folder).err()).collect();
        failed.first().map(|error| format!("plots are missing ({} of them): {error}", failed.len()))
    }

    fn failures(&self) -> impl Iterator<Item = (String, &'a str)> {
        self.sections.iter().flat_map(|section| section.runs).filter_map(|one| {
            Some((format!("{}, {}", one.run.title, one.run.tracker), one.run.error.as_deref()?))
        })
    }

    /// What fits a screen.
    fn summary(&self) -> String {
        let of_section = |section: &Section| {
            let recordings = Some(tables::recordings(section)).filter(|table| !table.rows.is_empty());
            let overview = tables::overview(section);
            let causes = tables::causes(section);
            let tables = [Some(overview), Some(causes), recordings];
            let worst = tables::worst(section).map(|worst| worst + "\n").unwrap_or_default();
            worst + &joined(tables.into_iter().flatten())
        };
        let sections: Vec<_> = self.sections.iter().map(of_section).collect();
        let note = self.sections.iter().any(|section| !section.printed().is_empty());
        let note = if note { format!("\n{}\n", thesis::NOTE) } else { String::new() };
        sections.join("\n") + &note
    }

    fn test_by_test(&self) -> String {
        let tables = self.sections.iter().flat_map(|section| {
            section.trackers().map(|tracker| tables::per_test(section, tracker)).collect::<Vec<_>>()
        });
        joined(tables.filter(|table| !table.rows.is_empty()))
    }
}

fn joined(tables: impl Iterator<Item = Table>) -> String {
    tables.map(|table| table.markdown()).collect::<Vec<_>>().join("\n")
}
