//! `evaluate`: runs tests and writes down what came out.

use std::process::ExitCode;

use clap::Parser;
use evaluation::cli::Args;

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
    let (trackers, left_out) = args.trackers();
    for reason in left_out {
        eprintln!("evaluate: {reason}");
    }
    let runs = evaluation::run_all(&args.experiments(&trackers), args.jobs, std::io::stderr());
    println!("{}", args.out.display());
    Ok(!runs.is_empty() && runs.iter().all(|run| run.error.is_none()))
}
