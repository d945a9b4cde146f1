// SPDX-License-Identifier: MPL-2.0

//! Keeps who was followed, in a thread of its own: where the disk is full, slow or hangs, nobody is followed the worse for it.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, SystemTime};

use events::{Error, Retention, Sighting};
use pipeline_supervisor::Backoff;

use crate::config::Store;
use crate::event::{Event, Level};
use crate::log::Log;
use crate::waiting::{Count, Sightings};

/// Between two tries; twice as long each time.
const SHORTEST_PAUSE: Duration = Duration::from_secs(1);
const LONGEST_PAUSE: Duration = Duration::from_secs(60);

/// What is too old goes this often where nothing happens.
const LOOK: Duration = Duration::from_secs(3600);

/// The last ones are waited for this long, as a disk may hang.
const LONGEST_END: Duration = Duration::from_secs(5);

/// Where state is kept: where systemd says, or where programs of a user have theirs (XDG Base Directory Specification).
pub fn state_folder() -> Option<PathBuf> {
    let of = |variable| std::env::var_os(variable).filter(|value| !value.is_empty()).map(PathBuf::from);
    let of_user = || of("XDG_STATE_HOME").or_else(|| Some(of("HOME")?.join(".local/state")));
    of("STATE_DIRECTORY").or_else(|| Some(of_user()?.join("ptztrack")))
}

impl Store {
    /// Where the file is.
    ///
    /// # Errors
    /// Where nobody says where.
    pub fn place(&self) -> Result<PathBuf, String> {
        let nowhere = "no folder for events: `folder` in [events] says which";
        self.folder.clone().or_else(state_folder).ok_or_else(|| nowhere.to_owned())
    }

    /// The same, where anything is kept.
    pub fn kept_in(&self) -> Option<PathBuf> {
        self.what.and_then(|_| self.place().ok())
    }
}

/// Whoever keeps, until [`Keeper::end`].
pub struct Keeper {
    log: Arc<Log>,
    ended: Receiver<()>,
    count: Arc<Count>,
}

impl Keeper {
    /// Keeps from now on who was followed; nobody where nothing is to be kept.
    pub fn start(settings: &Store, log: &Arc<Log>) -> Option<Self> {
        settings.what?;
        let started = settings.place().and_then(|folder| {
            let sightings = log.sightings();
            let keeping = Keeping::new(folder, settings.retention, log.clone(), sightings.count());
            Self::spawn(keeping, sightings).map_err(|err| err.to_string())
        });
        let tell = |reason: &String| {
            log.tell(&Event::new(Level::Warning, None, "events-not-kept", not_kept(reason)));
        };
        started.inspect_err(tell).ok()
    }

    fn spawn(mut keeping: Keeping, sightings: Sightings) -> io::Result<Self> {
        let (ending, ended) = channel();
        let (log, count) = (keeping.log.clone(), keeping.count.clone());
        thread::Builder::new().name("events".to_owned()).spawn(move || {
            keeping.run(&sightings);
            drop(ending);
        })?;
        Ok(Self { log, ended, count })
    }

    /// Waits until all is kept; not for ever.
    pub fn end(self) {
        self.log.keep_no_more();
        // Nothing is ever sent: it ends with the thread.
        let _ = self.ended.recv_timeout(LONGEST_END);
        let lost = self.count.waiting() + self.count.take_lost();
        if lost > 0 {
            let detail = format!("{lost} events are lost: the disk did not take them in time");
            self.log.tell(&Event::new(Level::Warning, None, "events-lost", detail));
        }
    }
}

fn not_kept(reason: &str) -> String {
    format!("events are not kept: {reason}")
}

struct Keeping {
    folder: PathBuf,
    retention: Retention,
    log: Arc<Log>,
    /// Of those who wait to be kept.
    count: Arc<Count>,
    open: Option<events::Store>,
    in_trouble: bool,
}

impl Keeping {
    fn new(folder: PathBuf, retention: Retention, log: Arc<Log>, count: Arc<Count>) -> Self {
        Self { folder, retention, log, count, open: None, in_trouble: false }
    }

