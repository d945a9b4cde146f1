// SPDX-License-Identifier: MPL-2.0

//! Names what is measured and what measures: a hash of the sources of the tracker, of the servo and of the laboratory, so
//! that a kept result is known by what it was made with.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// What only says which results are wanted, and shows them.
const NO_PART_OF_A_RUN: [&str; 13] = [
    "report",
    "main.rs",
    "cli.rs",
    "batch.rs",
    "store.rs",
    "provenance.rs",
    "gallery.rs",
    "endpoints.rs",
    "options.rs",
    "table.rs",
    "stages.rs",
    "motchallenge",
    "verdict",
];

fn main() -> io::Result<()> {
    let parts = [
        ("TRACKER_SOURCES", vec!["crates/contract/src", "gst-plugin-ptztrack/src"]),
        (
            "SERVO_SOURCES",
            vec![
                "crates/contract/src",
                "crates/servo/src",
                "crates/session/src",
                "crates/sink/src",
                "crates/vapix/src",
                "crates/onvif/src",
                "gst-plugin-vapix/src",
                "gst-plugin-onvif/src",
            ],
        ),
        (
            "GENERATOR_SOURCES",
            vec![
                "tests/virtual-camera/src/camera.rs",
                "tests/virtual-camera/src/geometry.rs",
                "tests/virtual-camera/src/imaging",
                "tests/virtual-camera/src/kinematics",
                "tests/virtual-camera/src/picture.rs",
                "tests/virtual-camera/src/seeded.rs",
                "tests/virtual-camera/src/settings.rs",
                "tests/virtual-camera/src/truth.rs",
                "tests/virtual-camera/src/vapix",
                "tests/virtual-camera/src/world",
                "tests/evaluation/src/open_loop/recorder.rs",
                "tests/evaluation/src/open_loop/recorded.rs",
                "tests/evaluation/src/open_loop/steering.rs",
                "tests/evaluation/src/codec.rs",
                "tests/evaluation/src/experiment.rs",
            ],
        ),
        ("LABORATORY_SOURCES", vec!["tests/virtual-camera/src", "tests/evaluation/src", "Cargo.lock"]),
    ];
    for (name, folders) in parts {
        let mut files = Vec::new();
        for folder in folders {
            let path = Path::new("../..").join(folder);
            println!("cargo:rerun-if-changed={}", path.display());
            collect(&path, &mut files)?;
        }
        files.sort();
        let mut hash = Fnv::default();
        for file in files {
            hash.add(file.as_os_str().as_encoded_bytes());
            hash.add(&fs::read(file)?);
        }
        println!("cargo:rustc-env={name}={:016x}", hash.0);
    }
    Ok(())
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    if path.is_dir() {
        for entry in fs::read_dir(path)? {
            let entry = entry?;
            if !NO_PART_OF_A_RUN.iter().any(|name| entry.file_name() == *name) {
                collect(&entry.path(), files)?;
            }
        }
    } else {
        files.push(path.into());
    }
    Ok(())
}

/// FNV-1a, which is the same everywhere and in every version.
struct Fnv(u64);

impl Default for Fnv {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv {
    fn add(&mut self, bytes: &[u8]) {
        let length = (bytes.len() as u64).to_le_bytes();
        for byte in length.iter().chain(bytes) {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}
