// SPDX-License-Identifier: MPL-2.0

//! What `scripts/fuzz` counts and keeps, with a fuzzer that only says that it did.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use end_to_end::scratch;

/// Gives as many inputs as it is told to; of those that it merges, what is left is one, and one that is too large to be kept.
const CARGO: &str = r#"#!/bin/bash
case "$*" in
*" -set_cover_merge=1 "*)
    while [ "$1" != word ]; do shift; done
    ls "$2" >>merged
    echo found >"$2/0123456789abcdef0123456789abcdef01234567"
    head -c 20000 /dev/zero >"$2/76543210fedcba9876543210fedcba9876543210"
    ;;
*" -runs="*) sed 's/.* -runs=\([0-9]*\) .*/Done \1 runs in 0 second(s)/' <<<"$*" ;;
esac
"#;

/// A repository with one target, which one file reads.
struct Repository(PathBuf);

impl Repository {
    fn with_a_word(test: &str) -> Self {
        let this = Self(scratch(&format!("fuzzing-{test}")));
        for script in ["fuzz", "fuzz-sources", "with-plugins"] {
            let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts").join(script);
            fs::create_dir_all(this.0.join("scripts")).unwrap();
            fs::copy(from, this.0.join("scripts").join(script)).unwrap();
        }
        this.write("bin/cargo", CARGO);
        fs::set_permissions(this.0.join("bin/cargo"), fs::Permissions::from_mode(0o755)).unwrap();
        this.write("tests/fuzz/sources.txt", "word src\n");
        this.write("tests/fuzz/inputs.txt", "");
        this.write("tests/fuzz/corpus/word/seed", "seed");
        this.write("src/word.rs", "one");
        this
    }

    fn write(&self, file: &str, text: &str) {
        let path = self.0.join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    fn fuzz(&self, inputs: &str) -> Output {
        let path = format!("{}:{}", self.0.join("bin").display(), std::env::var("PATH").unwrap());
        let mut command = Command::new(self.0.join("scripts/fuzz"));
        command.args([inputs, "0", "word"]).env("PATH", path).env_remove("SANITIZER");
        command.output().unwrap()
    }

    /// What it says of the target.
    #[track_caller]
    fn fuzzed(&self, inputs: &str) -> String {
        let output = self.fuzz(inputs);
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    }
}

impl Drop for Repository {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn inputs_count_until_what_reads_them_changes() {
    let repository = Repository::with_a_word("count");
    assert!(repository.fuzzed("7").starts_with("word: 7 inputs, 7 of them now,"));
    assert!(repository.fuzzed("10").starts_with("word: 10 inputs, 3 of them now,"));
    assert!(repository.fuzzed("10").starts_with("word: 10 inputs, 0 of them now,"));
    repository.write("src/word.rs", "another");
    assert!(repository.fuzzed("0").ends_with(" given on no commit\n"));
    assert!(repository.fuzzed("10").starts_with("word: 10 inputs, 10 of them now,"));
    repository.write("src/word.rs", "one");
    assert!(repository.fuzzed("10").starts_with("word: 10 inputs, 0 of them now,"));
}

#[test]
fn a_target_whose_sources_are_not_known_is_not_fuzzed() {
    let repository = Repository::with_a_word("sources");
    for sources in ["other src\n", "word src gone\n"] {
        repository.write("tests/fuzz/sources.txt", sources);
        assert!(!repository.fuzz("10").status.success(), "{sources}");
    }
    assert_eq!(fs::read_to_string(repository.0.join("tests/fuzz/inputs.txt")).unwrap(), "");
}

#[test]
fn of_what_was_found_little_is_kept_beside_the_seeds() {
    let repository = Repository::with_a_word("kept");
    repository.write("tests/fuzz/kept/word/of-old", "old");
    assert!(repository.fuzzed("7").contains(", 1 kept;"));
    // Seeds are there before, so that what they reach is not kept twice.
    assert_eq!(fs::read_to_string(repository.0.join("merged")).unwrap(), "seed\n");
    let kept = fs::read_dir(repository.0.join("tests/fuzz/kept/word")).unwrap();
    let kept: Vec<_> = kept.map(|entry| fs::read_to_string(entry.unwrap().path()).unwrap()).collect();
    assert_eq!(kept, ["found\n"]);
    assert_eq!(fs::read_to_string(repository.0.join("tests/fuzz/corpus/word/seed")).unwrap(), "seed");
}
