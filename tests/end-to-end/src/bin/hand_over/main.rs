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
mod run;

use std::fs;
use std::path::PathBuf;

use clap::Parser;
use run::Outcome;

#[derive(Parser)]
struct Options {
    /// How many rooms.
    #[arg(long, default_value_t = 20)]
    runs: u64,
    /// The seed of the first.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// How many more people wander about all the time.
    #[arg(long, default_value_t = 0)]
    others: usize,
    /// Where the runs go.
    #[arg(long, default_value = "target/handover")]
    out: PathBuf,
}

fn main() {
    let options = Options::parse();
    fs::create_dir_all(&options.out).unwrap();
    let mut lines = vec![Outcome::HEAD.to_owned()];
    println!("{}", Outcome::HEAD);
    let outcomes: Vec<Outcome> = (options.seed..options.seed + options.runs)
        .map(|seed| {
            let outcome = run::run(seed, options.others, &options.out);
            println!("{outcome}");
            lines.push(outcome.to_string());
            fs::write(options.out.join("runs.csv"), lines.join("\n") + "\n").unwrap();
            outcome
        })
        .collect();
    let of = |what: fn(&Outcome) -> bool| outcomes.iter().filter(|outcome| what(outcome)).count();
    let count = outcomes.len();
    println!("in the middle half within 3 s: {} of {count}", of(Outcome::is_soon));
    println!("the right person: {} of {count}", of(|outcome| outcome.right));
}
