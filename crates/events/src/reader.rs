// SPDX-License-Identifier: MPL-2.0

use std::path::{Path, PathBuf};

use rusqlite::types::Value;
use rusqlite::{Connection, OptionalExtension, Row, params_from_iter};

use crate::file::{self, Error};
use crate::{Filter, Looks, Pointer, Sighting, Step};

/// Answers whoever asks; whoever writes is not held up.
#[derive(Debug)]
pub struct Reader {
    connection: Connection,
    file: PathBuf,
}

/// A sighting that is kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Its number, which no other one ever has.
    pub id: i64,
    /// All of it but the picture.
    pub sighting: Sighting,
    /// How far they went, in degrees.
    pub way_deg: f64,
    /// Whether there is a picture.
    pub has_picture: bool,
    /// What they look like, where there is a picture.
    pub looks: Option<Looks>,
}

/// What an [`Entry`] is read from, but for its path, which is longer than all the rest. They are asked for by their places: names would
/// be compared in each row.
const BRIEF: &str = "id, camera, run_ms, track, from_ms, to_ms, way_deg, file, offset_ms, looks, \
     quality IS NOT NULL AS has_picture";

/// The place of the path, behind those.
const PATH: usize = 11;

/// All that an [`Entry`] is read from.
pub(crate) fn columns() -> String {
    format!("{BRIEF}, path")
}

impl Reader {
    /// Of the events in this folder.
    ///
    /// # Errors
    /// Where there are none, or they cannot be read.
    pub fn open(folder: &Path) -> Result<Self, Error> {
        Ok(Self { connection: file::open_to_read(folder)?, file: folder.join(file::FILE) })
    }

    /// Those that are asked for, the latest first.
    ///
    /// # Errors
    /// Where they cannot be read.
    pub fn sightings(&self, filter: &Filter) -> Result<Vec<Entry>, Error> {
        self.select(filter, &columns(), entry).map_err(Error::file(&self.file))
    }

    /// The same without their paths, which take longer to read than all the rest.
    ///
    /// # Errors
    /// Where they cannot be read.
    pub fn without_paths(&self, filter: &Filter) -> Result<Vec<Entry>, Error> {
        // To know who went through an area takes their paths.
        let columns = if filter.area.is_some() { columns() } else { BRIEF.to_owned() };
        self.select(filter, &columns, pathless).map_err(Error::file(&self.file))
    }

    /// One of them.
    ///
    /// # Errors
    /// Where it cannot be read.
    pub fn sighting(&self, id: i64) -> Result<Option<Entry>, Error> {
        let sql = format!("SELECT {} FROM sighting WHERE id = ?1", columns());
        self.connection.query_row(&sql, [id], entry).optional().map_err(Error::file(&self.file))
    }

    /// The picture of one, JPEG.
    ///
    /// # Errors
    /// Where it cannot be read.
    pub fn picture(&self, id: i64) -> Result<Option<Vec<u8>>, Error> {
        self.connection
            .query_row("SELECT jpeg FROM picture WHERE sighting = ?1", [id], |row| row.get(0))
            .optional()
            .map_err(Error::file(&self.file))
    }

    /// The cameras that there are sightings of.
    ///
    /// # Errors
    /// Where they cannot be read.
    pub fn cameras(&self) -> Result<Vec<String>, Error> {
        let all = || -> rusqlite::Result<Vec<String>> {
            let mut select =
                self.connection.prepare("SELECT DISTINCT camera FROM sighting ORDER BY camera")?;
            select.query_map([], |row| row.get(0))?.collect()
        };
        all().map_err(Error::file(&self.file))
    }

    fn select(
        &self,
        filter: &Filter,
        columns: &str,
        read: fn(&Row) -> rusqlite::Result<Entry>,
    ) -> rusqlite::Result<Vec<Entry>> {
        let mut conditions = Vec::new();
        let mut values: Vec<Value> = Vec::new();
        let mut add = |condition: &'static str, value: Option<Value>| {
            if let Some(value) = value {
                conditions.push(condition);
                values.push(value);
            }
        };
        add("to_ms >= ?", filter.since_ms.map(Value::from));
        add("from_ms <= ?", filter.until_ms.map(Value::from));
        add("camera = ?", filter.camera.clone().map(Value::from));
        let conditions = if conditions.is_empty() { "TRUE".to_owned() } else { conditions.join(" AND ") };
        let sql = format!("SELECT {columns} FROM sighting WHERE {conditions} ORDER BY from_ms DESC, id DESC");
        let mut select = self.connection.prepare(&sql)?;
        let wanted = |row: &Row| -> rusqlite::Result<bool> {
            filter.area.map_or(Ok(true), |area| Ok(area.saw(&path(row)?)))
        };
        let entries = select.query_and_then(params_from_iter(values), |row| {
            if wanted(row)? { read(row).map(Some) } else { Ok(None) }
        })?;
        entries.filter_map(Result::transpose).take(filter.most.unwrap_or(usize::MAX)).collect()
    }
}

pub(crate) fn entry(row: &Row) -> rusqlite::Result<Entry> {
    let mut entry = pathless(row)?;
    entry.sighting.path = path(row)?;
    Ok(entry)
}

fn path(row: &Row) -> rusqlite::Result<Vec<Step>> {
    let bytes = row.get_ref(PATH)?.as_blob()?;
    postcard::from_bytes(bytes).map_err(|err| {
        rusqlite::Error::FromSqlConversionFailure(PATH, rusqlite::types::Type::Blob, err.into())
    })
}

fn pathless(row: &Row) -> rusqlite::Result<Entry> {
    let file: Option<String> = row.get(7)?;
    let recording = match file {
        Some(file) => Some(Pointer { file: file.into(), offset_ms: row.get(8)? }),
        None => None,
    };
    let sighting = Sighting {
        camera: row.get(1)?,
        run_ms: row.get(2)?,
        track: row.get::<_, i64>(3)?.unsigned_abs(),
        from_ms: row.get(4)?,
        to_ms: row.get(5)?,
        path: Vec::new(),
        picture: None,
        recording,
    };
    let looks = row.get::<_, Option<Vec<u8>>>(9)?.map(Looks::from);
    Ok(Entry { id: row.get(0)?, sighting, way_deg: row.get(6)?, has_picture: row.get(10)?, looks })
}
