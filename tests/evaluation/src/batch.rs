// SPDX-License-Identifier: MPL-2.0

//! Many runs, some at once, in an order that does not depend on which is faster.

use std::{
    any::Any,
    io::Write,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    time::Instant,
};

use crate::{
    experiment::Experiment,
    metrics::Metrics,
    pipeline::lock,
    record::{Run, TrackerName},
    store::Store,
};

/// Runs those of the `experiments` that `store` has no result of, `jobs` at a time, and keeps the results there; the runs
/// come in the order of the experiments. Writes a line for each to `progress`.
pub fn run_all(
    experiments: &[Experiment],
    jobs: usize,
    store: &Store,
    mut progress: impl Write + Send,
) -> Vec<Run> {
    let kept: Vec<_> = experiments.iter().map(|experiment| store.get(experiment)).collect();
    let missing: Vec<_> = experiments
        .iter()
        .zip(&kept)
        .filter(|(_, kept)| kept.is_none())
        .map(|(one, _)| one.clone())
        .collect();
    if missing.len() < experiments.len() {
        // Nobody may be reading.
        let _ = writeln!(progress, "{} of {} are kept", experiments.len() - missing.len(), experiments.len());
    }
    let fault = Mutex::new(None);
    let run = |experiment: &Experiment| {
        let run = crate::run(experiment);
        if let Err(error) = store.put(experiment, &run) {
            lock(&fault).get_or_insert(error);
        }
        run
    };
    let mut made = run_all_with(&missing, jobs, &mut progress, run).into_iter();
    if let Some(error) = lock(&fault).take() {
        let _ = writeln!(progress, "results cannot be kept: {error}");
    }
    kept.into_iter().filter_map(|kept| kept.or_else(|| made.next())).collect()
}

/// How long runs take, tracker by tracker.
struct Pace<'a> {
    experiments: &'a [Experiment],
    taken_s: Vec<(TrackerName, f64)>,
}

impl Pace<'_> {
    /// Minutes until all is done with so many jobs: a tracker that was not run yet takes as long as the others do.
    fn minutes_left(&self, done: usize, jobs: usize) -> f64 {
        let mean = |of: &dyn Fn(TrackerName) -> bool| {
            let taken: Vec<_> = self.taken_s.iter().filter(|(name, _)| of(*name)).map(|(_, s)| *s).collect();
            crate::metrics::mean(&taken)
        };
        let any = mean(&|_| true).unwrap_or(0.0);
        let left = self.experiments.iter().skip(done);
        let left_s: f64 = left.map(|one| mean(&|name| name == one.tracker).unwrap_or(any)).sum();
        // Adding zero turns -0, the sum of nothing, into 0.
        left_s / 60.0 / jobs as f64 + 0.0
    }
}

fn run_all_with(
    experiments: &[Experiment],
    jobs: usize,
    progress: impl Write + Send,
    run: impl Fn(&Experiment) -> Run + Sync,
) -> Vec<Run> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let progress = Mutex::new((progress, Pace { experiments, taken_s: Vec::new() }));
    let take = || {
        let number = next.fetch_add(1, Ordering::Relaxed);
        Some((number, experiments.get(number)?))
    };
    let perform = |(number, experiment): (usize, &Experiment)| {
        let begin = Instant::now();
        let run = caught(experiment, &run);
        let mut both = lock(&progress);
        let (progress, pace) = &mut *both;
        let count = done.fetch_add(1, Ordering::Relaxed) + 1;
        let (all, took_s) = (experiments.len(), begin.elapsed().as_secs_f64());
        // Nobody may be reading.
        pace.taken_s.push((run.tracker, took_s));
        let left_min = pace.minutes_left(count, jobs.max(1));
        let _ =
            writeln!(progress, "[{count}/{all}, {left_min:.0} min left] {} ({took_s:.1} s)", summary(&run));
        (number, run)
    };
    let work = || std::iter::from_fn(take).map(perform).collect::<Vec<_>>();
    let mut runs = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..jobs.max(1)).map(|_| scope.spawn(work)).collect();
        let told = workers.into_iter().filter_map(|worker| worker.join().ok());
        told.flatten().collect::<Vec<(usize, Run)>>()
    });
    runs.sort_by_key(|(number, _)| *number);
    runs.into_iter().map(|(_, run)| run).collect()
}

