// SPDX-License-Identifier: MPL-2.0

//! `evaluate`: runs tests and writes down what came out.

use std::{
    fmt,
    io::{self, Write},
    process::ExitCode,
};

use clap::Parser;
use evaluation::{cli::Args, gallery, report, store::Store, suite};

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
        tell(io::stdout(), format_args!("{}", report::compare::compare(before, after)?))?;
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
    let runs = evaluation::run_all(&experiments, args.jobs(), &store, io::stderr());
    let report = report::write(&runs, &left_out, &args.out)?;
    for note in &report.notes {
        tell(io::stderr(), format_args!("evaluate: {note}"))?;
    }
    let hard = suite::summary::summary(&runs);
    if !hard.is_empty() {
        std::fs::write(args.out.join("hard.md"), &hard)?;
        tell(io::stdout(), format_args!("{hard}"))?;
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
