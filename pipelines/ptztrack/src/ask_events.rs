// SPDX-License-Identifier: MPL-2.0

//! `ptztrack events`.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use events::{Filter, Reader};

use crate::config::{Config, Store, Zone, units};
use crate::{report, store};

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct AskEvents {
    #[command(subcommand)]
    change: Option<Change>,
    /// From then on: 22:00, 2026-11-25, "2026-11-25 22:00", or so long ago, as 12h
    #[arg(long, value_name = "TIME", value_parser = time)]
    since: Option<i64>,
    /// Until then
    #[arg(long, value_name = "TIME", value_parser = time)]
    until: Option<i64>,
    /// Of this camera only
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    /// Who went through this [zone] of the file of cameras only
    #[arg(long, value_name = "NAME", requires = "config", conflicts_with = "camera")]
    zone: Option<String>,
    /// An object of JSON on each line
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// For spreadsheets
    #[arg(long)]
    csv: bool,
    #[command(flatten)]
    place: Place,
}

#[derive(Debug, Subcommand)]
enum Change {
    /// Delete all that is kept of one event: times, way and picture; a recording stays as it is
    Delete {
        /// Its number
        id: i64,
        #[command(flatten)]
        place: Place,
    },
}

/// Where the events are.
#[derive(Debug, Args)]
struct Place {
    /// The folder that events are kept in [default: STATE_DIRECTORY, else ~/.local/state/ptztrack]
    #[arg(long, value_name = "FOLDER")]
    folder: Option<PathBuf>,
    /// The file of cameras, which may name another folder
    #[arg(long, value_name = "FILE", conflicts_with = "folder")]
    config: Option<PathBuf>,
}

impl Place {
    /// What the file says that holds here.
    fn read(self) -> Result<(PathBuf, Vec<Zone>), String> {
        let (store, zones) = match self.config {
            Some(file) => {
                let config = Config::load(&file).map_err(|failure| failure.reason())?;
                (config.store, config.zones)
            }
            None => (Store { folder: self.folder, ..Store::default() }, Vec::new()),
        };
        Ok((store.place()?, zones))
    }
}

impl AskEvents {
    /// What is to be printed.
    ///
    /// # Errors
    /// Why there is nothing to be said.
    pub fn answer(self) -> Result<String, String> {
        let said = |err: events::Error| format!("{err}; --folder says where events are");
        if let Some(Change::Delete { id, place }) = self.change {
            let folder = place.read()?.0;
            check(&folder)?;
            let (mut store, aside) = events::Store::open(&folder).map_err(said)?;
            aside.iter().for_each(|aside| eprintln!("{}", store::moved(aside)));
            return match store.delete(id).map_err(said)? {
                true => Ok(format!("Event {id} is deleted.\n")),
                false => Err(format!("There is no event {id}; nothing of it is left in the file.")),
            };
        }
        let (folder, zones) = self.place.read()?;
        check(&folder)?;
        let filter =
            Filter { since_ms: self.since, until_ms: self.until, camera: self.camera, ..Filter::default() };
        let filter = Zone::narrow(&zones, self.zone.as_deref(), filter)
            .ok_or("the file of cameras has no [zone] of that name")?;
        let mut entries = Reader::open(&folder).and_then(|reader| reader.sightings(&filter)).map_err(said)?;
        // As they came, as in a log.
        entries.reverse();
        if self.csv {
            return Ok(report::csv(&entries));
        }
        if self.json {
            return Ok(entries.iter().map(|entry| format!("{}\n", report::object(entry))).collect());
        }
        Ok(report::table(&entries))
    }
}

/// Whether there is anything to be asked.
fn check(folder: &Path) -> Result<(), String> {
    match folder.join(events::FILE).try_exists() {
        Ok(false) => Err(format!(
            "no events are kept in {} yet; --folder or --config says where else they are",
            folder.display()
        )),
        // Why it cannot be read is said by who reads it.
        _ => Ok(()),
    }
}

/// Milliseconds since 1970, in the time of where we are.
fn time(text: &str) -> Result<i64, &'static str> {
    let now = glib::DateTime::now_local().map_err(|_| "the clock tells no time")?;
    at(text, &now, &glib::TimeZone::local())
        .map(|time| time.to_unix() * 1000)
        .ok_or("a time such as 22:00, \"2026-11-25 22:00\" or 12h")
}

fn at(text: &str, now: &glib::DateTime, zone: &glib::TimeZone) -> Option<glib::DateTime> {
    if let Some(ago) = units::duration(text) {
        return now.add_seconds(-ago.as_secs_f64()).ok();
    }
    if let Some(clock) = clock(text) {
        let today = on(now.year(), now.month(), now.day_of_month(), clock, zone)?;
        // The last time that it was so late.
        return if today > *now { today.add_days(-1).ok() } else { Some(today) };
    }
    let (date, rest) = text.split_once([' ', 'T']).unwrap_or((text, "00:00"));
    let mut parts = date.splitn(3, '-').map(str::parse);
    let (Some(Ok(year)), Some(Ok(month)), Some(Ok(day))) = (parts.next(), parts.next(), parts.next()) else {
        return None;
    };
    on(year, month, day, clock(rest)?, zone)
}

fn on(
    year: i32,
    month: i32,
    day: i32,
    (hour, minute): (i32, i32),
    zone: &glib::TimeZone,
) -> Option<glib::DateTime> {
    glib::DateTime::new(zone, year, month, day, hour, minute, 0.0).ok()
}

/// Hour and minute.
fn clock(text: &str) -> Option<(i32, i32)> {
    let (hour, minute) = text.split_once(':')?;
    Some((hour.parse().ok()?, minute.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_written_as_people_do() {
        let now = glib::DateTime::from_utc(2026, 11, 25, 9, 30, 0.0).unwrap();
        let read = |text: &str| {
            at(text, &now, &glib::TimeZone::utc())?.format("%Y-%m-%d %H:%M").ok().map(String::from)
        };
        for (text, wanted) in [
            ("22:00", "2026-11-24 22:00"),
            ("06:15", "2026-11-25 06:15"),
            ("2026-11-20", "2026-11-20 00:00"),
            ("2026-11-20 21:05", "2026-11-20 21:05"),
            ("2026-11-20T21:05", "2026-11-20 21:05"),
            ("12h", "2026-11-24 21:30"),
        ] {
            assert_eq!(read(text).as_deref(), Some(wanted), "{text}");
        }
        for wrong in ["", "yesterday", "25:00", "22", "2026-13-01", "2026-11-20 9", "-1h"] {
            assert_eq!(read(wrong), None, "{wrong}");
        }
    }
}
