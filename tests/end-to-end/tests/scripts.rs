// SPDX-License-Identifier: MPL-2.0

//! What the Makefile calls, on systems that lack something: in a folder with nothing in PATH but what each needs.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use end_to_end::scratch;

/// A system with nothing but these programs.
struct System(PathBuf);

impl System {
    fn with(test: &str, programs: &[&str]) -> Self {
        let folder = scratch(&format!("scripts-{test}"));
        fs::create_dir_all(folder.join("bin")).unwrap();
        for program in programs {
            let found = ["/usr/bin", "/bin"].map(|folder| Path::new(folder).join(program));
            symlink(found.iter().find(|file| file.exists()).unwrap(), folder.join("bin").join(program))
                .unwrap();
        }
        Self(folder)
    }

    fn run(&self, script: &str, arguments: &[&str]) -> Output {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts").join(script);
        Command::new("/bin/bash")
            .arg(script)
            .args(arguments)
            .env("PATH", self.0.join("bin"))
            .env("HOME", &self.0)
            .env_remove("XDG_DATA_HOME")
            .output()
            .unwrap()
    }

    /// What was built, as far as it has a name.
    fn build(&self, files: &[&str]) -> String {
        let build = self.0.join("build");
        fs::create_dir_all(&build).unwrap();
        files.iter().for_each(|file| fs::write(build.join(file), "").unwrap());
        build.to_str().unwrap().to_owned()
    }
}

impl Drop for System {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn said(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text)).concat()
}

/// The plugins, and the watchdogs after them.
const BUILT: [&str; 5] =
    ["libgstptztrack.so", "libgstvapix.so", "libgstonvifptz.so", "vapix-watchdog", "onvif-watchdog"];

/// `pkg-config` that puts the plugins into the system's folder.
fn pkg_config(system: &System) {
    let file = system.0.join("bin/pkg-config");
    fs::write(&file, format!("#!/bin/bash\necho {}\n", system.0.join("plugins").display())).unwrap();
    fs::set_permissions(&file, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
}

#[test]
fn without_apt_it_is_said_what_is_needed() {
    let system = System::with("apt", &["id"]);
    let output = system.run("install-packages", &["gcc", "libopencv-video-dev"]);
    assert!(output.status.success() && said(&output).contains("gcc libopencv-video-dev"), "{output:?}");
}

#[test]
fn what_is_not_built_is_not_installed_and_named() {
    let system = System::with("built", &["id", "install"]);
    let build = system.build(&BUILT[..3]);
    let output = system.run("install-plugins", &[&build, system.0.join("usr").to_str().unwrap(), ""]);
    assert!(!output.status.success() && said(&output).contains("vapix-watchdog is not built"), "{output:?}");
    assert!(!system.0.join("usr").exists());
}

#[test]
fn without_gst_inspect_nobody_says_that_the_plugins_are_found() {
    let system = System::with("inspect", &["id", "install"]);
    pkg_config(&system);
    let output = system.run("install-plugins", &[&system.build(&BUILT), "", ""]);
    assert!(output.status.success() && said(&output).contains("gst-inspect-1.0 is missing"), "{output:?}");
    assert!(!said(&output).contains("GStreamer finds them"), "{output:?}");
}

#[test]
fn plugins_that_are_not_found_are_no_success() {
    let system = System::with("found", &["id", "install"]);
    pkg_config(&system);
    symlink("/bin/false", system.0.join("bin/gst-inspect-1.0")).unwrap();
    let output = system.run("install-plugins", &[&system.build(&BUILT), "", ""]);
    assert!(!output.status.success() && said(&output).contains("does not load bgavgdetect"), "{output:?}");
}

/// As root it would leave files in the build that its owner cannot write.
#[test]
fn installing_builds_nothing() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let output = Command::new("make").args(["--dry-run", "install"]).current_dir(root).output().unwrap();
    assert!(output.status.success() && said(&output).contains("scripts/install-plugins"), "{output:?}");
    assert!(
        !said(&output).contains("build --release") && !said(&output).contains("install-rust"),
        "{output:?}"
    );
}
