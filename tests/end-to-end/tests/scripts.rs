// SPDX-License-Identifier: MPL-2.0

//! What the Makefile calls, on systems that lack something: in a folder with nothing in PATH but what each needs.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::collections::BTreeSet;
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

    /// Has a program that does this.
    fn program(&self, name: &str, what: &str) {
        let file = self.0.join("bin").join(name);
        fs::write(&file, format!("#!/bin/bash\n{what}\n")).unwrap();
        fs::set_permissions(&file, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    }

    /// What systemd, which runs where this system has a folder of that name, is told by a maintainer script of the package.
    fn told_by(&self, script: &str, arguments: &[&str]) -> Vec<String> {
        let told = self.0.join("told");
        fs::write(&told, "").unwrap();
        self.program("systemctl", &format!("echo \"$*\" >>{}", told.display()));
        let of_system = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../deploy/debian").join(script);
        let text = fs::read_to_string(of_system).unwrap();
        assert!(text.contains(SYSTEMD_RUNS), "{text}");
        let here = self.0.join(script);
        fs::write(&here, text.replace(SYSTEMD_RUNS, self.0.join("systemd").to_str().unwrap())).unwrap();
        let mut command = Command::new("/bin/sh");
        let output = command.arg(here).args(arguments).env("PATH", self.0.join("bin")).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        fs::read_to_string(told).unwrap().lines().map(str::to_owned).collect()
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

/// There where systemd runs (sd_booted(3)).
const SYSTEMD_RUNS: &str = "/run/systemd/system";

fn said(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text)).concat()
}

/// The plugins, and the watchdogs after them.
const BUILT: [&str; 5] =
    ["libgstptztrack.so", "libgstvapix.so", "libgstonvifptz.so", "vapix-watchdog", "onvif-watchdog"];

/// `pkg-config` that puts the plugins into the system's folder.
fn pkg_config(system: &System) {
    system.program("pkg-config", &format!("echo {}", system.0.join("plugins").display()));
}

#[test]
fn without_apt_it_is_said_what_is_needed() {
    let system = System::with("apt", &["id"]);
    let output = system.run("install-packages", &["gcc", "libopencv-imgproc-dev"]);
    assert!(output.status.success() && said(&output).contains("gcc libopencv-imgproc-dev"), "{output:?}");
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

/// All services, those that run and no others: what is not started by hand waits for its file of cameras.
#[test]
fn an_upgrade_restarts_the_services_that_run_once_their_new_units_are_known() {
    let system = System::with("upgrade", &[]);
    let none: [&str; 0] = [];
    assert_eq!(system.told_by("postinst", &["configure", "1.0"]), none, "there is no systemd");
    fs::create_dir(system.0.join("systemd")).unwrap();
    assert_eq!(system.told_by("postinst", &["abort-upgrade", "1.0"]), none, "nothing is new");
    let told = system.told_by("postinst", &["configure", "1.0"]);
    let [reload, restart] = &told[..] else { panic!("{told:?}") };
    assert_eq!(reload, "daemon-reload");
    let (how, services) = restart.split_once(' ').unwrap();
    assert_eq!(how, "try-restart");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../deploy/systemd");
    let units = fs::read_dir(folder).unwrap().map(|unit| unit.unwrap().file_name().into_string().unwrap());
    let restarted: BTreeSet<_> = services.split(' ').map(str::to_owned).collect();
    assert_eq!(restarted, units.collect::<BTreeSet<_>>());
}
