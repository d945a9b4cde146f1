// SPDX-License-Identifier: MPL-2.0

//! A disk of its own, small, that can be full and can hang: an image that another process, `fuse2fs`, makes a file system of.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use crate::{PATIENCE, scratch, signal};

/// It is there until it is dropped.
pub struct Disk {
    server: Child,
    image: PathBuf,
    folder: PathBuf,
}

impl Disk {
    /// An empty one of so many mebibytes, named after a test. Needs Debian's `fuse2fs` and `e2fsprogs`.
    #[track_caller]
    pub fn new(test: &str, mebibytes: u64) -> Self {
        let (image, folder) = (scratch(&format!("{test}.ext2")), scratch(&format!("{test}-disk")));
        fs::create_dir_all(&folder).unwrap();
        fs::File::create(&image).unwrap().set_len(mebibytes << 20).unwrap();
        let made = Command::new("/sbin/mke2fs").args(["-q", "-t", "ext2", "-m", "0"]).arg(&image).status();
        assert!(made.is_ok_and(|made| made.success()), "e2fsprogs is needed: `make test` installs it");
        let device = |folder: &Path| folder.metadata().map(|found| found.dev()).ok();
        let below = device(&folder);
        let mut server = Command::new("fuse2fs")
            .arg("-f")
            .args([&image, &folder])
            .spawn()
            .expect("fuse2fs is needed: `make test` installs it");
        let begin = Instant::now();
        while device(&folder) == below {
            assert!(server.try_wait().unwrap().is_none(), "fuse2fs ended: is there a /dev/fuse to be used?");
            assert!(begin.elapsed() < PATIENCE, "it is not mounted");
            std::thread::sleep(Duration::from_millis(20));
        }
        Self { server, image, folder }
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Whoever asks for anything on it waits.
    pub fn hang(&self) {
        signal(self.server.id(), "STOP");
    }

    /// It goes on.
    pub fn go_on(&self) {
        signal(self.server.id(), "CONT");
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        self.go_on();
        // What is left of it is litter only.
        let _ = Command::new("umount").arg("--lazy").arg(&self.folder).status();
        let _ = self.server.kill();
        let _ = self.server.wait();
        let _ = fs::remove_file(&self.image);
        let _ = fs::remove_dir(&self.folder);
    }
}
