//! Many runs, some at once, in an order that does not depend on which is faster.

use std::{
    io::Write,
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
        let run = run(experiment);
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
        // A worker that panicked has told why; its runs are missing, and that shows.
        workers.into_iter().filter_map(|worker| worker.join().ok()).flatten().collect::<Vec<(usize, Run)>>()
    });
    runs.sort_by_key(|(number, _)| *number);
    runs.into_iter().map(|(_, run)| run).collect()
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

    #[test]
    fn runs_come_in_order_and_each_is_told_of() {
        let experiments: Vec<_> = TestId::all()
            .filter_map(|test| Some(Experiment::new(Scene::room(test, 1)?, TrackerName::Still, 1)))
            .collect();
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
