// SPDX-License-Identifier: MPL-2.0

//! The file: its tables, its version, and what becomes of one that is not ours.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use rusqlite::{Connection, ErrorCode, OpenFlags};
use rustix::fs::{FlockOperation, flock};

/// Its name in the folder of state.
pub const FILE: &str = "events.db";

/// Of the tables below; another one is moved aside.
const VERSION: i32 = 2;

/// Whoever else writes has this long.
const LONGEST_WAIT: Duration = Duration::from_secs(5);

const TABLES: &str = "
    PRAGMA auto_vacuum = INCREMENTAL;
    PRAGMA journal_mode = WAL;
    BEGIN IMMEDIATE;
    CREATE TABLE sighting (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        camera TEXT NOT NULL,
        run_ms INTEGER NOT NULL,
        track INTEGER NOT NULL,
        from_ms INTEGER NOT NULL,
        to_ms INTEGER NOT NULL,
        way_deg REAL NOT NULL,
        path BLOB NOT NULL,
        quality REAL,
        looks BLOB,
        file TEXT,
        offset_ms INTEGER,
        UNIQUE (camera, run_ms, track)
    );
    CREATE INDEX sighting_by_time ON sighting (from_ms);
    CREATE TABLE picture (
        sighting INTEGER PRIMARY KEY REFERENCES sighting ON DELETE CASCADE,
        jpeg BLOB NOT NULL
    );
    PRAGMA user_version = 2;
    COMMIT;
";

/// Why events cannot be kept or read.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Something is wrong with the file, or the disk below it.
    #[error("{file}: {cause}")]
    File {
        /// The file.
        file: String,
        /// What SQLite says.
        cause: rusqlite::Error,
    },
    /// Something is wrong with its folder.
    #[error("{folder}: {cause}")]
    Folder {
        /// The folder.
        folder: String,
        /// What the system says.
        cause: io::Error,
    },
    /// Somebody reads what was deleted, for as long as that lasts.
    #[error(
        "{file}: the deleted event is still in the log beside it, as another program is reading it; repeat the deletion"
    )]
    Read {
        /// The file.
        file: String,
    },
    /// It was written by another version.
    #[error("{file} is of another version of ptztrack: this version moves it aside once it writes events")]
    OtherVersion {
        /// The file.
        file: String,
    },
}

impl Error {
    pub(crate) fn file(file: &Path) -> impl Fn(rusqlite::Error) -> Self + use<'_> {
        |cause| Self::File { file: file.display().to_string(), cause }
    }

    fn folder(folder: &Path) -> impl Fn(io::Error) -> Self + use<'_> {
        |cause| Self::Folder { folder: folder.display().to_string(), cause }
    }

    /// Whether the file is broken, so that it will be no better later.
    pub fn is_corrupt(&self) -> bool {
        let Self::File { cause, .. } = self else { return false };
        matches!(cause.sqlite_error_code(), Some(ErrorCode::DatabaseCorrupt | ErrorCode::NotADatabase))
    }
}

/// Which file it is, whatever its name is by now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Identity {
    device: u64,
    inode: u64,
}

impl Identity {
    fn of(path: &Path) -> io::Result<Self> {
        let metadata = std::fs::metadata(path)?;
        Ok(Self { device: metadata.dev(), inode: metadata.ino() })
    }

    /// Whether it is what lies there.
    pub(crate) fn is_at(self, path: &Path) -> bool {
        Self::of(path).is_ok_and(|there| there == self)
    }
}

/// To write; where the file is broken or of another version it is moved aside, and its new place is returned too.
pub(crate) fn open(folder: &Path) -> Result<(Connection, Identity, Option<PathBuf>), Error> {
    let said = Error::folder(folder);
    std::fs::create_dir_all(folder).map_err(&said)?;
    // Of several processes one moves it aside.
    let _alone = alone(folder).map_err(&said)?;
    let path = folder.join(FILE);
    let (connection, aside) = match prepare(&path) {
        Err(err) if err.is_corrupt() || matches!(err, Error::OtherVersion { .. }) => {
            let aside = move_aside(&path).map_err(&said)?;
            (prepare(&path)?, Some(aside))
        }
        prepared => (prepared?, None),
    };
    Ok((connection, Identity::of(&path).map_err(&said)?, aside))
}

/// Closes a broken file and moves it aside; its new place, unless another process has moved it already.
pub(crate) fn put_aside(
    folder: &Path,
    identity: Identity,
    connection: Connection,
) -> Result<Option<PathBuf>, Error> {
    let said = Error::folder(folder);
    let _alone = alone(folder).map_err(&said)?;
    let path = folder.join(FILE);
    // Asked while it is open: until then no other file can have its inode.
    let is_there = identity.is_at(&path);
    drop(connection);
    is_there.then(|| move_aside(&path).map_err(&said)).transpose()
}

/// To read only.
pub(crate) fn open_to_read(folder: &Path) -> Result<Connection, Error> {
    let path = folder.join(FILE);
    let said = Error::file(&path);
    // Not for reading only: who reads a log ahead takes part in it, and may be the first one.
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(&path, flags).map_err(&said)?;
    connection.busy_timeout(LONGEST_WAIT).map_err(&said)?;
    connection.pragma_update(None, "query_only", true).map_err(&said)?;
    if version(&connection).map_err(&said)? == VERSION {
        Ok(connection)
    } else {
        Err(Error::OtherVersion { file: path.display().to_string() })
    }
}

/// Held by whoever opens the file to write.
fn alone(folder: &Path) -> io::Result<File> {
    let file = OpenOptions::new().create(true).append(true).open(folder.join("events.lock"))?;
    flock(&file, FlockOperation::LockExclusive)?;
    Ok(file)
}

fn prepare(path: &Path) -> Result<Connection, Error> {
    let said = Error::file(path);
    let connection = Connection::open(path).map_err(&said)?;
    connection.busy_timeout(LONGEST_WAIT).map_err(&said)?;
    let is_new = connection
        .query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get::<_, i64>(0))
        .map_err(&said)?
        == 0;
    if is_new {
        connection.execute_batch(TABLES).map_err(&said)?;
    }
    if version(&connection).map_err(&said)? != VERSION {
        return Err(Error::OtherVersion { file: path.display().to_string() });
    }
    // What time it was by a clock that was believed, for whoever deletes by age; files of this version began without.
    connection
        .execute_batch(
            "CREATE TABLE IF NOT EXISTS clock (id INTEGER PRIMARY KEY, believed_ms INTEGER NOT NULL, ahead_ms INTEGER)",
        )
        .map_err(&said)?;
    // What was deleted is overwritten; what was written outlives a loss of power.
    connection
        .execute_batch("PRAGMA foreign_keys = ON; PRAGMA secure_delete = ON; PRAGMA synchronous = FULL;")
        .map_err(&said)?;
    Ok(connection)
}

fn version(connection: &Connection) -> rusqlite::Result<i32> {
    connection.query_row("PRAGMA user_version", [], |row| row.get(0))
}

/// Together with what SQLite has beside it.
fn move_aside(path: &Path) -> io::Result<PathBuf> {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let aside = path.with_file_name(format!("events-{}.db", now.as_nanos()));
    std::fs::rename(path, &aside)?;
    for end in ["-wal", "-shm"] {
        let with_end = |path: &Path| PathBuf::from(format!("{}{end}", path.display()));
        match std::fs::rename(with_end(path), with_end(&aside)) {
            Err(err) if err.kind() != io::ErrorKind::NotFound => return Err(err),
            _ => {}
        }
    }
    Ok(aside)
}
