// SPDX-License-Identifier: MPL-2.0

//! Two cameras in one room, of which nothing is known: one that does not turn, and one that does, followed with by the program. Somebody
//! walks about for a minute before both and leaves; then somebody else comes in, and only the fixed camera sees that.
//!
//! ```sh
//! cargo build --workspace --lib --bins
//! scripts/with-plugins debug target/debug/hand_over --runs 20    # leaves runs.csv, and what the program said, in target/handover
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod errors;
mod film;
mod pair;
mod run;

use std::fs;
use std::path::PathBuf;

use clap::Parser;
use run::Outcome;

/// What is played.
#[derive(Parser)]
pub struct Options {
    /// How many rooms.
    #[arg(long, default_value_t = 20)]
    runs: u64,
    /// The seed of the first.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// How many more people wander about all the time.
    #[arg(long, default_value_t = 0)]
    others: usize,
    /// Both cameras turn: one person walks about, then another one, too.
    #[arg(long)]
    both_turn: bool,
    /// Cameras that turn may follow the same person.
    #[arg(long, requires = "both_turn")]
    together: bool,
    /// Leave pictures of both cameras from when the second one comes in, in a folder for each run.
    #[arg(long)]
    film: bool,
    /// Where the runs go.
    #[arg(long, default_value = "target/handover")]
    out: PathBuf,
}

fn main() {
    let options = Options::parse();
    fs::create_dir_all(&options.out).unwrap();
    if options.both_turn {
        let outcomes = play(&options, pair::Outcome::HEAD, |seed| pair::run(seed, &options));
        let mean = |what: fn(&pair::Outcome) -> f64| {
            100.0 * outcomes.iter().map(what).sum::<f64>() / outcomes.len().max(1) as f64
        };
        println!("both follow one person for {:.1} % of the time", mean(|outcome| outcome.both));
        println!("each follows one of two for {:.1} % of the time", mean(|outcome| outcome.each));
        return;
    }
    let outcomes = play(&options, Outcome::HEAD, |seed| run::run(seed, &options));
    let of = |what: fn(&Outcome) -> bool| outcomes.iter().filter(|outcome| what(outcome)).count();
    let count = outcomes.len();
    println!("in the middle half within 3 s: {} of {count}", of(Outcome::is_soon));
    println!("the right person: {} of {count}", of(|outcome| outcome.right));
}

/// Plays the rooms one after the other; what became of them is told and kept as they end.
fn play<T: ToString>(options: &Options, head: &str, run: impl Fn(u64) -> T) -> Vec<T> {
    let mut lines = vec![head.to_owned()];
    println!("{head}");
    let play = |seed| {
        let outcome = run(seed);
        println!("{}", outcome.to_string());
        lines.push(outcome.to_string());
        fs::write(options.out.join("runs.csv"), lines.join("\n") + "\n").unwrap();
        outcome
    };
    (options.seed..options.seed + options.runs).map(play).collect()
}
