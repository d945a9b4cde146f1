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

use crate::{experiment::Experiment, metrics::Metrics, pipeline::lock, record::Run};

/// Runs all `experiments`, `jobs` at a time; the runs come in the order of the experiments. Writes a line for each to
/// `progress`.
pub fn run_all(experiments: &[Experiment], jobs: usize, progress: impl Write + Send) -> Vec<Run> {
    run_all_with(experiments, jobs, progress, crate::run)
}

fn run_all_with(
    experiments: &[Experiment],
    jobs: usize,
    progress: impl Write + Send,
    run: impl Fn(&Experiment) -> Run + Sync,
) -> Vec<Run> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let progress = Mutex::new(progress);
    let take = || {
        let number = next.fetch_add(1, Ordering::Relaxed);
        Some((number, experiments.get(number)?))
    };
    let perform = |(number, experiment): (usize, &Experiment)| {
        let begin = Instant::now();
        let run = caught(experiment, &run);
        let mut progress = lock(&progress);
        let count = done.fetch_add(1, Ordering::Relaxed) + 1;
        let (all, took_s) = (experiments.len(), begin.elapsed().as_secs_f64());
        // Nobody may be reading.
        let _ = writeln!(progress, "[{count}/{all}] {} ({took_s:.1} s)", summary(&run));
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
    let mut line = format!("{} {}", run.tracker, run.title);
    if run.sweep {
        line += &format!(" at {} ms", run.delays.total().as_millis());
    }
    if let Some(error) = &run.error {
        return line + ": " + error;
    }
    let metrics = Metrics::of(run);
    let percent = |share: Option<f64>| share.map_or("-".into(), |share| format!("{:.1} %", 100.0 * share));
    let number = |number: Option<f64>| number.map_or("-".into(), |number| format!("{number:.3}"));
    line + &format!(
        ": P {}, DP {}, TF {}, d_gc {}, d_gp {}",
        percent(metrics.precision),
        percent(metrics.detection_precision),
        percent(metrics.track_fragmentation),
        number(metrics.mean_dgc),
        number(metrics.mean_dgp)
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
            assert!(text.lines().last().unwrap().starts_with("[72/72] still test "), "{text}");
        }
    }
}
