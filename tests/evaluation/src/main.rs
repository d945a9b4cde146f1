// SPDX-License-Identifier: MPL-2.0

//! `evaluate`: runs tests and writes down what came out.

use std::{
    fmt,
    io::{self, Write},
    process::ExitCode,
};

use clap::Parser;
use evaluation::{
    Experiment,
    cli::Args,
    gallery, motchallenge,
    record::{Run, Suite},
    report,
    store::Store,
    strata::{self, SceneId, SceneRun},
    suite, verdict,
};

/// How many comparisons of a report with itself are made.
const CALIBRATIONS: usize = 200;

fn main() -> ExitCode {
    match evaluate(&Args::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            // Where not even that can be said, the exit code still tells.
            let _ = tell(io::stderr(), format_args!("evaluate: {error}"));
            ExitCode::FAILURE
        }
    }
}

/// Whether every run came to its end.
fn evaluate(args: &Args) -> Result<bool, Box<dyn std::error::Error>> {
    evaluation::init()?;
    if let [before, after] = args.compare.as_slice() {
        tell(io::stdout(), format_args!("{}", verdict::compare(before, after)?))?;
        return Ok(true);
    }
    if let Some(folder) = &args.calibrate {
        let told = verdict::calibrate(folder, CALIBRATIONS)?;
        tell(io::stdout(), format_args!("told apart from itself in {told} of {CALIBRATIONS} comparisons"))?;
        return Ok(true);
    }
    if let Some(suite) = args.strata.suite() {
        return strata(args, suite);
    }
    if let (Some(recording), Some(truth), Some(folder)) =
        (&args.still_recording, &args.truth, &args.strata.motchallenge)
    {
        motchallenge::write_recording(recording, truth, args.strata.elements.as_deref(), folder)?;
        return Ok(true);
    }
    let gallery = args.gallery()?;
    if !gallery.is_empty() {
        let folder = args.out.join("gallery");
        report::make_room(&folder)?;
        let written = gallery::write(&gallery, &folder)?;
        tell(io::stdout(), format_args!("{written} pictures in {}", folder.display()))?;
        return Ok(true);
    }
    let (trackers, left_out) = args.trackers();
    let experiments = args.experiments(&trackers)?;
    if experiments.is_empty() {
        return Err(format!("nothing to run: {}", left_out.join("; ")).into());
    }
    report::make_room(&args.out)?;
    let store = Store::new(&args.results, args.fresh);
    let runs = evaluation::run_all(&experiments, args.jobs, &store, io::stderr());
    let report = report::write(&runs, &left_out, &args.out)?;
    for note in &report.notes {
        tell(io::stderr(), format_args!("evaluate: {note}"))?;
    }
    let photos = suite::photo::summary(&runs);
    if !photos.is_empty() {
        std::fs::write(args.out.join("photos.md"), &photos)?;
        tell(io::stdout(), format_args!("{photos}"))?;
    }
    let page = args.out.join("index.html");
    tell(io::stdout(), format_args!("{}\nall of it: {}", report.summary, page.display()))?;
    Ok(runs.len() == experiments.len() && runs.iter().all(|run| run.error.is_none()))
}

/// The same for scenes of the strata.
fn strata(args: &Args, suite: Suite) -> Result<bool, Box<dyn std::error::Error>> {
    let seeds = args.seeds();
    if let Some(notice) = strata::options::notice(&seeds, args.record || args.strata.motchallenge.is_some())?
    {
        tell(io::stderr(), format_args!("evaluate: {notice}"))?;
    }
    report::make_room(&args.out)?;
    let (trackers, left_out) = args.trackers();
    for note in left_out {
        tell(io::stderr(), format_args!("evaluate: {note}"))?;
    }
    let films = args.record.then(|| args.out.join("films"));
    let asked = args.strata.experiments(suite, &seeds, &trackers);
    let experiments: Vec<_> = asked
        .iter()
        .map(|(_, one)| Experiment { films: films.clone(), servo: args.servo.clone(), ..one.clone() })
        .collect();
    let store = Store::new(&args.results, args.fresh);
    let runs = evaluation::run_all(&experiments, args.jobs, &store, io::stderr());
    let whole = runs.len() == experiments.len() && runs.iter().all(|run| run.error.is_none());
    let scene = |((id, experiment), run): ((SceneId, Experiment), Run)| SceneRun {
        id,
        replicate: experiment.replicate,
        replaced: experiment.replaced,
        run,
    };
    let scenes: Vec<_> = asked.into_iter().zip(runs).map(scene).collect();
    let table = match args.strata.by_stage {
        true => strata::stages::write(&scenes, &args.out)?,
        false => strata::table::write(&scenes, &args.out)?,
    };
    tell(io::stdout(), format_args!("{table}"))?;
    Ok(whole)
}

/// Writes a line. That nobody reads any more, as behind `| head`, is no fault.
fn tell(mut out: impl Write, line: fmt::Arguments) -> io::Result<()> {
    match writeln!(out, "{line}").and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        told => told,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_closed_pipe_is_no_fault() {
        let (reader, writer) = io::pipe().unwrap();
        drop(reader);
        assert!(tell(writer, format_args!("unheard")).is_ok());
        let full: &mut [u8] = &mut [0; 3];
        assert!(tell(full, format_args!("more than that")).is_err());
    }
}
