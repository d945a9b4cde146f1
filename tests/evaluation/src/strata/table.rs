// SPDX-License-Identifier: MPL-2.0

//! What came of the strata: a line a scene for machines, a line a stratum for people, the worst first.

use std::{fmt::Write, path::Path};

use super::{Endpoints, SceneId, Stratum};
use crate::{
    metrics::mean,
    open_loop::{Stage, generator, pointing_error},
    record::{Run, Suite, TrackerName},
    report::{self, ReportError, csv},
};

/// A line a scene, in the folder of a report.
pub const SCENES: &str = "scenes.csv";
/// The table, beside it.
const TABLE: &str = "strata.md";

/// What the columns of [`SCENES`] are called.
const COLUMNS: [&str; 19] = [
    "suite",
    "tracker",
    "stratum",
    "seed",
    "number",
    "replicate",
    "held",
    "distance",
    "changes",
    "pursuits",
    "losses",
    "elsewhere",
    "pictures",
    "seconds",
    "codec",
    "tracker_made_of",
    "servo",
    "generator",
    "error",
];

/// A run and which scene it is of.
pub struct SceneRun {
    /// Which scene.
    pub id: SceneId,
    /// Which recording of it, from 1.
    pub replicate: u32,
    /// What was replaced by the truth.
    pub replaced: Vec<Stage>,
    /// What came out.
    pub run: Run,
}

/// Writes lines and table into the folder `out`; gives the table.
///
/// # Errors
/// Where a file cannot be written.
pub fn write(runs: &[SceneRun], out: &Path) -> Result<String, ReportError> {
    let table = table(runs);
    report::save(&out.join(SCENES), lines(runs))?;
    report::save(&out.join(TABLE), &table)?;
    Ok(table)
}

fn lines(runs: &[SceneRun]) -> String {
    runs.iter().map(line).fold(heading(), |text, cells| text + &csv::line(cells))
}

/// The first line.
pub(crate) fn heading() -> String {
    csv::line(COLUMNS)
}

fn line(one: &SceneRun) -> Vec<String> {
    let SceneRun { id, replicate, run, .. } = one;
    let endpoints = Endpoints::of(run);
    let losses = crate::metrics::losses(&run.frames).len();
    vec![
        run.suite.to_string(),
        run.tracker.to_string(),
        id.stratum.to_string(),
        id.seed.to_string(),
        id.number.to_string(),
        replicate.to_string(),
        csv::number(endpoints.held),
        csv::number(endpoints.distance),
        endpoints.changes.map(|changes| changes.to_string()).unwrap_or_default(),
        endpoints.pursuits.to_string(),
        losses.to_string(),
        endpoints.elsewhere.map(|elsewhere| u8::from(elsewhere).to_string()).unwrap_or_default(),
        run.frames.len().to_string(),
        csv::number(Some(endpoints.seconds)),
        run.codec.to_string(),
        run.provenance.tracker.clone(),
        run.provenance.servo.clone(),
        generator(),
        run.error.clone().unwrap_or_default(),
    ]
}

fn table(runs: &[SceneRun]) -> String {
    let mut text = String::new();
    for suite in [Suite::OpenLoop, Suite::ClosedLoop] {
        for &tracker in TrackerName::ALL {
            let of: Vec<_> =
                runs.iter().filter(|one| one.run.suite == suite && one.run.tracker == tracker).collect();
            if !of.is_empty() {
                text += &table_of(suite, tracker, &of);
            }
        }
    }
    text
}

