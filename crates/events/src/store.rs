// SPDX-License-Identifier: MPL-2.0

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use rusqlite::{Connection, OptionalExtension, Transaction, TransactionBehavior, params};

use crate::clock::{Clock, milliseconds};
use crate::file::{self, Error, Identity};
use crate::reader::{columns, entry};
use crate::{Picture, Sighting};

/// How much is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Retention {
    /// Whatever ended longer ago goes; by a clock that has jumped ahead, once that is believed: after six hours.
    pub age: Duration,
    /// The oldest go where the file has more.
    pub bytes: u64,
}

/// Keeps sightings, in one file of a folder.
#[derive(Debug)]
pub struct Store {
    connection: Connection,
    identity: Identity,
    folder: PathBuf,
    file: PathBuf,
    /// Once somebody has asked for the time.
    clock: Option<Clock>,
}

/// So many of the oldest go at a time where there is too much.
const BATCH: i64 = 16;

impl Store {
    /// Opens the file, or makes one. Where there is a broken one, or one of another version, it is moved aside, and its new
    /// place is returned too.
    ///
    /// # Errors
    /// Where the folder or the file cannot be written.
    pub fn open(folder: &Path) -> Result<(Self, Option<PathBuf>), Error> {
        let (connection, identity, aside) = file::open(folder)?;
        let folder = folder.to_owned();
        Ok((Self { connection, identity, file: folder.join(file::FILE), folder, clock: None }, aside))
    }

    /// Whether its file still has its name. What is written to one that was moved or deleted is found by nobody.
    pub fn is_in_place(&self) -> bool {
        self.identity.is_at(&self.file)
    }

    /// Moves its file aside, which has turned out to be broken ([`Error::is_corrupt`]), so that another one is made the next time;
    /// its new place. Nothing is moved where another process has done so.
    ///
    /// # Errors
    /// Where the folder cannot be written.
    pub fn put_aside(self) -> Result<Option<PathBuf>, Error> {
        file::put_aside(&self.folder, self.identity, self.connection)
    }

    /// Keeps one; where the same track was kept before, both become one. Its number.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn keep(&mut self, sighting: &Sighting) -> Result<i64, Error> {
        let said = Error::file(&self.file);
        let keep = |connection: &mut Connection| {
            let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
            let id = write(&transaction, sighting)?;
            transaction.commit()?;
            Ok(id)
        };
        keep(&mut self.connection).map_err(said)
    }

    /// Deletes what is more than is kept, at this time. No moment of a wrong clock takes what cannot be had again: time goes on from
    /// what was believed last, until we have run for six hours with a clock that is ahead of that.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn retain(&mut self, retention: &Retention, now: SystemTime) -> Result<(), Error> {
        let believed = since_1970(self.believed(now)?);
        let oldest = believed.saturating_sub(retention.age);
        self.delete_where("to_ms < ?1", milliseconds(oldest))?;
        while self.bytes()? > retention.bytes {
            let the_oldest = "id IN (SELECT id FROM sighting ORDER BY from_ms LIMIT ?1)";
            if self.delete_where(the_oldest, BATCH)? == 0 {
                break;
            }
        }
        // At last, as a disk that is full has no room for it before.
        let believed_ms = milliseconds(believed);
        let ahead_ms = self.clock.as_ref().and_then(Clock::ahead).map(milliseconds);
        let sql = "INSERT OR REPLACE INTO clock (id, believed_ms, ahead_ms) VALUES (0, ?1, ?2)";
        self.connection.execute(sql, (believed_ms, ahead_ms)).map_err(Error::file(&self.file))?;
        Ok(())
    }

    /// The time, as far as a clock that says this is believed.
    fn believed(&mut self, now: SystemTime) -> Result<SystemTime, Error> {
        let at = Instant::now();
        let mut clock = match self.clock.take() {
            Some(clock) => clock,
            None => self.last_believed(now, at)?,
        };
        let believed = clock.read(now, at);
        self.clock = Some(clock);
        Ok(believed)
    }

    /// What was last believed: who was kept since by a clock that is ahead says nothing. Where that was never written down, the time
    /// at which the last of all ended, but for those that are in the future.
    fn last_believed(&self, now: SystemTime, at: Instant) -> Result<Clock, Error> {
        let sql = "SELECT believed_ms, ahead_ms, 0 AS place FROM clock \
                   UNION ALL SELECT max(to_ms), NULL, 1 FROM sighting WHERE to_ms <= ?1 ORDER BY place LIMIT 1";
        let read = |row: &rusqlite::Row| Ok((row.get::<_, Option<i64>>(0)?, row.get::<_, Option<i64>>(1)?));
        let last = self.connection.query_row(sql, [milliseconds(since_1970(now))], read);
        let (believed, ahead) = last.map_err(Error::file(&self.file))?;
        let duration = |ms: Option<i64>| ms.and_then(|ms| u64::try_from(ms).ok()).map(Duration::from_millis);
        let believed = duration(believed).map_or(now, |since| SystemTime::UNIX_EPOCH + since);
        Ok(Clock::new(believed, at, duration(ahead)))
    }

    /// Deletes all that is known of somebody: of one track. Whether there was something.
    ///
    /// # Errors
    /// Where it cannot be written. [`Error::Read`]: nobody finds it any more, but it is still in the log of the file, as somebody has
    /// been reading there for seconds; to delete it again takes it out of there.
    pub fn delete(&mut self, id: i64) -> Result<bool, Error> {
        let found = self.delete_where("id = ?1", id)? > 0;
        // It is not in the log either.
        let shorten = |row: &rusqlite::Row| row.get::<_, bool>(0);
        let is_read = self.connection.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], shorten);
        if is_read.map_err(Error::file(&self.file))? {
            return Err(Error::Read { file: self.file.display().to_string() });
        }
        Ok(found)
    }

    /// What the file takes, but for what is free in it.
    fn bytes(&self) -> Result<u64, Error> {
        let sql = "SELECT (page_count - freelist_count) * page_size \
                   FROM pragma_page_count, pragma_freelist_count, pragma_page_size";
        let bytes = self.connection.query_row(sql, [], |row| row.get::<_, i64>(0));
        Ok(bytes.map_err(Error::file(&self.file))?.unsigned_abs())
    }

    fn delete_where(&mut self, condition: &'static str, value: i64) -> Result<usize, Error> {
        let delete = || {
            let gone =
                self.connection.execute(&format!("DELETE FROM sighting WHERE {condition}"), [value])?;
            // It gives back a page with each of its rows.
            let mut vacuum = self.connection.prepare("PRAGMA incremental_vacuum")?;
            let mut pages = vacuum.query([])?;
            while pages.next()?.is_some() {}
            Ok(gone)
        };
        delete().map_err(Error::file(&self.file))
    }
}

