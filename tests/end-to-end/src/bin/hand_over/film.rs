// SPDX-License-Identifier: MPL-2.0

//! What the page shows of the cameras while somebody else comes in: to see by eye why somebody was not found.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use end_to_end::{Program, ask_page};
use virtual_camera::VirtualCamera;

/// Between two pictures.
const EVERY: Duration = Duration::from_millis(250);

/// Shoots while something is done: a picture of each camera, numbered by tenths of a second of the room's time.
pub fn shoot<T>(
    program: &Program,
    clock: &VirtualCamera,
    folder: Option<PathBuf>,
    what: impl FnOnce() -> T,
) -> T {
    let Some(folder) = folder else { return what() };
    fs::create_dir_all(&folder).unwrap();
    let over = AtomicBool::new(false);
    let url = program.url();
    let page = url.trim_start_matches("http://").trim_end_matches('/');
    thread::scope(|scope| {
        scope.spawn(|| {
            while !over.load(Ordering::Relaxed) {
                let time = clock.now().as_millis() / 100;
                for camera in ["yard", "door"] {
                    take(page, camera, &folder.join(format!("{time:05}-{camera}.jpg")));
                }
                thread::sleep(EVERY);
            }
        });
        let done = what();
        over.store(true, Ordering::Relaxed);
        done
    })
}

/// One that does not come is missing.
fn take(page: &str, camera: &str, file: &Path) {
    let (status, jpeg) = ask_page(page, page, "GET", &format!("/cameras/{camera}/picture"));
    if status == 200 {
        fs::write(file, jpeg).unwrap();
    }
}