/// A run that panics is one that failed: it shall not take the others with it.
fn caught(experiment: &Experiment, run: impl Fn(&Experiment) -> Run) -> Run {
    // What the closure could leave half done is all its own.
    catch_unwind(AssertUnwindSafe(|| run(experiment))).unwrap_or_else(|panic| Run {
        error: Some(format!("panicked: {}", words(&*panic))),
        ..experiment.blank()
    })
}

fn words(panic: &(dyn Any + Send)) -> &str {
    let fixed = panic.downcast_ref::<&str>().copied();
    fixed.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("without a word")
}

/// One line on one run.
fn summary(run: &Run) -> String {
    let line = format!("{} {}", run.tracker, run.title);
    if let Some(error) = &run.error {
        return line + ": " + error;
    }
    let metrics = Metrics::of(run);
    let losses: Vec<_> = crate::metrics::losses(&run.frames)
        .iter()
        .map(|loss| format!("; {} at {:.1} s", loss.cause, loss.begin_s))
        .collect();
    let percent = |share: Option<f64>| share.map_or("-".into(), |share| format!("{:.1} %", 100.0 * share));
    let number = |number: Option<f64>| number.map_or("-".into(), |number| format!("{number:.3}"));
    line + &format!(
        ", seed {}: P {}, DP {}, TF {}, d_gc {}, d_gp {}{}",
        run.seed,
        percent(metrics.precision),
        percent(metrics.detection_precision),
        percent(metrics.track_fragmentation),
        number(metrics.mean_dgc),
        number(metrics.mean_dgp),
        losses.concat()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        experiment::Scene,
        record::{TestId, TrackerName},
    };

    fn experiments() -> Vec<Experiment> {
        let scenes = TestId::all().filter_map(|test| Scene::room(test, 1));
        scenes.map(|scene| Experiment::new(scene, TrackerName::Still, 1)).collect()
    }

    #[test]
    fn a_run_that_panics_is_told_of_and_takes_no_other_with_it() {
        let experiments = experiments();
        let fake = |experiment: &Experiment| match experiment.scene.test {
            Some(TestId(3)) => panic!("of its own"),
            Some(TestId(test)) if test > 70 => panic!("of number {test}"),
            _ => experiment.blank(),
        };
        for jobs in [1, 3] {
            let runs = run_all_with(&experiments, jobs, std::io::sink(), fake);
            assert_eq!(runs.len(), experiments.len());
            let failed = runs.iter().filter_map(|run| Some((run.test?.0, run.error.as_deref()?)));
            assert_eq!(
                failed.collect::<Vec<_>>(),
                [(3, "panicked: of its own"), (71, "panicked: of number 71"), (72, "panicked: of number 72")]
            );
        }
    }

    #[test]
    fn runs_come_in_order_and_each_is_told_of() {
        let experiments = experiments();
        let fake = |experiment: &Experiment| Run { error: Some("not run".into()), ..experiment.blank() };
        for jobs in [0, 1, 3] {
            let mut progress = Vec::new();
            let runs = run_all_with(&experiments, jobs, &mut progress, fake);
            let tests: Vec<_> = runs.iter().filter_map(|run| run.test).collect();
            assert_eq!(tests, TestId::all().collect::<Vec<_>>());
            let text = String::from_utf8(progress).unwrap();
            assert_eq!(text.lines().count(), 72);
            assert!(text.lines().last().unwrap().starts_with("[72/72, 0 min left] still test "), "{text}");
        }
    }
}
