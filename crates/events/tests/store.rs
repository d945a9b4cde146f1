// SPDX-License-Identifier: MPL-2.0

//! What is kept, for how long, and what becomes of it when the process dies or the file is not what it should be.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, SystemTime};

use events::{Area, Error, FILE, Filter, Looks, Picture, Pointer, Reader, Retention, Sighting, Step, Store};

/// A folder that is gone with the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn store(&self) -> Store {
        let (store, aside) = Store::open(&self.0).unwrap();
        assert_eq!(aside, None);
        store
    }

    fn all(&self) -> Vec<i64> {
        self.ids(&Filter::default())
    }

    fn ids(&self, filter: &Filter) -> Vec<i64> {
        let entries = Reader::open(&self.0).unwrap().sightings(filter).unwrap();
        entries.iter().map(|entry| entry.id).collect()
    }

    fn aside(&self) -> Vec<PathBuf> {
        let files = fs::read_dir(&self.0).unwrap().map(|entry| entry.unwrap().path());
        let is_aside = |file: &PathBuf| {
            let name = file.file_name().unwrap().to_str().unwrap();
            name.starts_with("events-") && name.ends_with(".db")
        };
        files.filter(is_aside).collect()
    }

    /// Its beginning stays whole, so that only who writes notices; what it is then.
    fn break_file(&self) -> Vec<u8> {
        let mut bytes = fs::read(self.0.join(FILE)).unwrap();
        bytes[4096..].fill(0xa5);
        fs::write(self.0.join(FILE), &bytes).unwrap();
        bytes
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The nth, of ten seconds, a minute after the one before.
fn sighting(n: i64) -> Sighting {
    let from_ms = 1_700_000_000_000 + 60_000 * n;
    let step = |second: i64| Step {
        at_ms: from_ms + 1000 * second,
        pan_deg: n as f64 + second as f64,
        tilt_deg: -5.0,
    };
    Sighting {
        camera: if n % 2 == 0 { "door" } else { "yard" }.to_owned(),
        run_ms: 7,
        track: n.unsigned_abs(),
        from_ms,
        to_ms: from_ms + 10_000,
        path: (0..10).map(step).collect(),
        picture: Some(Picture { jpeg: vec![n as u8; 8000], quality: 1.0, looks: Looks::from(vec![1; 192]) }),
        recording: Some(Pointer { file: "/r/door-20260101T000000000.mkv".into(), offset_ms: 500 }),
    }
}

#[test]
fn what_is_kept_is_read_back() {
    let folder = Folder::new("read-back");
    let id = folder.store().keep(&sighting(4)).unwrap();
    let reader = Reader::open(&folder.0).unwrap();
    let entry = reader.sighting(id).unwrap().unwrap();
    assert_eq!(entry.sighting, Sighting { picture: None, ..sighting(4) });
    assert!((entry.way_deg - 9.0).abs() < 0.1 && entry.has_picture, "{entry:?}");
    assert_eq!(entry.looks, Some(Looks::from(vec![1; 192])));
    assert_eq!(reader.picture(id).unwrap(), Some(vec![4; 8000]));
    assert_eq!((reader.picture(99).unwrap(), reader.sighting(99).unwrap()), (None, None));
    assert_eq!(reader.cameras().unwrap(), ["door"]);
}

#[test]
fn those_are_found_that_are_asked_for_the_latest_first() {
    let folder = Folder::new("asked-for");
    let mut store = folder.store();
    let ids: Vec<i64> = (0..6).map(|n| store.keep(&sighting(n)).unwrap()).collect();
    let from_ms = |n: i64| sighting(n).from_ms;
    let filter = Filter::default();
    assert_eq!(folder.all(), ids.iter().rev().copied().collect::<Vec<_>>());
    // Who was there already, or still.
    assert_eq!(folder.ids(&Filter { since_ms: Some(from_ms(4) + 9000), ..filter.clone() }), [ids[5], ids[4]]);
    assert_eq!(folder.ids(&Filter { until_ms: Some(from_ms(1)), ..filter.clone() }), [ids[1], ids[0]]);
    assert_eq!(
        folder.ids(&Filter { camera: Some("yard".into()), ..filter.clone() }),
        [ids[5], ids[3], ids[1]]
    );
    assert_eq!(folder.ids(&Filter { camera: Some("' OR 1=1 --".into()), ..filter.clone() }), [0; 0]);
    assert_eq!(folder.ids(&Filter { most: Some(2), ..filter.clone() }), [ids[5], ids[4]]);
    let area = Some(Area { pan_deg: (13.5, 20.0), tilt_deg: (-6.0, -4.0) });
    assert_eq!(folder.ids(&Filter { area, ..filter.clone() }), [ids[5]]);
    let above = Some(Area { pan_deg: (-180.0, 179.0), tilt_deg: (0.0, 90.0) });
    assert_eq!(folder.ids(&Filter { area: above, ..filter }), [0; 0]);
}

#[test]
fn a_track_that_is_taken_up_again_is_one_sighting() {
    let folder = Folder::new("again");
    let mut store = folder.store();
    let id = store.keep(&sighting(1)).unwrap();
    let later =
        Sighting { from_ms: sighting(1).from_ms + 20_000, to_ms: sighting(1).to_ms + 20_000, ..sighting(1) };
    let better = Picture { jpeg: vec![9; 10], quality: 2.0, looks: Looks::default() };
    assert_eq!(store.keep(&Sighting { picture: Some(better), ..later }).unwrap(), id);
    let reader = Reader::open(&folder.0).unwrap();
    let entry = reader.sighting(id).unwrap().unwrap();
    assert_eq!(entry.sighting.to_ms - entry.sighting.from_ms, 30_000);
    assert_eq!((entry.sighting.path.len(), reader.picture(id).unwrap()), (20, Some(vec![9; 10])));
    // Another run of the tracker counts anew.
    let other = store.keep(&Sighting { run_ms: 8, ..sighting(1) }).unwrap();
    assert_eq!(folder.all().len(), 2);
    assert_ne!(other, id);
}

#[test]
fn what_is_too_old_or_too_much_goes_the_oldest_first() {
    let folder = Folder::new("retention");
    let mut store = folder.store();
    let ids: Vec<i64> = (0..100).map(|n| store.keep(&sighting(n)).unwrap()).collect();
    let now = SystemTime::UNIX_EPOCH + Duration::from_millis(sighting(100).from_ms.unsigned_abs());
    let retention = Retention { age: Duration::from_secs(50 * 60), bytes: u64::MAX };
    store.retain(&retention, now).unwrap();
    assert_eq!(folder.all(), ids[50..].iter().rev().copied().collect::<Vec<_>>());
    let file = || fs::metadata(folder.0.join(FILE)).unwrap().len();
    store.retain(&Retention { bytes: 250_000, ..retention }, now).unwrap();
    let left = folder.all();
    assert!((10..30).contains(&left.len()) && left[0] == ids[99], "{left:?}");
    // Once what was deleted is in the file, too, the file is as small as that.
    store.delete(left[0]).unwrap();
    assert!(file() <= 250_000, "{}", file());
    store.retain(&Retention { bytes: 0, ..retention }, now).unwrap();
    assert_eq!(folder.all(), [0; 0]);
}

#[test]
fn a_moment_of_a_clock_that_is_ahead_deletes_nothing() {
    let folder = Folder::new("clock-ahead");
    let mut store = folder.store();
    let ids: Vec<i64> = (0..10).rev().map(|n| store.keep(&sighting(n)).unwrap()).collect();
    let minutes = |minutes: u64| Retention { age: Duration::from_secs(60 * minutes), bytes: u64::MAX };
    let year = Duration::from_secs(365 * 24 * 3600);
    let now = SystemTime::UNIX_EPOCH + Duration::from_millis(sighting(9).to_ms.unsigned_abs());
    store.retain(&minutes(60), now).unwrap();
    store.retain(&minutes(60), now + year).unwrap();
    // As where the program is started anew meanwhile, and then keeps somebody as of that year.
    let mut store = folder.store();
    store.retain(&minutes(60), now + year).unwrap();
    let ahead_ms = sighting(9).to_ms + 1000 * 365 * 24 * 3600;
    let ahead = Sighting { run_ms: 8, from_ms: ahead_ms, to_ms: ahead_ms, ..sighting(9) };
    let ahead = store.keep(&ahead).unwrap();
    store.retain(&minutes(60), now + year).unwrap();
    assert_eq!(folder.all(), [&[ahead], &ids[..]].concat());
    // Nor does who was kept then make it believed, where it is started anew once more.
    folder.store().retain(&minutes(60), now + year).unwrap();
    assert_eq!(folder.all(), [&[ahead], &ids[..]].concat());
    // Whoever is in the future keeps the others no longer.
    folder.store().retain(&minutes(5), now).unwrap();
    assert_eq!(folder.all(), [&[ahead], &ids[..6]].concat());
}

#[test]
fn of_whom_was_deleted_nothing_is_left_in_the_files() {
    let folder = Folder::new("deleted");
    let mut store = folder.store();
    let word = b"the picture of somebody who objects";
    let with = |n, jpeg: &[u8]| Sighting {
        picture: Some(Picture { jpeg: jpeg.to_vec(), quality: 1.0, looks: Looks::default() }),
        ..sighting(n)
    };
    let (stays, goes) = (store.keep(&with(1, b"other")).unwrap(), store.keep(&with(2, word)).unwrap());
    let is_there = || {
        let files = fs::read_dir(&folder.0).unwrap().map(|file| fs::read(file.unwrap().path()).unwrap());
        files.into_iter().any(|bytes| bytes.windows(word.len()).any(|window| window == word))
    };
    assert!(is_there());
    assert!(store.delete(goes).unwrap() && !store.delete(goes).unwrap());
    assert!(!is_there());
    assert_eq!(folder.all(), [stays]);
    // Its number is nobody else's.
    drop(store);
    assert!(folder.store().keep(&sighting(3)).unwrap() > goes);
}

/// Waits for as long as whoever reads is given.
#[test]
fn what_somebody_reads_is_not_said_to_be_deleted_as_long_as_it_is_in_a_file() {
    let folder = Folder::new("read-meanwhile");
    let mut store = folder.store();
    let id = store.keep(&sighting(1)).unwrap();
    let reader = rusqlite::Connection::open(folder.0.join(FILE)).unwrap();
    reader.execute_batch("BEGIN").unwrap();
    let count = || reader.query_row("SELECT count(*) FROM sighting", [], |row| row.get::<_, i64>(0));
    assert_eq!(count(), Ok(1));
    assert!(matches!(store.delete(id), Err(Error::Read { .. })));
    reader.execute_batch("COMMIT").unwrap();
    assert_eq!(count(), Ok(0));
    assert!(!store.delete(id).unwrap(), "it is gone already");
}

#[test]
fn a_file_of_another_version_is_moved_aside_and_not_changed() {
    let folder = Folder::new("version");
    folder.store().keep(&sighting(1)).unwrap();
    let file = folder.0.join(FILE);
    // Where SQLite's file format has the version of its user.
    let mut bytes = fs::read(&file).unwrap();
    bytes[60..64].copy_from_slice(&99_u32.to_be_bytes());
    fs::write(&file, &bytes).unwrap();
    assert!(Reader::open(&folder.0).unwrap_err().to_string().contains("another version"));
    let (mut store, aside) = Store::open(&folder.0).unwrap();
    assert_eq!(fs::read(aside.unwrap()).unwrap(), bytes);
    store.keep(&sighting(2)).unwrap();
    assert_eq!((folder.all().len(), folder.aside().len()), (1, 1));
}

#[test]
fn a_file_that_is_no_database_is_moved_aside() {
    let folder = Folder::new("no-database");
    let nonsense = "no database at all, and longer than a header of one would be, so that it is none";
    fs::write(folder.0.join(FILE), nonsense).unwrap();
    let (mut store, aside) = Store::open(&folder.0).unwrap();
    assert_eq!(fs::read_to_string(aside.unwrap()).unwrap(), nonsense);
    store.keep(&sighting(1)).unwrap();
    assert_eq!(folder.all().len(), 1);
}

#[test]
fn a_file_that_turns_out_to_be_broken_is_put_aside_and_another_one_made() {
    let folder = Folder::new("broken");
    let mut store = folder.store();
    for n in 0..50 {
        store.keep(&sighting(n)).unwrap();
    }
    drop(store);
    let bytes = folder.break_file();
    let mut store = folder.store();
    let err = store.keep(&sighting(99)).unwrap_err();
    assert!(err.is_corrupt(), "{err}");
    let aside = store.put_aside().unwrap().unwrap();
    assert_eq!(fs::read(aside).unwrap(), bytes);
    folder.store().keep(&sighting(99)).unwrap();
    assert_eq!((folder.all().len(), folder.aside().len()), (1, 1));
}

#[test]
fn of_two_that_have_a_broken_file_one_puts_it_aside_and_none_the_one_made_after_it() {
    let folder = Folder::new("broken-for-two");
    folder.store().keep(&sighting(1)).unwrap();
    folder.break_file();
    let [mut first, mut second] = [folder.store(), folder.store()];
    assert!(first.keep(&sighting(2)).unwrap_err().is_corrupt());
    assert!(second.keep(&sighting(3)).unwrap_err().is_corrupt());
    assert!(first.put_aside().unwrap().is_some());
    let mut next = folder.store();
    next.keep(&sighting(2)).unwrap();
    assert!(next.is_in_place() && !second.is_in_place());
    assert_eq!(second.put_aside().unwrap(), None);
    assert!(next.is_in_place());
    next.keep(&sighting(3)).unwrap();
    assert_eq!((folder.all().len(), folder.aside().len()), (2, 1));
}

#[test]
fn a_folder_that_cannot_be_written_is_said() {
    let folder = Folder::new("unwritable");
    fs::write(folder.0.join("file"), "").unwrap();
    let err = Store::open(&folder.0.join("file")).unwrap_err();
    assert!(err.to_string().contains("file: "), "{err}");
    assert!(!err.is_corrupt());
    assert!(Reader::open(&folder.0).is_err());
}

/// In the folder that the environment names, until it is killed; each that is kept is said.
#[test]
#[ignore = "is the process that is killed"]
fn keeps_until_it_is_killed() {
    let folder = std::env::var_os("EVENTS_FOLDER").expect("started by the test below");
    let (mut store, _) = Store::open(Path::new(&folder)).unwrap();
    let begin = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap().as_nanos() as i64;
    for n in 1.. {
        let id = store.keep(&Sighting { run_ms: begin, ..sighting(n) }).unwrap();
        writeln!(std::io::stdout().lock(), "kept {id}").unwrap();
    }
}

/// By SIGKILL, each time at another moment of its work.
#[test]
fn no_sighting_that_was_kept_is_lost_where_the_process_is_killed() {
    let folder = Folder::new("killed");
    let mut kept = Vec::new();
    for round in 1..=20 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "keeps_until_it_is_killed", "--ignored", "--nocapture"])
            .env("EVENTS_FOLDER", &folder.0)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines().map_while(Result::ok);
        let said = lines.filter_map(|line| line.split_once("kept ")?.1.parse::<i64>().ok());
        kept.extend(said.take(round));
        child.kill().unwrap();
        child.wait().unwrap();
    }
    let all = folder.all();
    assert!(kept.len() >= 210 && kept.iter().all(|id| all.contains(id)), "{kept:?}\n{all:?}");
    let (mut store, aside) = Store::open(&folder.0).unwrap();
    assert_eq!(aside, None, "the file is broken");
    store.keep(&sighting(0)).unwrap();
}