fn table_of(suite: Suite, tracker: TrackerName, runs: &[&SceneRun]) -> String {
    let mut text = format!(
        "\n{tracker}, {suite}\n\n| stratum | scenes | held % | {} | changes a minute | pursuits of nobody an hour | with a loss |\n|---|---:|---:|---:|---:|---:|---:|\n",
        if suite == Suite::OpenLoop { "off by" } else { "d_gc" }
    );
    let of =
        |stratum: Stratum| runs.iter().filter(|one| one.id.stratum == stratum).copied().collect::<Vec<_>>();
    let mut strata: Vec<_> = Stratum::ALL.iter().map(|stratum| (*stratum, of(*stratum))).collect();
    strata.retain(|(_, runs)| !runs.is_empty());
    strata.sort_by(|one, other| worth(&one.1).total_cmp(&worth(&other.1)));
    for (stratum, runs) in &strata {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| {stratum} | {} |", cells(runs).join(" | "));
    }
    let failed = runs.iter().filter_map(|one| Some((one.id, one.run.error.as_deref()?)));
    for (id, error) in failed {
        let _ = writeln!(text, "\n{id} failed: {error}");
    }
    let elsewhere: Vec<_> = runs.iter().filter_map(|one| Endpoints::of(&one.run).elsewhere).collect();
    if !elsewhere.is_empty() {
        let count = elsewhere.iter().filter(|elsewhere| **elsewhere).count();
        let _ = writeln!(
            text,
            "\nA region showed the person, whole in view, while the target was elsewhere for more than half a second: in {count} of {} scenes.",
            elsewhere.len()
        );
    }
    if let Some(error) =
        pointing_error(runs.iter().map(|one| &one.run)).filter(|_| suite == Suite::ClosedLoop)
    {
        let ((pan, tilt), (pan_s, tilt_s)) = (error.size_deg, error.memory_s);
        let _ = writeln!(
            text,
            "\nPointing error while the person is followed: pan {pan:.2}°, tilt {tilt:.2}°; memory {pan_s:.2} s, {tilt_s:.2} s."
        );
    }
    text
}

fn worth(runs: &[&SceneRun]) -> f64 {
    mean(&runs.iter().filter_map(|one| Endpoints::of(&one.run).held).collect::<Vec<_>>()).unwrap_or(f64::MAX)
}

/// Scenes, held, off by, changes a minute, pursuits an hour, scenes with a loss.
pub(super) fn cells(runs: &[&SceneRun]) -> [String; 6] {
    let endpoints: Vec<_> = runs.iter().map(|one| Endpoints::of(&one.run)).collect();
    let of =
        |value: fn(&Endpoints) -> Option<f64>| mean(&endpoints.iter().filter_map(value).collect::<Vec<_>>());
    let show = |value: Option<f64>, decimals: usize| {
        value.map_or("—".into(), |value| format!("{value:.decimals$}"))
    };
    let seconds: f64 = endpoints.iter().map(|one| one.seconds).sum();
    let changed: Vec<_> = endpoints.iter().filter_map(|one| Some((one.changes?, one.seconds))).collect();
    let (changes, changing_s) =
        changed.iter().fold((0, 0.0), |(sum, s), (changes, seconds)| (sum + changes, s + seconds));
    let pursuits: usize = endpoints.iter().map(|one| one.pursuits).sum();
    let somebody: Vec<_> =
        runs.iter().filter(|one| one.run.frames.iter().any(|f| f.truth.is_some())).collect();
    let lost = somebody.iter().filter(|one| !crate::metrics::losses(&one.run.frames).is_empty()).count();
    [
        runs.len().to_string(),
        show(of(|one| one.held.map(|held| 100.0 * held)), 1),
        show(of(|one| one.distance), 3),
        show((changing_s > 0.0).then(|| 60.0 * changes as f64 / changing_s), 2),
        show((seconds > 0.0).then(|| 3600.0 * pursuits as f64 / seconds), 0),
        if somebody.is_empty() { "—".into() } else { format!("{lost} of {}", somebody.len()) },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::made_up;

    fn scene(stratum: Stratum, frames: usize) -> SceneRun {
        let tracked = made_up::tracked((80, 60));
        let run = Run { suite: Suite::OpenLoop, ..made_up::run(vec![tracked; frames]) };
        SceneRun { id: SceneId { stratum, seed: 2, number: 3 }, replicate: 1, replaced: Vec::new(), run }
    }

    #[test]
    fn a_scene_has_a_line_and_the_worst_stratum_comes_first() {
        let mut bad = scene(Stratum::Hidden, 20);
        bad.run.frames.iter_mut().skip(10).for_each(|frame| frame.estimate = None);
        let runs = [scene(Stratum::Alone, 20), bad];
        let parsed = csv::parse(&lines(&runs));
        assert!(parsed.iter().all(|cells| cells.len() == COLUMNS.len()), "{parsed:?}");
        assert_eq!(parsed[2][..7], ["open-loop", "ptztrack", "hidden", "2", "3", "1", "0.500000"]);
        let text = table(&runs);
        let place = |name: &str| text.find(&format!("| {name} | 1 |")).unwrap();
        assert!(place("hidden") < place("alone"), "{text}");
        assert!(text.contains("| alone | 1 | 100.0 | 0.000 | — | 0 | 0 of 1 |"), "{text}");
    }
}