    fn run(&mut self, sightings: &Sightings) {
        self.persist(|keeping| keeping.retain());
        loop {
            match sightings.next(LOOK) {
                Ok(sighting) => {
                    self.persist(|keeping| keeping.keep(&sighting));
                    sightings.done(&sighting);
                }
                Err(RecvTimeoutError::Timeout) => self.persist(|keeping| keeping.retain()),
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    /// Tries until it is done. The failure is said once, and its end.
    fn persist(&mut self, mut what: impl FnMut(&mut Self) -> Result<(), Error>) {
        let mut pauses = Backoff::new(SHORTEST_PAUSE, LONGEST_PAUSE, Duration::MAX);
        while let Err(err) = what(self) {
            // Whatever was wrong may be mended in the next one.
            let broken = self.open.take().filter(|_| err.is_corrupt());
            let is_mended = broken.is_some_and(|store| self.put_aside(store));
            if !is_mended && !std::mem::replace(&mut self.in_trouble, true) {
                let detail = format!("{}; the cameras keep following; retrying", not_kept(&err.to_string()));
                self.log.tell(&Event::new(Level::Warning, None, "events-not-kept", detail));
            }
            thread::sleep(pauses.after(Duration::ZERO));
        }
        let lost = self.count.take_lost();
        if std::mem::take(&mut self.in_trouble) || lost > 0 {
            let lost = if lost > 0 { format!("; {lost} are lost") } else { String::new() };
            self.log.info("events-kept", format!("events are kept again{lost}"));
        }
    }

    fn keep(&mut self, sighting: &Sighting) -> Result<(), Error> {
        let id = self.store()?.keep(sighting)?;
        let seconds = (sighting.to_ms - sighting.from_ms) as f64 / 1000.0;
        let detail = format!("event {id}: target {} was followed for {seconds:.1} s", sighting.track);
        let event = Event::new(Level::Info, Some(&sighting.camera), "event-kept", detail);
        self.log.tell(&match &sighting.picture {
            Some(picture) => event.with_picture(id, &picture.jpeg),
            None => event,
        });
        // What is too much can wait for the next one.
        let _ = self.retain();
        Ok(())
    }

    fn retain(&mut self) -> Result<(), Error> {
        let retention = self.retention;
        self.store()?.retain(&retention, SystemTime::now())
    }

    fn store(&mut self) -> Result<&mut events::Store, Error> {
        // Another process may have moved it aside.
        let store = match self.open.take().filter(events::Store::is_in_place) {
            Some(store) => store,
            None => self.open_anew()?,
        };
        Ok(self.open.insert(store))
    }

    fn open_anew(&self) -> Result<events::Store, Error> {
        let (store, aside) = events::Store::open(&self.folder)?;
        aside.iter().for_each(|aside| tell_moved(&self.log, aside));
        Ok(store)
    }

    /// A file that has turned out to be broken while it was written.
    fn put_aside(&self, store: events::Store) -> bool {
        let aside = store.put_aside();
        aside.iter().flatten().for_each(|aside| tell_moved(&self.log, aside));
        aside.is_ok()
    }
}

/// Says where the file of events is now, which was moved aside.
pub fn tell_moved(log: &Log, aside: &Path) {
    log.tell(&Event::new(Level::Warning, None, "events-moved-aside", moved(aside)));
}

/// The same, in words.
pub fn moved(aside: &Path) -> String {
    format!(
        "the file of events is broken or of another version: it is {} now, and a new one was begun",
        aside.display()
    )
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use events::{Looks, Picture};
    use tokio::sync::broadcast;

    use super::*;
    use crate::waiting::MOST_BYTES;

    fn sighting(track: u64) -> Sighting {
        Sighting {
            camera: "door".to_owned(),
            run_ms: 0,
            track,
            from_ms: 0,
            to_ms: 1000,
            path: Vec::new(),
            picture: None,
            recording: None,
        }
    }

    /// Told by the log so far.
    fn said(told: &mut broadcast::Receiver<Event>) -> Vec<(String, String)> {
        std::iter::from_fn(|| told.try_recv().ok()).map(|event| (event.event, event.detail)).collect()
    }

    /// While another program has the folder, and after it.
    #[test]
    fn who_finds_no_room_is_lost_and_that_is_said_with_how_many() {
        let folder = std::env::temp_dir().join(format!("ptztrack-locked-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let other = File::create(folder.join("events.lock")).unwrap();
        other.lock().unwrap();
        let log = Arc::new(Log::unwritten());
        let mut told = log.subscribe();
        let settings = Store { folder: Some(folder.clone()), ..Store::default() };
        let keeper = Keeper::start(&settings, &log).unwrap();
        let picture = Picture { jpeg: vec![0; MOST_BYTES / 8], quality: 1.0, looks: Looks::default() };
        (1..=10).for_each(|track| log.keep(Sighting { picture: Some(picture.clone()), ..sighting(track) }));
        // An eighth and a little more each: seven find room.
        let told_so_far = said(&mut told);
        assert!(matches!(&told_so_far[..], [(event, _)] if event == "events-lost"), "{told_so_far:?}");
        drop(other);
        let again = told.blocking_recv().unwrap();
        assert!(again.event == "events-kept" && again.detail.ends_with("; 3 are lost"), "{again:?}");
        let kept: Vec<_> = (1..=7).map(|_| told.blocking_recv().unwrap().event).collect();
        assert_eq!(kept, ["event-kept"; 7]);
        keeper.end();
        assert_eq!(said(&mut told), []);
        std::fs::remove_dir_all(folder).unwrap();
    }

    /// As on a disk that loses what was written, for two programs. Both keep the next ones in one file.
    #[test]
    fn a_file_that_breaks_while_it_is_written_is_moved_aside_once() {
        let folder = std::env::temp_dir().join(format!("ptztrack-breaks-{}", std::process::id()));
        let log = Arc::new(Log::unwritten());
        let mut told = log.subscribe();
        let retention = Retention { age: Duration::MAX, bytes: u64::MAX };
        let [mut first, mut second] =
            [log.clone(), log].map(|log| Keeping::new(folder.clone(), retention, log, Arc::default()));
        first.persist(|keeping| keeping.keep(&sighting(1)));
        first.open = None;
        let mut bytes = std::fs::read(folder.join(events::FILE)).unwrap();
        bytes[4096..].fill(0xa5);
        std::fs::write(folder.join(events::FILE), bytes).unwrap();
        second.store().unwrap();
        first.persist(|keeping| keeping.keep(&sighting(2)));
        second.persist(|keeping| keeping.keep(&sighting(3)));
        let kept = events::Reader::open(&folder).unwrap().sightings(&events::Filter::default()).unwrap();
        let mut tracks: Vec<u64> = kept.iter().map(|entry| entry.sighting.track).collect();
        tracks.sort_unstable();
        assert_eq!(tracks, [2, 3]);
        let said: Vec<String> = said(&mut told).into_iter().map(|(event, _)| event).collect();
        assert_eq!(said, ["event-kept", "events-moved-aside", "event-kept", "event-kept"]);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
