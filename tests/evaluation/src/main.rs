//! `evaluate`: runs tests and writes down what came out.

use std::process::ExitCode;

use clap::Parser;
use evaluation::{cli::Args, gallery, report};

fn main() -> ExitCode {
    match evaluate(&Args::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("evaluate: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether every run came to its end.
fn evaluate(args: &Args) -> Result<bool, Box<dyn std::error::Error>> {
    evaluation::init()?;
    if let Some(like) = args.gallery() {
        let folder = args.out.join("gallery");
        println!("{} pictures in {}", gallery::write(&like, &folder)?, folder.display());
        return Ok(true);
    }
    let (trackers, left_out) = args.trackers();
    for reason in left_out {
        eprintln!("evaluate: {reason}");
    }
    std::fs::create_dir_all(&args.out)?;
    let runs = evaluation::run_all(&args.experiments(&trackers)?, args.jobs(), std::io::stderr());
    let report = report::write(&runs, &args.out)?;
    for note in &report.notes {
        eprintln!("evaluate: {note}");
    }
    println!("{}\nall of it: {}", report.summary, args.out.join("index.html").display());
    Ok(!runs.is_empty() && runs.iter().all(|run| run.error.is_none()))
}