fn since_1970(time: SystemTime) -> Duration {
    time.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default()
}

fn write(transaction: &Transaction, new: &Sighting) -> rusqlite::Result<i64> {
    let track = new.track.cast_signed();
    let known =
        format!("SELECT {} FROM sighting WHERE camera = ?1 AND run_ms = ?2 AND track = ?3", columns());
    let known = transaction.query_row(&known, params![new.camera, new.run_ms, track], entry).optional()?;
    let (id, sighting) = match known {
        Some(known) => {
            let mut sighting = Sighting { picture: picture(transaction, known.id)?, ..known.sighting };
            sighting.join(new.clone());
            (Some(known.id), Cow::Owned(sighting))
        }
        None => (None, Cow::Borrowed(new)),
    };
    let path = postcard::to_stdvec(&sighting.path)
        .map_err(|err| rusqlite::Error::ToSqlConversionFailure(err.into()))?;
    let recording = sighting.recording.as_ref();
    transaction.execute(
        "INSERT INTO sighting (id, camera, run_ms, track, from_ms, to_ms, way_deg, path, quality, looks, file, offset_ms)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12)
         ON CONFLICT (id) DO UPDATE SET from_ms = ?5, to_ms = ?6, way_deg = ?7, path = ?8, quality = ?9, looks = ?10,
             file = ?11, offset_ms = ?12",
        params![
            id,
            sighting.camera,
            sighting.run_ms,
            track,
            sighting.from_ms,
            sighting.to_ms,
            sighting.way_deg(),
            path,
            sighting.picture.as_ref().map(|picture| picture.quality),
            sighting.picture.as_ref().map(|picture| picture.looks.bytes()),
            recording.map(|pointer| pointer.file.to_string_lossy()),
            recording.map(|pointer| pointer.offset_ms),
        ],
    )?;
    let id = id.unwrap_or_else(|| transaction.last_insert_rowid());
    if let Some(picture) = &sighting.picture {
        transaction
            .execute("REPLACE INTO picture (sighting, jpeg) VALUES (?1, ?2)", params![id, picture.jpeg])?;
    }
    Ok(id)
}

fn picture(transaction: &Transaction, id: i64) -> rusqlite::Result<Option<Picture>> {
    let sql = "SELECT jpeg, quality, looks FROM picture JOIN sighting ON sighting.id = picture.sighting WHERE id = ?1";
    let read = |row: &rusqlite::Row| {
        let looks: Vec<u8> = row.get(2)?;
        Ok(Picture { jpeg: row.get(0)?, quality: row.get(1)?, looks: looks.into() })
    };
    transaction.query_row(sql, [id], read).optional()
}
