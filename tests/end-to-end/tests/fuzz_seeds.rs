// SPDX-License-Identifier: MPL-2.0

//! The fuzz targets are kept compiling, and read what others really say, also cut short and damaged; and what fuzzing found.
#![allow(missing_docs, dead_code, clippy::unwrap_used, clippy::expect_used)]

#[path = "../../fuzz/src/lib.rs"]
mod targets;

use std::fs;
use std::path::Path;
use std::process::Command;

use targets::TARGETS;

fn seeds(target: &str) -> Vec<(String, Vec<u8>)> {
    inputs("corpus", target)
}

/// By the files that they are in.
fn inputs(kind: &str, target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz").join(kind).join(target);
    let entries = fs::read_dir(&folder).unwrap().map(Result::unwrap);
    entries.map(|entry| (entry.path().display().to_string(), fs::read(entry.path()).unwrap())).collect()
}

#[test]
fn every_seed_is_understood() {
    for (name, target) in TARGETS {
        let seeds = seeds(name);
        assert!(!seeds.is_empty(), "{name}");
        for (path, seed) in seeds {
            assert!(target(&seed), "{path}");
        }
    }
}

#[test]
fn nothing_made_of_a_seed_breaks_a_parser() {
    for (name, target) in TARGETS {
        for (_, seed) in seeds(name) {
            for end in 0..seed.len() {
                target(&seed[..end]);
                target(&seed[end..]);
                for byte in [0, b'=', b'"', b'-', b'\n', 0xff] {
                    let mut damaged = seed.clone();
                    damaged[end] = byte;
                    target(&damaged);
                }
            }
        }
    }
}

#[test]
fn nothing_that_was_kept_of_fuzzing_breaks_a_parser() {
    for (name, target) in TARGETS {
        let kept = inputs("kept", name);
        assert!(!kept.is_empty(), "scripts/fuzz 100000 0 {name} finds some");
        for (_, input) in kept {
            target(&input);
        }
    }
}

/// Otherwise it would not be noticed that its parser changes.
#[test]
fn of_every_target_it_is_said_what_reads_its_inputs() {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/fuzz-sources");
    for (name, _) in TARGETS {
        let output = Command::new(&script).arg(name).output().unwrap();
        assert!(output.status.success(), "{name}: {output:?}");
    }
}

/// A target without its file would never be fuzzed, and a file without its target never be compiled here.
#[test]
fn every_target_has_its_program() {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz");
    let manifest = fs::read_to_string(fuzz.join("Cargo.toml")).unwrap();
    for (name, _) in TARGETS {
        let program = fs::read_to_string(fuzz.join(format!("fuzz_targets/{name}.rs"))).unwrap();
        assert!(program.contains(&format!("targets::{name}(")), "{name}");
        assert!(manifest.contains(&format!("fuzz_targets/{name}.rs")), "{name}");
    }
    assert_eq!(fs::read_dir(fuzz.join("fuzz_targets")).unwrap().count(), TARGETS.len());
}
