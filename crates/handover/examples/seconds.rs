// SPDX-License-Identifier: MPL-2.0

//! How the map's error falls with the seconds learned, on made-up ground: `cargo run --release --package ptztrack-handover
//! --example seconds`.

#[path = "../tests/site/mod.rs"]
mod site;

use site::{PLANE, STEP, error_of, site};

fn main() {
    println!(
        "ground, wrong pairs, seconds: degrees in the median place, in the median and the worst of 20 runs"
    );
    for (name, ground) in [("plane", PLANE), ("step", STEP)] {
        for wrong in [0.0, 0.3] {
            for seconds in [10, 20, 30, 60, 120, 300] {
                let median = |seed| error_of(&site(ground), seconds, wrong, seed).0;
                let mut found: Vec<f64> = (0..20).map(median).collect();
                found.sort_by(f64::total_cmp);
                let (median, worst) = (found[found.len() / 2], found[found.len() - 1]);
                println!("{name}, {:.0} %, {seconds} s: {median:.1}, {worst:.1}", 100.0 * wrong);
            }
        }
    }
}
