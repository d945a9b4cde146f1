// SPDX-License-Identifier: MPL-2.0

//! Where losses come from: stages replaced by the truth, each alone and all but each, as what one costs depends on the others.

use std::{fmt::Write, path::Path};

use super::{SceneRun, table};
use crate::{
    open_loop::Stage,
    report::{self, ReportError},
};

/// The table, in the folder of a report.
const TABLE: &str = "stages.md";

/// What is replaced, one after the other: nothing, each stage alone, all but each, all.
pub fn sets() -> Vec<Vec<Stage>> {
    let alone = Stage::ALL.iter().map(|stage| vec![*stage]);
    let others = Stage::ALL.iter().map(|stage| all_but(*stage));
    [Vec::new()].into_iter().chain(alone).chain(others).chain([Stage::ALL.to_vec()]).collect()
}

fn all_but(stage: Stage) -> Vec<Stage> {
    Stage::ALL.iter().copied().filter(|other| *other != stage).collect()
}

/// Writes the table of `runs` with all [`sets`] replaced into the folder `out`; gives it.
///
/// # Errors
/// Where it cannot be written.
pub fn write(runs: &[SceneRun], out: &Path) -> Result<String, ReportError> {
    let table = table(runs);
    report::save(&out.join(TABLE), &table)?;
    Ok(table)
}

fn table(runs: &[SceneRun]) -> String {
    let of = |set: &[Stage]| {
        let with: Vec<_> = runs.iter().filter(|one| one.replaced == set).collect();
        let [_, held, off, _, _, lost] = table::cells(&with);
        [held, off, lost].join(" | ")
    };
    let mut text = String::from(
        "\n| stage | its truth alone: held % | off by | with a loss | all but its truth: held % | off by | with a loss |\n|---|---:|---:|---:|---:|---:|---:|\n",
    );
    let mut row = |name: &str, alone: &[Stage], others: &[Stage]| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| {name} | {} | {} |", of(alone), of(others));
    };
    row("none, all", &[], Stage::ALL);
    Stage::ALL.iter().for_each(|stage| row(stage.name(), &[*stage], &all_but(*stage)));
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        record::{Run, Suite},
        report::made_up,
        strata::{SceneId, Stratum},
    };

    #[test]
    fn every_stage_has_a_row_with_both_orders() {
        let id = SceneId { stratum: Stratum::Alone, seed: 1, number: 1 };
        let runs = sets().into_iter().map(|replaced| {
            // Half of it is held unless the regions are true.
            let mut frames = vec![made_up::tracked((80, 60)); 20];
            if !replaced.contains(&Stage::Regions) {
                frames.iter_mut().skip(10).for_each(|frame| frame.estimate = None);
            }
            let run = Run { suite: Suite::OpenLoop, ..made_up::run(frames) };
            SceneRun { id, replicate: 1, replaced, run }
        });
        let text = table(&runs.collect::<Vec<_>>());
        assert_eq!(text.lines().filter(|line| line.starts_with("| ")).count(), 2 + Stage::ALL.len());
        assert!(text.contains("| none, all | 50.0 | 0.500 | 0 of 1 | 100.0 | 0.000 | 0 of 1 |"), "{text}");
        assert!(text.contains("| regions | 100.0 | 0.000 | 0 of 1 | 50.0 | 0.500 | 0 of 1 |"), "{text}");
        assert!(text.contains("| size | 50.0 | 0.500 | 0 of 1 | 100.0 | 0.000 | 0 of 1 |"), "{text}");
    }
}
